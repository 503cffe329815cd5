"""Stiffness that depends on frequency, K(w) = K factor(i w): rubber, foam, structural damping, measured tables.

A *relaxation* is a spring in series with a damper, s tau / (1 + s tau). Sums of these with weights g >= 0, of a
constant and of a damper are stable and passive, and have one state each; they are fitted to any factor by non-negative
least squares. Any passive K(s) has Im K(i w) = w h(w) with h >= 0, and Re K follows from h: a linear programme over h
tells the least error that any passive model can have, so that a fit is not asked for the impossible.

Source: Lawson & Hanson, Solving Least Squares Problems (1974); Boyd & Chua, Int. J. Circuit Theory 10 (1982) 113, for
positive real functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any
from warnings import warn

import numpy as np

from mbsvib.common.arguments import shown
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.elements.passive_bound import least_error
from mbsvib.errors import AccuracyWarning, ModelError, nearest

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex

WHO = "Dynamic"
# Time constants of a fit: so many a decade, and so far beyond the band.
A_DECADE, BEYOND = 4, 10.0
# Lines a decade at which a fit and its error are taken.
LINES = 24
# The static stiffness of a fit is at least this share of its smallest storage stiffness in the band: it holds weights.
HELD = 0.5
# Weights below this share of the largest are none.
NONE = 1e-9
# Factors of passive elements have no power on the axis below this share of their size, but for rounding.
PASSIVE = 1e-9


@dataclass(frozen=True, repr=False, eq=False)
class Dynamic(Displayed):
    """How a stiffness changes with frequency: K(w) = K factor(i w).

    Made by ``prony``, ``table``, ``hysteretic`` and ``transfer``. A rational one has states: ``static`` + ``viscous`` s
    + sum of ``weights`` s ``times`` / (1 + s ``times``); others have ``rational(band)``, which says its ``error`` and
    the ``least_error`` that any passive model has over the band.
    """

    name: str
    _factor: Callable[[Array], Complex] = field(repr=False)
    static: float = 1.0
    viscous: float = 0.0
    weights: Array | None = None
    times: Array | None = None
    error: float = 0.0
    least_error: float = 0.0

    def __str__(self) -> str:
        return repr(self)  # ``table`` makes one here, and prints none

    @property
    def is_rational(self) -> bool:
        """Whether it has states."""
        return self.weights is not None

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Weight and time constant [s] of each relaxation."""
        if self.weights is None or self.times is None:
            return ()
        return tuple(zip(self.weights.tolist(), self.times.tolist(), strict=True))

    def __eq__(self, other: object) -> bool:
        if self.is_rational and isinstance(other, Dynamic) and other.is_rational:
            return self.words() == other.words()
        return self is other

    def __hash__(self) -> int:
        return hash((self.static, self.viscous, self.terms)) if self.is_rational else id(self)

    def words(self) -> dict[str, Any]:
        """Return the numbers of a rational one, as a model file has them.

        Returns
        -------
        dict
            ``static``, ``viscous`` [s], ``weights`` and ``times`` [s], without those at their default.
        """
        weights, times = (tuple([pair[k] for pair in self.terms]) for k in (0, 1))
        words: dict[str, Any] = {"static": self.static} if self.static != 1.0 else {}
        words |= {"viscous": self.viscous} if self.viscous else {}
        return words | {"weights": weights, "times": times}

    @staticmethod
    def of_words(words: Mapping[str, Any]) -> Dynamic:
        """Return the factor of the numbers that ``words`` returns.

        Parameters
        ----------
        words : mapping
            ``weights`` and ``times`` [s] of relaxations, ``static`` (default 1) and ``viscous`` [s] (default 0).

        Returns
        -------
        Dynamic
            static + viscous s + sum of weight s time / (1 + s time).

        Raises
        ------
        ModelError
            If a word is unknown, or a number is refused.
        """
        known = ("static", "viscous", "weights", "times")
        for word in words:
            if word not in known:
                raise ModelError(f"{WHO}: {word!r} is no word of it; expected some of {', '.join(known)}."
                                 f"{nearest(str(word), known)}", field="dynamic")  # fmt: skip
        plain = Dynamic.prony(words.get("weights", ()), words.get("times", ()))
        static, viscous = (float(_vector([words.get(word, default)], word, 0.0)[0]) for word, default in (
            ("static", 1.0), ("viscous", 0.0)))  # fmt: skip
        assert plain.weights is not None
        assert plain.times is not None
        return _rational("relaxations", static, viscous, plain.weights, plain.times)

    def factor(self, omega: ArrayLike) -> Complex:
        """Return the factor of the stiffness.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (n,)
            Complex factors; those of negative frequencies are conjugate.
        """
        w = np.asarray(reals(omega, WHO, "omega", "angular frequencies [rad/s]"))
        value = self._factor(np.abs(w))
        return np.where(w < 0.0, value.conj(), value)

    @staticmethod
    def prony(weights: ArrayLike, times: ArrayLike) -> Dynamic:
        """Return 1 + sum of g s tau / (1 + s tau), 1 at rest.

        Parameters
        ----------
        weights, times : array-like, shape (n,)
            g [1], 0 or more, and time constants tau [s]; infinite rates: K (1 + sum of g).

        Returns
        -------
        Dynamic
            Exact, with one state for each term and direction.

        Raises
        ------
        ModelError
            If a weight is negative, a time is not positive, or their numbers differ.
        """
        g, tau = _vector(weights, "weights", 0.0), _vector(times, "times", 0.0)
        if len(g) != len(tau) or (tau <= 0.0).any():
            raise ModelError(f"{WHO}.prony: weights = {shown(weights)}, times = {shown(times)}; expected as many "
                             f"times, above 0 s, as weights.")  # fmt: skip
        return _rational("prony", 1.0, 0.0, g, tau)

    @staticmethod
    def hysteretic(loss: float, band: tuple[float, float] | None = None) -> Dynamic:
        """Return 1 + i loss: damping that does not depend on frequency.

        Parameters
        ----------
        loss : float
            Loss factor [1], 0 or more.
        band : (float, float), optional
            Frequencies [Hz] over which it is to have states: ``rational(band)``.

        Returns
        -------
        Dynamic
            Without a band, for responses only.

        Raises
        ------
        ModelError
            If the loss factor is negative, or the band is none.
        """
        eta = _vector([loss], "loss", 0.0)[0]
        exact = Dynamic(f"loss factor {eta:g}", partial(_constant, value=1.0 + 1j * eta))
        return exact if band is None else exact.rational(band)

    @staticmethod
    def table(frequencies: ArrayLike, factors: ArrayLike) -> Dynamic:
        """Return measured factors: exact at their frequencies, smooth between, with a warning beyond.

        Parameters
        ----------
        frequencies : array-like, shape (n,)
            Ascending frequencies [Hz], above 0.
        factors : array-like, shape (n,)
            Complex factors; imaginary parts are 0 or more.

        Returns
        -------
        Dynamic
            Cubic over the logarithm of frequency without overshoot; constant beyond the table.

        Raises
        ------
        ModelError
            If frequencies do not ascend, or a factor gives energy to the mechanism.
        """
        from scipy.interpolate import PchipInterpolator

        f = _vector(frequencies, "frequencies", 0.0)
        values = np.asarray(factors, dtype=complex)
        if values.shape != f.shape or len(f) < 2 or (np.diff(f) <= 0.0).any() or f[0] == 0.0:
            raise ModelError(f"{WHO}.table: frequencies = {shown(frequencies)}, factors = {shown(factors)}; expected "
                             f"ascending frequencies above 0 Hz with a factor each, two at least.")  # fmt: skip
        if not np.isfinite(values).all() or (values.imag < 0.0).any():
            k = int(np.flatnonzero(~np.isfinite(values) | (values.imag < 0.0))[0])
            raise ModelError(f"{WHO}.table: the factor at {f[k]:g} Hz is {values[k]:g}; expected finite factors with "
                             f"an imaginary part of 0 or more, as only these take energy.")  # fmt: skip
        curve = PchipInterpolator(np.log(f), np.column_stack((values.real, values.imag)))
        return Dynamic(f"table of {len(f)} factors", partial(_of_table, curve=curve, ends=(float(f[0]), float(f[-1]))))

    @staticmethod
    def transfer(numerator: ArrayLike, denominator: ArrayLike) -> Dynamic:
        """Return a ratio of polynomials in s.

        Parameters
        ----------
        numerator, denominator : array-like, shape (n,)
            Coefficients, the highest power first; the numerator has at most one degree more.

        Returns
        -------
        Dynamic
            With states where it is a sum of relaxations; others have ``rational(band)``.

        Raises
        ------
        ModelError
            If it is not proper but for a damper, not stable, or gives energy to the mechanism.
        """
        num, den = (np.trim_zeros(_vector(one, label, -np.inf), "f") for one, label in (
            (numerator, "numerator"), (denominator, "denominator")))  # fmt: skip
        if not len(den) or len(num) > len(den) + 1:
            raise ModelError(f"{WHO}.transfer: numerator = {shown(numerator)}, denominator = {shown(denominator)}; "
                             f"expected at most one degree more in the numerator.")  # fmt: skip
        poles = np.roots(den)
        if (poles.real >= 0.0).any():
            raise ModelError(f"{WHO}.transfer: pole at {poles[poles.real.argmax()]:.4g} rad/s; expected stable ones, "
                             f"with a negative real part.")  # fmt: skip
        sizes = np.abs(np.concatenate((poles, np.roots(num))))
        sizes = sizes[sizes > 0.0]
        around = np.geomspace(0.01 * sizes.min(), 100.0 * sizes.max(), 400) if len(sizes) else np.ones(1)
        value = np.polyval(num, 1j * around) / np.polyval(den, 1j * around)
        if (value.imag < -PASSIVE * np.abs(value)).any():
            w = around[int((value.imag / np.abs(value)).argmin())]
            raise ModelError(f"{WHO}.transfer: at {w / (2 * np.pi):.4g} Hz its imaginary part is negative; expected "
                             f"0 or more, as only these take energy.")  # fmt: skip
        return _as_relaxations(num, den, poles)

    def rational(self, band: tuple[float, float], static: float | None = None) -> Dynamic:
        """Return the sum of relaxations that is nearest over a band of frequencies, stable and passive everywhere.

        Parameters
        ----------
        band : (float, float)
            Lowest and highest frequency [Hz].
        static : float, optional
            Factor at rest [1], which statics sees, 0 or more; default: the nearest that is half of the least real part
            in the band or more.

        Returns
        -------
        Dynamic
            With states; ``error`` is its largest relative error over the band, ``least_error`` what no passive model
            falls below.

        Raises
        ------
        ModelError
            If the band is no pair of ascending frequencies above 0, or ``static`` is negative.
        """
        low, high = _band(band)
        rest = None if static is None else float(_vector([static], "static", 0.0)[0])
        omega = np.geomspace(low, high, max(16, int(np.ceil(LINES * np.log10(high / low))) + 1))
        exact = self.factor(omega)
        terms = _fitted(omega, exact, low, high, rest)
        result = _rational(f"{self.name}, {low / (2 * np.pi):g} to {high / (2 * np.pi):g} Hz", *terms)
        error = float((np.abs(result.factor(omega) - exact) / np.abs(exact)).max())
        return _rational(result.name, *terms, error, least_error(self.factor, low, high))

    def __repr__(self) -> str:
        return f"Dynamic({self.name!r}{f', {len(self.weights)} relaxations' if self.weights is not None else ''})"


def _vector(value: Any, label: str, least: float) -> Array:
    array = np.atleast_1d(reals(value, WHO, label, "real numbers", ModelError))
    if array.ndim != 1 or not np.isfinite(array).all() or (array < least).any():
        limit = ", 0 or more" if least == 0.0 else ""
        raise ModelError(f"{WHO}: {label} = {shown(value)}; expected finite numbers{limit}.", field=label)  # fmt: skip
    return array


def _band(band: Any) -> tuple[float, float]:
    pair = _vector(band, "band", 0.0)
    if len(pair) != 2 or not 0.0 < pair[0] < pair[1]:
        raise ModelError(f"{WHO}: band = {shown(band)}; expected two ascending frequencies above 0 Hz.", field="band")
    return float(2 * np.pi * pair[0]), float(2 * np.pi * pair[1])


def _constant(omega: Array, value: complex) -> Complex:
    return np.where(omega == 0.0, value.real, np.full(omega.shape, value))


def _of_table(omega: Array, curve: Any, ends: tuple[float, float]) -> Complex:
    f = omega / (2 * np.pi)
    if ((f < ends[0]) | (f > ends[1])).any():
        warn(f"{WHO}.table: asked at {f.min():.4g} to {f.max():.4g} Hz, beyond its {ends[0]:.4g} to {ends[1]:.4g} Hz, "
             f"where it is taken as constant.", AccuracyWarning, stacklevel=4)  # fmt: skip
    value = curve(np.log(np.clip(f, *ends)))
    return np.asarray(np.where(omega == 0.0, value[..., 0], value[..., 0] + 1j * value[..., 1]))


def _sum(omega: Array, static: float, viscous: float, weights: Array, times: Array) -> Complex:
    turn = 1j * np.multiply.outer(omega, times)
    return np.asarray(static + 1j * omega * viscous + (turn / (1.0 + turn)) @ weights)


def _rational(
    name: str, static: float, viscous: float, weights: Array, times: Array, error: float = 0.0, least: float = 0.0
) -> Dynamic:  # fmt: skip
    function = partial(_sum, static=static, viscous=viscous, weights=weights, times=times)
    return Dynamic(name, function, static, viscous, weights, times, error, least)


def _as_relaxations(num: Array, den: Array, poles: Any) -> Dynamic:
    """A ratio of polynomials as a sum of relaxations, without states where it is none."""
    def function(omega: Array) -> Complex:
        return np.asarray(np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega))

    plain = Dynamic("transfer", function)
    if (np.abs(poles.imag) > 0.0).any():
        return plain
    quotient, rest = np.polydiv(num, den)
    viscous, high = (quotient[0], quotient[1]) if len(quotient) == 2 else (0.0, quotient[-1])
    slope = np.polyder(den)
    with np.errstate(divide="ignore", invalid="ignore"):
        residues = np.polyval(rest, poles) / np.polyval(slope, poles)
        weights = residues / poles  # r / (s - p) = -r / p + (r / p) s tau / (1 + s tau), tau = -1 / p
    static = high - weights.sum()
    if not np.isfinite(weights).all() or (weights < 0.0).any() or viscous < 0.0 or static < 0.0:
        return plain
    return _rational("transfer", float(static), float(viscous), weights, -1.0 / poles)


def _fitted(
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
