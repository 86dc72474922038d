"""Machines that share only an address, for tests: skipped where there can be none."""

import shutil
import subprocess
from contextlib import contextmanager
from functools import cache

import pytest
from killing.network import Network


@contextmanager
def network(*names):
    """A network of machines; the test is skipped where there can be none."""
    skip_without()
    with Network(names) as machines:
        yield machines


def skip_without():
    """Skip the test where there can be no network namespaces."""
    if (why := _why_not()) is not None:
        pytest.skip(f"no network namespaces here: {why}")


@cache
def _why_not():
    if not shutil.which("ip") or not shutil.which("ss"):
        return "ip and ss are not installed (iproute2)"
    try:
        with Network(("a",)):
            return None
    except subprocess.CalledProcessError as error:
        return error.stderr.strip() or str(error)
