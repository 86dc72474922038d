"""What stands above and beside a figure lies within it."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from analysis.figures import axes, curves

LONG = "Filters of ranges and bearings, and of lines of sight, against the noise of their sensors, and of much else besides"


def written(monkeypatch, tmp_path, rows, columns):
    """The figure that `curves` saves."""
    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, _: saved.append(figure))
    labels = [{"row": str(row), "column": str(column), "each": "a"} for row in range(rows) for column in range(columns)]
    error = np.ones((2, 5))
    cases = [curves.Curve(one, np.arange(5.0), error, error[:, 0]) for one in labels]
    curves.curves(
        tmp_path / "figure.png", LONG, cases, ("column", "row", "each"), "distance from the places steered for (m)"
    )
    (figure,) = saved
    figure.draw_without_rendering()
    return figure


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (6, 1), (1, 4), (2, 2)])
def test_titles_and_names_lie_within_their_figure(monkeypatch, tmp_path, rows, columns):
    figure = written(monkeypatch, tmp_path, rows, columns)
    whole = figure.bbox
    for text in (figure._suptitle, figure._supylabel):
        box = text.get_window_extent()
        assert whole.x0 <= box.x0
        assert box.x1 <= whole.x1
        assert whole.y0 <= box.y0
        assert box.y1 <= whole.y1
        assert " ".join(text.get_text().split()) in (LONG, "distance from the places steered for (m)")


def test_what_is_not_broken_into_lines_does_not_fit(monkeypatch, tmp_path):
    monkeypatch.setattr(axes, "fill", lambda text, _: text)
    figure = written(monkeypatch, tmp_path, 1, 1)
    assert figure._suptitle.get_window_extent().x1 > figure.bbox.x1
    assert figure._supylabel.get_window_extent().y1 > figure.bbox.y1
