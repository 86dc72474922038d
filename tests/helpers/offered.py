"""What affinet itself offers, whatever other packages are installed beside it."""

from importlib.metadata import EntryPoints, distribution


def by_affinet(what: str) -> EntryPoints:
    """Its own estimators or controllers."""
    return distribution("affinet").entry_points.select(group=f"affinet.{what}")
