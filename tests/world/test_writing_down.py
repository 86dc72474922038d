"""When the world of a run over processes writes down what was flown."""

from types import SimpleNamespace

from world import process
from world.process import WorldNode

BATCH, TICKS, KNOWN_AFTER = 5, 13, 2  # what was decided in a tick the medium tells so many later


def test_a_batch_is_written_as_soon_as_all_of_it_is_known_and_the_rest_at_the_end(monkeypatch):
    # It was when the number of a tick said so: of the last batch a tick was missing, and a span of the graph waited for it.
    carrier = SimpleNamespace(entries={}, timeline=None, kept=[], end=lambda: None)
    calls = []

    def of_time(_session, _supervisor, _brief, meanwhile):
        carrier.meanwhile = meanwhile
        return carrier, None

    def fly(*_):
        for tick in range(TICKS):
            if tick >= KNOWN_AFTER:
                carrier.entries[tick - KNOWN_AFTER] = "decided"
            carrier.meanwhile(tick)
            written.append(len(calls))
            yield SimpleNamespace(tick=tick)

    written = []
    monkeypatch.setattr(process, "_of_time", of_time)
    monkeypatch.setattr(process.flight, "fly", fly)
    brief = SimpleNamespace(world=None, books=SimpleNamespace(batch=BATCH), is_outside=False)
    WorldNode(None, None, brief, None, None, calls.append).run()
    ticks = [[flown.tick for flown, _ in call.args[0]] for call in calls]
    assert ticks == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9], [10]]
    assert written.index(1) == BATCH - 1 + KNOWN_AFTER
