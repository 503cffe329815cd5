"""Forces in joints that hold beams and superelements, against the text-book matrices."""

import numpy as np

import mbsvib as mv
from mbsvib.beams import Material, Rectangle
from tests.beams.reference import assembled, matrices
from tests.superelements.craig_bampton import NODES, reduced

ALLOY = Material(E=7e10, nu=0.3, rho=2700.0)
BAR = Rectangle(0.02, 0.03)
OMEGA = 2 * np.pi * np.array([5.0, 60.0, 700.0])
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def with_outputs(model, node, clamp):
    model.add_input("F", node, (0.3, 1.0, -2.0, 0.1, 0.2, 0.3))
    model.add_base_motion("shake", (1.0, 2.0, 0.5, 0.1, -0.2, 0.4), position=(0.3, 0.2, 0.1))
    for d in DIRECTIONS:
        model.add_force_output(f"hold.{d}", clamp, d)
        model.add_force_output(f"ground.{d}", "ground", d)
    return model.linearize().frequency_response(OMEGA)


def held(k, m, force, rigid, place):
    """Reactions on clamped degrees of freedom, (6, 2, frequencies): of a force, and of a base acceleration."""
    free = [i for i in range(len(k)) if i not in place]
    result = []
    for omega in OMEGA:
        both = k - omega**2 * m
        right = np.column_stack((force, -m @ rigid))
        moved = np.linalg.solve(both[np.ix_(free, free)], right[free])
        result.append(right[place] - both[np.ix_(place, free)] @ moved)
    return np.moveaxis(np.array(result), 0, -1)


def carried(points, source, origin, size):
    rigid = np.zeros(size)
    for i, point in enumerate(points):
        rigid[6 * i : 6 * i + 3] = source[:3] + np.cross(source[3:], np.subtract(point, origin))
        rigid[6 * i + 3 : 6 * i + 6] = source[3:]
    return rigid


def test_clamp_of_a_cantilever():
    n, length = 4, 0.8
    model = mv.Model("clamped")
    model.add_beam("c", None, None, BAR, ALLOY, start=(0, 0, 0), end=(length, 0, 0), elements=n)
    model.add_joint("clamp", "fixed", "ground", "c.0", position=(0, 0, 0))
    result = with_outputs(model, f"c.{n}", "clamp")
    p, h = BAR.properties(0.3), length / n
    points = [(h * i, 0, 0) for i in range(n + 1)]
    parts = matrices(h, p.A, p.Iy, p.Iz, p.J, ALLOY.E, ALLOY.shear_modulus, ALLOY.rho)
    k, m = assembled(points, [np.eye(3)] * n, lambda i: parts)
    force = np.zeros(len(k))
    force[-6:] = (0.3, 1.0, -2.0, 0.1, 0.2, 0.3)
    rigid = carried(points, np.array([1.0, 2.0, 0.5, 0.1, -0.2, 0.4]), (0.3, 0.2, 0.1), len(k))
    expected = held(k, m, force, rigid, list(range(6)))
    size = np.abs(expected).max(axis=(0, 2), keepdims=True)
    sign = np.sign(result[0, 0, 0].real * expected[0, 0, 0])
    assert np.abs((result[0::2] - sign * expected) / size).max() < 1e-9


def test_clamp_of_a_superelement():
    m, k = reduced(6)
    model = mv.Model("clamped")
    model.add_superelement("pipe", m, None, k, {"left": NODES[0], "right": NODES[-1]})
    model.add_joint("clamp", "fixed", "ground", "pipe.left", position=NODES[0])
    result = with_outputs(model, "pipe.right", "clamp")
    force = np.zeros(len(k))
    force[6:12] = (0.3, 1.0, -2.0, 0.1, 0.2, 0.3)
    rigid = carried((NODES[0], NODES[-1]), np.array([1.0, 2.0, 0.5, 0.1, -0.2, 0.4]), (0.3, 0.2, 0.1), len(k))
    expected = held(k, m, force, rigid, list(range(6)))
    size = np.abs(expected).max(axis=(0, 2), keepdims=True)
    sign = np.sign(result[0, 0, 0].real * expected[0, 0, 0])
    assert np.abs((result[0::2] - sign * expected) / size).max() < 1e-8
    # of a base motion, which has no reaction on the ground, the ground feels what the clamp carries
    assert np.abs((np.abs(result[1:6:2, 1]) - np.abs(result[0:6:2, 1])) / size[:, 1]).max() < 1e-8
