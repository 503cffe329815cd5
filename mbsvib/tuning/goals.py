"""Goals of ``mv.tune``: norms that are minimised or limited, and limits of damping, margins and roll-off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError
from mbsvib.random.sources import Correlation
from mbsvib.tuning.measures import Damping, Goal, Hinf, Margin, Rms, Rolloff
from mbsvib.tuning.peaks import over_frequency

__all__ = ["damping", "hinf", "margin", "rms", "rolloff"]
__dir__ = __all__.copy


def hinf(outputs: Names = None, inputs: Names = None, weight: Any = 1.0, most: float | None = None) -> Goal:
    """Return the goal of a small H-infinity norm: the highest peak of the largest singular value.

    max over w of sigma(W(i w) G(i w))

    Parameters
    ----------
    outputs, inputs : str or sequence of str, optional
        Names or patterns of ports of the loop; inputs may be noise, "SENSOR.noise" and "ACTUATOR.noise". Default: all
        outputs, and all inputs that are not noise.
    weight : float, filter, StateSpace, or array-like, shape (n, 2)
        Factor, by which goals are compared. Or W over frequency, stable: ``isolation.shaped(numerator, denominator)``,
        a transfer function of python-control, a StateSpace with one input or with the outputs as its inputs, whose
        units must be theirs, or pairs (frequency [Hz], gain): straight on log-log axes, and zero beyond.
    most : float, optional
        Limit of the norm, which is not minimised then.

    Returns
    -------
    Goal
        For ``mv.tune``, which minimises the largest of all weighted norms that have no limit.

    Raises
    ------
    ModelError
        If the weight is not positive, not stable, or none of these.
    """
    limit = None if most is None else check.positive(most, "goals.hinf", "most")
    if weight is None or isinstance(weight, (int, float, np.number, str)):
        return Hinf(outputs, inputs, check.positive(weight, "goals.hinf", "weight"), limit)
    return Hinf(outputs, inputs, 1.0, limit, over_frequency(weight, "goals.hinf"))


def rms(
    outputs: Names, floor: Mapping[str, Any], weight: float = 1.0, band: Iterable[float] | None = None,
    correlation: Correlation = None, weighting: Any = None, most: float | None = None,
) -> Goal:  # fmt: skip
    """Return the goal of a small root mean square under noise.

    weight sqrt(sum over outputs of E[y^2])

    Parameters
    ----------
    outputs : str or sequence of str
        Names or patterns.
    floor : mapping of str to density
        One-sided densities at inputs [unit^2/Hz] by name or pattern, as of ``system.rms``; also of "SENSOR.noise" and
        "ACTUATOR.noise".
    weight : float
        Factor, by which goals are compared.
    band : (float, float), optional
        First and last frequency [Hz].
    correlation, weighting : optional
        As of ``system.rms``.
    most : float, optional
        Limit of the root mean square, which is not minimised then.

    Returns
    -------
    Goal
        For ``mv.tune``, which minimises the largest of all weighted norms that have no limit.

    Raises
    ------
    ModelError
        If the weight is not positive.
    """
    return Rms(outputs, floor, check.positive(weight, "goals.rms", "weight"), band, correlation, weighting,
               None if most is None else check.positive(most, "goals.rms", "most"))  # fmt: skip


def damping(least: float) -> Goal:
    """Return the limit that all poles of the loop that vibrate have a damping ratio.

    -Re(s) / |s| >= least

    Parameters
    ----------
    least : float
        Damping ratio, from 0 to 1.

    Returns
    -------
    Goal
        A limit for ``mv.tune``.

    Raises
    ------
    ModelError
        If it is no damping ratio.
    """
    return Damping(_share(least, "damping"))


def margin(least: float) -> Goal:
    """Return a lower limit of the modulus margin of all loops simultaneously.

    1 / (max over w of mu((1 - K G)^-1)) >= least, at the actuators, mu of diagonal perturbations as in ``margins``

    Parameters
    ----------
    least : float
        Distance from the critical point, from 0 to 1.

    Returns
    -------
    Goal
        A limit for ``mv.tune``.

    Raises
    ------
    ModelError
        If it is no margin that a loop can have.
    """
    return Margin(_share(least, "margin"))


def rolloff(frequency: float, decibels: float = 20.0) -> Goal:
    """Return the limit that the loops roll off: commands hardly follow what comes in beyond a frequency.

    sigma(T(2 pi i f)) <= (frequency / f)^(decibels / 20),  frequency <= f <= 1000 frequency,
    T = L (1 + L)^-1 at the actuators, L = -K G, which is L where that is small

    Parameters
    ----------
    frequency : float
        First frequency [Hz], where |T| is to be 1 at most.
    decibels : float
        Slope [dB/decade], no less than 0; 20 for each pole more than zeros.

    Returns
    -------
    Goal
        A limit for ``mv.tune``; its value is the largest ratio of both sides, at most 1 where it is reached.

    Raises
    ------
    ModelError
        If the frequency is not positive, or the slope negative.
    """
    slope = check.number(decibels, "goals.rolloff", "decibels")
    if slope < 0.0:
        raise check.refuse("goals.rolloff", "decibels", decibels, "a slope [dB/decade], no less than 0")
    return Rolloff(check.positive(frequency, "goals.rolloff", "frequency"), slope)


def _share(value: Any, who: str) -> float:
    number = check.number(value, f"goals.{who}", "least")
    if not 0.0 < number < 1.0:
        raise check.refuse(f"goals.{who}", "least", value, "a number between 0 and 1")
    return number


def as_goals(goals: Any) -> tuple[Goal, ...]:
    """Return goals as a tuple."""
    several = (goals,) if isinstance(goals, Goal) else tuple(goals) if isinstance(goals, (list, tuple)) else ()
    if not several or not all(isinstance(goal, Goal) for goal in several):
        raise ResponseError(f"tune: goals = {check.shown(goals)}; expected a list of what mv.goals makes, such as "
                            f"[mv.goals.hinf('x', 'F')].")  # fmt: skip
    return several
