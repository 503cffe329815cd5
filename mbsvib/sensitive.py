"""What a system says of its parameters: sensitivities, as methods of ``System``."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.sensitivities.matrices import MatrixDerivatives
    from mbsvib.sensitivities.network import Network
    from mbsvib.system import System

    Complex = NDArray[np.complex128]
    Asked = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None


class Sensitive:
    """Sensitivities of everything that a system answers, to every number that it was made of."""

    @cached_property
    def _network(self) -> Network:
        from mbsvib.sensitivities.fields import complete_network

        return complete_network(cast("System", self))

    def eigenvalue_sensitivities(self, parameters: Asked = None) -> Complex:
        """Return the derivatives of all eigenvalues to parameters, without finite differences.

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
            number where a parameter, changed alone, takes degrees of freedom away.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system has forces whose derivatives are not supported.
        """
        from mbsvib.sensitivities import eigenvalue_sensitivities

        return eigenvalue_sensitivities(cast("System", self), parameters)

    def frequency_response_sensitivities(
        self, omega: ArrayLike, parameters: Asked = None, inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
    ) -> Complex:  # fmt: skip
        """Return the derivatives of the frequency response to parameters, for about one more solution a frequency.

        dG/dp = dD/dp + L^T dB/dp + dH/dp R - L^T (dK/dp + i w dC/dp - w^2 dM/dp) R

        R = T^-1 B, L = T^-T H^T, T = K + i w C - w^2 M, H = Cq + i w Cv - w^2 Ca.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s]; 0 gives the static compliance.
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.
        inputs, outputs : str or sequence of str, optional
            Names of ports; default: all.

        Returns
        -------
        array, shape (parameters, outputs, inputs, n)
            Derivatives [output unit / input unit per unit of the parameter]. Not a number where a parameter, changed
            alone, takes degrees of freedom away.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system has forces or ports whose derivatives are not supported.
        ResponseError
            If a frequency is not finite or is an undamped pole, or a port is unknown.
        """
        from mbsvib.sensitivities import frequency_response_sensitivities

        return frequency_response_sensitivities(cast("System", self), omega, parameters, inputs, outputs)

    def matrix_derivatives(self, parameters: Asked = None) -> MatrixDerivatives:
        """Return the derivatives of M, C, K, B, Cq, Cv, Ca and D to parameters, without finite differences.

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default: every parameter.

        Returns
        -------
        MatrixDerivatives
            One matrix a parameter, and ``factors`` of low rank.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system has forces or ports whose derivatives are not supported.
        """
        from mbsvib.sensitivities import matrix_derivatives

        return matrix_derivatives(cast("System", self), parameters)
