"""What each receiver hears of what all agents said, in one tick or in several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Integers


def picked(said: Sequence[NDArray[Any]], which: Integers, speaker: Integers) -> NDArray[Any]:
    """One field of the messages heard, shape (..., n, *); zeros where nothing is.

    Parameters
    ----------
    said
        The field as all agents said it, numbers or truths, shape (N, *), in each of some ticks.
    which
        In which of these ticks the message was said that arrives, shape (..., n); -1 where none does.
    speaker
        Rows of those who said it, shape (..., n).
    """
    shape = said[0].shape[1:]
    whole = (
        said[0].reshape(1, len(said[0]), -1)
        if len(said) == 1
        else np.stack([one.reshape(len(one), -1) for one in said])
    )
    pick = _of_truths if whole.dtype == np.bool_ else _of_numbers
    heard: NDArray[Any] = pick(whole, which, speaker)
    return heard.reshape(*which.shape, *shape)


def _picked() -> Plain:
    def plain(said: NDArray[Any], which: Integers, speaker: Integers, heard: NDArray[Any]) -> None:
        for place in range(len(which)):
            for number in range(said.shape[2]):
                if which[place] < 0:
                    heard[place, number] = 0
                else:
                    heard[place, number] = said[which[place], speaker[place], number]

    return plain


_LAYOUT = "(t,a,k),(n),(n)->(n,k)"
_of_numbers = kernel(_LAYOUT, "dll->d")(_picked)
_of_truths = kernel(_LAYOUT, "?ll->?")(_picked)
