"""The README's first picture is drawn from the data of the study that it names."""

import draw_bursts
import draw_measurements
import h5netcdf
import h5py
import numpy as np
import pytest
from PIL import Image

from affinet.studies import study

AXES = {axis.name: list(axis.values) for axis in study.load("bursts").axes}


@pytest.fixture
def left(tmp_path):
    """What the study would leave: errors that grow with the burst, and by estimator."""

    def write(factor):
        folder = tmp_path / f"{factor:g}"
        folder.mkdir()
        bursts = np.array([float(burst) for burst in AXES["mean burst (s)"]])
        number = np.arange(len(AXES["estimator"]))[:, None]
        error = np.broadcast_to(factor * (1 + number) * bursts, [len(labels) for labels in AXES.values()])
        over_runs = np.where(bursts == 2.0, np.nan, error)
        with h5netcdf.File(folder / "results.nc", "w") as file:
            file.dimensions = {name: len(labels) for name, labels in AXES.items()} | {"run": 1, "time": 2}
            for name in ("graph", "estimator"):
                file.create_variable(name, (name,), data=np.array(AXES[name], dtype=object), dtype=h5py.string_dtype())
            for name, values in (("mean burst (s)", bursts), ("time", np.arange(2.0))):
                file.create_variable(name, (name,), data=values)
            file.create_variable("tracking_error", (*AXES, "run"), data=over_runs[..., None])
            file.create_variable("mean_tracking_error", (*AXES, "time"), data=np.stack([error, error], axis=-1))
        return folder

    return write


def drawn(folder):
    draw_bursts.draw(folder, folder / "picture.png")
    with Image.open(folder / "picture.png") as picture:
        return np.asarray(picture.convert("RGB"))


def test_the_picture_shows_the_data(left):
    one, other = drawn(left(1.0)), drawn(left(3.0))
    assert min(one.shape[:2]) > 300
    assert one.shape == other.shape
    assert (one != other).any()


def test_who_names_no_study_is_told():
    with pytest.raises(SystemExit, match="give the directory that `affinet study bursts` has left"):
        draw_bursts.main([])


def test_the_ellipses_of_measurements_are_those_of_their_covariances(tmp_path):
    places = np.array([[0.0, 0.0], [3.0, 2.0]])
    origin, found, slanting = places[:1], places[1:] + 0.1, np.array([[[0.3, 0.2], [0.2, 0.3]]])
    pictures = []
    for number, covariance in enumerate((slanting, slanting * np.eye(2), slanting)):
        draw_measurements.draw(places, origin, found, covariance, tmp_path / f"{number}.png")
        with Image.open(tmp_path / f"{number}.png") as picture:
            pictures.append(np.asarray(picture.convert("RGB")))
    full, diagonal, again = pictures
    half = full.shape[1] // 2
    assert (full == again).all()
    assert (full[:, :half] != diagonal[:, :half]).any()
    assert (full[:, half:] == diagonal[:, half:]).all()


def test_what_is_drawn_as_measured_is_about_where_the_agents_are(monkeypatch):
    drawn_with = []
    monkeypatch.setattr(draw_measurements, "draw", lambda *given: drawn_with.append(given))
    draw_measurements.main()
    ((places, origin, found, covariance, _),) = drawn_with
    off = np.linalg.norm(found[:, None] - places, axis=-1).min(axis=1)
    assert origin.shape == found.shape == (28, 2)
    assert (off < 4.0 * np.sqrt(np.linalg.eigvalsh(covariance)[:, -1])).all()
