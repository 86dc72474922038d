"""The arrays of a run directory, written anew."""

import shutil

import numpy as np

from world.books.history import file_of


def rewrite(folder, arrays):
    """In place of all that a run has left there."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, array in arrays.items():
        np.save(folder / file_of(name), array)
