"""State space: first-order equations with names, and their responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed, upper
from mbsvib.common.expected import reals
from mbsvib.common.selection import Names, port_numbers, signal_names
from mbsvib.errors import ResponseError, counted
from mbsvib.responses.linear import LinearVerbs

if TYPE_CHECKING:
    from mbsvib.modes.state_modes import StateModes
    from mbsvib.responses.first_order_solver import FirstOrderSolver


@dataclass(frozen=True, repr=False, eq=False)
class StateSpace(LinearVerbs, Displayed):
    """x' = A x + B u, y = C x + D u, with names and units of states, inputs and outputs.

    ``transform`` (2m, states) recovers (q, q') = transform x + ``through`` u. ``through`` (2m, inputs) is None except
    for damped massless motions, whose rates depend directly on inputs. Of a reduced model ``error_bound`` bounds the
    largest singular value of the error of its frequency response, output by input in SI units. Arrays are read-only.
    """

    _engine = "equations kind through transform"

    kind: ClassVar[str] = "state space"
    """Tells first-order equations from other linear systems."""

    name: str
    """Name of the system that it comes from."""
    realization: str
    """Which states: physical, modal, balanced or others."""
    A: Array
    """State matrix (n, n) [1/s]."""
    B: Array
    """Input matrix (n, inputs)."""
    C: Array
    """Output matrix (outputs, n); ``system.C`` is damping."""
    D: Array
    """Direct response of outputs to inputs (outputs, inputs)."""
    transform: Array
    """Coordinates and their rates by the states (2m, n)."""
    states: tuple[str, ...]
    """Names of the states."""
    state_units: tuple[str, ...]
    """Their units."""
    inputs: tuple[str, ...]
    """Names of the inputs."""
    input_units: tuple[str, ...]
    """Their units."""
    outputs: tuple[str, ...]
    """Names of the outputs."""
    output_units: tuple[str, ...]
    """Their units."""
    through: Array | None = None
    """Coordinates and their rates by the inputs (2m, inputs), None without."""
    error_bound: float | None = None
    """Largest error of the frequency response of a reduced model, None of others."""

    def __post_init__(self) -> None:
        for array in (self.A, self.B, self.C, self.D, self.transform, self.through):
            if array is not None:
                array.setflags(write=False)

    @classmethod
    def from_arrays(
        cls, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None, states: Sequence[str] | None = None, name: str = "state space",
    ) -> Self:  # fmt: skip
        """Return a state space of matrices that come from elsewhere.

        x' = A x + B u,  y = C x + D u

        Parameters
        ----------
        A : array-like, shape (n, n)
            State matrix [1/s]; ``[]``, as B and C, for a static gain.
        B : array-like, shape (n, inputs)
            Input matrix.
        C : array-like, shape (outputs, n)
            Output matrix.
        D : array-like, shape (outputs, inputs)
            Feedthrough; 0 for none.
        inputs, outputs, states : sequence of str, optional
            Names; default: u1, u2, ...; y1, y2, ...; x1, x2, ....
        name : str
            Name for tables and figures.

        Returns
        -------
        StateSpace
            With copies of the matrices; signals have no units.

        Raises
        ------
        ResponseError
            If shapes do not match, numbers are not finite, or names are repeated.
        """
        a, b, c = (_matrix(name, label, value) for label, value in zip("ABC", (A, B, C), strict=True))
        through = np.asarray(reals(D, f"StateSpace '{name}'", "D", "a matrix of real numbers, or 0"))
        if not a.size + b.size + c.size and through.ndim == 2:  # a static gain, however empty matrices are written
            a, b, c = np.zeros((0, 0)), np.zeros((0, through.shape[1])), np.zeros((len(through), 0))
        n = len(a)
        if a.shape != (n, n) or b.shape[:1] != (n,) or c.shape[1:] != (n,):
            raise ResponseError(f"StateSpace '{name}': A has shape {a.shape}, B {b.shape}, C {c.shape}; expected "
                                f"(n, n), (n, inputs) and (outputs, n) with one number of states n.")  # fmt: skip
        shape = (len(c), b.shape[1])
        d = np.zeros(shape) if through.ndim == 0 and not through.any() else _matrix(name, "D", through)
        if d.shape != shape:
            raise ResponseError(f"StateSpace '{name}': D has shape {d.shape}; expected {shape}, a row for each output "
                                f"and a column for each input, or 0.")  # fmt: skip
        into, out, at = (_named(name, label, labels, count) for label, labels, count in
                         (("inputs", inputs, shape[1]), ("outputs", outputs, shape[0]), ("states", states, n)))
        return cls(name, "given", a, b, c, d, np.zeros((0, n)), at, ("",) * n, into, ("",) * shape[1], out,
                   ("",) * shape[0])  # fmt: skip

    @classmethod
    def from_control(cls, space: Any) -> Self:
        """Return a state space or transfer function of python-control with its names.

        Parameters
        ----------
        space : control.StateSpace or control.TransferFunction
            In continuous time. In a transfer function of several inputs and outputs, the entries of one input with
            one denominator share their states.

        Returns
        -------
        StateSpace
            With copies of the matrices.

        Raises
        ------
        ResponseError
            If it is neither, or discrete, or an improper transfer function.
        """
        from mbsvib.responses.from_control import arguments, check_continuous, is_control, is_transfer_function

        if not (is_control(space) or is_transfer_function(space)):
            raise ResponseError(f"from_control: {type(space).__name__}; expected a control.StateSpace "
                                f"or control.TransferFunction.")  # fmt: skip
        check_continuous(space)
        return cls.from_arrays(**arguments(space))

    @cached_property
    def _solver(self) -> FirstOrderSolver:
        from mbsvib.responses.first_order_solver import first_order_solver

        return first_order_solver(self.A, self.B, self.C, self.name)

    @cached_property
    def _decays(self) -> bool:
        from mbsvib.linalg.spectrum import spectrum

        return bool(spectrum(self.A).decaying.all())

    def state_space(self, realization: str | None = None) -> Self:
        """Return these equations.

        Parameters
        ----------
        realization : str, optional
            That of these equations; no other one is computed.

        Returns
        -------
        StateSpace
            This object.

        Raises
        ------
        ResponseError
            If another realization is asked for.
        """
        if realization not in (None, self.realization):
            raise ResponseError(f"state_space: realization = {realization!r}; '{self.name}' is a state space whose "
                                f"states are {self.realization!r}. Ask the system for other states.")  # fmt: skip
        return self

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
        from mbsvib.equations.selection import port_fields

        o, i = port_numbers(outputs, inputs, (self.outputs, self.inputs), self.name)
        through = None if self.through is None else self.through[:, i]
        return replace(self, B=self.B[:, i], C=self.C[o], through=through, **port_fields(self, o, i))

    def modes(self) -> StateModes:
        """Return the eigenvalues of A mode by mode: natural frequencies, damping ratios, shapes of the states.

        Returns
        -------
        StateModes
            Printed as a table.
        """
        from mbsvib.modes.state_modes import state_modes

        return state_modes(self.A, self.name, self.states)

    def poles(self) -> Complex:
        """Return the eigenvalues of A.

        Returns
        -------
        array, shape (states,)
            Poles [1/s] in ascending magnitude.
        """
        return self.modes().eigenvalues.copy()

    def _response(self, part: StateSpace, w: Array) -> Complex:
        from mbsvib.linalg.lasting import separated
        from mbsvib.responses.first_order_solver import check_poles, first_order_solver

        if not self._decays:
            parts = separated(part.A, part.B, part.C)
            check_poles(w, parts, self.name)
            if len(parts.shown) < len(parts.lasting):
                rest = parts.minimal
                solver = first_order_solver(rest.a, rest.b, rest.c, self.name)
                return solver.frequency_response(w, rest.b, rest.c, part.D)
        return self._solver.frequency_response(w, part.B, part.C, part.D)

    def _over_time(self, part: StateSpace, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
        from mbsvib.responses.first_order_solver import time_response

        return time_response((part.A, part.B, part.C, part.D), part.inputs, record)

    def __repr__(self) -> str:
        groups = ((self.states, "state"), (self.inputs, "input"), (self.outputs, "output"))
        counts = ", ".join(counted(len(names), noun) for names, noun in groups)
        bound = "" if self.error_bound is None else f", error at most {upper(self.error_bound)}"
        return f"StateSpace({self.name!r}, {self.realization}: {counts}{bound})"


def _matrix(name: str, label: str, value: Any) -> Array:
    array = np.array(reals(value, f"StateSpace '{name}'", label, "a matrix of real numbers"), ndmin=2)
    if array.ndim != 2 or not np.isfinite(array).all():
        raise ResponseError(f"StateSpace '{name}': {label} has shape {array.shape}; expected a matrix of finite "
                            f"numbers.")  # fmt: skip
    return array


def _named(name: str, label: str, labels: Sequence[str] | None, count: int) -> tuple[str, ...]:
    return signal_names(labels, count, label, f"StateSpace '{name}'")
