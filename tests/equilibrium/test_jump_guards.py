"""Loops close to a dead point stay on their side of it, or are refused: four-bars by circles that intersect."""

import re
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.equilibrium import path
from tests.support.sizes import few


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
    rng, result = np.random.default_rng(1), []
    while len(result) < count:
        points = np.column_stack((rng.uniform(-1, 1, (4, 2)), np.zeros(4)))
        by = rng.uniform(-3, 3)
        coupler, rocker = np.linalg.norm(points[2] - points[1]), np.linalg.norm(points[3] - points[2])
        gap = np.linalg.norm(turned(points, np.linspace(0, by, 2000)) - points[3, :2], axis=1)
        room = min((coupler + rocker - gap).min(), (gap - abs(coupler - rocker)).min())
        if least < room < most and abs(gap[-1] - gap).max() > 0.2:
            result.append((points, by, coupler, rocker))
    return result


def pin(points, by, coupler, rocker):
    """Where coupler and rocker meet as the crank has turned."""
    crank = turned(points, by)
    along = points[3, :2] - crank
    gap = np.hypot(*along)
    part = (gap**2 + coupler**2 - rocker**2) / (2 * gap)
    across = side(points) * np.sqrt(coupler**2 - part**2) * np.array((-along[1], along[0])) / gap
    return crank + part * along / gap + across


@pytest.mark.few(2)
@pytest.mark.parametrize("case", few(range(12), 6))
def test_the_same_side_of_a_dead_point(case):
    points, by, *lengths = near_dead_points(12, 1e-4, 5e-3)[case]
    model = four_bar(points).moved({"j0.rz": by})
    result = np.array([model.joints[f"j{i}"].position for i in range(4)])
    np.testing.assert_allclose(result[1, :2], turned(points, by), atol=1e-9)
    np.testing.assert_allclose(result[2, :2], pin(points, by, *lengths), atol=1e-8)


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


@pytest.mark.few(2)
@pytest.mark.parametrize("case", range(6))
def test_beyond_a_dead_point(case):
    points, by, *_ = near_dead_points(6, -0.05, -1e-3)[case]
    with pytest.raises(mv.ModelError, match=r"moved: the loops closed by j\d can be closed up to j0.rz = .* and no"):
        four_bar(points).moved({"j0.rz": by})


def near_a_dead_point(seed):
    """A four-bar whose coupler and rocker are nearly in line, under gravity in its plane."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi)
    start, end = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0]), np.array([1.0, 0, 0])
    line = end - start
    length = np.linalg.norm(line)
    along, bend = rng.uniform(0.3, 0.7), 10 ** rng.uniform(-2, -0.3) * rng.choice([-1, 1])
    knee = start + along * line + 0.2 * bend * np.array([-line[1], line[0], 0]) / length
    model = mv.Model(f"bars{seed}", gravity=9.81 / 2 * np.array([*rng.normal(size=2), 0]))
    for name, first, second in (("crank", np.zeros(3), start), ("coupler", start, knee), ("rocker", knee, end)):
        center = (first + second) / 2
        model.add_body(name, rng.uniform(0.5, 2), (0.1, 0.1, 0.1), center + 0.1 * np.array([*rng.normal(size=2), 0]))
    model.add_joint("o", "revolute", "ground", "crank", (0, 0, 0))
    model.add_joint("a", "revolute", "crank", "coupler", start)
    model.add_joint("b", "revolute", "coupler", "rocker", knee)
    model.add_joint("d", "revolute", "ground", "rocker", end)
    if rng.random() < 0.5:
        model.add_bushing("k", "ground", "crank", (0, 0, 0), (0, 0, 0, 0, 0, rng.uniform(1, 10)))
    return model


@pytest.mark.slow
@pytest.mark.parametrize("seed", [39, 235])
def test_an_equilibrium_is_on_the_way_down(seed):
    """Coupler and rocker keep the side to which they bend, as they do in steps of a thirtieth."""
    def side(model):
        start, knee, end = (np.array(model.joints[name].position) for name in "abd")
        return np.sign(np.cross(knee - start, end - knee)[2])

    model = near_a_dead_point(seed)
    assert side(model.equilibrium()) == side(model)


def test_a_pose_with_open_loops_is_none_on_the_way(monkeypatch):
    """A step that leaves a loop open is halved: it may close later on another side."""
    model = near_a_dead_point(410)
    found = model.equilibrium()
    monkeypatch.setattr(path, "LONGEST", 0.03)
    for name, body in model.equilibrium().bodies.items():
        np.testing.assert_allclose(found.bodies[name].position, body.position, rtol=0, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [189, 310])
def test_a_branch_that_ends_at_a_dead_point_is_not_left_for_another(seed):
    """In steps of a thirtieth it ends under the same share of the load."""
    with pytest.raises(mv.EquilibriumError, match="it would snap through to a pose elsewhere"):
        near_a_dead_point(seed).equilibrium()


@pytest.mark.few(1)
@pytest.mark.parametrize("case", few(range(6), 3))
def test_a_path_ends_at_a_dead_point(case):
    """Where the crank's end is as far from the rocker's pin as coupler and rocker reach, or as their difference."""
    points, by, coupler, rocker = near_dead_points(6, -0.05, -1e-3)[case]

    def room(angle):
        gap = np.linalg.norm(turned(points, angle) - points[3, :2])
        return min(coupler + rocker - gap, gap - abs(coupler - rocker))

    angles = np.linspace(0.0, by, 2001)
    first = next(k for k, angle in enumerate(angles) if room(angle) < 0.0)
    dead = brentq(room, angles[first - 1], angles[first])
    with pytest.raises(mv.EquilibriumError, match=r"path: 'j0\.rz' can be led to") as caught:
        four_bar(points).path("j0.rz", [by])
    told = float(re.search(r"led to (\S+)", str(caught.value))[1])
    assert abs(told) < abs(dead) * (1.0 + 1e-5)
    assert told == pytest.approx(dead, abs=5e-3)
