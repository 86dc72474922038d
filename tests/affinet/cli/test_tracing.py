"""`affinet trace`: what a file comes to, the chain, and a profile that flies."""

import json
import tomllib

import numpy as np
import pytest
from scipy import stats

from affinet.cli import commands, options
from affinet.cli.options import traces as words
from affinet.planning import making as planning
from affinet.scenario import loading
from affinet.scenario.trace_files import FormatName
from affinet.traces import fitting, formats

CONTACTS = "0 1 2 up\n2 1 2 down\n3 1 2 up\n10 1 2 down\n"


@pytest.fixture
def pings(tmp_path):
    """1000 pings in bursts of losses, of 4 ms there and back."""
    rng, bad = np.random.default_rng(5), False
    lines = ["PING b (10.0.0.2) 56(84) bytes of data."]
    for number in range(1, 1001):
        bad = rng.random() < (0.7 if bad else 0.03)
        if not bad:
            lines.append(f"64 bytes from b: icmp_seq={number} ttl=64 time=4.0 ms")
    (tmp_path / "pings.txt").write_text("\n".join([*lines, "1000 packets transmitted, 900 received"]))
    return tmp_path / "pings.txt"


@pytest.fixture
def told(capsys):
    def of(*given):
        status = commands.main(["trace", *map(str, given)])
        said = capsys.readouterr()
        assert status == 0, said.err
        return said.out

    return of


def test_the_words_of_the_command_are_those_of_readers_and_models():
    assert words.FORMATS == tuple(formats.FORMATS) == FormatName.__args__
    assert ("best", *fitting.MODELS) == words.MODELS
    assert options.parser().parse_args(["trace", "x"]).fit is None


def test_a_ping_log(pings, told):
    said = json.loads(told(pings, "--json", "--fit", "gilbert", "--interval", 0.1))
    (link,) = said["links"]
    assert (said["format"], said["nodes"], said["seconds"]) == ("ping", ["here", "b"], pytest.approx(100.0))
    assert link["delays_s"] == pytest.approx([0.002] * 3)
    assert link["loss"] == pytest.approx(said["fit"]["parameters"]["p"]["value"] / 0.3, rel=0.5)
    assert link["outages"]["mean"] * link["outages"]["number"] == pytest.approx(1000 * link["loss"])
    assert said["fit"]["goodness"]["refused"] is False
    shown = told(pings, "--fit", "gilbert")
    assert "nothing speaks against the chain" in shown
    assert "note: ping tells of round trips: half of one is taken" in shown
    assert "here" in shown


def test_the_profile_of_a_fit_flies(pings, told, tmp_path):
    told(pings, "--fit", "gilbert", "--profile", tmp_path / "field.toml")
    said = tomllib.loads((tmp_path / "field.toml").read_text())["network"]["profiles"]["pings"]
    assert said["delay"]["table"] == [0.002] * 50
    assert said["loss"][0]["step"] == "packet"
    loss = said["loss"][0]
    overrides = (f'network.profiles.pings.loss=[{{model="gilbert-elliott",p={loss["p"]},r={loss["r"]}}}]',)
    plan = planning.make(loading.load("corridor", [*overrides, 'network.profile="pings"', "time.duration=1.0"]))
    assert plan.profiles[0].chains[-1].loss.max() == 1.0


def test_a_fit_in_ticks_keeps_the_loss_and_steps_with_time(pings, told, tmp_path):
    told(pings, "--fit", "gilbert", "--interval", 0.1, "--dt", 0.01, "--profile", tmp_path / "field.toml")
    (loss,) = tomllib.loads((tmp_path / "field.toml").read_text())["network"]["profiles"]["pings"]["loss"]
    assert loss["step"] == "time"
    assert loss["p"] < 0.01
    said = json.loads(told(pings, "--json"))
    assert loss["p"] / (loss["p"] + loss["r"]) == pytest.approx(said["links"][0]["loss"], rel=0.02)


def test_the_profile_of_a_file_follows_it_from_where_it_lies(told, tmp_path):
    (tmp_path / "field").mkdir()
    (tmp_path / "field" / "met.txt").write_text(CONTACTS)
    told(tmp_path / "field" / "met.txt", "--profile", tmp_path / "met.toml")
    (loss,) = tomllib.loads((tmp_path / "met.toml").read_text())["network"]["profiles"]["met"]["loss"]
    assert loss == {"model": "trace", "file": "field/met.txt"}


def test_the_profile_of_rates_and_delays_follows_them(told, tmp_path):
    (tmp_path / "lte.txt").write_text("1\n2\n")
    (tmp_path / "links.csv").write_text("time,src,dst,delay,rssi\n0,1,2,0.1,-80\n0,2,1,0.2,-70\n")
    told(tmp_path / "lte.txt", "--profile", tmp_path / "lte.toml")
    told(tmp_path / "links.csv", "--curve", "[[-80,0.5],[-70,1.0]]", "--profile", tmp_path / "links.toml")
    said = [
        tomllib.loads((tmp_path / f"{name}.toml").read_text())["network"]["profiles"][name] for name in ("lte", "links")
    ]
    assert said[0] == {"rate": {"trace": {"file": "lte.txt"}}}
    assert said[1]["delay"] == {"model": "trace", "trace": {"file": "links.csv"}}
    assert said[1]["loss"] == [{"model": "trace", "file": "links.csv", "curve": [[-80.0, 0.5], [-70.0, 1.0]]}]
    assert "rate" not in said[1]


def test_contacts_are_fitted_step_by_step(told, tmp_path):
    (tmp_path / "met.txt").write_text(CONTACTS)
    said = json.loads(told(tmp_path / "met.txt", "--json", "--fit", "gilbert", "--dt", 0.5))
    assert [one["link"] for one in said["links"]] == ["1->2", "2->1"]
    assert said["links"][0]["loss"] == pytest.approx(0.1)
    assert said["links"][0]["outages"] == {"number": 1, "mean": 1.0, "longest": 1.0}
    assert said["fit"]["parameters"]["r"]["value"] == 0.5  # down for two steps
    assert said["fit"]["parameters"]["p"]["value"] == pytest.approx(1 / 17)  # both ways are told of, and one counts
    assert said["fit"]["parameters"]["r"]["high"] == pytest.approx(stats.beta.ppf(0.975, 2, 1))


def test_nodes_that_move_say_how_far_they_are_and_a_curve_what_passes(told, tmp_path):
    (tmp_path / "moves.txt").write_text("0 0 0 10 100 0\n0 0 0\n")
    said = json.loads(told(tmp_path / "moves.txt", "--json", "--dt", 1, "--curve", '{model="disk",range=50.0}'))
    assert said["links"][0]["measured"] == pytest.approx([0.0, 45.0, 100.0])
    assert said["links"][0]["loss"] == pytest.approx(0.4)
    assert "distance (m) least" in told(tmp_path / "moves.txt")


@pytest.mark.parametrize(
    ("text", "given", "says"),
    [
        (CONTACTS, ["--fit", "gilbert"], "give the step of the chain by --dt"),
        ("time,src,dst,availability\n0,1,2,0.5\n", ["--fit", "best"], "how long bursts are cannot be known"),
        ("5\n", ["--fit", "best"], "it says nothing of losses"),
        ("0 0 0\n0 5 5\n", ["--profile", "{}.toml"], "there is no profile of it"),
        (CONTACTS, ["--curve", "[["], "no TOML"),
        (CONTACTS, ["--curve", "[[1,2]]"], "give a curve like"),
        (CONTACTS, ["--interval", "2"], "its times are in seconds"),
        ("0 1 2 up\n0 1 2 up\n", [], "line 2: 1 and 2 go up and were up already"),
    ],
)
def test_what_is_wrong_is_one_line(text, given, says, tmp_path, capsys):
    file = tmp_path / "field.txt"
    file.write_text(text)
    assert commands.main(["trace", str(file), *(one.format(tmp_path / "out") for one in given)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


def test_a_fit_to_too_little_says_so(told, tmp_path):
    (tmp_path / "three.txt").write_text(
        "PING b (10.0.0.2) 56(84) bytes of data.\n64 bytes from b: icmp_seq=1 ttl=64 time=4.0 ms\n"
        "64 bytes from b: icmp_seq=3 ttl=64 time=4.0 ms\n\n3 packets transmitted, 2 received\n"
    )
    said = json.loads(told(tmp_path / "three.txt", "--fit", "gilbert", "--json"))["fit"]
    assert (said["steps"], said["bursts"], said["too_little"]) == (3, 1, True)
    shown = told(tmp_path / "three.txt", "--fit", "gilbert", "--profile", tmp_path / "three.toml")
    assert "note: too little to fit a chain to, 1 burst of losses in 3 steps" in shown
    assert "nothing speaks against" not in shown
    assert "too little to fit a chain to" in (tmp_path / "three.toml").read_text().splitlines()[0]


def test_no_file(tmp_path, capsys):
    assert commands.main(["trace", str(tmp_path / "none.txt")]) == 2
    assert "none.txt': No such file or directory" in capsys.readouterr().err
