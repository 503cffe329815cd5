"""Joints and couplers of a scene as their calls describe them: axes, points, free directions, terms."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.support.exact import FREE

# kinds whose free directions ``tests/support/exact.py`` does not list
MORE_FREE = {"screw": ("rz",), "universal": ("rx", "ry"), "homokinetic": ("rx", "ry")}


@dataclass(frozen=True)
class JointView:
    """A joint: ``point`` is where its second body has it, ``gap`` leads there from the point of the first.

    ``other`` is the second axis of a universal joint in its axes, or the pitch of a screw.
    """

    name: str
    kind: str
    free: tuple[Any, ...]
    first: str
    second: str
    axes: np.ndarray
    point: np.ndarray
    gap: np.ndarray
    other: np.ndarray


def joint_view(call, origins):
    """A joint from its call; its axis is z, of a universal joint x is the first axis and z normal to both."""
    a = call.arguments
    kind = a.get("kind") or "custom"
    free = tuple(a["free"]) if kind == "custom" else (FREE | MORE_FREE)[kind]
    axes = np.array(a.get("orientation", np.eye(3)), dtype=float)
    axis, other, gap = a.get("axis"), np.array([a.get("pitch", 0.0), 0.0, 0.0]), np.zeros(3)
    if kind == "universal":
        other = np.array([0.0, 1.0, 0.0])
        if axis is not None:
            x, y = (np.array(v, dtype=float) / np.linalg.norm(v) for v in (axis, a["axis2"]))
            z = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
            axes = np.column_stack((x, np.cross(z, x), z))
            other = axes.T @ y
    elif kind == "distance":
        gap = np.subtract(a["end"], a["position"])
        axes = np.eye(3)
    elif axis is not None:
        axes = frame(axis)
    first, second = a["first"], a["second"]
    point = a.get("end", a.get("position"))
    if point is None:  # nothing turns: any point will do, and forces are taken at the second body's centre
        point = origins[second if second != "ground" else first]
    return JointView(call.name, kind, free, first, second, axes, np.array(point, dtype=float), axes.T @ gap, other)


def frame(z):
    """Some right-handed axes whose third is along z."""
    z = np.array(z, dtype=float) / np.linalg.norm(z)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def coupler_terms(call, views):
    """Triples (joint, direction, coefficient) of a coupler of any kind."""
    a = call.arguments

    def term(text, factor, directions=("rx", "ry", "rz")):
        if text in views:
            return text, next(d for d in views[text].free if d in directions), factor
        joint, _, direction = text.rpartition(".")
        return joint, direction, factor

    if call.kind == "coupler":
        return [term(name, factor) for name, factor in a["coefficients"].items()]
    if call.kind == "rack":
        return [term(a["pinion"], -a["radius"]), term(a["rack"], 1.0, ("x", "y", "z"))]
    first, second = ("first", "second") if call.kind == "gear" else ("worm", "wheel")
    return [term(a[first], -a["ratio"]), term(a[second], 1.0)]
