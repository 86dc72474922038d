"""The data that a study leaves, read without xarray, which not every environment has."""

from typing import NamedTuple

import h5netcdf
import numpy as np


class Variable(NamedTuple):
    """One of a file."""

    dimensions: tuple
    values: np.ndarray
    attributes: dict


def read(out):
    """All variables in the file of a study, by name, and what it says of itself."""
    with h5netcdf.File(out / "results.nc", decode_vlen_strings=True) as file:
        variables = {name: Variable(one.dimensions, one[...], dict(one.attrs)) for name, one in file.variables.items()}
        return variables, dict(file.attrs)


def flown(out):
    """How many cases are there, and how many runs of each."""
    error = read(out)[0]["tracking_error"].values
    return int(np.isfinite(error).all(axis=-1).sum()), error.shape[-1]
