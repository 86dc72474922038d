"""What is compiled computes what is written, on any arrays, and is kept for the processes to come."""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from compiled import kernels, sizes

from analysis.kernels import kept
from analysis.kernels import kernel as kernels_of
from analysis.kernels.kernel import Kernel, Part, kernel, scratch
from netem.core.draws import Purpose, uniform

ROWS, SMALL = 40, 5
EVERY = list(kernels())


def drawn(one, dimension, rng):
    """Arguments of a kernel for some rows, with numbers that are none among them, and whole numbers that index anything."""
    known = dict(zip(one.sizes, sizes(one, dimension), strict=True))
    given = []
    for letter, core in zip(one.types, one.cores[: one.arguments], strict=False):
        shape = (ROWS, *(known.get(name, SMALL) for name in core))
        if letter == "d":
            numbers = rng.normal(size=shape)
            numbers[rng.random(shape) < 0.02] = rng.choice([np.nan, np.inf, 0.0])
            given.append(numbers)
        elif letter == "?":
            given.append(rng.random(shape) < 0.7)
        elif letter == "l":
            given.append(rng.integers(0, 2, size=shape))
        elif letter == "B":
            given.append(rng.choice([0, 1, 2, 14, 255], size=shape).astype(np.uint8))
        else:
            given.append(rng.integers(0, 2**32, size=shape, dtype=np.uint64))
    return given


def written_out(one, plain, given):
    """What the plain function fills in, row by row."""
    lengths = {"one": 1}
    for names, array in zip(one.cores, given, strict=False):
        lengths.update(zip(names, array.shape[1:], strict=True))
    results = [
        np.zeros((ROWS, *(lengths[name] for name in core or ["one"])), dtype=letter)
        for letter, core in zip(one.types[one.arguments :], one.cores[one.arguments :], strict=True)
    ]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for row in range(ROWS):
            plain(*(array[row] for array in given), *(result[row] for result in results))
    return [result if core else result[:, 0] for result, core in zip(results, one.cores[one.arguments :], strict=True)]


def same_bits(one, plain, dimension):
    given = drawn(one, dimension, np.random.default_rng(dimension))
    wanted, made = written_out(one, plain, given), one(*given)
    made = made if isinstance(made, tuple) else (made,)
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in zip(made, wanted, strict=True))


def test_kernels_are_found():
    assert len(EVERY) > 12
    assert {one.name.partition(".")[0] for one in EVERY} >= {"agents", "analysis", "netem"}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("one", EVERY, ids=[f"{one.name}-{one.types}" for one in EVERY])
def test_what_is_compiled_has_the_bits_of_what_is_written(one, dimension):
    assert same_bits(one, one.plain(*sizes(one, dimension)), dimension)


def backwards():
    def plain(numbers, summed):
        summed[0] = 0.0
        for place in range(len(numbers) - 1, -1, -1):
            summed[0] += numbers[place]

    return plain


@kernel("(n)->()", "d->d")
def _sum():
    def plain(numbers, summed):
        summed[0] = 0.0
        for place in range(len(numbers)):
            summed[0] += numbers[place]

    return plain


def test_another_order_of_a_sum_is_noticed():
    assert same_bits(_sum, _sum.plain(), 2)
    assert not same_bits(_sum, backwards(), 2)


def fused():
    def plain(one, two, three, made):
        made[0] = one * two + three

    return plain


def test_no_product_is_fused_with_a_sum():
    one, two = 1.0 + 2.0**-30, 1.0 - 2.0**-30
    made = kernel("(),(),()->()", "ddd->d")(fused)(np.full(9, one), np.full(9, two), np.full(9, -1.0))
    assert (made == 0.0).all()  # fused, it is -2**-60
    assert (np.array([one * two - 1.0]) == 0.0).all()


def test_leading_axes_broadcast_and_strides_do_not_matter():
    rng = np.random.default_rng(1)
    numbers = rng.normal(size=(4, 3, 6))
    wanted = _sum(numbers)
    assert wanted.shape == (4, 3)
    np.testing.assert_array_equal(_sum(np.asfortranarray(numbers)), wanted)
    np.testing.assert_array_equal(_sum(numbers[::-1, ::2])[::-1], wanted[:, ::2])
    np.testing.assert_array_equal(_sum(np.repeat(numbers, 2, axis=-1)[..., ::2]), wanted)
    np.testing.assert_array_equal(_sum(np.broadcast_to(numbers[0], (4, 3, 6))), np.broadcast_to(wanted[0], (4, 3)))
    assert _sum(numbers[:0]).shape == (0, 3)


def quotient():
    def plain(above, below, made):
        made[0] = above / below if below != 0.0 else 0.0

    return plain


def test_what_is_not_chosen_raises_no_error():
    divided = kernel("(),()->()", "dd->d")(quotient)
    with np.errstate(all="raise"):
        made = divided(np.ones(64), np.tile([0.0, 2.0], 32))
    np.testing.assert_array_equal(made, np.tile([0.0, 0.5], 32))


@Part
def doubled(number):
    return 2.0 * number


def twice_over():
    def plain(number, made):
        room = scratch(1, 1)
        room[0, 0] = doubled(number)
        made[0] = doubled(room[0, 0])

    return plain


def test_kernels_call_parts_and_have_room_of_their_own():
    made = kernel("()->()", "d->d")(twice_over)(np.arange(5.0))
    np.testing.assert_array_equal(made, 4.0 * np.arange(5.0))


def squared(number):
    return number * number


TABLE = {1.0: 2.0}


def by_default():
    def plain(number, made, factor=2.0):
        made[0] = factor * number

    return plain


def of_a_module():
    def plain(number, made):
        made[0] = sys.maxsize * number

    return plain


def of_a_table():
    def plain(number, made):
        made[0] = TABLE[number]

    return plain


def no_part():
    def plain(number, made):
        made[0] = squared(number)

    return plain


def raising():
    def plain(number, made):
        if number < 0.0:
            raise ValueError("negative")
        made[0] = number

    return plain


@Part
def checked(number):
    assert number > 0.0
    return number


def raising_within():
    def plain(number, made):
        made[0] = checked(number)

    return plain


@pytest.mark.parametrize(
    ("factory", "why"),
    [
        (no_part, "squared, which is no Part"),
        (by_default, "has no defaults: by_default"),
        (of_a_module, "holds <module 'sys'"),
        (of_a_table, r"holds {1.0: 2.0}: give it numbers"),
        (raising, "raises nothing, as nobody would hear of it: raising"),
        (raising_within, "nobody would hear of it: checked"),
    ],
)
def test_what_is_not_compiled_with_it_or_may_change_unnoticed_is_refused(factory, why):
    with pytest.raises(TypeError, match=why):
        kernel("()->()", "d->d")(factory)(np.ones(3))


def roomy(rows):
    def factory():
        def plain(numbers, made):
            room = scratch(rows, 1)
            for row in range(rows):
                room[row, 0] = numbers[0]
            made[0] = room[rows - 1, 0]

        return plain

    return factory


def as_long_as_it_is():
    def plain(numbers, made):
        room = scratch(len(numbers), 1)
        room[0, 0] = 1.0
        made[0] = room[0, 0]

    return plain


def test_room_is_as_large_as_constants_say_and_has_a_limit():
    assert kernel("(n)->()", "d->d")(roomy(2000))(np.full(1, 3.0)) == 3.0
    with pytest.raises(Exception, match="room for 4096 numbers, and not for 5000 x 1"):
        kernel("(n)->()", "d->d")(roomy(5000))(np.ones(1))
    with pytest.raises(Exception, match="sizes that are constants"):
        kernel("(n)->()", "d->d")(as_long_as_it_is)(np.ones(90))


@pytest.mark.parametrize("step", [1, 2])
def test_another_number_of_arrays_is_refused(step):
    numbers = np.ones((3, 8))[:, ::step]
    with pytest.raises(TypeError, match="takes 1 arrays, not 2"):
        _sum(numbers, np.empty(3))


def looked_up(table):
    def factory():
        def plain(number, made):
            made[0] = table[1000] * number

        return plain

    return factory


def test_arrays_of_constants_count_to_the_last_digit(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for last in (2.0, 2.000000001, 3.0):
        table = np.ones(2000)
        table[1000] = last
        assert kernel("()->()", "d->d")(looked_up(table))(np.ones(1)) == last


def times(factor):
    def factory():
        def plain(number, made):
            made[0] = factor * number

        return plain

    return factory


def test_other_constants_parts_and_sizes_are_compiled_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for factor in (2.0, 3.0):
        made = Kernel(times(factor), "()->()", "d->d")(np.ones(2))
        np.testing.assert_array_equal(made, factor)
    before = len(list(kept.folder().iterdir()))
    assert before == 2
    monkeypatch.setattr(sys.modules[__name__], "doubled", Part(lambda number: 3.0 * number))
    np.testing.assert_array_equal(Kernel(twice_over, "()->()", "d->d")(np.ones(2)), 9.0)
    by_size = Kernel(lambda _: _sum.plain(), "(D)->()", "d->d")
    assert by_size(np.ones(2)) == 2.0
    assert by_size(np.ones(3)) == 3.0
    assert len(list(kept.folder().iterdir())) == before + 3


def test_what_one_process_has_prepared_another_prepares_as_well(tmp_path, monkeypatch):
    here = Kernel(times(7.0), "()->()", "d->d")
    here(np.ones(1))
    name = f"{here.name} {here.types}"
    ((sizes, file),) = kernels_of.prepared()[name]
    assert sizes == ()
    there = Kernel(times(7.0), "()->()", "d->d")  # as it is in the other
    assert not there.prepared
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # as a test that moves home between the two
    kernels_of.prepare({name: [([], file)], "of nobody d->d": [([2], file)]})
    assert there.prepared == [((), file)]
    assert there(np.ones(1)) == 7.0
    assert not kept.folder().exists(), "it was compiled once more"


OUTLIVES = """
import gc, sys
import numpy as np
from netem.core import draws
uniform, purpose = draws.uniform, draws.Purpose.LOSS
before = uniform(3, purpose, tick=7)
for name in [name for name in sys.modules if name.startswith("analysis.kernels")]:
    sys.modules[name].__dict__.clear()
    del sys.modules[name]
gc.collect()
others = [np.ones(2**16) for _ in range(50)]
assert uniform(3, purpose, tick=7) == before
"""


def test_a_kernel_outlives_the_modules_that_made_it():
    done = subprocess.run([sys.executable, "-c", OUTLIVES], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


LATER = """
import sys
sys.modules["numba"] = None
from netem.core.draws import Purpose, uniform
print(uniform(3, Purpose.LOSS, tick=7)[0])
"""


def test_later_processes_need_no_compiler(tmp_path, monkeypatch):
    def later():
        return subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, check=False)

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert "numba" in later().stderr  # nothing is kept yet
    from netem.core import draws

    wanted = Kernel(draws._drawn.factory, draws._drawn.layout, "LLLLLL->d")
    key = [np.uint64(one) for one in (3, 7, 0, 0, int(draws.Purpose.LOSS) << 16)]
    (number,) = wanted(*key, np.empty(1, dtype=np.uint64))
    assert later().stdout.split() == [str(number)]


@pytest.mark.parametrize("left", [0, 10, 700, -1])
def test_a_file_that_was_cut_short_is_compiled_anew(tmp_path, monkeypatch, left):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    Kernel(times(11.0), "()->()", "d->d")(np.ones(1))
    (file,) = kept.folder().iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[:left])
    assert Kernel(times(11.0), "()->()", "d->d")(np.ones(1)) == 11.0
    assert file.read_bytes() == whole


NOTHING_KEPT = """
import subprocess, sys
from analysis.kernels.kernel import prepared
from netem.core import draws
draws.uniform(3, draws.Purpose.LOSS, tick=7)
later = "import sys, json; sys.modules['numba'] = None; from netem.core import draws; from analysis.kernels import kernel;"
later += "kernel.prepare(json.loads(sys.argv[1])); print(draws.uniform(3, draws.Purpose.LOSS, tick=7)[0])"
import json
sys.exit(subprocess.run([sys.executable, "-c", later, json.dumps(prepared())]).returncode)
"""


@pytest.mark.parametrize("what_is_there", ["a file", "a folder"])
def test_where_nothing_can_be_kept_it_is_said_and_still_compiled_once(tmp_path, monkeypatch, what_is_there):
    if what_is_there == "a file":
        (tmp_path / "affinet").touch()
    else:
        Path(draws_of(tmp_path)).mkdir(parents=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    done = subprocess.run([sys.executable, "-c", NOTHING_KEPT], capture_output=True, text=True, check=True)
    assert done.stderr.count("set XDG_CACHE_HOME to a folder that can be written to") == 1
    assert done.stdout.split() == [str(uniform(3, Purpose.LOSS, tick=7)[0])]


def draws_of(cache):
    """Where the kernel of draws would be kept in such a folder."""
    uniform(3, Purpose.LOSS, tick=7)
    ((_, file),) = [one for one in kernels_of.prepared()["netem.core.draws._drawn LLLLLLd"] if one[0] == ()]
    return cache / "affinet" / "kernels" / Path(file).name


def test_who_has_no_home_keeps_no_kernels_and_is_told(monkeypatch):
    def nobody():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", nobody)
    with pytest.warns(UserWarning, match="set XDG_CACHE_HOME"):
        file = kept._keep(kept.folder() / "mine.o", b"code")
    assert Path(file).read_bytes() == b"code"
