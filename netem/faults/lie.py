"""What an agent says of its perceived shape, and what a liar says in its place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from analysis.models.algebra import product
from netem.core.channels import THETA
from netem.faults.fault import Fault

CHANNEL = THETA


def told(fields: Mapping[str, Any], liar: Fault) -> dict[str, Any]:
    """The fields (..., D, D) of maps that a liar tells, each multiplied by its matrix; other fields as they are."""
    matrix = np.array(liar.matrix)
    return {
        name: product(matrix, field) if field.shape[-2:] == matrix.shape else field for name, field in fields.items()
    }
