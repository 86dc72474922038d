"""A certificate authority for runs, and a certificate for each name in them."""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from netem.processes.system_errors import about
from netem.processes.whole import whole
from netem.wire.certificates import AUTHORITY, NotTrusted, read_certificate, read_key, refuse_open
from netem.wire.session import COORDINATOR, HUB, LOOPBACK

_ALLOWED_SKEW = timedelta(hours=1)  # clocks of other machines
_AUTHORITY_LASTS = timedelta(days=3650)
_HOST = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*")


@dataclass(frozen=True)
class Made:
    """What was made.

    Parameters
    ----------
    names
        Who has a certificate now.
    addresses
        Under which the hub is reached.
    ends
        Until when they are valid.
    renewed
        Whether the authority is the one that was there before.
    """

    names: tuple[str, ...]
    addresses: tuple[str, ...]
    ends: datetime
    renewed: bool


def make(folder: Path, names: Iterable[str], addresses: Sequence[str], lasts: timedelta) -> Made:
    """Make a certificate and a key for each name, and the authority unless it is there.

    Whoever else has a certificate in the folder gets a new one too, and the hub keeps its addresses if none are given.

    Parameters
    ----------
    folder
        Where: for its user alone.
    names
        Of the processes, as in `netem.wire.session`.
    addresses
        Host names and IP addresses under which the hub is reached; those of loopback are always among them.
    lasts
        How long they are valid from now on.

    Raises
    ------
    NotTrusted
        When an address is none, or others may look into the folder, or its authority is not whole, or ends too soon.
    OSError
        When the folder cannot be written to.
    """
    for address in addresses:
        _general_name(address)  # before anything is made
    begins = datetime.now(UTC) - _ALLOWED_SKEW
    ends = begins + _ALLOWED_SKEW + lasts
    with about(folder):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_mode & 0o077:
            raise NotTrusted(f"{folder}: others may look into it: name a new folder, or chmod 700 this one")
    authority, key, renewed = _authority(folder, begins, ends)
    known = [path.stem for path in folder.glob("*.pem") if path.stem != AUTHORITY]
    addresses = tuple(dict.fromkeys([*LOOPBACK, *(addresses or _addresses(folder))]))
    everybody = tuple(dict.fromkeys([*names, *known]))
    for name in everybody:
        own = ec.generate_private_key(ec.SECP256R1())
        certificate = _builder(name, authority.subject, own, begins, ends)
        listens = name in (HUB, COORDINATOR)
        certificate = _of_hub(certificate, addresses) if listens else _of_client(certificate)
        _keep(folder, name, certificate.sign(key, hashes.SHA256()), own)
    return Made(everybody, addresses, ends, renewed)


def _authority(
    folder: Path, begins: datetime, ends: datetime
) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey, bool]:
    path, key_path = folder / f"{AUTHORITY}.pem", folder / f"{AUTHORITY}.key"
    if path.exists() != key_path.exists():
        raise NotTrusted(
            f"{folder}: of the authority only one file is here: renew certificates where they were made, "
            f"or remove {path if path.exists() else key_path} to begin anew"
        )
    if path.exists():
        refuse_open(key_path)
        authority = read_certificate(path)
        if authority.not_valid_after_utc < ends:
            raise NotTrusted(
                f"{path}: it ends at {authority.not_valid_after_utc:%Y-%m-%d}, before they would: "
                "ask for fewer --days, or make them in a new folder, for all machines"
            )
        return authority, read_key(key_path), True
    key = ec.generate_private_key(ec.SECP256R1())
    name = f"affinet {os.urandom(4).hex()}"  # two authorities of one name are told apart by nobody who reads an error
    builder = _builder(name, _called(name), key, begins, max(ends, begins + _AUTHORITY_LASTS))
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    authority = builder.add_extension(usage, critical=True).sign(key, hashes.SHA256())
    _keep(folder, AUTHORITY, authority, key)
    return authority, key, False


def _builder(
    name: str, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, begins: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(_called(name))
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins)
        .not_valid_after(ends)
    )


def _called(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _of_hub(builder: x509.CertificateBuilder, addresses: Iterable[str]) -> x509.CertificateBuilder:
    names = x509.SubjectAlternativeName([_general_name(address) for address in addresses])
    both = ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH  # the medium joins a coordinator, too
    return _for(builder, *both).add_extension(names, critical=False)


def _of_client(builder: x509.CertificateBuilder) -> x509.CertificateBuilder:
    # For nothing else: an agent that listens as if it were the hub is nobody to the others.
    return _for(builder, ExtendedKeyUsageOID.CLIENT_AUTH)


def _for(builder: x509.CertificateBuilder, *purposes: x509.ObjectIdentifier) -> x509.CertificateBuilder:
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    return builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False)


def _general_name(address: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        if not _HOST.fullmatch(address):
            raise NotTrusted(f"{address!r}: give host names and IP addresses, without ports") from None
        return x509.DNSName(address)


def _addresses(folder: Path) -> tuple[str, ...]:
    if not (path := folder / f"{HUB}.pem").exists():
        return ()
    names = read_certificate(path).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return tuple(str(name.value) for name in names)


def _keep(folder: Path, name: str, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    for path, content in ((f"{name}.key", secret), (f"{name}.pem", certificate.public_bytes(Encoding.PEM))):
        with about(folder / path), whole(folder / path) as part:
            part.touch(mode=0o600)
            part.write_bytes(content)
