"""Closed loops of first-order equations: a plant and a controller whose signals meet."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex

    Matrices = tuple[Array, Array, Array, Array]

# A singular value of 1 - D K below this share of its terms is rounding: the loop has no solution.
ALGEBRAIC = 1e-12


class ClosedSpace(NamedTuple):
    """x' = a x + b w, y = c x + d w of a closed loop; its controllers demand gain x + push w of their actuators."""

    a: Array
    b: Array
    c: Array
    d: Array
    gain: Array
    push: Array


def transfer(space: Matrices, s: Complex) -> Complex:
    """Return C (s - A)^-1 B + D (n, outputs, inputs) at points ``s`` (n,)."""
    a, b, c, d = space
    result = np.broadcast_to(d, (len(s), *d.shape)).astype(complex)
    return np.asarray(result + c @ np.linalg.solve(s[:, None, None] * np.eye(len(a)) - a, b) if len(a) else result)


def regular(product: Array) -> bool:
    """Return whether 1 - D K can be inverted, for the product D K (n, n) of the feedthroughs."""
    n = len(product)
    if not n:
        return True
    smallest = np.linalg.svd(np.eye(n) - product, compute_uv=False)[-1]
    return bool(smallest > ALGEBRAIC * (1.0 + np.linalg.norm(product, 2)))


def closed_space(plant: Matrices, law: Matrices, sensors: list[int], actuators: list[int]) -> ClosedSpace:
    """Return A, B, C, D of a plant under u = w + K y, in continuous or discrete time; states of the plant come first.

    ``plant``, ``law``: A, B, C, D. ``sensors``, ``actuators``: numbers of the outputs and inputs of the plant that the
    controller has, in its order.
    """
    (a, b, c, d), (ka, kb, kc, kd) = plant, law
    n, through = len(a), d[np.ix_(sensors, actuators)]
    loop = np.eye(len(sensors)) - through @ kd
    # y = observed (x, z) + direct w
    observed = np.linalg.solve(loop, np.concatenate((c[sensors], through @ kc), axis=1))
    direct = np.linalg.solve(loop, d[sensors])
    gain, push = kd @ observed, kd @ direct
    gain[:, n:] += kc
    acts = b[:, actuators]
    closed_a = np.concatenate((acts @ gain, kb @ observed))
    closed_a[:n, :n] += a
    closed_a[n:, n:] += ka
    closed_c = d[:, actuators] @ gain
    closed_c[:, :n] += c
    return ClosedSpace(closed_a, np.concatenate((b + acts @ push, kb @ direct)), closed_c, d + d[:, actuators] @ push,
                       gain, push)  # fmt: skip
