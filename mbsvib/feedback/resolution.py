"""Poles and panels of the responses of a system or a closed loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Complex


class Resolution(NamedTuple):
    """Structure of responses: ``poles`` [1/s], repeated after the ``period`` [Hz]; ``longest`` [Hz] is the maximum
    length of a panel on which other factors are polynomials of the frequency.
    """

    poles: Complex
    longest: float = np.inf
    period: float = np.inf


def resolution(linear: Any) -> Resolution:
    """Return poles and panels of the responses of a system or a closed loop."""
    known = getattr(linear, "resolution", None)
    return known if isinstance(known, Resolution) else Resolution(linear.poles())
