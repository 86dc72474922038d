"""Cells that fly on a Dask cluster have the bits that they have here; who cannot fly them is named before they do."""

import sys

import numpy as np
import pytest
from distributed import LocalCluster
from flying import PROCESSES

from affinet.cli import commands
from affinet.studies import cluster, identity, labelled, study
from affinet.studies.executor import Here

pytestmark = PROCESSES

STUDY = """\
title = "Two"
source = "nobody"
figure = "curves"
scenario = "corridor"
set = ["time.dt=0.05", "time.duration=0.2"]
full = { runs = 2 }
quick = { runs = 2 }
axes = [
  { name = "graph", values = { zhao7 = [] } },
  { name = "loss", values = { "0.5" = ["network.availability=0.5"] } },
  { name = "estimator", values = { none = ["agents.estimator=none"], conral = ["agents.estimator=conral"] } },
]
"""


@pytest.fixture(scope="module")
def scheduler():
    """The address of one with one worker, a process of its own."""
    with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=":0", host="127.0.0.1") as local:
        yield local.scheduler_address


@pytest.fixture
def two(tmp_path):
    (tmp_path / "two.toml").write_text(STUDY)
    return tmp_path / "two.toml"


def test_cells_have_the_bits_that_they_have_here(scheduler, two, monkeypatch):
    planned = study.plans(study.load(str(two)), quick=True)
    here = [*study.fly(planned, 2, Here())]
    monkeypatch.setattr(study, "fly_together", lambda *_: pytest.fail("it flew here"))
    with cluster.connected(scheduler, []) as workers:
        assert workers.at_once == 1
        there = [*study.fly(planned, 2, workers)]
    for one, other in zip(here, there, strict=True):
        assert one.labels == other.labels
        for name, values in one.runs.quantities.items():
            np.testing.assert_array_equal(other.runs.quantities[name], values, strict=True)
        assert (one.runs.mean_error == other.runs.mean_error).all()


def test_a_study_leaves_the_same_data_as_here(scheduler, two, tmp_path):
    for name, where in (("here", ["--jobs", "1"]), ("there", ["--dask", scheduler])):
        assert commands.main(["study", str(two), "--out", str(tmp_path / name), *where]) == 0
    here, there = ((tmp_path / name / labelled.FILE).read_bytes() for name in ("here", "there"))
    assert here == there


def test_a_worker_that_would_give_other_bits_is_named(scheduler, two, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(identity, "_rounding", lambda: "as nowhere else")
    assert commands.main(["study", str(two), "--dask", scheduler, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("worker tcp://127.0.0.1:")
    assert "it differs in the rounding of linear algebra; install there what is installed here" in line
    assert not (tmp_path / "out").exists()


def test_a_worker_that_came_later_is_asked_too():
    assert cluster._there(identity.here([]), [], len, "four") == 4
    with pytest.raises(cluster.OtherBits, match=r"it differs in numpy \(.*, here 1.0\)"):
        cluster._there(identity.here([]) | {"numpy": "1.0"}, [], len, "four")


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("tcp://127.0.0.1:1", "Timed out trying to connect"),
        ("somewhere", "missing port number in address 'somewhere'"),
        ("pigeon://loft:1", "unknown address scheme 'pigeon'"),
    ],
)
def test_a_scheduler_that_is_not_there_is_one_line(address, says, two, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.2)
    assert commands.main(["study", str(two), "--dask", address]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"no Dask scheduler at '{address}': {says}")
    assert line.endswith("give an address like tcp://host:8786, where one is started")


def test_a_scheduler_without_workers_is_one_line(two, capsys):
    with LocalCluster(n_workers=0, dashboard_address=":0", host="127.0.0.1") as local:
        assert commands.main(["study", str(two), "--dask", local.scheduler_address]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.endswith(f"has no workers: start some, like `dask worker {local.scheduler_address}`")


def test_who_has_no_dask_is_told_what_to_install(two, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert commands.main(["study", str(two), "--dask", "tcp://127.0.0.1:1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("which is not installed: pip install 'affinet[cluster]'")


def test_a_cluster_that_loses_its_workers_is_told(two, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE_S", -1.0)
    planned = study.plans(study.load(str(two)), quick=True)
    with LocalCluster(n_workers=0, dashboard_address=":0", host="127.0.0.1") as local, local.get_client() as client:
        workers = cluster.Workers(client, 1, identity.here([]), ())
        with pytest.raises(cluster.Lost, match="the cluster has had no worker for"):
            list(study.fly(planned, 2, workers))
