"""The transfer functions of all pairs in the form from which the page computes its curves.

G(s) = sum over rows r of an output of s^o_r  c_r (s - A)^-1 B + D,  A in blocks of one or two states, or triangular

The modal form is exact for critically damped modes too, as their block is no pair of residues. Where modal states
depend on each other, A is a complex Schur form instead.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, schur, solve_banded, solve_triangular

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import part_numbers
from mbsvib.responses.general_terms import cleaned
from mbsvib.responses.state_space import StateSpace

Ports = tuple[Sequence[int], Sequence[int]]

# Largest difference from the response of the system, relative to the largest value of the curve, that modal states may
# have: those of a form whose states are nearly dependent are larger, and no figure shows this one.
ACCURATE = 1e-10
# Frequencies at which a form is compared with the system: some to each side of all scales of a mechanism.
COMPARED = 48
NO_SUMS = np.zeros((0, 0)), np.zeros((0, 0))


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """x' = a x + b u; outputs are sums of ``rows`` x, differentiated ``order`` times, and d u.

    ``blocks``: sizes of the diagonal blocks of ``a``, none where it is triangular. ``rows`` (rows, n), with ``order``
    and ``output`` of each. ``starts`` (rows, inputs): D of rows of order 2. ``ends`` (rows, inputs): limit at infinity
    of s^2 times the transfer function of the row before it is differentiated, plus D in rows of order 2. Both are empty
    where outputs are sums of states as they are. ``error``: largest difference from the response of the system.
    """

    blocks: tuple[int, ...]
    a: NDArray[Any]
    b: NDArray[Any]
    rows: NDArray[Any]
    order: NDArray[np.intp]
    output: NDArray[np.intp]
    starts: Array
    ends: Array
    d: Array
    error: float

    def packed(self) -> dict[str, Any]:
        """Return the form for JSON: 64-bit floats, little-endian, in base64."""
        starts = np.cumsum((0, *self.blocks))[:-1]
        own = [self.a[i : i + k, i : i + k] for i, k in zip(starts.tolist(), self.blocks, strict=True)]
        a = np.concatenate([block.ravel() for block in own]) if own else self.a[np.triu_indices(len(self.a))]
        return {"states": len(self.a), "blocks": list(self.blocks), "a": doubles(a), "b": doubles(self.b),
                "rows": doubles(self.rows), "order": self.order.tolist(), "output": self.output.tolist(),

                "starts": doubles(self.starts), "ends": doubles(self.ends), "d": doubles(self.d),
                "error": self.error}  # fmt: skip


def doubles(values: NDArray[Any]) -> str:
    """Return an array as base64 of 64-bit floats, little-endian; complex numbers are two of them."""
    kind = "<c16" if np.iscomplexobj(values) else "<f8"
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def form_of(
    system: Any, ports: Ports, omega: Array, response: Complex, counted: NDArray[np.bool_]
) -> Form:  # fmt: skip
    """Return the modal form of a system if it is accurate, else the better of it and the triangular form.

    ``ports``: numbers of the outputs and inputs to keep. ``omega`` (n,): angular frequencies [rad/s] of ``response``
    (kept outputs, kept inputs, n). ``counted`` (kept outputs, kept inputs): whether the response of a pair is more than
    rounding.
    """
    o, i = ports
    best: Form | None = None
    ways: tuple[Callable[[], Form | None], ...] = (
        lambda: _modal(system, o, i), lambda: _triangular(_states(system), o, i),
    )  # fmt: skip
    for way in ways:
        form = way()
        if form is None:
            continue
        size = np.maximum(np.abs(response).max(axis=2, initial=0.0), np.finfo(float).tiny)
        off = np.abs(_at(form, np.asarray(1j * omega, dtype=complex)) - response).max(axis=2, initial=0.0) / size
        error = float(np.where(np.isfinite(off), off, 1e300)[counted].max(initial=0.0))
        form = replace(form, error=error)
        if best is None or error < best.error:
            best = form
        if error <= ACCURATE:
            break
    assert best is not None
    return best


def _modal(system: Any, o: Sequence[int], i: Sequence[int]) -> Form | None:
    if getattr(system, "basis", None) is None:
        return None
    try:
        space: StateSpace = system.state_space("modal")
    except ResponseError:
        return None
    return _blocks(system, space, o, i)


def _states(system: Any) -> StateSpace:
    space: StateSpace = (
        system.state_space() if getattr(system, "basis", None) is None else system.state_space("physical")
    )
    return space


def _blocks(system: Any, space: StateSpace, o: Sequence[int], i: Sequence[int]) -> Form | None:
    """Modal states, each output split into rows by how often a displacement is differentiated."""
    n = len(space.A)
    member = part_numbers(space.A != 0.0)
    starts = np.flatnonzero(np.diff(member, prepend=-1))
    sizes = np.diff(np.append(starts, n))
    if len(starts) != len(np.unique(member)) or sizes.max(initial=0) > 2:
        return None
    if space.through is not None:  # rates follow inputs directly: outputs as they are
        rows, order, output = space.C[o], np.zeros(len(o), dtype=np.intp), np.arange(len(o))
        return Form(tuple(sizes.tolist()), space.A, space.B[:, i], rows, order, output, *NO_SUMS,
                    space.D[np.ix_(o, i)], 0.0)  # fmt: skip
    rates = [c[o] for c in (system.Cq, system.Cv, system.Ca)]
    order, output = np.nonzero([c.any(axis=1) for c in rates])
    motion = np.array(rates)[order, output]
    rows, rate = motion @ space.transform[: system.dof], space.transform[system.dof :]
    b, d = space.B[:, i], space.D[np.ix_(o, i)]
    feedthrough = np.asarray(system.D)[np.ix_(o, i)]
    direct = np.where((order == 2)[:, None], feedthrough[output], 0.0)
    accelerates = np.zeros(len(o), dtype=bool)
    accelerates[output[order == 2]] = True
    return Form(tuple(sizes.tolist()), space.A, b, rows, order, output, direct, cleaned(motion, rate, b, direct=direct),
                np.where(accelerates[:, None], 0.0, d), 0.0)  # fmt: skip


def _triangular(space: StateSpace, o: Sequence[int], i: Sequence[int]) -> Form:
    balanced, (scale, _) = matrix_balance(space.A, permute=False, separate=True)
    a, vectors = schur(balanced, output="complex")
    rows, b = (space.C[o] * scale) @ vectors, vectors.conj().T @ (space.B[:, i] / scale[:, None])
    return Form((), a, b, rows, np.zeros(len(o), dtype=np.intp), np.arange(len(o)),
                *NO_SUMS, space.D[np.ix_(o, i)], 0.0)  # fmt: skip


def _at(form: Form, s: Complex) -> Complex:
    """G(s), shape (outputs, inputs, n), by linear solutions."""
    result = np.repeat(form.d[:, :, None].astype(complex), len(s), axis=2)
    for k, point in enumerate(s.tolist()):
        part = form.rows @ _solution(form, point)
        for r, (order, output) in enumerate(zip(form.order.tolist(), form.output.tolist(), strict=True)):
            result[output, :, k] += point**order * part[r]
            if order == 2:
                result[output, :, k] += form.starts[r]
    return result


def _solution(form: Form, s: complex) -> Complex:
    """(s - A)^-1 B: blocks by banded elimination, triangles by substitution; infinite at a pole."""
    n = len(form.a)
    try:
        if not form.blocks:
            return np.asarray(solve_triangular(s * np.eye(n) - form.a, form.b))
        bands = np.zeros((3, n), dtype=complex)
        bands[0, 1:], bands[1], bands[2, :-1] = -np.diag(form.a, 1), s - np.diag(form.a), -np.diag(form.a, -1)
        return np.asarray(solve_banded((1, 1), bands, form.b.astype(complex)))
    except np.linalg.LinAlgError:
        return np.full(form.b.shape, np.inf + 0j)
