"""By which files a process proves who it is, beyond one machine: an authority, a certificate of its name, and the key to it.

`affinet keys` makes them (`netem/wire/authority.py`). TLS refuses a stranger without a word of why, so what can be seen of the
files is said here before anybody connects.
"""

from __future__ import annotations

import socket
import ssl
import stat
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netem.core.refusal import Refusal

if TYPE_CHECKING:
    from cryptography.x509 import Certificate

AUTHORITY = "authority"
AGAIN = "make them again with `affinet keys`"
_PROBE_S = 2.0
# What OpenSSL calls the alerts of the other end.
_ALERTS = {
    "TLSV1_ALERT_UNKNOWN_CA": "the hub does not know the authority of {own}",
    "TLSV1_ALERT_DECRYPT_ERROR": "the hub does not know the authority of {own}",
    "SSLV3_ALERT_CERTIFICATE_EXPIRED": "to the hub {own} has expired: look at its clock",
    "SSLV3_ALERT_BAD_CERTIFICATE": "the hub refuses {own}",
}


class NotTrusted(Refusal, ValueError):
    """What a process would connect or listen with is no proof of who it is: why, in one line."""


@dataclass(frozen=True)
class Certificates:
    """The files of one process.

    Parameters
    ----------
    folder
        Which `affinet keys` made; of its files those below are all that a machine needs.
    name
        The name of the process in a run, as in `netem.wire.session`.
    """

    folder: str
    name: str

    @property
    def authority(self) -> Path:
        """The certificate of the authority, by which those of others are judged."""
        return Path(self.folder, f"{AUTHORITY}.pem")

    @property
    def certificate(self) -> Path:
        """The process' own."""
        return Path(self.folder, f"{self.name}.pem")

    @property
    def key(self) -> Path:
        """The private key to it."""
        return Path(self.folder, f"{self.name}.key")

    def check(self) -> None:
        """Go on if these files will do, now.

        Raises
        ------
        NotTrusted
            When one is missing or no certificate, or others may read the key, or they do not belong together, or the time of
            one is over.
        """
        refuse_open(self.key)
        authority, own = read_certificate(self.authority), read_certificate(self.certificate)
        for path, certificate in ((self.authority, authority), (self.certificate, own)):
            _refuse_out_of_time(path, certificate)
        if (name := common_name(own)) != self.name:
            raise NotTrusted(f"{self.certificate}: it is of {name!r}, and not of {self.name!r}; {AGAIN}")
        if not _issued(own, authority):
            raise NotTrusted(f"{self.certificate}: it is of another authority than {self.authority}; {AGAIN}")
        if read_key(self.key).public_key() != own.public_key():
            raise NotTrusted(f"{self.key}: it is not the key to {self.certificate}; {AGAIN}")

    def why_refused(self, address: str, port: int) -> str:
        """Why the hub there lets nobody in with these, or is not one to be trusted, in one line."""
        where = f"{address} port {port}"
        own = str(self.certificate)
        context = ssl.create_default_context(cafile=self.authority)
        context.load_cert_chain(self.certificate, self.key)
        try:
            with (
                socket.create_connection((address, port), _PROBE_S) as connection,
                context.wrap_socket(connection, server_hostname=address) as probe,
            ):
                probe.recv(1)  # in TLS 1.3 the other end judges after the handshake
        except ssl.SSLCertVerificationError as error:
            return f"who listens at {where} is not the hub of {self.authority}: {error.verify_message}; {AGAIN}"
        except ssl.SSLError as error:
            said = _ALERTS.get(error.reason, f"the hub refuses {{own}}: {error.reason}").format(own=own)
            return f"{where}: {said}; {AGAIN}"
        except TimeoutError:
            return f"{where}: the hub knows {own}, and lets nobody in: is another session of {self.name} open?"
        except OSError as error:
            return f"{where}: nobody can be reached: {error.strerror or error}"
        return f"{where}: who listens there does not speak TLS as the hub does, or has closed at once"

    def _tls(self, side: str) -> dict[str, Any]:
        return {
            "root_ca_certificate": str(self.authority),
            "enable_mtls": True,
            f"{side}_certificate": str(self.certificate),
            f"{side}_private_key": str(self.key),
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }

    def connecting(self) -> dict[str, Any]:
        """How Zenoh is told of them, of a process that connects."""
        return self._tls("connect")

    def listening(self) -> dict[str, Any]:
        """How Zenoh is told of them, of the one that listens."""
        return self._tls("listen")


def common_name(certificate: Certificate) -> str:
    """Whose it is."""
    from cryptography.x509.oid import NameOID

    return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)


def refuse_open(key: Path) -> None:
    """Refuse a key that is not there, or that others may read.

    Raises
    ------
    NotTrusted
        Which, and what to do.
    """
    try:
        mode = stat.S_IMODE(key.stat().st_mode)
    except FileNotFoundError as error:
        raise NotTrusted(f"{key}: it is not there; copy it from where `affinet keys` made it") from error
    if mode & 0o077:
        raise NotTrusted(f"{key}: others may read it (mode {mode:o}), so it proves nothing; {AGAIN}, and chmod 600")


def read_certificate(path: Path) -> Certificate:
    """The certificate in a file.

    Raises
    ------
    NotTrusted
        When there is none.
    """
    from cryptography.x509 import load_pem_x509_certificate

    try:
        return load_pem_x509_certificate(path.read_bytes())
    except FileNotFoundError as error:
        raise NotTrusted(f"{path}: it is not there; copy it from where `affinet keys` made it") from error
    except ValueError as error:
        raise NotTrusted(f"{path}: it is no certificate; {AGAIN}") from error


def read_key(path: Path) -> Any:
    """The private key in a file.

    Raises
    ------
    NotTrusted
        When there is none.
    """
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        return load_pem_private_key(path.read_bytes(), password=None)
    except (ValueError, TypeError) as error:
        raise NotTrusted(f"{path}: it is no private key; {AGAIN}") from error


def _refuse_out_of_time(path: Path, certificate: Certificate) -> None:
    now, begins, ends = datetime.now(UTC), certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if now > ends:
        raise NotTrusted(f"{path}: it expired at {ends:%Y-%m-%d %H:%M} UTC; {AGAIN}")
    if now < begins:
        raise NotTrusted(f"{path}: it is valid from {begins:%Y-%m-%d %H:%M} UTC on; set the clock of this machine")


def _issued(certificate: Certificate, authority: Certificate) -> bool:
    from cryptography.exceptions import InvalidSignature

    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        return False
    return True
