"""Mechanisms that move although counting their constraints says that they cannot, and mechanisms at dead centre."""

import numpy as np

import mbsvib as mv

INERTIA = (0.1, 0.12, 0.11)


def add_body(model, name, at):
    model.add_body(name, 1.0, INERTIA, position=np.add(at, (0.01, 0.02, 0.03)))


def ring(name, points, axes):
    """A single loop of revolute joints, the first and the last on ground."""
    model = mv.Model(name)
    parts = ["ground", *(f"b{i}" for i in range(len(points) - 1)), "ground"]
    for i, part in enumerate(parts[1:-1]):
        add_body(model, part, (points[i] + points[i + 1]) / 2)
    for i, (point, axis) in enumerate(zip(points, axes, strict=True)):
        model.add_joint(f"j{i}", "revolute", parts[i], parts[i + 1], position=point, axis=axis)
    model.add_bushing("k", "ground", "b0", points[0], (1e3,) * 3 + (50.0,) * 3)
    return model


def bennett():
    """Four skewed axes: lengths a, b and twists alpha, beta with a / sin alpha = b / sin beta."""
    alpha, beta, a, first = 0.7, 1.1, 1.0, 1.0
    b = a * np.sin(beta) / np.sin(alpha)
    second = 2 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(first / 2))
    position, points, axes = np.eye(4), [], []
    for angle, twist, length in zip((first, second, -first, -second), (alpha, beta) * 2, (a, b) * 2, strict=True):
        points.append(position[:3, 3].copy())
        axes.append(position[:3, 2].copy())
        c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
        position = position @ [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        position = position @ [[1, 0, 0, length], [0, ct, -st, 0], [0, st, ct, 0], [0, 0, 0, 1]]
    assert np.allclose(position, np.eye(4), atol=1e-14), "the loop closes"
    return ring("Bennett linkage", points, axes), 3


def spherical():
    """Four axes through one point."""
    points = np.random.default_rng(0).normal(size=(4, 3))
    return ring("spherical four-bar", points, points), 3


def sarrus():
    """Two planar groups of three hinges in different planes: the plate goes straight up."""
    model = mv.Model("Sarrus linkage")
    add_body(model, "top", (1, 1, 1.2))
    groups = [((0, 1, 0), [(0, 1, 0), (-0.5, 1, 0.6), (0, 1, 1.2)]),
              ((1, 0, 0), [(1, 0, 0), (1, -0.5, 0.6), (1, 0, 1.2)])]  # fmt: skip
    for g, (axis, points) in enumerate(groups):
        parts = ["ground", f"low{g}", f"high{g}", "top"]
        for i in (0, 1):
            add_body(model, parts[i + 1], np.add(points[i], points[i + 1]) / 2)
        for i, point in enumerate(points):
            model.add_joint(f"j{g}{i}", "revolute", parts[i], parts[i + 1], position=point, axis=axis)
    model.add_spring("k", "ground", "top", (1, 1, 0), (1, 1, 1.2), stiffness=1e3)
    return model, 1


def cardan():
    """Two parallel shafts with two universal joints between them."""
    model = mv.Model("Cardan shaft")
    along = np.array([1, 0.6, 0])
    for name, at in (("in", (-0.5, 0, 0)), ("mid", along / 2), ("out", (1.5, 0.6, 0))):
        add_body(model, name, at)
    across = np.cross(along, (0, 0, 1))
    model.add_joint("r1", "revolute", "ground", "in", position=(-1, 0, 0), axis=(1, 0, 0))
    model.add_joint("u1", "universal", "in", "mid", position=(0, 0, 0), axis=(0, 0, 1), axis2=across)
    model.add_joint("u2", "universal", "mid", "out", position=along, axis=across, axis2=(0, 0, 1))
    model.add_joint("r2", "revolute", "out", "ground", position=(2, 0.6, 0), axis=(1, 0, 0))
    model.add_bushing("k", "ground", "in", (0, 0, 0), (0, 0, 0, 100.0, 0, 0))
    return model, 1


def locomotive():
    """Three parallel cranks of one length on one rod, where two would hold it."""
    model = mv.Model("coupled wheels")
    crank = np.array([0.3, 0.8, 0])
    add_body(model, "rod", np.add(crank, (1, 0, 0)))
    for i, x in enumerate((0.0, 1.0, 2.2)):
        foot = np.array([x, 0, 0])
        add_body(model, f"crank{i}", foot + crank / 2)
        model.add_joint(f"a{i}", "revolute", "ground", f"crank{i}", position=foot)
        model.add_joint(f"b{i}", "revolute", f"crank{i}", "rod", position=foot + crank)
    model.add_bushing("k", "ground", "crank0", (0, 0, 0), (0, 0, 0, 0, 0, 100.0))
    return model, 7


def slider(angle):
    """A slider crank; at the angles 0 and pi the piston stands still, and the crank goes on."""
    model = mv.Model("slider crank")
    pin = np.array([np.cos(angle), np.sin(angle), 0])
    piston = np.array([pin[0] + np.sqrt(4 - pin[1] ** 2), 0, 0])
    for name, at in (("crank", pin / 2), ("rod", (pin + piston) / 2), ("piston", piston)):
        add_body(model, name, at)
    model.add_joint("a", "revolute", "ground", "crank", position=(0, 0, 0))
    model.add_joint("b", "revolute", "crank", "rod", position=pin)
    model.add_joint("c", "revolute", "rod", "piston", position=piston)
    model.add_joint("d", "prismatic", "ground", "piston", axis=(1, 0, 0))
    model.add_bushing("k", "ground", "crank", (0, 0, 0), (0, 0, 0, 0, 0, 100.0))
    return model, 3


def wedge():
    """Three sliders in one plane: nothing turns, so four rows are too many."""
    model = mv.Model("wedge")
    add_body(model, "a", (0, 0, 0))
    add_body(model, "b", (1, 0, 0))
    model.add_joint("p1", "prismatic", "ground", "a", axis=(1, 0, 0))
    model.add_joint("p2", "prismatic", "a", "b", axis=(1, 1, 0))
    model.add_joint("p3", "prismatic", "b", "ground", axis=(0, 1, 0))
    model.add_spring("k", "ground", "a", (-1, 0, 0), (0, 0, 0), stiffness=100.0)
    return model, 4


def differential_screw():
    """Two screws of different pitch on one axis, and a slider that keeps the last body from turning."""
    model = mv.Model("differential screw")
    add_body(model, "a", (0, 0, 0))
    add_body(model, "b", (0, 0, 1))
    model.add_joint("s1", "screw", "ground", "a", position=(0, 0, 0), pitch=0.01)
    model.add_joint("s2", "screw", "a", "b", position=(0, 0, 0), pitch=0.03)
    model.add_joint("p", "prismatic", "b", "ground")
    model.add_bushing("k", "ground", "a", (0, 0, 0), (0, 0, 0, 0, 0, 100.0))
    return model, 4


ALL = {
    "bennett": bennett, "spherical": spherical, "sarrus": sarrus, "cardan": cardan, "locomotive": locomotive,
    "slider": lambda: slider(0.7), "slider out": lambda: slider(0.0), "slider in": lambda: slider(np.pi),
    "wedge": wedge, "differential screw": differential_screw,
}  # fmt: skip
