"""Modal states of systems without symmetry: one block a mode, of two states or, for a mode of first order, of one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.massless_null_motion import independent_coordinates
from mbsvib.modes.general import rigid_shapes
from mbsvib.responses.first_order import FirstOrder
from mbsvib.responses.general_terms import cleaned
from mbsvib.responses.modal_blocks import modal_inputs, pair_block

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.equations.equations import Equations
    from mbsvib.modes.general import General


def modal_states(system: Equations, modal: General) -> FirstOrder:
    """Return first-order equations in modal states.

    Each mode has a block [[0, 1], [-l1 l2, l1 + l2]] of its eigenvalues l1, l2; one of first order has the block l1,
    two motions without stiffness that come to rest have [[0, 0], [0, 0]], and two others of first order with equal
    eigenvalues, which are paired as a mode, have [[l1, 0], [0, l2]].
    """
    state = modal.state
    blocks, columns, names = [], [], []
    if state.long:
        blocks.append(state.nilpotent)
        columns.append(state.right)
        names += [f"rigid{i + 1}" for i in range(len(state.nilpotent))]
    for i, block, pair in _blocks(modal):
        blocks.append(block)
        columns.append(pair)
        names += [f"mode{i + 1}{rate}" for rate in ("", "'")[: len(block)]]
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
    return FirstOrder(a, b, transform, through, tuple(names), units, carried)


def _blocks(modal: General) -> list[tuple[int, Array, Array]]:
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
            result.append((i, *pair_block(state.a, first_value, second_value, first, second)))
    return result
