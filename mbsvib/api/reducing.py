"""Reduced models of systems."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, Self, overload

if TYPE_CHECKING:
    from mbsvib.api.state_space import StateSpace
    from mbsvib.common.selection import Names


class ReducibleSystem:
    """Equations of motion that can be reduced."""

    @overload
    def reduced(
        self, order: int | None = ..., error: float | None = ..., method: Literal["balanced"] = ..., keep: Names = ...
    ) -> StateSpace: ...

    @overload
    def reduced(
        self, order: int | None = ..., error: float | None = ..., *,
        method: Literal["modal", "static-corrected", "craig-bampton"], keep: Names = ...,
    ) -> Self: ...  # fmt: skip

    def reduced(
        self, order: int | None = None, error: float | None = None, method: str = "balanced", keep: Names = None
    ) -> Self | StateSpace:
        """Return a model with fewer states or coordinates, and a bound on the error of its frequency response.

        balanced: a state space without the states that inputs hardly reach or outputs hardly see; states that do not
        decay are kept;  modal: the equations of motion of the modes that contribute most;  static-corrected: these,
        with the static response of all others in D;  craig-bampton: displacements of outputs and of the points where
        inputs act, and modes with these held

        ``error_bound`` of the result bounds the largest singular value of G(i w) - G_reduced(i w) over all frequencies,
        output by input in SI units: of balanced models twice the sum of the Hankel singular values left out, of the
        others the norm of the difference itself. It is infinite where a mode that is left out does not decay.

        Parameters
        ----------
        order : int, optional
            Number of states (balanced) or coordinates (others).
        error : float, optional
            Largest error instead of an order: the smallest model within it is returned. Of methods other than
            "balanced", whose errors need not fall with the order, it is one that bisection finds.
        method : str
            "balanced", "modal", "static-corrected" or "craig-bampton".
        keep : str or sequence of str, optional
            Names or patterns of the outputs to keep, which the error is about; default: all.

        Returns
        -------
        StateSpace or System
            A state space of balanced states; else equations of motion with all methods of a system.

        Raises
        ------
        ResponseError
            If neither or both of order and error are given, a name is unknown, a method does not apply, or no smaller
            model is possible.

        Source: Antoulas, Approximation of Large-Scale Dynamical Systems (2005), chapter 7; Craig & Bampton, Coupling of
        substructures for dynamic analyses, AIAA Journal 6 (1968).
        """
        from mbsvib.api.state_space import StateSpace
        from mbsvib.reduction.reduced import reduced_equations, reduced_space
        from mbsvib.responses.realizations import accurate

        system: Any = self if keep is None else self[keep, :]  # type: ignore[index]
        if method != "balanced":
            result: Self = reduced_equations(system, method, order, error)  # type: ignore[assignment]
            return result
        space = replace(accurate(system.basis, StateSpace), error_bound=system.error_bound)
        return reduced_space(space, order, error)  # type: ignore[return-value]
