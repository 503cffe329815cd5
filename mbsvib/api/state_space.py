"""State spaces as users get them: with their responses, and with loops closed."""

from __future__ import annotations

from mbsvib.api.connecting import Connecting
from mbsvib.api.reducing_space import ReducibleSpace
from mbsvib.random.verbs import RandomVerbs
from mbsvib.responses import state_space


class StateSpace(Connecting, ReducibleSpace, RandomVerbs, state_space.StateSpace):
    """x' = A x + B u, y = C x + D u, with names and units of states, inputs and outputs.

    ``transform`` (2m, states) recovers (q, q') = transform x + ``through`` u. ``through`` (2m, inputs) is None except
    for damped massless motions, whose rates depend directly on inputs. Arrays are read-only. ``from_arrays`` makes one
    of matrices.
    """

    def explain(self) -> str:
        """Return in words what realization it is and, of a reduced model, how large its error is at most."""
        from mbsvib.explain.state_space import explain

        return explain(self)
