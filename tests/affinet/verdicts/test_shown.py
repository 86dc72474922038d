"""A run as it is looked at: in a terminal, in a notebook, in Rerun's viewer and as a picture."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import affinet
from affinet.verdicts import pictured

FAULTS = [{"verb": "cut", "links": [f"1-{agent}"], "at": 0.1 * agent} for agent in (2, 3, 4, 5)]
ODD = "</td><script>&"


@pytest.fixture(scope="module")
def run():
    return affinet.run(affinet.scenario.extended(affinet.scenario.load("corridor", dt=0.05, duration=1), FAULTS))


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return affinet.run("corridor", dt=0.05, duration=0.5, out=tmp_path_factory.mktemp("kept") / "run")


def test_a_terminal_shows_what_flew_and_what_came_of_it_in_a_few_lines(run):
    first, *lines = repr(run).splitlines()
    assert first == "<FlownRun: in code, pass"
    assert [line.partition(":")[0].strip() for line in lines] == [
        *("flown by", "flown", "network", "tracking error", "messages"),
        *("fault", "fault", "fault", "faults", "digest"),
    ]
    mean = run.outcome.tracking_error["mean"]
    assert f"tracking error: mean {mean:.4g}, " in repr(run)
    assert lines[0] == "  flown by: ga-rkf, varying-velocity, seed 1"
    assert lines[2] == "  network: availability 0.7"
    assert str(run.bites[0]) in repr(run)
    assert lines[-2:] == ["  faults: and 1 more", f"  digest: {run.outcome.digest}>"]


def test_a_run_that_fails_says_why():
    flown = affinet.run(affinet.scenario.extended(affinet.scenario.load("corridor", duration=0.1), FAULTS))
    assert flown.outcome.verdict == "vacuous"
    assert repr(flown).count("\n  why: ") == len(flown.outcome.reasons) > 0


def drawn(run):
    """The page, as a browser reads it."""
    return ElementTree.fromstring(run._repr_html_())


def test_a_notebook_shows_the_figures_and_two_drawings_without_any_script(run):
    page = drawn(run)
    assert [cell.text for cell in page.iter("th")][:3] == ["flown by", "flown", "network"]
    paths, error = page.iter("{http://www.w3.org/2000/svg}svg")
    lines = paths.findall("{*}polyline")
    assert len(lines) == run.plan.world.links.agents
    assert len({line.get("stroke") for line in lines}) == 2  # leaders and followers
    assert len(error.findall("{*}polyline")) == 1
    assert "script" not in run._repr_html_()
    assert {element.tag.rpartition("}")[2] for element in page.iter()} <= {
        *("div", "b", "table", "tr", "th", "td", "figure", "figcaption"),
        *("svg", "rect", "polyline", "circle", "title", "text"),
    }


def test_a_drawing_goes_where_the_agents_went(run):
    paths, error = drawn(run).iter("{http://www.w3.org/2000/svg}svg")
    at = np.array(
        [
            [float(number) for number in circle.attrib.values() if number[0].isdigit()][:2]
            for circle in paths.findall("{*}circle")
        ]
    )
    last = run.position[-1]
    for axis, sign in ((0, 1.0), (1, -1.0)):
        assert np.corrcoef(at[:, axis], sign * last[:, axis])[0, 1] > 0.999
    drawn_error = [float(point.split(",")[1]) for point in error.find("{*}polyline").get("points").split()]
    assert np.corrcoef(drawn_error, -np.log10(run.error))[0, 1] > 0.999


def test_a_long_run_is_thinned_and_a_gap_is_left_out(run):
    arrays = {name: np.concatenate([array[: run.ticks]] * 50) for name, array in run.arrays.items()}
    arrays["position"][100:200, 2] = np.nan
    arrays["error"][100:200] = np.nan
    long = affinet.FlownRun(run.plan, arrays, run.outcome)
    assert "nan" not in long._repr_html_()
    assert len(long._repr_html_()) < 60_000
    nowhere = affinet.FlownRun(
        run.plan, {**arrays, "position": arrays["position"] * np.nan, "error": arrays["error"] * np.nan}, run.outcome
    )
    assert list(drawn(nowhere).iter("{http://www.w3.org/2000/svg}svg")) == []


def test_what_a_user_has_named_stays_text(run):
    flown = replace(run.outcome, reasons=(ODD,))
    html = affinet.FlownRun(run.plan, run.arrays, flown)._repr_html_()
    assert ODD not in html
    assert "&lt;/td&gt;&lt;script&gt;&amp;" in html


# ---- run.show()


@pytest.fixture
def shown(monkeypatch):
    """What a notebook, which is none, is given to show."""
    there = []
    display = SimpleNamespace(display=there.append, Image=lambda data: ("picture", data))
    ipython = SimpleNamespace(get_ipython=lambda: "a shell", display=display, version_info=(9, 0))
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    return there


class Viewer:
    """In place of Rerun's."""

    def __init__(self, **size):
        self.size, self.sent = size, []

    def send_rrd(self, data):
        self.sent.append(data)


def test_a_recording_is_shown_in_reruns_viewer_where_that_is(kept, shown, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun_notebook", SimpleNamespace(Viewer=Viewer))
    for run in (kept, affinet.load(kept.outcome.out)):
        run.show()
        assert shown.pop().sent == [kept_file(kept).read_bytes()]
    assert capsys.readouterr().out == ""


def kept_file(run):
    (file,) = [*Path(run.outcome.out).glob("*.rrd")]
    return file


@pytest.mark.parametrize(
    ("which", "says"),
    [
        ("kept", "for Rerun's viewer in place of this picture: pip install 'affinet[notebook]'\n"),
        ("run", "it left no recording: for one to look at in Rerun's viewer fly it with out=DIR\n"),
    ],
)
def test_else_a_picture_is_shown_and_a_line_says_how_to_have_the_viewer(
    which, says, shown, monkeypatch, capsys, request
):
    monkeypatch.setitem(sys.modules, "rerun_notebook", None)
    request.getfixturevalue(which).show()
    ((kind, data),) = shown
    assert kind == "picture"
    assert data.startswith(b"\x89PNG")
    assert capsys.readouterr().out == says


def test_the_recording_of_another_run_in_its_place_is_not_shown(run, kept, shown, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun_notebook", SimpleNamespace(Viewer=Viewer))
    monkeypatch.chdir(kept.outcome.out)  # a run without a directory says that it is here
    run.show()
    assert shown[0][0] == "picture"


def test_outside_of_a_notebook_it_says_what_opens_the_recording(run, kept, monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    with pytest.raises(
        RuntimeError, match=rf"^there is no notebook to show it in: affinet watch {re.escape(kept.outcome.out)}$"
    ):
        kept.show()
    with pytest.raises(RuntimeError, match=r"^there is no notebook to show it in: fly it with out=DIR"):
        run.show()


@pytest.mark.parametrize("scenario", ["ravine", "target"])
def test_a_picture_is_drawn_of_any_run(scenario):
    assert pictured.png(affinet.run(scenario, duration=0.1)).startswith(b"\x89PNG")
