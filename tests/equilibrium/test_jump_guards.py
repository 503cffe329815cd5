"""Loops close to a dead point stay on their side of it, or are refused: four-bars by circles that intersect."""

from functools import cache

import numpy as np
import pytest

import mbsvib as mv


def four_bar(points):
    model = mv.Model("four-bar")
    names = ("ground", "a", "b", "c", "ground")
    for i, name in enumerate(names[1:4]):
        model.add_body(name, 1.0, (1, 1, 1), position=(points[i] + points[i + 1]) / 2)
    for i in range(4):
        model.add_joint(f"j{i}", "revolute", names[i], names[i + 1], position=points[i])
    return model


def turned(points, angle):
    """The crank's end after it turned, a row for each angle."""
    x, y = (points[1] - points[0])[:2]
    c, s = np.cos(angle), np.sin(angle)
    return points[0, :2] + np.stack((c * x - s * y, s * x + c * y), axis=-1)


def side(points):
    (x, y), (u, v) = points[3, :2] - points[1, :2], points[2, :2] - points[1, :2]
    return np.sign(x * v - y * u)


@cache
def near_dead_points(count, least, most):
    """Four-bars and angles of their cranks on the way to which the circles all but cease to intersect, or do so."""
    rng, found = np.random.default_rng(1), []
    while len(found) < count:
        points = np.column_stack((rng.uniform(-1, 1, (4, 2)), np.zeros(4)))
        by = rng.uniform(-3, 3)
        coupler, rocker = np.linalg.norm(points[2] - points[1]), np.linalg.norm(points[3] - points[2])
        gap = np.linalg.norm(turned(points, np.linspace(0, by, 2000)) - points[3, :2], axis=1)
        room = min((coupler + rocker - gap).min(), (gap - abs(coupler - rocker)).min())
        if least < room < most and abs(gap[-1] - gap).max() > 0.2:
            found.append((points, by, coupler, rocker))
    return found


def pin(points, by, coupler, rocker):
    """Where coupler and rocker meet as the crank has turned."""
    crank = turned(points, by)
    along = points[3, :2] - crank
    gap = np.hypot(*along)
    part = (gap**2 + coupler**2 - rocker**2) / (2 * gap)
    across = side(points) * np.sqrt(coupler**2 - part**2) * np.array((-along[1], along[0])) / gap
    return crank + part * along / gap + across


@pytest.mark.parametrize("case", range(12))
def test_the_same_side_of_a_dead_point(case):
    points, by, *lengths = near_dead_points(12, 1e-4, 5e-3)[case]
    model = four_bar(points).moved({"j0.rz": by})
    found = np.array([model.joints[f"j{i}"].position for i in range(4)])
    np.testing.assert_allclose(found[1, :2], turned(points, by), atol=1e-9)
    np.testing.assert_allclose(found[2, :2], pin(points, by, *lengths), atol=1e-8)


@pytest.mark.parametrize("case", [5, 8])
def test_two_loops_at_their_dead_points_at_once(case):
    """One crank drives two equal couplers and rockers: a determinant has the same sign where both have jumped."""
    points, by, *lengths = near_dead_points(12, 1e-4, 5e-3)[case]
    model = four_bar(points)
    for name, i in (("b", 1), ("c", 2)):
        model.add_body(f"{name}2", 1.0, (1, 1, 1), position=(points[i] + points[i + 1]) / 2)
    for i, ends in enumerate((("a", "b2"), ("b2", "c2"), ("c2", "ground")), 1):
        model.add_joint(f"k{i}", "revolute", *ends, position=points[i])
    there = model.moved({"j0.rz": by})
    for name in ("j2", "k2"):
        np.testing.assert_allclose(there.joints[name].position[:2], pin(points, by, *lengths), atol=1e-8)


@pytest.mark.parametrize("case", range(6))
def test_beyond_a_dead_point(case):
    points, by, *_ = near_dead_points(6, -0.05, -1e-3)[case]
    with pytest.raises(mv.ModelError, match=r"moved: the loops closed by j\d can be followed up to j0.rz = .* and no"):
        four_bar(points).moved({"j0.rz": by})
