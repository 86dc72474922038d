"""What a process writes on another machine is here but its last second, whichever machine dies."""

from types import SimpleNamespace

import pytest
from awaiting import await_true

from affinet.runtimes.child import RunFailed
from affinet.runtimes.machines import joining, place
from affinet.runtimes.machines.bringing import Bringing
from affinet.runtimes.machines.joining import Part
from affinet.runtimes.machines.place import of_folder
from netem.wire.carrier import NotCarried


class There:
    """Another machine, as the coordinator has it: what is in its folder, while it can be reached."""

    def __init__(self, folder):
        self.folder, self.is_reached, self.asked, self.waited_for = folder, True, [], 0
        self.seats = {"netem": SimpleNamespace(process="runs")}

    def ask(self, _name, what, _within_s):
        self.asked.append(what)
        if not self.is_reached:
            raise NotCarried("the link is cut")
        return of_folder(self.folder, what)

    def asked_for(self, name, what):
        self.waited_for += 1
        try:
            return self.ask(name, what, 1.0)
        except NotCarried as error:
            raise RunFailed("its files cannot be had") from error


@pytest.fixture
def there(tmp_path):
    (tmp_path / "there").mkdir()
    return There(tmp_path / "there")


@pytest.fixture
def here(tmp_path):
    (tmp_path / "here").mkdir()
    return tmp_path / "here"


@pytest.fixture
def bringing(there, here):
    bringing = Bringing(there, "netem", here)
    bringing.start()
    yield bringing
    there.is_reached = True
    bringing.finish(patiently=True)


def holds(path, data):
    return lambda: path.exists() and path.read_bytes() == data


@pytest.mark.usefixtures("bringing")
def test_a_table_is_here_while_it_grows(there, here):
    journal = there.folder / "journal.arrows"
    for grown in (b"one", b"one two", b"one two three"):
        journal.write_bytes(grown)
        await_true(holds(here / "journal.arrows", grown), "it was not brought")


@pytest.mark.usefixtures("bringing")
def test_it_goes_on_where_it_was_once_a_link_comes_back(there, here):
    (there.folder / "journal.arrows").write_bytes(b"one")
    await_true(holds(here / "journal.arrows", b"one"), "it was not brought")
    there.is_reached = False
    (there.folder / "journal.arrows").write_bytes(b"one two")
    asked = len(there.asked)
    await_true(lambda: len(there.asked) > asked, "nobody asked")
    there.is_reached = True
    await_true(holds(here / "journal.arrows", b"one two"), "it was not brought")
    assert [what.start for what in there.asked if isinstance(what, Part)] == [0, 3]


def test_at_the_end_the_rest_of_each_table_is_brought_in_parts(bringing, there, here, monkeypatch):
    monkeypatch.setattr(place, "_PART", 4)
    tables = {"journal.arrows": b"all of it", "journal-2.arrows": b"more", "deliveries.arrows": b""}
    for name, data in (tables | {"netem.log": b"not a table"}).items():
        (there.folder / name).write_bytes(data)
    bringing.finish(patiently=True)
    # One that is empty has not begun: nobody could read it.
    assert {path.name: path.read_bytes() for path in here.iterdir()} == {
        name: data for name, data in tables.items() if data
    }


def test_a_machine_that_does_not_answer_at_the_end_fails_the_run(bringing, there):
    there.is_reached = False
    with pytest.raises(RunFailed):
        bringing.finish(patiently=True)


def test_where_the_run_has_failed_nobody_waits_for_a_link_that_is_cut(bringing, there):
    # A process that died while a link was cut kept the run from ending until the machine behind it was given up.
    there.is_reached = False
    bringing.finish(patiently=False)
    assert there.waited_for == 0


def test_nothing_is_asked_of_a_process_that_is_here_or_never_began(there, here):
    there.seats["netem"].process = None
    for name in ("netem", "world"):
        bringing = Bringing(there, name, here)
        bringing.start()
        bringing.finish(patiently=True)
    assert not there.asked


@pytest.mark.usefixtures("bringing")
def test_no_file_is_kept_beside_the_folder(there, here, monkeypatch):
    listed = joining.pack({"../outside.arrows": 3})
    monkeypatch.setattr(there, "ask", lambda _name, what, _s: b"bad" if isinstance(what, Part) else listed)
    await_true((here / "outside.arrows").exists, "it was not brought")
    assert not (here.parent / "outside.arrows").exists()
