"""Names in a sentence, and how many more there are."""

import pytest

from netem.core.listing import listed


@pytest.mark.parametrize(
    ("names", "most", "between", "says"),
    [
        ([], 2, ", ", ""),
        ([1, 2], 2, ", ", "1, 2"),
        ([1, 2, 3, 4], 2, ", ", "1, 2 and 2 more"),
        ("abc", 1, "; ", "a and 2 more"),
        ("abc", 2, "; ", "a; b and 1 more"),
    ],
)
def test_the_first_are_named_and_the_others_counted(names, most, between, says):
    assert listed(iter(names), most, between) == says
