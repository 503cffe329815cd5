"""Reduced models of state spaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:

    from mbsvib.common.arrays import Array
    from mbsvib.common.selection import Names



class ReducibleSpace:
    """State spaces that can be reduced."""

    def reduced(
        self, order: int | None = None, error: float | None = None, method: str = "balanced", keep: Names = None
    ) -> Self:
        """Return a state space with fewer states by balanced truncation, with a bound on its error.

        max over omega of sigma(G(i w) - G_reduced(i w)) <= ``error_bound``

        The bound includes rounding of these states. At frequencies far below all poles that decay, or next to a pole
        on the imaginary axis, both responses are large, and rounding of these is not in it.

        Parameters
        ----------
        order : int, optional
            Number of states; those that do not decay are kept if they are controllable and observable.
        error : float, optional
            Largest error instead of an order, output by input in SI units.
        method : str
            "balanced"; the other methods of ``System.reduced`` need equations of motion.
        keep : str or sequence of str, optional
            Names or patterns of the outputs to keep, which the error is about; default: all.

        Returns
        -------
        StateSpace
            With states hankel1, hankel2, ...

        Raises
        ------
        ResponseError
            If neither or both of order and error are given, a name is unknown, the method is another one, no smaller
            model is possible, or rounding of the states alone exceeds the error.
        """
        from mbsvib.reduction.reduced import check_first_order, reduced_space

        check_first_order(self.name, method)  # type: ignore[attr-defined]
        space: Any = self if keep is None else self[keep, :]  # type: ignore[index]
        result: Self = reduced_space(space, order, error)  # type: ignore[assignment]
        return result

    def hankel_singular_values(self) -> Array:
        """Return the Hankel singular values of the states that decay, in descending order.

        sigma_i = sqrt(lambda_i(P Q)), of the controllability and the observability Gramian

        Returns
        -------
        array, shape (n,)
            Positive values, output by input in SI units; the first is the Hankel norm.

        Raises
        ------
        ResponseError
            If the Gramians do not converge.

        Source: Antoulas, Approximation of Large-Scale Dynamical Systems (2005), section 5.4.
        """
        from mbsvib.reduction.reduced import hankel_singular_values

        return hankel_singular_values(self)  # type: ignore[arg-type]
