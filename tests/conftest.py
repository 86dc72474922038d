"""Fixtures of all tests."""

from pathlib import Path

import pytest


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A run directory to be made."""
    return tmp_path / "run"
