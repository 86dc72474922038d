"""Pictures and films of runs, without a viewer."""

import numpy as np
import pytest
from flying import plan_of
from matplotlib.image import imread
from PIL import Image

from affinet.cli.commands import main
from affinet.runtimes.run import fly
from analysis.figures import swarm

SHORT = ("time.dt=0.05", "time.duration=2")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for out, name, *overrides in (
        ("filtered", "corridor"),
        ("again", "corridor"),
        ("rkf", "corridor", "agents.estimator=rkf"),
        ("half", "corridor", "agents.estimator=rkf", "network.availability=0.5"),
        ("cut $off", "corridor", 'timeline=[{verb="cut",at=1.0,until=1.5,links=["all"]}]'),
        ("places", "localization"),
        ("found", "target", "time.dt=0.01"),
        ("deep", "ravine"),
    ):
        fly(plan_of(name, *SHORT, "record.enabled=false", *overrides), "inprocess", folder / out, lambda *_: None)
    return folder


def share(picture, colour):
    pixels = imread(picture)[..., :3]
    return float((np.abs(pixels - np.array(colour) / 255.0).max(axis=-1) < 0.02).mean())


@pytest.mark.parametrize("name", ["filtered", "cut $off", "places", "found", "deep"])
def test_a_moment_of_every_task_is_a_picture(name, runs, tmp_path):
    assert main(["render", str(runs / name), "--at", "1.2", "--out", str(tmp_path / "swarm.png")]) == 0
    picture = imread(tmp_path / "swarm.png")
    assert picture.shape[0] > 500
    assert picture.std() > 0.05


def test_a_link_has_the_colour_of_its_verdict_at_that_moment(runs, tmp_path):
    green, red = (61, 220, 132), (255, 59, 48)
    shares = {}
    for at in ("0.9", "1.2"):
        assert main(["render", str(runs / "cut $off"), "--at", at, "--out", str(tmp_path / f"{at}.png")]) == 0
        shares[at] = share(tmp_path / f"{at}.png", green), share(tmp_path / f"{at}.png", red)
    # The legend names both in either; the scene has the one or the other.
    assert shares["0.9"][0] > 2 * shares["1.2"][0]
    assert shares["1.2"][1] > 2 * shares["0.9"][1]


def test_several_runs_are_beside_each_other(runs, tmp_path):
    for names in (["filtered"], ["filtered", "cut $off"]):
        command = ["render", *(str(runs / name) for name in names), "--out", str(tmp_path / f"{len(names)}.png")]
        assert main(command) == 0
    one, two = imread(tmp_path / "1.png"), imread(tmp_path / "2.png")
    assert two.shape[1] > 1.5 * one.shape[1]


def drawn(monkeypatch):
    """What is drawn of each picture from now on."""
    pictures, draw = [], swarm.Picture.show
    monkeypatch.setattr(swarm.Picture, "show", lambda of, at: (pictures.append(of), draw(of, at)))
    return pictures


def titled(names, runs, tmp_path, monkeypatch):
    pictures = drawn(monkeypatch)
    assert main(["render", *(str(runs / name) for name in names), "--out", str(tmp_path / "titled.png")]) == 0
    return [axes.get_title() for axes in pictures[-1].figure.axes[: len(names)]]


@pytest.mark.parametrize(
    ("names", "titles"),
    [
        (["filtered"], ["filtered"]),
        (["filtered", "rkf"], ["estimator ga-rkf", "estimator rkf"]),
        (
            ["rkf", "half", "filtered"],
            [
                "estimator rkf, availability 0.7",
                "estimator rkf, availability 0.5",
                "estimator ga-rkf, availability 0.7",
            ],
        ),
        (["rkf", "half"], ["availability 0.7", "availability 0.5"]),
        (["filtered", "cut $off"], ["filtered", "cut $off"]),  # a timeline is no title
        (["filtered", "again"], ["filtered", "again"]),
    ],
)
def test_runs_beside_each_other_are_called_by_what_tells_them_apart(names, titles, runs, tmp_path, monkeypatch):
    assert titled(names, runs, tmp_path, monkeypatch) == titles


@pytest.mark.parametrize("name", ["filtered", "deep"])
def test_agents_have_their_numbers_where_they_are(name, runs, tmp_path, monkeypatch):
    pictures = drawn(monkeypatch)
    assert main(["render", str(runs / name), "--at", "1.2", "--out", str(tmp_path / "swarm.png")]) == 0
    numbers = pictures[-1]._panels[0]._numbers
    position = np.load(runs / name / "arrays" / "position.npy")[24]
    places = [number.xy if name == "filtered" else number.get_position_3d() for number in numbers]
    assert [int(number.get_text()) for number in numbers] == list(range(1, len(position) + 1))
    assert np.array_equal(np.array(places), position)


def test_a_large_swarm_has_no_numbers(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(swarm, "_MOST_NUMBERS", 6)
    pictures = drawn(monkeypatch)
    assert main(["render", str(runs / "filtered"), "--out", str(tmp_path / "swarm.png")]) == 0
    assert pictures[-1]._panels[0]._numbers == []


@pytest.mark.parametrize("command", ["render", "compare", "report", "conformance"])
def test_what_is_there_is_not_overwritten(command, runs, tmp_path, capsys):
    out = tmp_path / "kept.png"
    out.write_text("mine")
    given = {"compare": [str(runs / "filtered"), str(runs / "rkf")], "conformance": ["true"]}
    assert main([command, *given.get(command, [str(runs / "filtered")]), "--out", str(out)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said == f"'{out}' is there already; name another with --out, or remove it"
    assert out.read_text() == "mine"


def test_a_film_has_as_many_frames_as_its_speed_asks_for(runs, tmp_path):
    out = tmp_path / "swarm.gif"
    assert main(["render", str(runs / "filtered"), "--speed", "4", "--fps", "5", "--out", str(out)]) == 0
    with Image.open(out) as film:
        first = np.asarray(film.convert("L")).astype(int)
        assert film.n_frames == 3  # 0, 0.8 and 1.6 s
        assert film.info["duration"] == 200
        film.seek(2)
        assert np.abs(np.asarray(film.convert("L")).astype(int) - first).max() > 100


def test_one_tick_is_no_film(tmp_path, capsys):
    short = str(tmp_path / "short")
    assert (
        main(["run", "corridor", "--runtime", "inprocess", "--dt", "0.05", "--duration", "0.05", "--out", short]) == 0
    )
    capsys.readouterr()
    assert main(["render", short, "--out", str(tmp_path / "x.gif")]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.endswith("x.gif: the run has one tick, which is no film; give a name that ends in .png")


def test_without_ffmpeg_a_film_says_what_would_help(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(swarm.FFMpegWriter, "isAvailable", lambda: False)
    out = tmp_path / "swarm.mp4"
    assert main(["render", str(runs / "filtered"), "--out", str(out)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said == f"{out}: there is no ffmpeg on the path to write it with: install it, or write a .gif"
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--at", "2.5", "--out", "x.png"], "--at 2.5: give a moment from 0 to 1.95 s"),
        (["--from", "1.5", "--to", "1", "--out", "x.gif"], "--to 1: give a moment after --from 1.5"),
        (
            ["--speed", "0.001", "--out", "x.gif"],
            "--speed 0.001: that would be more than 20000 frames; give a higher one",
        ),
        (["--out", "nowhere/x.png"], "No such file or directory"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_line(options, line, runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["render", str(runs / "filtered"), *options]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert line in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["swarm", "swarm.webm", "swarm.PNGX"])
def test_the_ending_says_what_it_is_to_be(name, runs, capsys):
    with pytest.raises(SystemExit):
        main(["render", str(runs / "filtered"), "--out", name])
    assert "give a name that ends in .png" in capsys.readouterr().err
