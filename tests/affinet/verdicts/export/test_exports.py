"""A run in the formats of others has the numbers of its arrays, bit for bit, and nothing where there was nothing."""

import csv
import errno
import json
import re
import sys

import numpy as np
import pandas
import pyarrow.parquet
import pytest
import xarray
from mcap.reader import make_reader

import affinet
from affinet.verdicts.export import derived, foxglove, tables
from affinet.verdicts.export.extras import NotInstalled
from affinet.verdicts.export.formats import FORMATS, write
from netem.medium.verdict import Verdict
from world.books import described, history

# An agent is dead for a while, links carry nothing, and some messages come late.
FAULTS = [
    {"verb": "cut", "links": ["6->4"], "at": 0.5, "until": 1.0},
    {"verb": "kill", "agents": [5], "at": 0.2},
    {"verb": "restart", "agents": [5], "at": 0.7},
]


@pytest.fixture(scope="module")
def run():
    given = affinet.scenario.load("corridor", availability=0.5, dt=0.05, duration=1.5, network={"delay_ticks": 1})
    return affinet.run(affinet.scenario.extended(given, FAULTS))


@pytest.fixture(autouse=True, params=[512, 7], ids=["at once", "in parts"])
def span(request, monkeypatch):
    """The ticks that are looked at together: a run may be longer."""
    monkeypatch.setattr(history, "_SPAN", request.param)


def slots(run, name):
    """An array of slots as one of links, of all axes behind."""
    links = run.plan.world.links
    return run.arrays[name][:, links.dst - 1, [where(run, link) for link in range(len(links))]]


def where(run, link):
    links = run.plan.world.links
    return links.neighbours_of(int(links.dst[link])).index(int(links.src[link]))


# ---- xarray


def test_a_dataset_has_every_array_with_its_axes_units_and_name(run):
    dataset = run.dataset
    assert dataset.data_vars.keys() == run.arrays.keys() | {"age_of_news", "final_position"}
    for name, form in (described.of_run(run.plan.world, run.plan.reports) | described.DERIVED).items():
        assert dataset[name].dims == form.axes
        assert (dataset[name].attrs["units"], dataset[name].attrs["long_name"]) == (form.unit, form.says)
    assert dataset.time.attrs == {"units": "s", "long_name": "time"}
    assert (dataset.attrs["estimator"], dataset.attrs["digest"]) == ("ga-rkf", run.outcome.digest)


def test_a_dataset_is_selected_from_by_its_labels(run):
    dataset = run.dataset
    row = run.plan.world.links.index[6, 4]
    assert (dataset.verdicts.sel(link="6->4", channel="sense") == run.arrays["verdicts"][:, 0, row]).all()
    assert (dataset.position.sel(agent=4, axis="y", time=0.5) == run.arrays["position"][10, 3, 1]).all()
    assert dataset.neighbour.sel(agent=4).dropna("slot").values.tolist() == [*run.plan.world.links.neighbours_of(4)]
    assert dataset.link.where(dataset.receiver == 4, drop=True).values.tolist() == ["1->4", "2->4", "5->4", "6->4"]
    lost = dict(zip(dataset.verdicts.flag_meanings.split(), dataset.verdicts.flag_values, strict=True))["lost"]
    assert ((dataset.verdicts == lost).sum() == (run.arrays["verdicts"] == Verdict.LOST).sum()).all()


def test_a_dataset_has_the_bits_of_the_arrays_and_is_nan_where_there_is_nothing(run):
    dataset, arrays, present = run.dataset, run.arrays, run.plan.world.links.present
    for name in (
        "position",
        "input",
        "target",
        "error",
        "measured",
        "copies",
        "late",
        "dropped",
        "verdicts",
        "known",
        "psi",
    ):
        np.testing.assert_array_equal(dataset[name].values, arrays[name][: run.ticks])
    np.testing.assert_array_equal(dataset.final_position.values, arrays["position"][-1])
    known = arrays["known"]
    assert known.any()
    assert not (known | ~present).all()
    for name in ("estimate", "covariance"):
        np.testing.assert_array_equal(dataset[name].values[known], arrays[name][known])
        assert np.isnan(dataset[name].values[~known]).all()
    for name in ("feasible", "newest"):
        assert (arrays[name] == -1).any()
        np.testing.assert_array_equal(dataset[name].values, np.where(arrays[name] == -1, np.nan, arrays[name]))
    assert np.isnan(dataset.neighbour.values[~present]).all()
    assert np.isnan(dataset.nis.values[:, ~present]).all()


def test_a_netcdf_file_is_opened_as_the_same_dataset(run, tmp_path):
    run.to_netcdf(tmp_path / "run.nc")
    with xarray.open_dataset(tmp_path / "run.nc") as opened:
        xarray.testing.assert_equal(opened, run.dataset)
        assert opened.known.dtype == bool
        assert opened.attrs == run.dataset.attrs
        for name, one in run.dataset.variables.items():
            assert opened[name].attrs.keys() == one.attrs.keys(), name


def test_the_age_of_news_is_how_long_ago_the_newest_was_said_that_came(run):
    ages, newest = run.dataset.age_of_news, run.arrays["newest"]
    sensing, said = ages.sel(channel="sense"), ages.sel(channel="input")
    now = run.dataset.time
    heard = run.dataset.verdicts.sel(channel="sense") == Verdict.DELIVERED
    np.testing.assert_array_equal(sensing.values == 0.0, heard.values)
    np.testing.assert_allclose(said.values[newest[:, list(run.plan.channels).index("input")] >= 0].min(), run.dt)
    cut = sensing.sel(link="6->4").where((now > 0.55) & (now < 0.95), drop=True)
    np.testing.assert_allclose(np.diff(cut), run.dt)
    assert np.isnan(ages).any()
    np.testing.assert_array_equal(ages, affinet.realised(run).age_s)


# ---- tables


def test_the_table_of_agents_has_a_row_for_each_tick_and_agent(run):
    rows = run.to_pandas()
    assert len(rows) == run.ticks * 7
    of_four = rows[rows.agent == 4]
    np.testing.assert_array_equal(of_four.time, run.seconds)
    np.testing.assert_array_equal(of_four[["position_x", "position_y"]], run.position[:, 3])
    np.testing.assert_array_equal(of_four.theta_2_1, run.arrays["theta"][:, 3, 1, 0])
    assert rows.attrs["units"]["input_x"] == "m/s"
    assert rows.feasible.isna().sum() == (run.arrays["feasible"] == -1).sum()


def test_the_table_of_links_has_what_an_agent_believes_and_hears_of_a_neighbour(run):
    rows = run.to_pandas("links")
    links = run.plan.world.links
    assert rows.agent[: len(links)].tolist() == links.dst.tolist()
    assert rows.neighbour[: len(links)].tolist() == links.src.tolist()
    known = slots(run, "known").reshape(-1)
    assert rows.known.tolist() == known.tolist()
    np.testing.assert_array_equal(rows.covariance_xy[known], slots(run, "covariance").reshape(-1, 3)[known, 1])
    assert rows.estimate_x[~known].isna().all()
    newest = run.arrays["newest"][:, 2].reshape(-1)
    np.testing.assert_array_equal(rows[f"newest_{run.plan.channels[2]}"], np.where(newest < 0, np.nan, newest))
    np.testing.assert_array_equal(
        rows[f"age_of_news_{run.plan.channels[2]}"],
        run.dataset.age_of_news.sel(channel=run.plan.channels[2]).values.reshape(-1),
    )
    labels = [Verdict(code).label for code in run.arrays["verdicts"][:, 2].reshape(-1)]
    assert rows[f"verdict_{run.plan.channels[2]}"].tolist() == labels
    assert {"silent", "delayed", "lost", "cut", "dead"} <= {*labels}


def test_every_array_is_in_one_table(run):
    named = {name: {*run.to_pandas(name).columns} for name in tables.NAMES}
    for name in (*run.arrays, *described.DERIVED):
        begins = re.compile(rf"{'verdict' if name == 'verdicts' else name}(_|$)")
        holding = [table for table, columns in named.items() if any(map(begins.match, columns))]
        assert len(holding) == 1, name


def test_a_report_called_like_a_column_has_another_name(run):
    odd = {"tick": (), "position_x": (), "time": (2,)}
    arrays = run.arrays | {name: np.full((run.ticks, 7, *shape), 3.0) for name, shape in odd.items()}
    plan = type(run.plan)(**{**run.plan.__getstate__(), "reports": {**run.plan.reports, **odd}})
    other = affinet.FlownRun(plan, arrays, run.outcome)
    assert {"report_tick", "report_position_x", "time_1"} <= {*other.to_pandas().columns}
    assert other.dataset.report_time.dims == ("time", "agent", "time_1")
    np.testing.assert_array_equal(other.to_pandas().position_x, run.to_pandas().position_x)


def test_parquet_is_read_as_the_tables_of_pandas(run, tmp_path):
    run.to_parquet(tmp_path / "tables")
    assert sorted(file.name for file in (tmp_path / "tables").iterdir()) == [
        "agents.parquet",
        "links.parquet",
        "ticks.parquet",
    ]
    for name in tables.NAMES:
        read = pyarrow.parquet.read_table(tmp_path / "tables" / f"{name}.parquet")
        pandas.testing.assert_frame_equal(
            read.to_pandas(), run.to_pandas(name), check_dtype=False, check_categorical=False
        )
    assert read.schema.field("estimate_x").metadata == {
        b"units": b"m",
        b"long_name": b"estimate of where the agent is from its neighbour",
    }
    assert read.schema.metadata[b"digest"].decode() == run.outcome.digest
    assert str(read.schema.field("newest_sense").type) == "int32"


def test_csv_has_units_in_its_heading_and_is_read_back_bit_for_bit(run, tmp_path):
    write(run, "csv", tmp_path / "tables")
    with (tmp_path / "tables" / "agents.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    position = np.array([[float(row["position_x [m]"]), float(row["position_y [m]"])] for row in rows])
    assert position.tobytes() == run.position.tobytes()
    assert [float(row["time [s]"]) for row in rows[::7]] == run.seconds.tolist()
    assert [row["feasible"] for row in rows] == [
        {-1: "", 0: "0", 1: "1"}[told] for told in run.arrays["feasible"].reshape(-1)
    ]
    for name in tables.NAMES:
        with (tmp_path / "tables" / f"{name}.csv").open(newline="") as file:
            (heading, *cells), want = [*csv.reader(file)], run.to_pandas(name)
        assert [column.partition(" [")[0] for column in heading] == [*want.columns]
        for column, said in zip(want.columns, zip(*cells, strict=True), strict=True):
            there = [cell != "" for cell in said]
            assert there == want[column].notna().tolist()
            read = [cell if column.startswith("verdict") else float(cell) for cell in said if cell]
            assert read == want[column].dropna().tolist(), column


# ---- MCAP


@pytest.fixture
def messages(run, tmp_path):
    """What is said on each topic: log time, schema and content."""
    write(run, "mcap", tmp_path / "run.mcap")
    said = {}
    with (tmp_path / "run.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            said.setdefault(channel.topic, []).append(
                (message.log_time, json.loads(schema.data), json.loads(message.data))
            )
    return said


def test_mcap_has_every_number_under_simulated_time(run, messages):
    rows = run.to_pandas()
    said = messages["/agents/4"]
    assert [ns for ns, _, _ in said] == [round(second * 1e9) for second in run.seconds]
    assert [content["position_x"] for _, _, content in said] == run.position[:, 3, 0].tolist()
    assert [content.get("psi") for _, _, content in said] == [
        None if np.isnan(one) else one for one in run.arrays["psi"][:, 3]
    ]
    assert {*said[0][2]} <= {*rows.columns}
    links = run.to_pandas("links")
    for neighbour in run.plan.world.links.neighbours_of(4):
        mine = links[(links.agent == 4) & (links.neighbour == neighbour)]
        said = [content for _, _, content in messages[f"/agents/4/neighbours/{neighbour}"]]
        assert [content.get("estimate_y") for content in said] == [
            None if np.isnan(one) else one for one in mine.estimate_y
        ]
        assert [content["verdict_sense"] for content in said] == mine.verdict_sense.tolist()
    assert [content["error"] for _, _, content in messages["/swarm"]] == run.error.tolist()


def test_mcap_shows_the_swarm_by_the_schemas_of_foxglove(run, messages):
    named = {
        topic: said[0][1]["title"] for topic, said in messages.items() if not topic.startswith(("/agents", "/swarm"))
    }
    assert named == {
        "/tf": "foxglove.FrameTransforms",
        "/targets": "foxglove.PosesInFrame",
        "/scene/agents": "foxglove.SceneUpdate",
        "/scene/edges": "foxglove.SceneUpdate",
        "/log": "foxglove.Log",
    }
    _, _, transforms = messages["/tf"][10]
    assert transforms["transforms"][3] == {
        "timestamp": {"sec": 0, "nsec": 500_000_000},
        "parent_frame_id": "world",
        "child_frame_id": "agent_4",
        "translation": {"x": run.position[10, 3, 0], "y": run.position[10, 3, 1], "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }
    ((_, _, agents),) = messages["/scene/agents"]
    assert [entity["frame_id"] for entity in agents["entities"]] == [f"agent_{agent}" for agent in range(1, 8)]
    ((line,),) = (entity["lines"] for entity in messages["/scene/edges"][10][2]["entities"])
    assert len(line["points"]) == len(line["colors"]) == 2 * len(run.plan.world.links)


def test_mcap_has_the_faults_in_its_log(messages):
    said = [(ns, content["level"], content["message"]) for ns, _, content in messages["/log"]]
    assert [(ns, level) for ns, level, _ in said] == [
        (200_000_000, 3),
        (500_000_000, 3),
        (700_000_000, 2),
        (1_000_000_000, 2),
        (1_500_000_000, 2),
    ]
    texts = [text for _, _, text in said]
    assert texts[0].startswith("kill 5: touched ")
    assert texts[1].startswith("cut 6->4: touched ")
    assert texts[2:] == ["restart 5", "heal: cut 6->4", "pass"]


def fits(schema, value):
    """Whether a JSON schema, as far as those here go, takes a value."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}
    if not isinstance(value, kinds[schema["type"]]) or (isinstance(value, bool) and schema["type"] != "boolean"):
        return False
    inside = schema.get("properties", {})
    if isinstance(value, list):
        return all(fits(schema["items"], item) for item in value)
    if isinstance(value, dict):
        whole = {*schema.get("required", ())} <= value.keys() <= inside.keys()
        return whole and all(fits(inside[name], item) for name, item in value.items())
    return True


def test_every_message_fits_its_schema(messages):
    for topic, said in messages.items():
        for _, schema, content in said:
            assert fits(schema, content), topic
    (_, log, line), *_ = messages["/log"]
    assert not fits(log, line | {"level": "2"})
    assert not fits(log, {name: line[name] for name in line if name != "message"})
    assert {*foxglove.SCHEMAS} == {
        said[0][1]["title"] for said in messages.values() if "foxglove" in said[0][1]["title"]
    }


# ---- what is short, and what is refused


def test_a_run_that_ended_before_its_first_tick_has_its_labels_and_nothing_else(run, tmp_path):
    none = affinet.FlownRun(
        run.plan, {name: array[: name == "position"] for name, array in run.arrays.items()}, run.outcome
    )
    assert (none.dataset.sizes["time"], none.dataset.sizes["link"]) == (0, 24)
    for form in FORMATS:
        write(none, form, tmp_path / form)
    assert (tmp_path / "csv" / "agents.csv").read_text().startswith("time [s],tick,agent,position_x [m],")
    assert pyarrow.parquet.read_table(tmp_path / "parquet" / "links.parquet").num_rows == 0
    with xarray.open_dataset(tmp_path / "netcdf", engine="h5netcdf") as opened:
        xarray.testing.assert_equal(opened, none.dataset)


@pytest.mark.parametrize("form", FORMATS)
def test_what_is_there_is_left_as_it_is(form, run, tmp_path):
    there = tmp_path / f"run{FORMATS[form].ending}"
    there.write_text("mine")
    with pytest.raises(FileExistsError, match=r"run\S+' is there already; name another place$"):
        write(run, form, there)
    assert there.read_text() == "mine"


@pytest.mark.parametrize("form", FORMATS)
def test_a_place_that_is_not_there_is_named(form, run, tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write(run, form, tmp_path / "nowhere" / "run")


@pytest.mark.parametrize("form", FORMATS)
def test_nothing_is_left_of_what_could_not_be_written_to_its_end(form, run, tmp_path, monkeypatch):
    def break_off(arrays):
        yield {name: array[:5] for name, array in arrays.items()}
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(derived, "by_span", break_off)
    with pytest.raises(OSError, match="full"):
        write(run, form, tmp_path / "run")
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    ("library", "want", "extra"),
    [
        ("xarray", lambda run, _: run.dataset, "xarray"),
        ("pandas", lambda run, _: run.to_pandas(), "xarray"),
        ("mcap.writer", lambda run, folder: write(run, "mcap", folder / "run.mcap"), "mcap"),
    ],
)
def test_a_library_that_is_missing_is_named_with_how_to_have_it(library, want, extra, run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(NotInstalled, match=rf"is made with {library.split('.')[0]}: pip install 'affinet\[{extra}\]'$"):
        want(run, tmp_path)
    assert not [*tmp_path.iterdir()]


def test_a_table_that_there_is_not_is_said(run):
    with pytest.raises(ValueError, match=r'^table "agent": did you mean \'agents\'\? there are ticks, agents, links$'):
        run.to_pandas("agent")
