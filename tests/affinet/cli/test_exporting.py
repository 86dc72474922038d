"""`affinet export`: a run directory in the formats of others, beside it, and nothing overwritten."""

import subprocess
import sys

import pytest
import xarray

import affinet
from affinet.cli import commands
from affinet.verdicts.export.formats import FORMATS


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    out = tmp_path_factory.mktemp("kept") / "flown"
    affinet.run("corridor", {"record.enabled": False}, dt=0.05, duration=0.5, out=out)
    return out


def exported(capsys, *words):
    """Exit status, and what was said."""
    status = commands.main(["export", *map(str, words)])
    said = capsys.readouterr()
    return status, said.out + said.err


@pytest.mark.parametrize("form", FORMATS)
def test_a_run_is_written_beside_itself_once(form, kept, capsys):
    out = kept.with_name(f"flown{FORMATS[form].ending}")
    assert exported(capsys, kept, "--to", form) == (0, f"{out}\n")
    assert out.exists()
    assert exported(capsys, kept, "--to", form) == (2, f"'{out}' is there already; name another place\n")


def test_it_has_what_the_library_has(kept, capsys, tmp_path):
    assert exported(capsys, kept, "--to", "netcdf", "--out", tmp_path / "mine.nc")[0] == 0
    with xarray.open_dataset(tmp_path / "mine.nc") as dataset:
        xarray.testing.assert_equal(dataset, affinet.load(kept).dataset)


def test_what_is_no_run_is_bad_input(tmp_path, capsys):
    status, said = exported(capsys, tmp_path, "--to", "csv")
    assert (status, said) == (2, f"{tmp_path}: no run that has ended: it has no summary.json\n")


def test_a_library_that_is_missing_is_one_line(kept, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    status, said = exported(capsys, kept, "--to", "mcap", "--out", tmp_path / "run.mcap")
    assert (status, said) == (2, "an MCAP file is made with mcap: pip install 'affinet[mcap]'\n")


def test_a_command_line_that_exports_nothing_imports_none_of_the_formats():
    code = "import sys, affinet.cli.options; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    within = {name for name in done.stdout.split() if name.startswith("affinet.verdicts.export")}
    assert within == set()
    assert not {"pyarrow", "h5netcdf", "xarray", "pandas", "mcap"} & {*done.stdout.split()}
