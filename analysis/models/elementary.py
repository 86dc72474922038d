"""Elementary functions whose bits depend on nothing but the number: not on the CPU, the C library, the batch or its layout.

NumPy takes the C library for a number alone, and on some CPUs its own vector code, or another power, for an array; these round
apart. Here are only operations that IEEE 754 rounds correctly: sums, products, quotients, roots, and powers of two. Polynomials
and reductions of arguments are those of fdlibm; errors stay below two units in the last place, but for `power`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from analysis.models.arrays import Array

# The high parts end in zeros, so that small multiples of them are exact.
_LN2 = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROOT_HALF = 7.07106781186547524401e-01
_PER_LN2 = 1.44269504088896338700
_HALF_PI = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_PI = 3.14159265358979311600e00, 1.2246467991473531772e-16
_FAR = 2.0**20  # as long as there are not more quarter turns, their high parts add up exactly

_EXP = (
    1.66666666666666019037e-01,
    -2.77777777770155933842e-03,
    6.61375632143793436117e-05,
    -1.65339022054652515390e-06,
    4.13813679705723846039e-08,
)
_LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
_SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_ARCTAN = (
    3.33333333333329318027e-01,
    -1.99999999998764832476e-01,
    1.42857142725034663711e-01,
    -1.11111104054623557880e-01,
    9.09088713343650656196e-02,
    -7.69187620504482999495e-02,
    6.66107313738753120669e-02,
    -5.83357013379057348645e-02,
    4.97687799461593236017e-02,
    -3.65315727442169155270e-02,
    1.62858201153657823623e-02,
)


def whole_power(base: ArrayLike, exponent: int) -> Array:
    """Numbers to a whole power from 0 on, multiplied out."""
    base = np.asarray(base, dtype=np.float64)
    return reduce(np.multiply, [base] * exponent) if exponent else np.ones_like(base)


def whole_powers(base: ArrayLike, number: int) -> Array:
    """The first powers of numbers (...), from 0 on, shape (..., number)."""
    return np.stack([whole_power(base, exponent) for exponent in range(number)], axis=-1)


def power(base: ArrayLike, exponent: ArrayLike) -> Array:
    """Numbers from 0 on to any power; the relative error grows with |exponent log(base)|."""
    exponent = np.asarray(exponent, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        raised = exp(exponent * log(base))
    return np.where(exponent == 0.0, 1.0, raised)


def hypot(x: ArrayLike, y: ArrayLike) -> Array:
    """The length of (x, y), without overflow on the way."""
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    largest = np.maximum(np.abs(x), np.abs(y))
    _, scale = np.frexp(np.where(np.isfinite(largest), largest, 0.0))
    small_x, small_y = np.ldexp(x, -scale), np.ldexp(y, -scale)
    with np.errstate(over="ignore"):  # the length itself may be
        return np.ldexp(np.sqrt(small_x * small_x + small_y * small_y), scale)


def exp(x: ArrayLike) -> Array:
    """E to the power x."""
    within = np.clip(np.asarray(x, dtype=np.float64), -746.0, 710.0)  # beyond lie 0 and infinity
    twos = np.rint(within * _PER_LN2)
    high, low = within - twos * _LN2[0], twos * _LN2[1]
    rest = high - low
    squared = rest * rest
    bent = rest - squared * _polynomial(_EXP, squared)
    with np.errstate(invalid="ignore", over="ignore"):  # NaN is no power of two, and beyond the largest lies infinity
        return np.ldexp(1.0 - ((low - rest * bent / (2.0 - bent)) - high), twos.astype(np.int32))


def expm1(x: ArrayLike) -> Array:
    """E to the power x, less one, without the loss of digits near 0 (Kahan)."""
    x = np.asarray(x, dtype=np.float64)
    raised = exp(x)
    bent = (raised != 1.0) & (raised > 0.0) & (raised < np.inf)
    steady = np.where(bent, raised, 2.0)
    return np.where(
        bent, (steady - 1.0) * (np.where(bent, x, 0.0) / log(steady)), np.where(raised == 1.0, x, raised - 1.0)
    )


def log(x: ArrayLike) -> Array:
    """The natural logarithm; minus infinity of 0, NaN of negative numbers."""
    x = np.asarray(x, dtype=np.float64)
    regular = (x > 0.0) & (x < np.inf)
    fraction, twos = np.frexp(np.where(regular, x, 1.0))
    low = fraction < _ROOT_HALF
    fraction, twos = np.where(low, 2.0 * fraction, fraction), np.where(low, twos - 1, twos)
    f = fraction - 1.0
    s = f / (2.0 + f)
    squared, half = s * s, 0.5 * f * f
    bent = squared * _polynomial(_LOG, squared)
    found = twos * _LN2[0] - ((half - (s * (half + bent) + twos * _LN2[1])) - f)
    return np.where(regular, found, np.where(x == 0.0, -np.inf, np.where(x == np.inf, np.inf, np.nan)))


def sin(angle: ArrayLike) -> Array:
    """The sine of angles in radians."""
    quarters, sine, cosine = _turned_back(angle)
    found = np.where(quarters % 2.0 == 0.0, sine, cosine)
    return np.where(quarters >= 2.0, -found, found)


def cos(angle: ArrayLike) -> Array:
    """The cosine of angles in radians."""
    quarters, sine, cosine = _turned_back(angle)
    found = np.where(quarters % 2.0 == 0.0, cosine, sine)
    return np.where((quarters == 1.0) | (quarters == 2.0), -found, found)


def arctan2(y: ArrayLike, x: ArrayLike) -> Array:
    """The angle of (x, y), in radians, in [-pi, pi]; with the signs of zeros that C has."""
    y, x = np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64)
    large, small = np.maximum(np.abs(x), np.abs(y)), np.minimum(np.abs(x), np.abs(y))
    equal = large == small  # also where both are 0, or infinite
    tangent = np.where(
        equal, np.where(large == 0.0, 0.0, 1.0), np.where(equal, 0.0, small) / np.where(equal, 1.0, large)
    )
    steep = tangent > 7.0 / 16.0
    bent = _arctan(np.where(steep, (tangent - 1.0) / (tangent + 1.0), tangent))
    angle = np.where(steep, _PI[0] / 4.0 + (bent + _PI[1] / 4.0), bent)
    angle = np.where(np.abs(y) > np.abs(x), _PI[0] / 2.0 - (angle - _PI[1] / 2.0), angle)
    angle = np.where(np.signbit(x), _PI[0] - (angle - _PI[1]), angle)
    return np.copysign(angle, y)


def _arctan(t: Array) -> Array:
    squared = t * t
    return t - t * (squared * _polynomial(_ARCTAN, squared))


def _turned_back(angle: ArrayLike) -> tuple[Array, Array, Array]:
    """How many quarter turns, from 0 to 3, to turn back, and sine and cosine of what is left, at most an eighth of a turn."""
    angle = np.asarray(angle, dtype=np.float64)
    finite = np.where(np.isfinite(angle), angle, 0.0)
    # Neighbours among such numbers lie farther apart than the error of so many turns.
    finite = np.where(np.abs(finite) < _FAR, finite, np.fmod(finite, 2.0 * _PI[0]))
    turns = np.rint(finite * (2.0 / _PI[0]))
    nearly = finite - turns * _HALF_PI[0]
    rest = nearly - turns * _HALF_PI[1]
    lost = turns * _HALF_PI[2] - ((nearly - rest) - turns * _HALF_PI[1])
    left = np.where(np.isfinite(angle), rest - lost, np.nan)
    tail = (rest - left) - lost
    return turns - 4.0 * np.floor(turns / 4.0), _sine(left, tail), _cosine(left, tail)


def _sine(x: Array, tail: Array) -> Array:
    squared = x * x
    cubed = squared * x
    return x - ((squared * (0.5 * tail - cubed * _polynomial(_SIN[1:], squared)) - tail) - cubed * _SIN[0])


def _cosine(x: Array, tail: Array) -> Array:
    squared = x * x
    half = 0.5 * squared
    nearly = 1.0 - half
    return nearly + (((1.0 - nearly) - half) + (squared * (squared * _polynomial(_COS, squared)) - x * tail))


def _polynomial(coefficients: Sequence[float], x: Array) -> Array:
    return reduce(lambda total, coefficient: total * x + coefficient, reversed(coefficients), np.zeros_like(x))
