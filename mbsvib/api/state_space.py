"""State spaces as users get them: with their responses, reduced, and with loops closed."""

from __future__ import annotations

from typing import Self

from mbsvib.api.connecting import Connecting
from mbsvib.api.elsewhere import FUNCTIONS, tell_functions
from mbsvib.common.arrays import Array
from mbsvib.common.display import upper
from mbsvib.common.selection import Names
from mbsvib.common.tables import listed
from mbsvib.errors import counted
from mbsvib.random.verbs import RandomVerbs
from mbsvib.responses import state_space


class StateSpace(Connecting, RandomVerbs, state_space.StateSpace):
    """x' = A x + B u, y = C x + D u, with names and units of states, inputs and outputs.

    ``transform`` (2m, states) recovers (q, q') = transform x + ``through`` u. ``through`` (2m, inputs) is None except
    for damped massless motions, whose rates depend directly on inputs. Arrays are read-only. ``from_arrays`` makes one
    of matrices.
    """

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

        check_first_order(self.name, method)
        space = self if keep is None else self[keep, :]
        return reduced_space(space, order, error)  # type: ignore[return-value]

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

        return hankel_singular_values(self)

    def explain(self) -> str:
        """Return in words what realization it is and, of a reduced model, how large its error is at most."""
        lines = [f"{self.name}: {counted(len(self.states), 'state')}, realization {self.realization!r}"]
        if self.error_bound is not None:
            lines.append(f"  the frequency response differs by {upper(self.error_bound)} at most from that of the full "
                         f"model, as its largest singular value, output by input in SI units")  # fmt: skip
        lines.append(f"  states: {listed(self.states) or 'none'}")
        return "\n".join(lines)


tell_functions(StateSpace, FUNCTIONS, "space")
