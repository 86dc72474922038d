"""The web viewer in headless Chromium shows the swarm (`make test-browser`)."""

import io
import shutil

import numpy as np
import pytest
from flying import plan_of

from affinet.cli.commands import main
from affinet.runtimes.run import fly
from affinet.runtimes.viewers import WebViewer
from netem.core.parts import parts
from netem.medium.verdict import Verdict
from world.recording import palette

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
playwright = pytest.importorskip("playwright.sync_api")
image = pytest.importorskip("matplotlib.image")

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on the path"),
    pytest.mark.timeout(600),
]
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
LOOKS = 60


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield opened
        opened.close()


def share(shot, colour):
    """Of a picture, how much is about this colour."""
    pixels = image.imread(io.BytesIO(shot), format="png")[..., :3]
    wanted = np.array([colour >> 24, colour >> 16 & 255, colour >> 8 & 255]) / 255.0
    return float((np.abs(pixels - wanted).max(axis=-1) < 0.04).mean())


def seen(browser, page, looks):
    """Whether the page comes to show messages that are delivered, and the walls of the corridor; and its last picture."""
    with browser.new_page(viewport={"width": 1400, "height": 900}, color_scheme="dark") as tab:
        tab.goto(f"{page}&renderer=webgl")
        for _ in range(looks):
            tab.wait_for_timeout(1000)  # of the page's own: it draws meanwhile
            shot = tab.screenshot()
            if min(share(shot, colour) for colour in (palette.OF_VERDICT[Verdict.DELIVERED], palette.WALL)) > 2e-4:
                return True, shot
        return False, shot


def test_a_swarm_is_seen(browser, tmp_path):
    out = tmp_path / "run"
    fly(
        plan_of("corridor", "time.dt=0.05", "time.duration=2", "network.availability=1"),
        "inprocess",
        out,
        lambda *_: None,
    )
    with WebViewer(parts(out / "run.rrd")) as web:
        found, shot = seen(browser, web.page, LOOKS)
    (tmp_path / "seen.png").write_bytes(shot)
    assert found, f"look at {tmp_path / 'seen.png'}"


def test_where_nothing_is_streamed_no_swarm_is_seen(browser):
    """The counterpart."""
    with WebViewer() as web:
        found, _ = seen(browser, web.page, 10)
    assert not found


@pytest.mark.parametrize(
    ("size", "scheme"), [({"width": 1200, "height": 900}, "light"), ({"width": 390, "height": 844}, "dark")]
)
def test_a_report_is_seen_on_a_desk_and_on_a_telephone(size, scheme, browser, tmp_path):
    out, wrong = tmp_path / "run", []
    fly(plan_of("corridor", "time.dt=0.05", "time.duration=4"), "inprocess", out, lambda *_: None)
    assert main(["report", str(out)]) == 0
    with browser.new_page(viewport=size, color_scheme=scheme) as tab:
        tab.on("pageerror", lambda error: wrong.append(error))
        tab.on("request", lambda request: request.url.startswith(("file:", "data:")) or wrong.append(request.url))
        tab.goto(f"file://{out / 'report.html'}")
        scene = tab.locator(".scene canvas")
        last = scene.screenshot()
        assert share(last, palette.LEADER) > 0.0
        tab.locator(".scene input").fill("0")
        assert scene.screenshot() != last
        assert tab.locator(".scene output").inner_text() == "0.00 s"
        assert tab.evaluate("document.documentElement.scrollWidth") <= size["width"]
        tab.screenshot(path=tmp_path / "report.png", full_page=True)
    assert wrong == []
