"""Sensitivities of a system with respect to its parameters, as methods of ``System``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.selection import Names
from mbsvib.equations.equations import Equations
from mbsvib.equations.selection import with_ports
from mbsvib.responses.linear import StepVerbs

if TYPE_CHECKING:
    from mbsvib.responses.basis import Basis
    from mbsvib.responses.norms import Norm
    from mbsvib.sensitivities.basis import SensitivityBasis
    from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
    from mbsvib.sensitivities.shapes import ModeSensitivities
    from mbsvib.uncertain.plant import UncertainPlant

Requested = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None


class SensitiveVerbs(StepVerbs):
    """Derivatives of what linear equations of a mechanism answer, to every number that it was made of."""

    if TYPE_CHECKING:
        sensitivity_basis: Any

        def _slopes(self, question: str, *arguments: Any) -> Any:
            """The derivatives that a function of ``mbsvib.sensitivities`` returns."""

    def uncertain(self, limits: Mapping[str, Any], order: int = 1) -> UncertainPlant:
        """Return the system with parameters that lie within limits, as an exact linear fractional map of these.

        M + d dM, C + d dC, ...: each parameter enters as w = d z, as often as the rank of what it changes: a stiffness
        once, a mass by the rank of its motion. (MATLAB: ``uss``.)

        Parameters
        ----------
        limits : mapping of str to float or (float, float)
            By name or pattern, half the width relative to the nominal value, 0.1 for 10 %, or (lower, upper). A pattern
            makes each parameter that it picks uncertain by itself.
        order : int
            1: exact maps; what is not affine is refused. Higher, for places and directions: polynomials of this order
            in each parameter, with the products of two; ``error`` of the plant is what they miss at sampled values, as
            a share of the change. Proofs are those of the polynomials, ``at`` and ``sample`` linearize anew.

        Returns
        -------
        UncertainPlant
            With ``feedback``, ``robust_stability``, ``worst_gain`` and ``worst_rms``.

        Raises
        ------
        ModelError
            If a parameter is unknown, limits are refused, the equations are not affine in a parameter (as in places
            and directions, of order 1), polynomials miss more than a tenth of a change, or a value within the limits
            is no mechanism.

        Source: Zhou, Doyle & Glover, Robust and Optimal Control (1996), section 10.2.
        """
        from mbsvib.uncertain.plant import uncertain

        return uncertain(self, limits, order)

    def eigenvalue_sensitivities(self, parameters: Requested = None) -> Complex:
        """Return the derivatives of all eigenvalues to parameters.

        d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names; a pattern ties all that it picks to one variable (``"leg*.k.stiffness"``), a mapping gives linear
            maps, {variable: {parameter: rate}}. Default: every parameter of the system.

        Returns
        -------
        array, shape (parameters, eigenvalues)
            Derivatives [1/s per unit of the parameter], eigenvalues in the order of ``modes().eigenvalues``; those that
            coincide have the derivatives of their branches, an eigenvalue 0 that a parameter would move infinity. Not a
            number where a parameter, changed alone, takes degrees of freedom away; asked for all parameters, also
            where one by itself would be refused.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        """
        from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities

        return eigenvalue_sensitivities(self.sensitivity_basis, parameters)

    def frequency_response_sensitivities(
        self, omega: ArrayLike, parameters: Requested = None, outputs: Names = None, inputs: Names = None
    ) -> Complex:
        """Return the derivatives of the frequency response to parameters, for about one more solution a frequency.

        dG/dp = dD/dp + L^T dB/dp + dH/dp R - L^T (dK/dp + i w dC/dp - w^2 dM/dp) R

        R = T^-1 B, L = T^-T H^T, T = K + i w C - w^2 M, H = Cq + i w Cv - w^2 Ca.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s]; 0 gives the static compliance.
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (parameters, outputs, inputs, n)
            Derivatives [output unit / input unit per unit of the parameter]. Not a number where a parameter, changed
            alone, takes degrees of freedom away; asked for all parameters, also where one by itself would be refused.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        ResponseError
            If a frequency is not finite or is an undamped pole, or a port is unknown.
        """
        return self._slopes("frequency_response_sensitivities", omega, parameters, outputs, inputs)  # type: ignore[no-any-return]

    def matrix_derivatives(self, parameters: Requested = None) -> MatrixDerivatives:
        """Return the derivatives of M, C, K, B, Cq, Cv, Ca and D to parameters.

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.

        Returns
        -------
        MatrixDerivatives
            One matrix a parameter, and ``factors`` of low rank. Under load they follow the equilibrium.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        """
        result: MatrixDerivatives = self.sensitivity_basis.matrix_derivatives(parameters)
        return result

    def mode_sensitivities(self, parameters: Requested = None) -> ModeSensitivities:
        """Return the derivatives of natural frequencies, damping ratios and mode shapes to parameters.

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.

        Returns
        -------
        ModeSensitivities
            ``frequencies``, ``damped_frequencies``, ``damping_ratios``, ``eigenvalues`` and ``shapes``, one row a
            variable; shapes are differentiated on first access.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        """
        from mbsvib.sensitivities.shapes import mode_sensitivities

        return mode_sensitivities(self.sensitivity_basis, parameters)

    def compliance_sensitivities(
        self, parameters: Requested = None, outputs: Names = None, inputs: Names = None
    ) -> Array:  # fmt: skip
        """Return the derivatives of the static compliance, G(0) = Cq K^-1 B + D, to parameters.

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (parameters, outputs, inputs)
            Derivatives [output unit / input unit per unit of the parameter].

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        ResponseError
            If the mechanism is free to move, or a port is unknown.
        """
        derivatives: Complex = self._slopes("frequency_response_sensitivities", [0.0], parameters, outputs, inputs)
        return derivatives[..., 0].real

    def time_response_sensitivities(
        self, t: ArrayLike, u: ArrayLike, parameters: Requested = None, hold: str = "first",
        initial: tuple[ArrayLike, ArrayLike] | None = None,
    ) -> Array:  # fmt: skip
        """Return the derivatives of the time response to parameters; exact for inputs that are held or linear.

        Parameters
        ----------
        t : array-like, shape (n,)
            Ascending times [s].
        u : array-like, shape (inputs, n), or (n,) for a single input
            Inputs at these times.
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.
        initial : pair of array-like, shape (m,), optional
            q and q' at t[0], which no parameter changes; default: rest.

        Returns
        -------
        array, shape (parameters, outputs, n)
            Derivatives [output unit per unit of the parameter].

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system does not change smoothly with it.
        ResponseError
            If times do not ascend, shapes do not match, or the hold is unknown.
        """
        return self._slopes("time_response_sensitivities", t, u, parameters, hold, initial)  # type: ignore[no-any-return]

    def _norm(self, question: str, outputs: Names, inputs: Names, parameters: Requested) -> Norm:
        return self._slopes(question, outputs, inputs, parameters)  # type: ignore[no-any-return]


class Sensitive(SensitiveVerbs, Equations):
    """Sensitivities of everything that a system answers, to every number that it was made of."""

    @cached_property
    def basis(self) -> Basis:
        """Cached modes and derived quantities, computed on first access."""
        from mbsvib.api.modes import Modes
        from mbsvib.responses.basis import Basis

        return Basis(self, Modes)

    @cached_property
    def sensitivity_basis(self) -> SensitivityBasis:
        """Cached data of all sensitivities: the network of connections and the vectors of eigenvalues."""
        from mbsvib.sensitivities.basis import SensitivityBasis

        return SensitivityBasis(self.basis)

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
        selection = with_ports(self, outputs, inputs)
        selection.__dict__["basis"] = self.basis.with_equations(selection)
        return selection

    def _slopes(self, question: str, *arguments: Any) -> Any:
        from mbsvib.sensitivities import QUESTIONS

        return QUESTIONS[question](self.sensitivity_basis, *arguments)
