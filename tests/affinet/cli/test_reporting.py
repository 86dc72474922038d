"""Pages of runs and studies: whole in one file, with what the run said, and nothing of a user's that is not escaped."""

import base64
import json
import re
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest
from flying import plan_of

from affinet.cli.commands import main
from affinet.runtimes.run import fly
from affinet.studies import page as study_page
from affinet.studies import record
from affinet.verdicts import told
from affinet.verdicts.page import html, ticks
from analysis.claims.intervals import Decision
from netem.medium.verdict import COUNTED, Verdict
from world.books.history import ARRAYS, load
from world.recording import palette

SHORT = ("time.dt=0.05", "time.duration=2", "record.enabled=false")
FAULTS = 'timeline=[{verb="cut",at=1.0,until=1.5,links=["6->4"]},{verb="kill",at=1.2,agents=[7]}]'
HOSTILE = 'description="</script><script>alert(1)</script><b>&"'


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for out, name, *overrides in (
        ("fault <i>&", "corridor", FAULTS, HOSTILE),
        ("places", "localization"),
        ("found", "target", "time.dt=0.01"),
        ("deep", "ravine"),
    ):
        fly(plan_of(name, *SHORT, *overrides), "inprocess", folder / out, lambda *_: None)
    return folder


@pytest.fixture
def page(runs, tmp_path, capsys):
    def page(name):
        assert main(["report", str(runs / name), "--out", str(tmp_path / "page.html")]) == 0
        assert capsys.readouterr().out.strip() == str(tmp_path / "page.html")
        return (tmp_path / "page.html").read_text(encoding="utf-8")

    return page


class Elements(HTMLParser):
    """All elements in their order, with what is open where; a page that closes another than it opened fails."""

    VOID = frozenset({"meta", "input", "img", "br"})
    OF_SVG = frozenset({"path", "polyline", "line"})

    def __init__(self, text):
        super().__init__()
        self.seen, self._open = [], []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.seen.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag


def flight(page):
    return json.loads(re.search(r'id="flight">(.*?)</script>', page, flags=re.DOTALL)[1])


@pytest.mark.parametrize("name", ["fault <i>&", "places", "found", "deep"])
def test_a_page_of_every_task_is_whole_and_asks_for_nothing_else(name, page):
    text = page(name)
    for tag, attributes in Elements(text).seen:
        assert tag not in ("link", "iframe", "object", "embed")
        assert not attributes.get("src", "data:").startswith(("http", "//", "/"))
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", text)
    assert 'name="viewport"' in text


def test_what_a_user_wrote_is_text(page):
    text = page("fault <i>&")
    assert "<script>alert" not in text
    assert "<i>&" not in text
    assert "</script><script>alert(1)</script><b>&" in unescape(text)
    assert [tag for tag, _ in Elements(text).seen].count("script") == 2


def test_the_scene_is_that_of_the_arrays(page, runs):
    said, arrays = flight(page("fault <i>&")), load(runs / "fault <i>&" / ARRAYS)
    position = np.frombuffer(base64.b64decode(said["position"]), dtype=np.float32).reshape(40, 7, 2)
    np.testing.assert_allclose(position, arrays["position"][:40], atol=1e-5)
    verdicts = np.frombuffer(base64.b64decode(said["verdicts"]), dtype=np.uint8).reshape(40, 24)
    np.testing.assert_array_equal(verdicts, arrays["verdicts"][:, 0])
    assert said["seconds"] == pytest.approx((0.05 * np.arange(40)).tolist())
    assert said["colours"][Verdict.SILENT] is None
    assert said["leaders"] == [True] * 3 + [False] * 4


def test_a_long_run_is_thinned_to_its_end(tmp_path):
    fly(plan_of("corridor", "time.duration=8", "record.enabled=false"), "inprocess", tmp_path / "long", lambda *_: None)
    assert main(["report", str(tmp_path / "long")]) == 0
    said = flight((tmp_path / "long" / "report.html").read_text())
    assert len(said["seconds"]) == 600
    assert said["seconds"][-1] == pytest.approx(7.99)


def test_verdict_faults_messages_settings_and_the_command_are_there(page, runs):
    text = unescape(page("fault <i>&"))
    summary = json.loads((runs / "fault <i>&" / "summary.json").read_text())
    assert f'<span class="verdict pass">{summary["verdict"]}</span>' in text
    for fault in summary["faults"]:
        assert fault.get("fault", "") in text
    assert f"<td>{summary['messages']['offered']}</td>" in text
    assert f"affinet replay '{runs / 'fault <i>&'}' --runtime inprocess" in text
    assert 'estimator = "ga-rkf"' in text


def test_the_matrix_says_how_many_messages_got_through_on_each_link(page, runs):
    rows = re.search(r'<table class="matrix">(.*?)</table>', page("fault <i>&"), flags=re.DOTALL)[1].split("<tr>")[2:]
    cells = [re.findall(r"<td>(.*?)</td>", row) for row in rows]
    arrays, links = load(runs / "fault <i>&" / ARRAYS), plan_of("corridor").world.links
    row = links.index[6, 4]
    offered = (arrays["verdicts"][:, :, row] != Verdict.SILENT).sum()
    arrived = (arrays["verdicts"][:, :, row] == Verdict.DELIVERED).sum()
    assert cells[3][5] == f"{100 * arrived / offered:.0f}"
    assert cells[0][0] == "·"


def test_a_page_of_a_study_has_its_claims_figures_and_cases(tmp_path):
    kept = record.StudyRecord(
        title="Loss <b>",
        source="ours",
        flown="0" * 16,
        quick=True,
        runs=5,
        confidence=0.99,
        claims=[record.JudgedClaim(says="rkf < none", asked="0" * 16, decision=Decision.DOES_NOT_HOLD, found="1 > 0")],
        cases=[record.CaseMean(labels={"loss": "0.5"}, quantity="error", unit="m²", found=0.25, low=0.2, high=None)],
    )
    record.write(tmp_path, kept)
    (tmp_path / "errors.png").write_bytes(b"\x89PNG")
    assert study_page.is_one(tmp_path)
    assert main(["report", str(tmp_path)]) == 0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    Elements(text)
    assert "<h1>Loss &lt;b&gt;</h1>" in text
    assert '<td class="verdict does-not-hold">does not hold</td><td>1 &gt; 0</td>' in text
    assert f'src="data:image/png;base64,{base64.b64encode(bytes([0x89]) + b"PNG").decode()}"' in text
    assert "<tr><th>0.5</th><td>error (m²)</td><td>0.25</td><td>0.2</td></tr>" in text


def test_a_study_that_was_changed_is_refused(tmp_path, capsys):
    (tmp_path / record.FILE).write_text("{}")
    assert main(["report", str(tmp_path)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "is not as the study left it" in said


def test_what_is_no_run_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_curve_of_one_value_and_one_of_none_are_drawn():
    seconds = np.array([0.0, 1.0])
    assert "polyline" in html.curves("flat", seconds, [("", "#000", np.ones(2))])
    assert html.curves("none", seconds, [("", "#000", np.full(2, np.nan))]) == ""
    drawn = html.curves("log", seconds, [("", "#000", np.array([1.0, 100.0]))], logarithmic=True)
    assert "log, on a logarithmic axis, over time (s)" in drawn
    assert re.findall(r'class="y" style="bottom:(.*?)%">(.*?)<', drawn)[::3] == [
        ("0.00", "1"),
        ("50.00", "10"),
        ("100.00", "100"),
    ]


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [(0.0, 1.0, "0 0.2 0.4 0.6 0.8 1"), (0.0, 7.99, "0 2 4 6"), (-3.0, 65.9, "0 20 40 60"), (1e-9, 1.1e-9, None)],
)
def test_an_axis_has_a_few_round_numbers(low, high, says):
    found = ticks.of(low, high)
    assert 3 <= len(found) <= 8
    assert all(low - 1e-9 * (high - low) <= at <= high * (1 + 1e-9) for at, _ in found)
    assert [float(said) for _, said in found] == pytest.approx([at for at, _ in found])
    if says:
        assert " ".join(said for _, said in found) == says


@pytest.mark.parametrize(
    ("low", "high", "says"),
    [(-3.0, 0.5, "0.001 0.01 0.1 1"), (-0.4, 0.8, "0.5 1 2 5"), (-15.0, 12.0, None), (0.31, 0.32, None)],
)
def test_a_logarithmic_axis_has_powers_of_ten(low, high, says):
    found = ticks.decades(low, high)
    assert 2 <= len(found) <= 8
    assert all(low - 1e-6 <= at <= high + 1e-6 for at, _ in found)
    if says:
        assert " ".join(said for _, said in found) == says


def test_the_air_is_told_with_what_differs_and_zones_have_a_line(tmp_path):
    given = (
        'network={availability=0.9,links=[{links="4-6",profile="jammed"}],zones=[{centre=[0,0],radius=9.0,share=0.5}]}'
    )
    fly(plan_of("corridor", *SHORT, given), "inprocess", tmp_path / "run", lambda *_: None)
    assert main(["report", str(tmp_path / "run")]) == 0
    text = unescape((tmp_path / "run" / "report.html").read_text(encoding="utf-8"))
    assert "22 links, profile 'perfect': mean loss 0.1" in text
    assert "2 links, profile 'jammed': mean loss 0.55, mean burst" in text
    assert text.count("1, 9 m about (0, 0) jammed ") == 1
    assert told.OF_PASS in text


def brightness(colour):
    channels = [(colour >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("verdict", COUNTED)
def test_a_verdict_can_be_told_from_a_white_ground_and_from_a_dark_one(verdict):
    bright = brightness(palette.OF_VERDICT[verdict])
    assert 1.05 / (bright + 0.05) > 1.7
    assert (bright + 0.05) / (brightness(0x14171BFF) + 0.05) > 2.5
