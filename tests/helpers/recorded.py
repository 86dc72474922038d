"""What stands in recordings, for tests."""

from collections import Counter

from rerun.chunk import RrdReader


def chunks_of(file):
    """All chunks of a recording."""
    return RrdReader(str(file)).stream().to_chunks()


def column(chunks, path, name, *, static=False):
    """The values of a component of an entity, in order; those that change, or those that do not."""
    batches = [one.to_record_batch() for one in chunks if str(one.entity_path) == path and one.is_static == static]
    return [value for batch in batches if name in batch.schema.names for value in batch.column(name).to_pylist()]


def rows(file):
    """How many rows there are of each entity: those that change, and those that do not."""
    changing, static = Counter(), Counter()
    for chunk in chunks_of(file):
        (static if chunk.is_static else changing)[str(chunk.entity_path)] += chunk.num_rows
    return changing, static
