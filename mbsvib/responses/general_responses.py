"""Responses of systems with unsymmetric matrices or massless motions, from right and left vectors.

(s^2 M + s C + K)^-1 is the sum of x y^T / (theta (s - lambda)) over all eigenvalues but 0, theta = y^T (2 lambda M + C)
x, and of X (s - J)^-1 Y^T for the eigenvalue 0, on whose invariant subspace A is the nilpotent J. Far above all
eigenvalues it is E1 / s + E2 / s^2 with E1 = S F, which only massless motions have, and E2 = S A F, which is M^-1 where
there are none. The equations themselves are solved, frequency by frequency, where eigenvectors are nearly dependent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.memory import BATCH_BYTES
from mbsvib.equations.equations import Equations
from mbsvib.equations.unresisted_motion import independent_coordinates
from mbsvib.errors import ResponseError
from mbsvib.linalg.rank import EPS
from mbsvib.modes.energy_state import EnergyState
from mbsvib.modes.general import General, rigid_shapes
from mbsvib.responses.energy_schur import ModalStates, last
from mbsvib.responses.first_order import FirstOrder
from mbsvib.responses.general_terms import asymptotic_terms, cleaned
from mbsvib.responses.modal_blocks import modal_inputs, pair_block
from mbsvib.responses.modal_sum import general_motions

# Residual up to which the sum over modes is used: rounding of some hundred modes; the second value if the alternative
# is refined solutions.
BACKWARD, SUMMED = 5e-14, 8.0 * EPS
SERIES_STIFFNESS = 1e3  # largest ratio of springs in series with dampers to the static stiffness
CHECKED = 3  # frequencies next to the most ill-conditioned eigenvalues at which the residual is computed


@dataclass(frozen=True, slots=True)
class Realization:
    """x' = A x + ``b`` u, y = ``c`` x + ``d`` u in the states of ``EnergyState``."""

    a: Array
    b: Array
    c: Array
    d: Array


def realization(system: Equations, state: EnergyState) -> Realization:
    """Return the first-order equations in energy coordinates. A feedthrough that is 0 up to rounding is exactly 0."""
    rate = state.show @ state.a
    e1, e2 = asymptotic_terms(state)
    seen, b = _in_basis(system, state)
    c = system.Cq @ state.show + system.Cv @ rate + seen @ (state.motion @ state.a @ state.a)
    improper = cleaned(seen, e1, b)
    if improper.any():
        i, j = np.argwhere(improper)[0]
        raise ResponseError(
            f"output '{system.outputs[i]}': an acceleration of a motion without mass is the derivative of input "
            f"'{system.inputs[j]}', which no proper system has; give the body it is measured on a mass, or ask for "
            f"its velocity."
        )
    d = system.D + cleaned(system.Cv @ state.basis, e1, b)
    d = cleaned(seen, e2, b, direct=system.D) + (d - system.D)
    return Realization(state.a, state.force @ system.B, c, d)


def _in_basis(system: Equations, state: EnergyState) -> tuple[Array, Array]:
    """Accelerations that outputs see (outputs, m) and forces of inputs (m, inputs) in the basis, with zeros where
    massless motions are not seen or not driven.
    """
    seen, b, null = system.Ca @ state.basis, state.basis.T @ system.B, system.null_inertia
    if null is not None:
        p = len(state.scale)
        share = state.basis[independent_coordinates(null)[0], p:]
        seen[:, p:], b[p:] = cleaned(system.Ca, null) @ share, share.T @ cleaned(null.T, system.B)
    return seen, b


def summable(modal: General) -> bool:
    """Tell whether a sum over modes has terms for all eigenvalues: no chain of 0 longer than two, no defective pair."""
    return not modal.state.long and bool(modal.spectrum.slopes.all())


def trusted(modal: General, b: Array, w: Array, residual: float = BACKWARD) -> bool:
    """Tell whether the sum over modes solves the equations, at a few frequencies next to the worst eigenvalues.

    ``b`` (m, inputs): inputs in the basis. ``w`` (n,) [rad/s]: none negative. ``residual``: largest one, relative to
    the terms.
    """
    if not summable(modal):
        return False
    inside = w[w > 0.0]
    if not len(inside) or not b.size:
        return True
    spectrum = modal.spectrum
    speed = np.abs(spectrum.values)
    # vectors have unit energy: in energy coordinates the condition is the energy over |lambda theta|
    worst = speed[np.argsort(np.abs(spectrum.slopes) * speed, kind="stable")[:CHECKED]]
    at = np.unique([*np.abs(inside - worst[:, None]).argmin(axis=1), len(inside) // 2, 0])
    s: Complex = 1j * inside[at]
    mixed = b @ np.cos(np.arange(b.shape[1]))[:, None]
    answer = general_motions(modal, mixed).at(s)
    with np.errstate(invalid="ignore"):
        return bool((_residual(modal.state, s, mixed, answer) <= residual).all())


def _residual(state: EnergyState, s: Complex, b: Array, eta: Complex) -> Array:
    """Residual of the equations relative to their terms, each row in its own scale, (n,)."""
    p, m = len(state.scale), len(state.basis)
    result = np.empty(len(s))
    for i, point in enumerate(s.tolist()):
        matrix = _matrix(state, np.array([point]))[0]
        size = np.ones(m)
        size[:p] = np.abs(state.square) + abs(point) ** 2
        size[p:] = np.maximum(np.abs(matrix[p:, p:]).max(axis=1, initial=0.0), EPS)
        amplitudes = eta[:, :, i]
        residual = np.abs(b - matrix @ amplitudes) / size[:, None]
        terms = np.maximum(np.abs(b), np.abs(matrix) @ np.abs(amplitudes)) / size[:, None]
        scale = np.maximum(terms, np.abs(amplitudes)).max(axis=0)
        result[i] = np.divide(residual.max(axis=0), scale, out=np.zeros_like(scale), where=scale > 0.0).max()
    return result


def _matrix(state: EnergyState, s: Complex) -> Complex:
    """s^2 M + s C + K in the basis, (n, m, m); differences as products where s is imaginary."""
    p = len(state.scale)
    result = s[:, None, None] * state.damping + state.coupling
    at, root = np.arange(p), np.sqrt(np.abs(state.square))
    point = s[:, None]
    inertial = np.where(state.square >= 0.0, (point + 1j * root) * (point - 1j * root), (point - root) * (point + root))
    result[:, at, at] += inertial
    return np.asarray(result)


def solved(system: Equations, state: EnergyState, s: Complex) -> Complex:
    """Return the transfer matrix (outputs, inputs, n) by one factorisation a point ``s`` (n,); NaN at singular ones."""
    b = (state.basis.T @ system.B).astype(complex)
    outputs = [c @ state.basis for c in (system.Cq, system.Cv, system.Ca)]
    result: Complex = np.empty((len(system.outputs), b.shape[1], len(s)), dtype=complex)
    batch = max(1, BATCH_BYTES // (16 * max(1, len(b)) ** 2))
    for start in range(0, len(s), batch):
        part = s[start : start + batch]
        eta = _solutions(_matrix(state, part), b)
        powers = part[:, None, None]
        value = outputs[0] @ eta + powers * (outputs[1] @ eta + powers * (outputs[2] @ eta))
        result[:, :, start : start + batch] = value.transpose(1, 2, 0) + system.D[:, :, None]
    return result


def cancels(system: Equations, state: EnergyState) -> bool:
    """Tell whether most of a stiffness is that of springs in series with dampers, which resist hardly any static load.

    That is, whether more than three digits cancel in the static stiffness; False for unsymmetric equations.
    """
    p = len(state.scale)
    if not state.massless or system.gyroscopic is not None or system.circulatory is not None:
        return False
    block, joined = state.coupling[p:, p:], state.coupling[p:, :p]
    correction = np.einsum("kp,kp->p", joined, np.linalg.lstsq(block, joined, rcond=None)[0])
    return bool((SERIES_STIFFNESS * np.abs(state.square - correction) < correction).any())


def refined_solutions(system: Equations, state: EnergyState, w: Array) -> Complex:
    """Return the transfer matrix (outputs, inputs, n) by solutions that are refined in twice the working precision.

    ``w`` (n,) [rad/s]: none negative. Not a number where the equations are singular.
    """
    from mbsvib.responses.refined import Factors, refined

    result: Complex = np.empty((*system.D.shape, len(w)), dtype=complex)
    size = max(1, BATCH_BYTES // (64 * len(state.basis) * (len(state.basis) + len(system.elastic_rows))))
    outputs = [(order, rows) for order, rows in enumerate((system.Cq, system.Cv, system.Ca)) if rows.any()]
    for start in range(0, len(w), size):
        part = w[start : start + size]
        matrix = _matrix(state, (1j * part).astype(complex, copy=False))

        def solve(load: Complex, matrix: Complex = matrix) -> Complex:
            right = np.ascontiguousarray(load.transpose(2, 0, 1))
            return np.ascontiguousarray(_solutions(matrix, right).transpose(1, 2, 0))

        load = np.broadcast_to(system.B[:, :, None], (*system.B.shape, len(part))).astype(complex)
        transfer = refined(Factors.of(system, part), state.basis, load, (outputs, system.D), solve)
        result[:, :, start : start + size] = transfer.value
    return result


def _solutions(matrices: Complex, right: Complex) -> Complex:
    """Solutions of several systems (n, m, m) with right sides (m, k) or (n, m, k); NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full((1, *right.shape[-2:]), np.nan, dtype=complex)
        each = np.broadcast_to(right, (len(matrices), *right.shape[-2:]))
        return np.concatenate([_solutions(*pair) for pair in zip(matrices[:, None], each[:, None], strict=True)])


def modal_states(system: Equations, modal: General) -> FirstOrder:
    """Return first-order equations in modal states.

    Each mode has a block [[0, 1], [-l1 l2, l1 + l2]] of its eigenvalues l1, l2; one of first order has the block l1,
    two motions without stiffness that come to rest have [[0, 0], [0, 0]], and two others of first order with equal
    eigenvalues, which are paired as a mode, have [[l1, 0], [0, l2]].
    """
    state = modal.state
    blocks, columns, names, lasting = [], [], [], []
    if state.long:
        blocks.append(state.nilpotent)
        columns.append(state.right)
        names += [f"rigid{i + 1}" for i in range(len(state.nilpotent))]
        lasting += [True] * len(state.nilpotent)
    for i, block, pair in _blocks(modal, system.name):
        blocks.append(block)
        columns.append(pair)
        names += [f"mode{i + 1}{rate}" for rate in ("", "'")[: len(block)]]
        lasting += [bool(last(modal.pairs[i]).any())] * len(block)
    n = len(state.a)
    a, right = np.zeros((n, n)), np.concatenate(columns, axis=1) if columns else np.zeros((n, n))
    start = 0
    for block in blocks:
        a[start : start + len(block), start : start + len(block)] = block
        start += len(block)
    forces = state.force @ system.B
    b = modal_inputs(state.a, a, right, [len(block) for block in blocks], forces, names, system.name)
    back = np.concatenate((state.show, state.show @ state.a))
    through = np.concatenate((np.zeros_like(system.B), state.show @ forces))
    units = tuple(["modal/s" if name.endswith("'") else "modal" for name in names])
    transform, carried = back @ right, None
    if system.null_inertia is not None:
        independent, dependent = independent_coordinates(system.null_inertia)
        rate = transform[system.dof :]
        carried = cleaned(-system.null_inertia[dependent], rate[independent], direct=rate[dependent])
    return FirstOrder(a, b, transform, through, tuple(names), units, carried,
                      ModalStates(right, forces, np.array(lasting, dtype=bool)))  # fmt: skip


def _blocks(modal: General, name: str) -> list[tuple[int, Array, Array]]:
    """Number, block and columns in the states of each mode, except for long chains of the eigenvalue 0."""
    state, spectrum = modal.state, modal.spectrum
    rest, drift = rigid_shapes(state)
    rigid = [state.position @ column for column in rest.T]
    vectors = state.position @ spectrum.right + state.rate @ (spectrum.right * spectrum.values)
    result: list[tuple[int, Array, Array]] = []
    for i, (first_value, second_value) in enumerate(modal.pairs):
        numbers = np.nonzero(modal.mode == i)[0]
        numbers = numbers[np.argsort(np.abs(spectrum.values[numbers]), kind="stable")]
        if state.long and (first_value == 0.0 or second_value == 0.0):
            continue
        if i < drift.shape[1]:
            chain = state.right[:, state.null_count + i]
            columns = np.stack((state.position @ drift[:, i], chain), axis=1)
            result.append((i, np.array([[0.0, 1.0], [0.0, 0.0]]), columns))
        elif not len(numbers):
            count = 1 if modal.single[i] else 2
            result.append((i, np.zeros((count, count)), np.stack([rigid.pop(0) for _ in range(count)], axis=1)))
        elif modal.single[i]:
            result.append((i, np.array([[first_value.real]]), vectors[:, numbers].real))
        else:
            if first_value == 0.0:
                same = [k for k, v in enumerate(rigid) if np.array_equal(v, state.position @ modal.shapes[:, i].real)]
                first, second = rigid.pop(same[0]).astype(complex), vectors[:, numbers[0]]
            else:
                first = vectors[:, numbers[0]]
                second = first.conj() if len(numbers) == 1 else vectors[:, numbers[1]]
            values, pair = (first_value, second_value), (first, second)
            result.append((i, *pair_block(state.a, values, pair, f"mode{i + 1}", name)))
    return result
