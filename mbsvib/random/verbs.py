"""Methods of linear equations under noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.expected import hertz
from mbsvib.common.selection import Names
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from mbsvib.random.budget import Budget
    from mbsvib.random.sources import Correlation


class RandomVerbs:
    """What systems, state spaces and loops answer under noise.

    Noise is given as ``{"floor.z": [(1, 1e-5), (100, 1e-6)], "leg*.noise": isolation.white(1e-6)}``: by name or pattern
    the one-sided density of an input [unit^2/Hz] as a table of pairs (frequency [Hz], density), straight on log-log
    axes and zero beyond (``OutsideTableWarning`` where that is asked for), as a number (white noise), filtered white
    noise (``isolation.shaped``), a curve such as ``isolation.vc_spectrum("VC-C")``, or a function of the frequency
    [Hz].
    """

    def psd(
        self, outputs: Names, floor: Mapping[str, Any], frequencies: ArrayLike, correlation: Correlation = None,
        weighting: Any = None,
    ) -> Array:  # fmt: skip
        """Return the one-sided power spectral densities of outputs under noise.

        S_y = G S_x G^H

        Parameters
        ----------
        outputs : str or sequence of str or None
            Names or patterns; None: all.
        floor : mapping of str to density
            Noise at the inputs, by name or pattern.
        frequencies : array-like, shape (n,)
            Frequencies [Hz].
        correlation : array-like or callable, optional
            As of ``budget``.
        weighting : str, filter, callable or mapping, optional
            As of ``budget``.

        Returns
        -------
        array, shape (outputs, n)
            Densities [unit^2/Hz].

        Raises
        ------
        ResponseError
            If a name is unknown, noise is refused, a frequency is an undamped pole, or the equations are not stable.
        """
        from mbsvib.random.budget import random
        from mbsvib.responses.norms import growth

        f = hertz(frequencies)
        under = random(self, floor, outputs, None, correlation, weighting)
        if words := growth(self):
            raise ResponseError(f"psd: '{under.linear.name}' is not stable: {words} grows, so that no density exists. "
                                f"Add stiffness or damping, or change the controller.")  # fmt: skip
        under.warn_outside(f[0], f[-1])
        return np.asarray(under.densities(f).sum(axis=1))

    def rms(
        self, outputs: Names, floor: Mapping[str, Any], band: Iterable[float] | None = None,
        correlation: Correlation = None, weighting: Any = None,
    ) -> dict[str, float]:  # fmt: skip
        """Return the root mean squares of outputs under noise.

        Exact moments (Lyapunov equations) where noise is filtered white noise and no band is given, else integrals of
        the densities that are exact to rounding, for functions to a bound that ``budget`` states.

        Parameters
        ----------
        outputs : str or sequence of str or None
            Names or patterns; None: all.
        floor : mapping of str to density
            Noise at the inputs, by name or pattern.
        band : (float, float), optional
            First and last frequency [Hz]; default: all of them.
        correlation : array-like or callable, optional
            As of ``budget``.
        weighting : str, filter, callable or mapping, optional
            As of ``budget``.

        Returns
        -------
        dict
            {output: root mean square}; infinite where a driven motion does not decay, or noise without a last frequency
            comes through directly.

        Raises
        ------
        ResponseError
            If a name is unknown, noise is refused, or a pole grows.
        """
        return dict(self.budget(floor, outputs, band, correlation, weighting).rms)

    def budget(
        self, floor: Mapping[str, Any], outputs: Names = None, band: Iterable[float] | None = None,
        correlation: Correlation = None, weighting: Any = None,
    ) -> Budget:  # fmt: skip
        """Return the error budget: how much each source of noise contributes to the root mean square of each output.

        Parameters
        ----------
        floor : mapping of str to density
            Noise at the inputs, by name or pattern.
        outputs : str or sequence of str, optional
            Names or patterns; default: all.
        band : (float, float), optional
            First and last frequency [Hz]; default: all of them.
        correlation : array-like, shape (s, s), or callable, optional
            Of the sources in the order of ``floor``: entry (i, j) is E[x_i conj(x_j)] over both roots; or a function of
            a frequency [Hz] that returns (s, s), or of frequencies (n,) that returns (n, s, s). A rear axle that
            repeats the front tau later has exp(2 pi i f tau) in [front, rear]. Default: independent.
        weighting : str, filter, callable or mapping, optional
            Filter of all outputs, or of some by name or pattern: "Wk" or "Wd" of ISO 2631-1, of accelerations, what
            ``isolation.shaped``, ``moving_average`` and ``moving_deviation`` make, a StateSpace or transfer function of
            python-control, pairs (frequency [Hz], gain), straight on log-log axes and zero beyond, or a function of
            frequencies [Hz].

        Returns
        -------
        Budget
            ``rms``, ``contributions``, ``psd``, ``cumulative``; printed as a table.

        Raises
        ------
        ResponseError
            If a name is unknown, noise is refused, or a pole grows.
        """
        from mbsvib.random.budget import budget, random

        return budget(random(self, floor, outputs, band, correlation, weighting))
