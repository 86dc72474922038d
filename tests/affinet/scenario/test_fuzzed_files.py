"""Bytes that are wrong in whatever way, in every file that is read: each is taken, or refused in one line."""

import json
import shutil
from random import Random

import mutations
import pytest
from flying import plan_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from affinet.planning import traces
from affinet.planning.plan import PlanError
from affinet.runtimes.run import fly
from affinet.scenario import files, loading
from affinet.scenario.sections import TimeSection
from affinet.scenario.trace_files import Traced
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.studies import study
from affinet.traces.link_data import Quantity
from affinet.verdicts import reading
from netem.core.links import Links
from netem.impairments import trace
from netem.impairments.measured import MeasuredError
from netem.impairments.trace import TraceError
from netem.medium import journal, recorded
from netem.medium.journal import JournalError
from netem.medium.medium import JOURNAL
from netem.processes.user_code import UserCodeError
from world.books.history import Damaged

LINKS = Links.both_ways(3, [(1, 2), (2, 3)])
TRACE = "time,src,dst,availability\n0,1,2,1\n0.5,1,2,0.25\n0,2,1,50 %\n0e0,2,3,0.125\n0,3,2,.75\n"
EACH = 5


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("fuzzed") / "run"
    plan = plan_of("corridor", "time.dt=0.05", "time.duration=1", "record.enabled=false", "network.availability=0.7")
    fly(plan, "inprocess", out, lambda *_: None)
    return out


ARRAY = "arrays/position.npy"


def reads_scenario(path):
    loading.load(str(path))


def reads_study(path):
    study.load(str(path))


def reads_trace(path):
    every, time = LINKS.src > 0, TimeSection(dt=0.05, duration=1.0)
    given, _ = traces.measured(Traced(model="trace", file=str(path)), Quantity.AVAILABILITY, LINKS, every, time)
    trace.table(given, LINKS, every, 0.05, 20)


def reads_journal(path):
    table = journal.read(path)
    journal.told(path)
    recorded.check(table, ("sense",), 20)
    recorded.carried(table, LINKS, sensing=True)


def reads_run(path):
    reading.evidence(path.parents[1] if path.parent.name == "arrays" else path.parent)


def shipped(name, folder):
    return files.read(name, folder, "file").text.encode()


@pytest.fixture
def read(run, tmp_path):
    """By kind of file: its right bytes, where they stand, and what reads them."""
    flown = shutil.copytree(run, tmp_path / "flown")
    return {
        "scenario": (shipped("bursts", "scenarios"), tmp_path / "scenario.toml", reads_scenario),
        "study": (shipped("paper-000-fig11", "studies"), tmp_path / "study.toml", reads_study),
        "trace": (TRACE.encode(), tmp_path / "trace.csv", reads_trace),
        "journal": ((run / JOURNAL).read_bytes(), tmp_path / JOURNAL, reads_journal),
        **{
            name: ((run / name).read_bytes(), flown / name, reads_run)
            for name in ("scenario.json", "summary.json", ARRAY, JOURNAL)
        },
    }


KINDS = ("scenario", "study", "trace", "journal", "scenario.json", "summary.json", ARRAY, JOURNAL)


def test_what_is_right_is_read(read):
    assert set(read) == set(KINDS)
    for right, path, reads in read.values():
        path.write_bytes(right)
        reads(path)


def fuzz(read, examples):
    taken = dict.fromkeys(KINDS, 0)

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(kind=st.sampled_from(KINDS), seed=st.integers(0, 2**32))
    def any_bytes(kind, seed):
        right, path, reads = read[kind]
        random = Random(seed)
        try:
            for _ in range(EACH):
                data = mutations.of_bytes(random, right)
                if kind.endswith(".json") and random.random() < 0.7:
                    data = json.dumps(without_bytes(mutations.of_plain(random, json.loads(right)))).encode()
                path.write_bytes(data)
                taken[kind] += is_taken(reads, path)
        finally:
            path.write_bytes(right)

    any_bytes()
    return taken


def without_bytes(plain):
    match plain:
        case bytes():
            return list(plain)
        case list():
            return [without_bytes(one) for one in plain]
        case dict():
            return {name: without_bytes(one) for name, one in plain.items()}
    return plain


def is_taken(reads, path):
    try:
        reads(path)
    except (ScenarioError, PlanError, MeasuredError, TraceError, JournalError, Damaged, UserCodeError) as error:
        said = one_line(str(error))
        assert 0 < len(said) < 2000
        return False
    return True


def test_hundreds_of_spoilt_files_fail_no_reader(read):
    taken = fuzz(read, 60)
    assert sum(taken.values()) < 200


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_ten_thousand_spoilt_files_fail_no_reader(read):
    fuzz(read, 2_000)
