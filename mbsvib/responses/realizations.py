"""First-order equations of a mechanism: x' = A x + B u, y = C x + D u with physical, modal or balanced states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar, cast

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.common.expected import one_of
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.modes.damped import Damped
from mbsvib.modes.general import General, is_general
from mbsvib.responses.basis import Basis
from mbsvib.responses.energy_schur import ModalStates, energy_matrix, last, zeros_of_lasting_states
from mbsvib.responses.feedthrough import accelerations, feedthrough, of_first_order
from mbsvib.responses.first_order import RATE_UNITS, physical
from mbsvib.responses.state_space import StateSpace

REALIZATIONS = ("physical", "modal", "balanced")
S = TypeVar("S", bound=StateSpace)


def state_space(basis: Basis, realization: str = "physical", form: type[S] = StateSpace) -> S:  # type: ignore[assignment]
    """Return first-order equations of a system.

    physical: x = (q, q'), A = [[0, 1], [-M^-1 K, -M^-1 C]];
    modal: x = (z1, z1', z2, z2', ...) with one block [[0, 1], [-l1 l2, l1 + l2]] for each mode's eigenvalues l1, l2
    (one state for a mode of first order);
    balanced: the physical states scaled by powers of two, so that rows and columns of A, B and C are of like size.

    The equations are proper, with as many states as eigenvalues. Damped massless motions have no rates among the
    states: the physical states are then q and the rates that move mass (``"d(node.z + body.z)/dt"`` if a rate is a
    sum).
    """
    if one_of(realization, REALIZATIONS, "state_space", "realization") == "balanced":
        return balanced_states(state_space(basis, "physical", form))
    system = basis.equations
    if system.massless or (realization == "modal" and is_general(system)):
        return _massless(basis, realization, form)
    a, b, transform, names, units = _physical(system) if realization == "physical" else _modal(basis)
    m = system.dof
    q, rate = transform[:m], transform[m:]
    # q'' = T' A x + T' B u with T' the rows of q', whatever the states are
    c = system.Cq @ q + system.Cv @ rate + system.Ca @ (rate @ a)
    if realization == "modal":
        b, c = _zeros(system, cast("Damped", basis.response_modes.damped), transform, b, c)
    d = feedthrough(system)
    return form(system.name, realization, a, b, c, d, transform, names, units, system.inputs, system.input_units,
                system.outputs, system.output_units)  # fmt: skip


def accurate(basis: Basis, form: type[S] = StateSpace) -> S:  # type: ignore[assignment]
    """Return modal states, in which slow modes beside fast ones lose no digits; balanced ones of modes that depend on
    each other.
    """
    try:
        return state_space(basis, "modal", form)
    except ResponseError:
        return state_space(basis, "balanced", form)


def first_order(linear: Any) -> Any:
    """Return first-order equations of a system in its most accurate states, of a state space or a loop as they are."""
    return accurate(linear.basis) if linear.kind == "system" else linear.state_space()


def balanced_states(space: S) -> S:
    """Return the same equations in states scaled by powers of two, which their units include (``"2^-13 rad"``)."""
    from mbsvib.linalg.balancing import balanced

    a, b, c, transform, power = balanced(space.A, space.B, space.C, space.transform)
    units = tuple(f"2^{k} {unit}" if k else unit for k, unit in zip(power.tolist(), space.state_units, strict=True))
    return replace(space, realization="balanced", A=a, B=b, C=c, transform=transform, state_units=units)


def _massless(basis: Basis, realization: str, form: type[S]) -> S:
    from mbsvib.responses.general_responses import modal_states

    system = basis.equations
    modal = basis.modal if realization == "modal" else None
    reduced = modal_states(system, modal) if isinstance(modal, General) else physical(system)
    m = system.dof
    q, rate = reduced.transform[:m], reduced.transform[m:]
    # linearize ensures that no output depends on the rate of an input
    seen, rates = reduced.accelerations(system)
    parts = system.Cq @ q, system.Cv @ rate, seen @ (rates @ reduced.a)
    b, c = reduced.b, parts[0] + parts[1] + parts[2]
    if reduced.modal is not None:
        columns = reduced.modal.columns
        back = np.linalg.inv(columns)
        b, c = zeros_of_lasting_states(reduced.modal, b, c, [(part @ back, columns) for part in parts])
    d = of_first_order(system, reduced if reduced.modal is None else None)
    return form(
        system.name, realization, reduced.a, b, c, d, reduced.transform, reduced.names, reduced.units,
        system.inputs, system.input_units, system.outputs, system.output_units,
        reduced.through if system.massless else None,
    )  # fmt: skip


def _physical(system: Equations) -> tuple[Array, Array, Array, tuple[str, ...], tuple[str, ...]]:
    m = system.dof
    a = np.zeros((2 * m, 2 * m))
    b = np.zeros((2 * m, system.B.shape[1]))
    if m:
        solution = accelerations(system, np.concatenate((system.K, system.C, system.B), axis=1))
        a[:m, m:] = np.eye(m)
        a[m:] = -solution[:, : 2 * m]
        b[m:] = solution[:, 2 * m :]
    names = (*system.coordinates, *(f"d({name})/dt" for name in system.coordinates))
    units = (*system.coordinate_units, *(RATE_UNITS.get(unit, "") for unit in system.coordinate_units))
    return a, b, np.eye(2 * m), names, units


def _modal(basis: Basis) -> tuple[Array, Array, Array, tuple[str, ...], tuple[str, ...]]:
    system, modes = basis.equations, basis.response_modes
    modal = cast("Damped", modes.damped)
    m = system.dof
    product = (modes.eigenvalues[0::2] * modes.eigenvalues[1::2]).real
    total = (modes.eigenvalues[0::2] + modes.eigenvalues[1::2]).real
    even = 2 * np.arange(m)
    a = np.zeros((2 * m, 2 * m))
    a[even, even + 1] = 1.0
    a[even + 1, even] = -product
    a[even + 1, even + 1] = total
    transform: Array = np.zeros((2 * m, 2 * m))
    b: Array = np.zeros((2 * m, system.B.shape[1]))
    if modal.vectors is None:
        phi = modal.shapes
        transform[:m, even] = phi
        transform[m:, even + 1] = phi
        b[even + 1] = phi.T @ system.B
    else:
        change = np.zeros((2 * m, 2 * m))
        change[:m, :m] = change[m:, m:] = modal.shapes
        forces = np.concatenate((np.zeros_like(b[:m]), modal.shapes.T @ system.B))
        local, b = _blocks(modal, a, forces, system.name)
        transform = change @ local
    names = tuple(f"mode{i + 1}{rate}" for i in range(m) for rate in ("", "'"))
    return a, b, transform, names, ("modal", "modal/s") * m


def _zeros(system: Equations, modal: Damped, transform: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """B and C of modal states, ``transform`` (2m, 2m), with zeros for what is rounding in modes that last."""
    lasting = np.repeat(last(modal.pairs).any(axis=1), 2)
    if not lasting.any():
        return b, c
    m = len(modal.square)
    scale, a = energy_matrix(modal)
    into = modal.shapes.T @ system.M
    columns = np.concatenate((scale[:, None] * (into @ transform[:m]), into @ transform[m:]))
    rates = [rows @ modal.shapes for rows in (system.Cq, system.Cv, system.Ca)]
    seen = [(rates[0] / scale, columns), (rates[1], columns), (rates[2], a @ columns)]
    return zeros_of_lasting_states(ModalStates(columns, modal.shapes.T @ system.B, lasting), b, c, seen)


def _blocks(modal: Damped, a: Array, forces: Array, name: str) -> tuple[Array, Array]:
    """Columns T that transform the state matrix to companion blocks ``a`` (sets those of close pairs), and inputs B."""
    from mbsvib.responses.modal_blocks import modal_inputs, pair_block

    m = len(modal.square)
    result = np.zeros((2 * m, 2 * m))
    assert modal.vectors is not None
    scale, matrix = energy_matrix(modal)
    size = np.concatenate((scale, np.ones(m)))
    for k, (first_value, second_value) in enumerate(modal.pairs):
        first, second = modal.vectors[:, k, 0], modal.vectors[:, k, 1]
        if first_value == second_value == 0.0:  # an undamped rigid-body mode: z and z' themselves
            result[:m, 2 * k], result[m:, 2 * k + 1] = scale * first.real, first.real
            continue
        v1 = np.concatenate((scale * first, first_value * first))
        v2 = np.concatenate((scale * second, second_value * second))
        at = slice(2 * k, 2 * k + 2)
        a[at, at], result[:, at] = pair_block(
            matrix, (first_value, second_value), (v1, v2), f"mode{k + 1}", name)  # fmt: skip
    inputs = modal_inputs(matrix, a, result, [2] * m, forces, [f"mode{k // 2 + 1}" for k in range(2 * m)], name)
    return result / size[:, None], inputs
