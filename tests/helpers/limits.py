"""What the system grants a process, and less of it."""

import resource
from contextlib import contextmanager


@contextmanager
def limit(kind, value):
    """A limit of this process and its children for as long as the block lasts: pytest itself may write to a file."""
    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (value, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(kind, before)
