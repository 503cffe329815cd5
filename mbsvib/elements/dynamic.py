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
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any
from warnings import warn

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.elements import dynamic_factors as forms
from mbsvib.elements.dynamic_factors import WHO, least_error
from mbsvib.errors import AccuracyWarning, ModelError, counted

# Lines a decade at which a fit and its error are taken.
LINES = 24
# Relative error of a measured factor, unless it is stated: of good tests of elastomers.
NOISE = 0.05


@dataclass(frozen=True, repr=False, eq=False)
class Dynamic(Displayed):
    """How a stiffness changes with frequency: K(w) = K factor(i w).

    Made by ``prony``, ``zener``, ``ghm``, ``table``, ``hysteretic``, ``transfer`` and ``delay``. A rational one has
    states: ``static`` + ``viscous`` s + sum of ``weights`` s ``times`` / (1 + s ``times``); others have
    ``rational(band)``, which says its ``error`` and the ``least_error`` that any passive model has over the band.
    """

    name: str
    """Name for tables and messages."""
    _factor: Callable[[Array], Complex] = field(repr=False)
    static: float = 1.0
    viscous: float = 0.0
    weights: Array | None = None
    times: Array | None = None
    error: float = 0.0
    least_error: float = 0.0
    noise: float = np.inf
    late: float = 0.0  # delay [s] of which it is made

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
            ``static``, ``viscous`` [s], ``delay`` [s], ``weights`` and ``times`` [s], without those at their default.
        """
        weights, times = (tuple([pair[k] for pair in self.terms]) for k in (0, 1))
        words: dict[str, Any] = {"static": self.static} if self.static != 1.0 else {}
        words |= {word: value for word, value in (("viscous", self.viscous), ("delay", self.late)) if value}
        return words | {"weights": weights, "times": times}

    @staticmethod
    def of_words(words: Mapping[str, Any]) -> Dynamic:
        """Return the factor of the numbers that ``words`` returns.

        Parameters
        ----------
        words : mapping
            ``weights`` and ``times`` [s] of relaxations, ``static`` (default 1) and ``viscous`` [s] (default 0); with a
            ``delay`` [s], weights may be negative.

        Returns
        -------
        Dynamic
            static + viscous s + sum of weight s time / (1 + s time).

        Raises
        ------
        ModelError
            If a word is unknown, or a number is refused.
        """
        static, viscous, weights, times, late = forms.read(words)
        return _rational("delay" if late else "relaxations", static, viscous, weights, times, late)

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
        return _rational("prony", 1.0, 0.0, *forms.terms(weights, times, 0.0))

    @staticmethod
    def zener(weight: float, time: float, order: float = 1.0) -> Dynamic:
        """Return 1 + g (s tau)^a / (1 + (s tau)^a), a spring beside one in series with a damper or a springpot.

        Parameters
        ----------
        weight, time : float
            g [1], 0 or more, and tau [s], above 0.
        order : float
            Order a of the derivative, above 0 and up to 1: with less than 1 the loss spreads over more decades.

        Returns
        -------
        Dynamic
            With a state where the order is 1, as ``prony``; others have ``rational(band)``.

        Raises
        ------
        ModelError
            If the weight is negative, the time not positive, or the order is none.

        Source: Bagley & Torvik, AIAA Journal 21 (1983) 741.
        """
        if not 0.0 < order <= 1.0:
            raise ModelError(f"{WHO}.zener: order = {shown(order)}; expected one above 0 and up to 1, as only these "
                             f"take energy at all frequencies.", field="order")  # fmt: skip
        prony = Dynamic.prony([weight], [time])
        function = partial(forms.fractional, weight=float(weight), time=float(time), order=float(order))
        return prony if order == 1.0 else Dynamic(f"zener of order {order:g}", function)

    @staticmethod
    def ghm(weights: ArrayLike, damping_ratios: ArrayLike, frequencies: ArrayLike) -> Dynamic:
        """Return 1 + sum of g (s^2 + 2 z w s) / (s^2 + 2 z w s + w^2), Golla-Hughes-McTavish: 1 at rest.

        Parameters
        ----------
        weights, damping_ratios, frequencies : array-like, shape (n,)
            g [1], 0 or more, z [1], above 0, and w / (2 pi) [Hz], above 0.

        Returns
        -------
        Dynamic
            For responses; ``rational(band)`` has relaxations in the place of its oscillators, and states the error.

        Raises
        ------
        ModelError
            If a number is out of its range, or their counts differ.

        Source: McTavish & Hughes, J. Vibration and Acoustics 115 (1993) 103, eq. (5).
        """
        g, z, f = (forms.vector(value, label, 0.0) for value, label in (
            (weights, "weights"), (damping_ratios, "damping_ratios"), (frequencies, "frequencies")))  # fmt: skip
        if not len(g) == len(z) == len(f) or min(*z, *f, 1.0) <= 0.0:
            raise ModelError(f"{WHO}.ghm: weights = {shown(weights)}, damping_ratios = {shown(damping_ratios)}, "
                             f"frequencies = {shown(frequencies)}; expected as many of each, the last two above 0.")
        function = partial(forms.ghm, weights=g, ratios=z, natural=2 * np.pi * f)
        return Dynamic(f"ghm of {counted(len(g), 'oscillator')}", function)

    @staticmethod
    def hysteretic(loss: float, band: tuple[float, float] | None = None) -> Dynamic:
        """Return 1 + i loss: damping that does not depend on frequency.

        Parameters
        ----------
        loss : float
            Loss factor [1], 0 or more.
        band : (float, float), optional
            Frequencies [Hz] over which it is to have states: ``rational(band)``. No causal spring has this factor, and
            the ``error`` may be as large as the loss: of a loss of 0.1 over two decades it is 7 %, the loss itself
            0.05 amid the band and 0.16 at its end. A narrow band about the resonance is nearest.

        Returns
        -------
        Dynamic
            Without a band, for responses only.

        Raises
        ------
        ModelError
            If the loss factor is negative, or the band is none.
        """
        eta = forms.vector([loss], "loss", 0.0)[0]
        exact = Dynamic(f"loss factor {eta:g}", partial(forms.constant, value=1.0 + 1j * eta))
        return exact if band is None else exact.rational(band)

    @staticmethod
    def table(frequencies: ArrayLike, factors: ArrayLike, noise: float = NOISE) -> Dynamic:
        """Return measured factors: exact at their frequencies, smooth between, with a warning beyond.

        Parameters
        ----------
        frequencies : array-like, shape (n,)
            Ascending frequencies [Hz], above 0.
        factors : array-like, shape (n,)
            Complex factors; imaginary parts are 0 or more.
        noise : float
            Relative error of the factors [1]. ``rational`` warns where no passive model comes as near as that: storage
            and loss then do not belong together, as they do in what is causal and passive.

        Returns
        -------
        Dynamic
            Cubic over the logarithm of frequency without overshoot; constant beyond the table.

        Raises
        ------
        ModelError
            If frequencies do not ascend, or a factor gives energy to the mechanism.

        Warns
        -----
        AccuracyWarning
            If the first factor is below 0.005 or above 500: the table may have N/mm where the element has N/m.
        """
        from scipy.interpolate import PchipInterpolator

        f = forms.vector(frequencies, "frequencies", 0.0)
        values = np.asarray(factors, dtype=complex)
        if values.shape != f.shape or len(f) < 2 or (np.diff(f) <= 0.0).any() or f[0] == 0.0:
            raise ModelError(f"{WHO}.table: frequencies = {shown(frequencies)}, factors = {shown(factors)}; expected "
                             f"ascending frequencies above 0 Hz with a factor each, two at least.")  # fmt: skip
        wrong = np.flatnonzero(~np.isfinite(values) | (values.imag < 0.0))
        curve = None if not np.isfinite(values).all() else PchipInterpolator(
            np.log(f), np.column_stack((values.real, values.imag)))  # fmt: skip
        function = partial(forms.of_table, curve=curve, ends=(float(f[0]), float(f[-1])))
        if len(wrong):
            share = "" if curve is None else (
                f" No passive model is nearer than "
                f"{100 * least_error(function, 2 * np.pi * f[0], 2 * np.pi * f[-1]):.2g} %.")  # fmt: skip
            raise ModelError(f"{WHO}.table: the factor at {f[wrong[0]]:g} Hz is {values[wrong[0]]:g}; expected finite "
                             f"factors with an imaginary part of 0 or more, as only these take energy.{share}")
        forms.warn_of_stiffnesses(f[0], abs(values[0]))
        return Dynamic(f"table of {len(f)} factors", function, noise=float(forms.vector([noise], "noise", 0.0)[0]))

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
        num, den = (np.trim_zeros(forms.vector(one, label, -np.inf), "f") for one, label in (
            (numerator, "numerator"), (denominator, "denominator")))  # fmt: skip
        if not len(den) or len(num) > len(den) + 1:
            raise ModelError(f"{WHO}.transfer: numerator = {shown(numerator)}, denominator = {shown(denominator)}; "
                             f"expected at most one degree more in the numerator.")  # fmt: skip
        poles = np.roots(den)
        if (poles.real >= 0.0).any():
            raise ModelError(f"{WHO}.transfer: pole at {poles[poles.real.argmax()]:.4g} rad/s; expected stable ones, "
                             f"with a negative real part.")  # fmt: skip
        if (w := forms.active_at(num, den, poles)) is not None:
            raise ModelError(f"{WHO}.transfer: at {w / (2 * np.pi):.4g} Hz its imaginary part is negative; expected "
                             f"0 or more, as only these take energy.")  # fmt: skip
        if (rest := np.polyval(num, 0.0) / np.polyval(den, 0.0)) < 0.0:
            raise ModelError(f"{WHO}.transfer: it is {rest:.4g} at rest; expected 0 or more, as less gives energy.")
        terms = forms.relaxations_of(num, den, poles)
        other = Dynamic("transfer", partial(forms.ratio, num=num, den=den))
        return other if terms is None else _rational("transfer", *terms)

    @staticmethod
    def delay(time: float) -> Dynamic:
        """Return e^(-s T), a force that follows the deformation T later, as that of an actuator fed by a sensor.

        Parameters
        ----------
        time : float
            T [s], above 0.

        Returns
        -------
        Dynamic
            For responses; not passive. ``rational(band)`` is (1 - s T / 2) / (1 + s T / 2) and states its error.

        Raises
        ------
        ModelError
            If the time is not positive.
        """
        if (late := float(forms.vector([time], "time", 0.0)[0])) <= 0.0:
            raise ModelError(f"{WHO}.delay: time = {shown(time)}; expected one above 0 s.", field="time")
        return Dynamic(f"delay of {late:g} s", partial(forms.delayed, time=late), late=late)

    def rational(self, band: tuple[float, float], static: float | None = None) -> Dynamic:
        """Return the sum of relaxations that is nearest over a band of frequencies, stable and passive everywhere.

        Of a delay it is the first-order Padé approximation, which is as large at all frequencies and not passive.

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
            If the band is no pair of ascending frequencies above 0, ``static`` is negative, or not 1 of a delay.
        """
        low, high = forms.band(band)
        rest = None if static is None else float(forms.vector([static], "static", 0.0)[0])
        omega = np.geomspace(low, high, max(16, int(np.ceil(LINES * np.log10(high / low))) + 1))
        exact = self.factor(omega)
        if self.late and rest not in (None, 1.0):
            raise ModelError(f"{WHO}.rational: static = {static} of a {self.name}; expected 1.", field="static")
        terms = (1.0, 0.0, *forms.pade(self.late)) if self.late else forms.fitted(omega, exact, low, high, rest)
        result = _rational(f"{self.name}, {low / (2 * np.pi):g} to {high / (2 * np.pi):g} Hz", *terms)
        error = float((np.abs(result.factor(omega) - exact) / np.abs(exact)).max())
        # sums of relaxations are passive, and the programme has bins
        least = min(least_error(self.factor, low, high), np.inf if self.late else error)
        if least > self.noise:
            warn(f"{self.name}: no passive model comes nearer to it than {100 * least:.2g} % from "
                 f"{low / (2 * np.pi):g} to {high / (2 * np.pi):g} Hz, which is more than its noise of "
                 f"{100 * self.noise:.2g} %: it is not causal or not passive.",
                 AccuracyWarning, stacklevel=2)  # fmt: skip
        return replace(result, error=error, least_error=least, late=self.late)

    def __repr__(self) -> str:
        states = "" if self.weights is None else f", {counted(len(self.weights), 'relaxation')}"
        return f"Dynamic({self.name!r}{states})"


def _rational(name: str, static: float, viscous: float, weights: Array, times: Array, late: float = 0.0) -> Dynamic:
    function = partial(forms.sum_of, static=static, viscous=viscous, weights=weights, times=times)
    return Dynamic(name, function, static, viscous, weights, times, late=late)
