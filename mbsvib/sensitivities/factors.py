"""Derivatives of the equations as products of motions and wrenches.

With T(s) = K + s C + s^2 M every derivative is symmetric and of low rank:
x^T dT y = sum_t P_t(x) Q_t(y) + Q_t(x) P_t(y).
Stiffness, damping and inertia see motions only. Where a part moves, the wrench in it works on what the change does to
the motion: a connection at p turned by rho and moved by dp sees (u + theta x dp, theta) turned back by rho, a joint of
the tree hands on the same with the other sign.

Source: Jiang, Chen & Luo (2011), equations 78-87; here by the wrenches that connections transmit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.parts import Spring

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mbsvib.sensitivities.fields import Field, Fields
    from mbsvib.sensitivities.network import Network

Pair = tuple["Field", "Field"]
_NEXT = [1, 2, 0]
_LAST = [2, 0, 1]
_SIX = [(i, j) for i in range(6) for j in range(i, 6)]
_THREE = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]


def body_factors(network: Network, found: Fields, which: Sequence[int], field: str) -> Pair:
    """Return P and Q of one field of bodies.

    Parameters
    ----------
    network : Network
        Bodies and connections.
    found : Fields
        Motions and wrenches.
    which : sequence of int
        Numbers of the bodies.
    field : str
        mass, inertia, position or orientation.

    Returns
    -------
    pair of array, shape (bodies, entries, terms, n)
        P and Q.
    """
    index = list(which)
    x, w = found.body[index], found.body_wrench[index]
    if field == "mass":
        return 0.5 * found.square * x[:, None, :3], x[:, None, :3]
    if field == "inertia":
        own = network.axes[index].transpose(0, 2, 1) @ x[:, 3:]
        p, q = _entries(own, _THREE)
        return p * found.square, q
    return _crossed(w[:, :3] if field == "position" else w[:, 3:], x[:, 3:])


def spring_factors(network: Network, found: Fields, which: Sequence[int], field: str) -> Pair:
    """Return P and Q of one field of spring-dampers of one kind; parameters and result as of ``body_factors``."""
    index = len(network.joints) + np.array(which, dtype=np.intp)
    part = network.springs[which[0]]
    d, w = found.relative[index], found.wrench[index]
    if isinstance(part, Spring):
        return _line(network, which, field, d, w, found)
    if field in ("stiffness", "damping"):
        axes = np.array([network.springs[i].orientation for i in which]).transpose(0, 2, 1)  # type: ignore[union-attr]
        own = np.concatenate((axes @ d[:, :3], axes @ d[:, 3:]), axis=1)
        whole = isinstance(getattr(part, field)[0], tuple)
        p, q = _entries(own, _SIX if whole else [(i, i) for i in range(6)])
        return p * (found.stiff if field == "stiffness" else found.rate), q
    return _moved(d, w, field)


def joint_factors(network: Network, found: Fields, which: Sequence[int], field: str) -> Pair:
    """Return P and Q of one field of joints; parameters and result as of ``body_factors``."""
    index = list(which)
    d, w = found.relative[index], found.wrench[index]
    if field == "pitch":
        axis = np.array([network.joints[i].axes for i in index])[:, :, 2]
        along = np.einsum("ki,kin->kn", axis, w[:, :3]), np.einsum("ki,kin->kn", axis, d[:, 3:])
        return along[0][:, None, None], along[1][:, None, None]
    p, q = _moved(d, w, "position" if field == "end" else field)
    if network.joints[index[0]].end is None:
        return -p, q
    turned = _rods(network, index, d, w, field)
    return (turned[0], turned[1]) if field == "position" else (
        np.concatenate((-p, turned[0]), axis=2), np.concatenate((q, turned[1]), axis=2))


def _rods(network: Network, index: Sequence[int], d: Field, w: Field, field: str) -> Pair:
    """Rods turn with their ends: along the rod the force works on dp . u / L."""
    rods: list[Any] = [network.joints[i] for i in index]
    span = np.array([np.subtract(rod.end, rod.position) for rod in rods])[:, :, None]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    push = (span * w[:, :3]).sum(axis=1)[:, None, None] / (length * length)[:, None]
    if field == "end":
        push = -push
    return np.broadcast_to(push, (len(index), 3, 1, push.shape[-1])), d[:, :3, None]


def _entries(d: Field, pairs: list[tuple[int, int]]) -> Pair:
    """A symmetric matrix on d: d_i^2 for entries on the diagonal, 2 d_i d_j beside it."""
    first, second = [i for i, _ in pairs], [j for _, j in pairs]
    half = np.array([0.5 if i == j else 1.0 for i, j in pairs])[:, None]
    return (d[:, first] * half)[:, :, None], d[:, second][:, :, None]


def _crossed(force: Field, theta: Field) -> Pair:
    """force . (theta x e) for the three unit vectors e."""
    p = np.stack((force[:, _NEXT], -force[:, _LAST]), axis=2)
    return p, np.stack((theta[:, _LAST], theta[:, _NEXT]), axis=2)


def _moved(d: Field, w: Field, field: str) -> Pair:
    """A connection that is moved or turned."""
    if field == "position":
        return _crossed(w[:, :3], d[:, 3:])
    forces, turns = _crossed(w[:, :3], d[:, :3]), _crossed(w[:, 3:], d[:, 3:])
    return np.concatenate((forces[0], turns[0]), axis=2), np.concatenate((forces[1], turns[1]), axis=2)


def _line(network: Network, which: Sequence[int], field: str, d: Field, w: Field, found: Fields) -> Pair:
    """Line springs: with e the line and L its length, moving an end by dp changes the elongation by
    dp . (+-(1 - e e^T) u / L + e x theta), u the relative motion there.
    """
    parts: list[Any] = [network.springs[i] for i in which]
    line = np.array([part.line for part in parts])[:, :, None]
    if field in ("stiffness", "damping"):
        along = (line * d[:, :3]).sum(axis=1)[:, None, None]
        return 0.5 * along * (found.stiff if field == "stiffness" else found.rate), along
    span = np.array([np.subtract(part.end, part.start) for part in parts])[:, :, None]
    sign = 1.0 if field == "end" else -1.0
    u, theta = d[:, :3], d[:, 3:]
    if field == "end":
        u = u + np.cross(theta, span, axis=1)
    across = u - line * (line * u).sum(axis=1, keepdims=True)
    length = np.linalg.norm(span, axis=1, keepdims=True)
    tension = (line * w[:, :3]).sum(axis=1)[:, None, None]
    change = sign * across / length + np.cross(line, theta, axis=1)
    return np.broadcast_to(tension, (len(parts), 3, 1, tension.shape[-1])), change[:, :, None]
