"""How far a study is, and how long it takes on: by a clock that stands where the test puts it."""

import io
import os
import pty
import sys
from contextlib import closing
from types import SimpleNamespace

import pytest
from terminals import written_to

from affinet.cli.progress import left
from affinet.cli.show import Grid


class Clock:
    """Seconds, as many as a test says."""

    seconds = 0.0

    def __call__(self):
        return self.seconds


def done(*labels):
    return SimpleNamespace(labels=dict(enumerate(labels)))


@pytest.mark.parametrize(
    ("elapsed", "share", "says"),
    [
        (0.0, 0.5, ""),
        (10.0, 0.0, ""),
        (10.0, 0.25, "about 0:00:30 left"),
        (3600.0, 0.5, "about 1:00:00 left"),
        (10.0, 1.0, "about 0:00:00 left"),
    ],
)
def test_time_left_is_as_long_for_what_is_left_as_it_took_so_far(elapsed, share, says):
    assert left(elapsed, share) == says


def test_where_there_is_no_terminal_a_study_says_a_line_for_each_case(monkeypatch):
    monkeypatch.setattr(sys, "stderr", log := io.StringIO())
    clock = Clock()
    with Grid("losses", [100, 300], clock) as grid:
        clock.seconds = 5.0
        grid.look([0.5, 0.0])
        assert log.getvalue() == ""
        clock.seconds = 10.0
        grid.see(done("zhao7", "rkf"))
        clock.seconds = 25.0
        grid.look([0.0, 0.5])  # what is done stays done
        assert log.getvalue() == "losses: 1/2 cases  25 %  about 0:00:30 left  zhao7, rkf\n"
        clock.seconds = 40.0
        grid.see(done("zhao7", "none"))
    assert log.getvalue().splitlines()[1:] == ["losses: 2/2 cases  100 %  about 0:00:00 left  zhao7, none"]


def test_what_has_flown_before_says_nothing_of_how_long_the_rest_takes(monkeypatch):
    monkeypatch.setattr(sys, "stderr", log := io.StringIO())
    clock = Clock()
    with Grid("losses", [100, 300], clock, there=[1.0, 0.0]) as grid:
        grid.see(done("zhao7", "rkf"))
        clock.seconds = 10.0
        grid.look([1.0, 0.5])
        grid.see(done("zhao7", "none"))
    assert log.getvalue().splitlines()[0] == "losses: 1/2 cases  25 %  zhao7, rkf"


def test_at_a_terminal_a_study_shows_how_far_it_is_within_a_case(monkeypatch):
    terminal, shown = pty.openpty()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    clock = Clock()
    with closing(os.fdopen(shown, "w")) as screen, monkeypatch.context() as here:
        here.setattr(sys, "stderr", screen)
        with Grid("losses", [100, 100], clock) as grid:
            clock.seconds = 10.0
            grid.look([0.5, 0.0])
    drawn = written_to(terminal)
    assert "0/2 cases  25 %  about 0:00:30 left" in drawn
    assert "━" in drawn
