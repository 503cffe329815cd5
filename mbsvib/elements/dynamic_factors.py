"""Factors of a stiffness over angular frequency [rad/s], the sum of relaxations that is nearest to one, and the least
error that any passive model of it has, by a linear programme.

Any passive K(s) has Im K(i w) = w h(w) with h >= 0, and Re K follows from h.

Source: Boyd & Chua, Int. J. Circuit Theory 10 (1982) 113, for positive real functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from warnings import warn

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import reals
from mbsvib.errors import AccuracyWarning, ModelError, nearest
from mbsvib.linalg.bands import within

WHO = "Dynamic"
# Factors of passive elements have no power on the axis below this share of their size, but for rounding.
PASSIVE = 1e-9
# Time constants of a fit: so many a decade, and so far beyond the band.
A_DECADE, BEYOND = 4, 10.0
# The static stiffness of a fit is at least this share of its smallest storage stiffness in the band: it holds weights.
HELD = 0.5
# Weights below this share of the largest are none.
NONE = 1e-9
# Sizes of the first factor of a table; beyond, it may be in other units than the stiffness of the element.
USUAL = 5e-3, 500.0


def vector(value: Any, label: str, least: float) -> Array:
    """Return finite numbers that are at least ``least``, of which there may be one."""
    array = np.atleast_1d(reals(value, WHO, label, "real numbers", ModelError))
    if array.ndim != 1 or not np.isfinite(array).all() or (array < least).any():
        limit = ", 0 or more" if least == 0.0 else ""
        raise ModelError(f"{WHO}: {label} = {shown(value)}; expected finite numbers{limit}.", field=label)  # fmt: skip
    return array


def warn_of_stiffnesses(frequency: float, size: float) -> None:
    """Warn of a table whose first factor has the size of a stiffness."""
    if not USUAL[0] <= size <= USUAL[1]:
        warn(f"{WHO}.table: the factor at {frequency:g} Hz is {size:.3g}. Factors are parts of the stiffness of the "
             f"element: divide stiffnesses by that, both in N/m.", AccuracyWarning, stacklevel=3)  # fmt: skip


def band(given: Any) -> tuple[float, float]:
    """Return the ends [rad/s] of a band [Hz]."""
    pair = vector(given, "band", 0.0)
    if len(pair) != 2 or not 0.0 < pair[0] < pair[1]:
        raise ModelError(f"{WHO}: band = {shown(given)}; expected two ascending frequencies above 0 Hz.", field="band")
    return float(2 * np.pi * pair[0]), float(2 * np.pi * pair[1])


def terms(weights: Any, times: Any, least: float) -> tuple[Array, Array]:
    """Return weights, each at least ``least``, and times [s] of relaxations, as many of each."""
    g, tau = vector(weights, "weights", least), vector(times, "times", 0.0)
    if len(g) != len(tau) or (tau <= 0.0).any():
        raise ModelError(f"{WHO}.prony: weights = {shown(weights)}, times = {shown(times)}; expected as many times, "
                         f"above 0 s, as weights.")  # fmt: skip
    return g, tau


def read(words: Mapping[str, Any]) -> tuple[float, float, Array, Array, float]:
    """Return static and viscous part, weights, times and delay of the words of a model file."""
    known = ("static", "viscous", "delay", "weights", "times")
    for word in words:
        if word not in known:
            raise ModelError(f"{WHO}: {word!r} is not a word of it; expected some of {', '.join(known)}."
                             f"{nearest(str(word), known)}", field="dynamic")  # fmt: skip
    static, viscous, late = (float(vector([words.get(word, default)], word, 0.0)[0]) for word, default in (
        ("static", 1.0), ("viscous", 0.0), ("delay", 0.0)))  # fmt: skip
    if late and "weights" not in words:
        raise ModelError(f"{WHO}: delay = {late:g} without weights and times; expected those of "
                         f"Dynamic.delay({late:g}).rational((low, high)), which states its error.", field="delay")
    weights, times = terms(words.get("weights", ()), words.get("times", ()), -np.inf if late else 0.0)
    return static, viscous, weights, times, late


def constant(omega: Array, value: complex) -> Complex:
    """Return a factor that does not depend on frequency, real at rest."""
    return np.where(omega == 0.0, value.real, np.full(omega.shape, value))


def of_table(omega: Array, curve: Any, ends: tuple[float, float]) -> Complex:
    """Return the factors of a table: a ``curve`` over log f [Hz] between its ``ends`` [Hz], with a warning beyond."""
    f = omega / (2 * np.pi)
    if not within(f, *ends).all():
        warn(f"Dynamic.table: asked at {f.min():.4g} to {f.max():.4g} Hz, beyond its {ends[0]:.4g} to {ends[1]:.4g} "
             f"Hz, where it is taken as constant.", AccuracyWarning, stacklevel=4)  # fmt: skip
    value = curve(np.log(np.clip(f, *ends)))
    return np.asarray(np.where(omega == 0.0, value[..., 0], value[..., 0] + 1j * value[..., 1]))


def sum_of(omega: Array, static: float, viscous: float, weights: Array, times: Array) -> Complex:
    """Return static + viscous s + sum of weight s time / (1 + s time)."""
    turn = 1j * np.multiply.outer(omega, times)
    return np.asarray(static + 1j * omega * viscous + (turn / (1.0 + turn)) @ weights)


def fractional(omega: Array, weight: float, time: float, order: float) -> Complex:
    """Return 1 + weight x / (1 + x), x = (i omega time)^order, of a Zener element with a fractional derivative."""
    power = (1j * omega * time) ** order
    return np.asarray(1.0 + weight * power / (1.0 + power), dtype=complex)


def ghm(omega: Array, weights: Array, ratios: Array, natural: Array) -> Complex:
    """Return 1 + sum of weight (s^2 + 2 ratio w s) / (s^2 + 2 ratio w s + w^2), w = ``natural`` [rad/s]."""
    s = 1j * omega[..., None]
    moving = s * s + 2.0 * ratios * natural * s
    return np.asarray(1.0 + (moving / (moving + natural**2)) @ weights)


def delayed(omega: Array, time: float) -> Complex:
    """Return e^(-s time)."""
    return np.asarray(np.exp(-1j * omega * time))


def pade(time: float) -> tuple[Array, Array]:
    """Return weight and time of (1 - s time / 2) / (1 + s time / 2) = 1 - 2 (s time / 2) / (1 + s time / 2)."""
    return np.array([-2.0]), np.array([0.5 * time])


def ratio(omega: Array, num: Array, den: Array) -> Complex:
    """Return a ratio of polynomials in s."""
    return np.asarray(np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega))


def active_at(num: Array, den: Array, poles: Any) -> float | None:
    """Return the angular frequency [rad/s] at which a ratio of polynomials gives energy most, None if nowhere."""
    sizes = np.array([size for size in np.abs([*poles, *np.roots(num)]) if size > 0.0])
    around = np.geomspace(0.01 * sizes.min(), 100.0 * sizes.max(), 400) if len(sizes) else np.ones(1)
    value = ratio(around, num, den)
    share = value.imag / np.abs(value)
    return float(around[int(share.argmin())]) if (value.imag < -PASSIVE * np.abs(value)).any() else None


def relaxations_of(num: Array, den: Array, poles: Any) -> tuple[float, float, Array, Array] | None:
    """Return static and viscous part, weights and times [s] of the relaxations that a ratio of polynomials is, None
    where it is no sum of them.
    """
    if (np.abs(poles.imag) > 0.0).any():
        return None
    quotient, rest = np.polydiv(num, den)
    viscous, high = (quotient[0], quotient[1]) if len(quotient) == 2 else (0.0, quotient[-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        residues = np.polyval(rest, poles) / np.polyval(np.polyder(den), poles)
        weights = residues / poles  # r / (s - p) = -r / p + (r / p) s tau / (1 + s tau), tau = -1 / p
    static = high - weights.sum()
    if not np.isfinite(weights).all() or (weights < 0.0).any() or viscous < 0.0 or static < 0.0:
        return None
    return float(static), float(viscous), weights, -1.0 / poles


def fitted(
    omega: Array, exact: Complex, low: float, high: float, static: float | None
) -> tuple[float, float, Array, Array]:
    """Static and viscous part, weights and times of relaxations, none negative: least squares of relative errors.

    The static part is ``static``, or if that is None, free from a share of the least real part upwards.
    """
    from scipy.optimize import nnls

    count = int(np.ceil(A_DECADE * np.log10(BEYOND**2 * high / low))) + 1
    times = np.geomspace(1.0 / (BEYOND * high), BEYOND / low, count)
    turn = 1j * np.multiply.outer(omega, times)
    columns = np.concatenate((np.ones((len(omega), 1)), 1j * omega[:, None] / high, turn / (1.0 + turn)), axis=1)
    rest = HELD * max(float(exact.real.min()), 0.0) if static is None else static
    columns[:, 0] = 0.0 if static is not None else 1.0
    scaled, target = columns / np.abs(exact)[:, None], (exact - rest) / np.abs(exact)
    weights = nnls(np.concatenate((scaled.real, scaled.imag)), np.concatenate((target.real, target.imag)))[0]
    acts = weights[2:] > NONE * weights.max()
    return float(weights[0]) + rest, float(weights[1] / high), weights[2:][acts], times[acts]


# Bins a decade, and so many decades beyond the band.
BINS, OUTSIDE = 40, 2


def least_error(factor: Callable[[Array], Complex], low: float, high: float) -> float:
    """Return the least relative error, of real and imaginary part, that any passive model has from ``low`` to ``high``
    [rad/s].

    K(i w) = c0 - w^2 c2 + i w h(w) - (w / pi) integral of h over pairs of bins, h constant in each bin
    """
    from scipy.optimize import linprog

    beyond = np.geomspace(low, low / 10**OUTSIDE, BINS * OUTSIDE // 4 + 1)[:0:-1]
    inside = np.geomspace(low, high, max(8, int(np.ceil(BINS * np.log10(high / low)))) + 1)
    above = np.geomspace(high, high * 10**OUTSIDE, BINS * OUTSIDE // 4 + 1)[1:]
    edges = np.concatenate((beyond, inside, above))
    start, end = np.concatenate(([0.0], edges)), np.concatenate((edges, [np.inf]))
    omega = np.sqrt(inside[:-1] * inside[1:])
    exact = factor(omega)
    w = omega[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        upper = np.where(np.isinf(end), 0.0, np.log(np.abs((end - w) / (end + w))))
        columns = -(w / np.pi) * (upper + np.log(np.abs((start + w) / (start - w))))
    within = (start < w) & (w < end)
    scale = 1.0 / np.sqrt(low * high)
    real = np.column_stack((np.ones(len(omega)), -((omega * scale) ** 2), columns * scale))
    imaginary = np.column_stack((np.zeros((len(omega), 2)), np.where(within, w, 0.0) * scale))
    size = np.abs(exact)[:, None]
    rows = np.concatenate((real / size, imaginary / size))
    target = np.concatenate((exact.real, exact.imag)) / np.concatenate((size, size))[:, 0]
    bound = -np.ones((len(rows), 1))
    found = linprog(np.append(np.zeros(rows.shape[1]), 1.0), np.block([[rows, bound], [-rows, bound]]),
                    np.concatenate((target, -target)), bounds=(0.0, None), method="highs")  # fmt: skip
    return float(found.fun) if found.success else float("nan")
