"""Shapes of bodies and springs: bars, plates or hulls between the connection points of a body, and coils."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


FLAT = 1e-4  # share of the size below which points lie in a line or a plane
LEAD = 0.14  # share of a spring's length that is straight at either end


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Points, polylines (kind and point numbers) and triangles that represent a body."""

    points: Array
    polylines: tuple[tuple[str, tuple[int, ...]], ...]
    faces: tuple[tuple[int, int, int], ...] = ()


def outline(centre: Array, attachments: Array, size: float) -> Outline:
    """Return the outline of a body: a bar, a plate or a hull between its connection points.

    ``centre`` (3,): its centre of mass. ``attachments`` (n, 3): where joints and springs hold it, each point once.
    ``size``: extent of the mechanism [m]. Returns its lines and faces; none where it is held at its centre only.
    """
    points = np.concatenate((attachments, centre[None]))
    if not len(attachments):
        return Outline(points, ())
    spread, axes = _principal(attachments)
    rank = int(np.count_nonzero(spread > FLAT * size))
    if rank >= 2:
        ring, faces = _plate(attachments @ axes[:2].T) if rank == 2 else _hull(attachments)
        off = _distance(centre, attachments, axes, rank) > 0.02 * size
        corners = sorted({i for polyline in ring for i in polyline}) if off else []
        polylines: list[tuple[str, tuple[int, ...]]] = [("body", polyline) for polyline in ring]
        return Outline(points, (*polylines, *(("spoke", (len(attachments), i)) for i in corners)), faces)
    inline, axes = _principal(points)
    if np.count_nonzero(inline > FLAT * size) <= 1:
        return Outline(points, (("body", tuple(np.argsort(points @ axes[0], kind="stable").tolist())),))
    return Outline(points, tuple([("body", (len(attachments), i)) for i in range(len(attachments))]))


def coil(start: Array, end: Array, radius: float, turns: int, per_turn: int) -> tuple[Array, Array]:
    """Return the points (n, 3) of a coil spring from start to end, and their positions along it, (n,) from 0 to 1."""
    span = end - start
    length = float(np.linalg.norm(span))
    along = span / length
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    third = np.cross(along, across)
    angle = np.linspace(0.0, 2.0 * np.pi * turns, turns * per_turn + 1)
    share = np.linspace(LEAD, 1.0 - LEAD, len(angle))
    r = min(radius, 0.12 * length) * np.minimum(1.0, np.minimum(angle, angle[-1] - angle) / np.pi)
    points = start + share[:, None] * span + r[:, None] * (
        np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * third)  # fmt: skip
    return np.concatenate((start[None], points, end[None])), np.concatenate(([0.0], share, [1.0]))


def _principal(points: Array) -> tuple[Array, Array]:
    """Extents of points along their principal axes, and these axes as rows."""
    moved = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(moved, full_matrices=True)
    return np.ptp(moved @ axes.T, axis=0), axes


def _distance(centre: Array, attachments: Array, axes: Array, rank: int) -> float:
    """Distance of the centre from the plane of the points, 0 inside of a hull."""
    return abs(float((centre - attachments.mean(axis=0)) @ axes[2])) if rank == 2 else 0.0


def _plate(flat: Array) -> tuple[list[tuple[int, ...]], tuple[tuple[int, int, int], ...]]:
    from scipy.spatial import ConvexHull

    ring = ConvexHull(flat).vertices.tolist()
    faces = tuple((ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1))
    return [(*ring, ring[0])], faces


def _hull(attachments: Array) -> tuple[list[tuple[int, ...]], tuple[tuple[int, int, int], ...]]:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(attachments)
    edges = set()
    for face, neighbours in enumerate(hull.neighbors):
        for neighbour in neighbours:
            # edges between triangles of one flat side are not drawn
            if not np.allclose(hull.equations[face], hull.equations[neighbour], atol=1e-6):
                edges.add(tuple(sorted(set(hull.simplices[face].tolist()) & set(hull.simplices[neighbour].tolist()))))
    return sorted(edges), tuple((int(i), int(j), int(k)) for i, j, k in hull.simplices)
