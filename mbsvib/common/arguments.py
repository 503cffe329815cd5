"""Checks of arguments: they return finite floats and tuples, or raise a ModelError that names the element.

They are pure Python, as one numpy call takes three times as long as the check of a three-vector, of which a model has
hundreds.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from math import hypot, inf, isfinite, pi, sin, sqrt
from numbers import Integral
from operator import mul
from typing import Any

from mbsvib.common.number_text import real
from mbsvib.common.tables import listed as row
from mbsvib.errors import AccuracyWarning, MbsvibError, ModelError, nearest

Vector = tuple[float, float, float]
Matrix3 = tuple[Vector, Vector, Vector]

IDENTITY: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
UNIT6 = tuple(tuple(1.0 if i == j else 0.0 for j in range(6)) for i in range(6))

# A rotation matrix is orthonormal to 1e-15 in double precision, and to 2e-4 with four digits, as CAD writes it; what is
# off by more is none.
ROTATION_TOLERANCE = 2e-4
# Axes of six digits or less are off by angles that lock loops: worth a warning.
FEW_DIGITS = 1e-6
# Columns off by more than rounding give a joint's free directions components along its locked ones, by which a second
# joint on the same axes would lock it.
ROUNDED = 1e-14
# Squares of lengths below this lose digits, or are 0.
TINY = 1e-150
# The length of a normalised vector differs from 1 by at most this; it is not normalised again, so that files restore it
# exactly.
UNIT_LENGTH = 4.0 * 2.0**-52
# Largest accepted rotation; larger ones are probably in degrees.
ONCE_AROUND = 2.0 * pi * (1.0 + 1e-9)


def refuse(who: str, field: str, value: Any, expected: str, hint: str = "") -> ModelError:
    """Build the error "WHO: FIELD = GIVEN; expected EXPECTED. HINT"."""
    text = f"{who}: {field} = {shown(value)}; expected {expected}."
    quoted = "It is a text: write it without quotes." if "number" in expected and _is_number(value) else ""
    return ModelError(" ".join(filter(None, (text, quoted, hint))), element=who, field=field)


def _is_number(text: Any) -> bool:
    """Whether a text is that of a number."""
    try:
        return isinstance(text, str) and real(text) == float(text)
    except ValueError:
        return False


def unknown(
    name: Any, known: Iterable[str], text: str, field: str | None = None, told: str = "It has",
    error: Callable[..., MbsvibError] = ModelError, element: str | None = None,
) -> MbsvibError:  # fmt: skip
    """Build the error "TEXT. Did you mean 'x'? It has x, y." for a name that is none of those known."""
    names = list(known)
    text += f".{nearest(str(name), names)}" + (f" {told} {row(names) or 'none'}." if told else "")
    return error(text, element=element or str(name), field=field) if error is ModelError else error(text)


def known(name: Any, known: Collection[str], text: str, *where: Any, **words: Any) -> None:
    """Refuse a name that is none of those known, by the error of ``unknown``."""
    if not isinstance(name, str) or name not in known:
        raise unknown(name, known, text, *where, **words)


def names_in(items: Any) -> list[str] | None:
    """Return names of several parts, or names themselves, as a list; None if they are anything else."""
    try:
        names = [str(item) if isinstance(item, str) else item.name for item in items]  # str: numpy has its own
    except (TypeError, AttributeError):
        return None
    return names if all(isinstance(name, str) for name in names) else None


def shown(value: Any) -> str:
    """Return a one-line text of a value, cut to a readable length."""
    text = " ".join(repr(value.tolist() if hasattr(value, "tolist") else value).split())
    return text if len(text) <= 90 else f"{text[:87]}..."


def number(value: Any, who: str, field: str, expected: str = "a finite number") -> float:
    """Return ``value`` as a finite float."""
    if type(value) is not float:
        if isinstance(value, (str, bytes, bool, complex)) or value is None:
            raise refuse(who, field, value, expected)
        try:
            value = float(value)
        except (TypeError, ValueError, OverflowError) as error:
            raise refuse(who, field, value, expected) from error
    if not isfinite(value):
        raise refuse(who, field, value, expected, "NaN and infinity are not values a mechanism can have.")
    return value  # type: ignore[no-any-return]


def positive(value: Any, who: str, field: str, unit: str = "") -> float:
    """Return ``value`` as a finite float above 0."""
    expected = f"a positive number [{unit}]" if unit else "a positive number"
    if (result := number(value, who, field, expected)) <= 0.0:
        raise refuse(who, field, value, expected)
    return result


def count(value: Any, who: str, field: str, least: int = 1) -> int:
    """Return ``value`` as an integer that is ``least`` or more."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise refuse(who, field, value, f"a whole number, at least {least}")
    return int(value)


def mapping(who: str, field: str, value: Any, expected: str, empty: bool = False) -> None:
    """Refuse what is no mapping, or an empty one unless it may be ``empty``."""
    if not isinstance(value, Mapping) or not (value or empty):
        raise refuse(who, field, value, expected)


def listed(value: Any, who: str, field: str, expected: str) -> Any:
    """Return ``value`` as something with a length and an order; text, sets and mappings are refused."""
    if type(value) is tuple or type(value) is list:
        return value
    items = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(items, (str, bytes, dict)) or not hasattr(items, "__len__") or not hasattr(items, "__getitem__"):
        raise refuse(who, field, value, expected)
    return items


def numbers(value: Any, sizes: tuple[int, ...], who: str, field: str, expected: str) -> tuple[float, ...]:
    """Return ``value`` as a tuple of finite floats whose length is one of ``sizes``."""
    items = listed(value, who, field, expected)
    if len(items) not in sizes:
        raise refuse(who, field, value, expected)
    if any(type(item) is not float and isinstance(item, (str, bytes, bool)) for item in items):
        raise refuse(who, field, value, expected)
    try:
        result = tuple(map(float, items))
    except (TypeError, ValueError, OverflowError) as error:
        raise refuse(who, field, value, expected) from error
    # a finite sum has finite terms; where it is not finite, it may have overflowed
    if not isfinite(sum(result)) and not all(map(isfinite, result)):
        hint = "NaN and infinity are not values a mechanism can have."
        raise refuse(who, field, value, expected, hint)
    return result


def vector(value: Any, who: str, field: str, expected: str = "three finite numbers (x, y, z)") -> Vector:
    """Return ``value`` as three finite floats."""
    if type(value) is tuple and len(value) == 3:
        x, y, z = value
        # a fast path for floats; where the sum is not finite, the general check finds the reason
        if type(x) is type(y) is type(z) is float and isfinite(x + y + z):
            return value
    return numbers(value, (3,), who, field, expected)  # type: ignore[return-value]


_DIRECTION = "a direction (x, y, z) that is not zero, such as (0, 0, 1)"


def axis(value: Any, who: str, field: str) -> Vector:
    """Return ``value`` as a unit vector."""
    x, y, z = vector(value, who, field, _DIRECTION)
    length = hypot(x, y, z)
    if length == 0.0 or length == inf:
        raise refuse(who, field, value, _DIRECTION)
    if length < TINY:  # lengths of subnormal numbers lose digits
        return axis((x / TINY, y / TINY, z / TINY), who, field)
    if abs(length - 1.0) <= UNIT_LENGTH:
        return (x, y, z)
    return (x / length, y / length, z / length)


def square(value: Any, size: int, who: str, field: str, expected: str) -> tuple[tuple[float, ...], ...]:
    """Return ``value`` as a tuple of ``size`` rows of ``size`` finite floats."""
    items = listed(value, who, field, expected)
    if len(items) != size:
        raise refuse(who, field, value, expected)
    if size == 3:
        return tuple([vector(row, who, field, expected) for row in items])
    return tuple([numbers(row, (size,), who, field, expected) for row in items])


def orientation(value: Any, who: str, field: str = "orientation") -> Matrix3:
    """Return ``value`` (a rotation matrix whose columns are the axes, or a rotation vector) as a matrix.

    A matrix with rounded digits is made orthonormal, with a warning where these are few.
    """
    expected = "a 3x3 rotation matrix whose columns are the axes, or a rotation vector (3 values, rad)"
    if value is None or value is IDENTITY:
        return IDENTITY
    items = listed(value, who, field, expected)
    if len(items) != 3:
        raise refuse(who, field, value, expected)
    if not hasattr(items[0], "__len__"):
        turn = vector(items, who, field, expected)
        if hypot(*turn) > ONCE_AROUND:
            hint = f"This one goes {hypot(*turn) / (2.0 * pi):.3g} times around: angles are in radians, not degrees."
            raise refuse(who, field, value, expected, hint)
        return exponential(turn)
    rows = square(items, 3, who, field, expected)
    off = _skewness(rows)  # type: ignore[arg-type]
    if off > ROTATION_TOLERANCE:
        hint = f"Its columns are off by {off:.1e} from being orthonormal (limit {ROTATION_TOLERANCE:g})."
        raise refuse(who, field, value, expected, hint)
    (a, b, c), (d, e, f), (g, h, i) = rows
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0.0:
        raise refuse(who, field, value, expected, "This one is left-handed: negate one column.")
    if off > FEW_DIGITS:
        warnings.warn(
            f"{who}: {field} is off by {off:.1e} from a rotation matrix, as if rounded to a few digits. It is made "
            f"orthonormal with the direction of its third column; its axes are known to about {off:.0e} rad. Give all "
            f"digits, or a rotation vector.", AccuracyWarning, stacklevel=4,
        )  # fmt: skip
    return orthonormal(rows)  # type: ignore[arg-type]


def _skewness(axes: Matrix3) -> float:
    """Return the largest error of products of columns from those of orthonormal ones."""
    (a, b, c), (d, e, f), (g, h, i) = axes
    return max(
        abs(a * a + d * d + g * g - 1.0), abs(b * b + e * e + h * h - 1.0), abs(c * c + f * f + i * i - 1.0),
        abs(a * b + d * e + g * h), abs(a * c + d * f + g * i), abs(b * c + e * f + h * i),
    )  # fmt: skip


def orthonormal(axes: Matrix3) -> Matrix3:
    """Return right-handed axes with rounded digits as orthonormal ones; the third keeps its direction."""
    if axes is IDENTITY or _skewness(axes) <= ROUNDED:
        return axes
    x, y, z = zip(*axes, strict=True)
    z = _unit(z)
    along = x[0] * z[0] + x[1] * z[1] + x[2] * z[2]
    x = _unit((x[0] - along * z[0], x[1] - along * z[1], x[2] - along * z[2]))
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    return ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))


def _unit(a: Vector) -> Vector:
    length = hypot(*a)
    return (a[0] / length, a[1] / length, a[2] / length)


def exponential(w: Vector) -> Matrix3:
    """Return the rotation matrix exp([w]x) of the rotation vector ``w`` [rad] (Rodrigues' formula)."""
    x, y, z = w
    square_angle = x * x + y * y + z * z
    if square_angle < 1e-10:  # the next term of either series is below 1e-22
        s, c = 1.0 - square_angle / 6.0, 0.5 - square_angle / 24.0
    else:
        angle = sqrt(square_angle)
        s, c = sin(angle) / angle, 2.0 * (sin(0.5 * angle) / angle) ** 2
    return (
        (1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y),
        (c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x),
        (c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)),
    )


def rotated(w: Any, value: Any) -> Any:
    """Return a vector, or axes as columns, turned by the rotation vector ``w`` [rad]."""
    turn = exponential(tuple(w))
    if not isinstance(value[0], tuple):
        return tuple([sum(map(mul, row, value)) for row in turn])
    columns = list(zip(*value, strict=True))
    return tuple([tuple([sum(map(mul, row, column)) for column in columns]) for row in turn])


def frame_along(z: Vector) -> Matrix3:
    """Return a rotation matrix whose third column is the unit vector ``z``, the identity where z is (0, 0, 1)."""
    zx, zy, zz = z
    if zz < -0.5:  # far from the pole of the formula below
        return ((1.0 - zx * zx / (1.0 - zz), zx * zy / (1.0 - zz), zx),
                (-zx * zy / (1.0 - zz), zy * zy / (1.0 - zz) - 1.0, zy),
                (zx, -zy, zz))  # fmt: skip
    return ((1.0 - zx * zx / (1.0 + zz), -zx * zy / (1.0 + zz), zx),
            (-zx * zy / (1.0 + zz), 1.0 - zy * zy / (1.0 + zz), zy),
            (-zx, -zy, zz))  # fmt: skip


def name(value: Any, who: str) -> str:
    """Return ``value`` if it can be a name: text that is not empty and has no blank at its ends."""
    if not isinstance(value, str) or not value or value != value.strip() or not value.isprintable():
        raise ModelError(
            f"{who}: name = {value!r}; expected a text that is not empty, has no blanks at its ends, and no "
            "line breaks or other characters that are not printed.",
            element=who, field="name",
        )  # fmt: skip
    return value


def direction(value: Any, who: str, field: str = "direction") -> tuple[float, ...]:
    """Return x y z rx ry rz, a 3-vector (translation) or a 6-vector as a six-tuple."""
    if isinstance(value, str):
        if value not in DIRECTIONS:
            expected = "one of x y z rx ry rz, or a vector of 3 or 6 numbers"
            raise refuse(who, field, value, expected, nearest(value, DIRECTIONS).strip())
        return UNIT6[DIRECTIONS.index(value)]
    expected = "x y z rx ry rz, or a vector of 3 or 6 numbers that is not zero"
    result = numbers(value, (3, 6), who, field, expected)
    if not any(result):
        raise refuse(who, field, value, expected)
    return result if len(result) == 6 else (*result, 0.0, 0.0, 0.0)


def above_zero(value: Any, who: str, field: str, expected: str) -> float:
    """Return ``value`` as a finite float above 0."""
    if (result := number(value, who, field, expected)) <= 0.0:
        raise refuse(who, field, value, expected)
    return result


def not_zero(value: Any, who: str, field: str, expected: str) -> float:
    """Return a number that is not zero."""
    result = number(value, who, field, f"{expected}, not zero")
    if result == 0.0:
        raise refuse(who, field, value, f"{expected}, not zero")
    return result
