"""`affinet keys`: what it makes, what it says, and what it refuses in one line."""

import re

import pytest

from affinet.cli.commands import main
from netem.wire.certificates import Certificates


def test_keys_are_made_for_each_process_of_a_run(tmp_path, capsys):
    folder = tmp_path / "keys"
    assert main(["keys", str(folder), "--agents", "2", "--hosts", "1", "--hub", "10.0.0.1", "--days", "7"]) == 0
    names = ["coordinator", "netem", "world", "centre", "control", "driver", "agent-1", "agent-2", "host-1"]
    assert {path.name for path in folder.iterdir()} == {
        f"{name}.{kind}" for name in ("authority", *names) for kind in ("pem", "key")
    }
    for name in names:
        Certificates(str(folder), name).check()
    said = capsys.readouterr().out
    assert re.match(rf"{folder}: certificates of a new authority for 9 names until .* UTC; .*, 10\.0\.0\.1\n", said)
    assert main(["keys", str(folder)]) == 0
    assert "certificates of the authority that was there for 17 names" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--hub", "lab:7447"], "'lab:7447': give host names and IP addresses, without ports"),
        (["--hub", ""], "'': give host names and IP addresses, without ports"),
    ],
)
def test_what_is_no_address_is_refused_in_one_line(words, says, tmp_path, capsys):
    assert main(["keys", str(tmp_path / "keys"), *words]) == 2
    assert capsys.readouterr().err == f"{says}\n"
    assert not (tmp_path / "keys").exists()


@pytest.mark.parametrize("words", [["--days", "0"], ["--days", "4000"], ["--days", "x"], ["--agents", "0"]])
def test_numbers_out_of_bounds_are_refused(words, tmp_path):
    with pytest.raises(SystemExit):
        main(["keys", str(tmp_path / "keys"), *words])
    assert not (tmp_path / "keys").exists()


def test_a_folder_that_cannot_be_made_is_named(tmp_path, capsys):
    (tmp_path / "file").touch()
    assert main(["keys", str(tmp_path / "file" / "keys")]) == 2
    assert str(tmp_path / "file" / "keys") in capsys.readouterr().err


def test_an_authority_whose_key_others_may_read_makes_no_certificates(tmp_path, capsys):
    folder = tmp_path / "keys"
    assert main(["keys", str(folder), "--agents", "2"]) == 0
    before = (folder / "agent-1.pem").read_bytes()
    (folder / "authority.key").chmod(0o644)
    assert main(["keys", str(folder), "--agents", "2"]) == 2
    assert "authority.key: others may read it (mode 644)" in capsys.readouterr().err
    assert (folder / "agent-1.pem").read_bytes() == before
