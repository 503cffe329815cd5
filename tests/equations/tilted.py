"""Loops and rails whose axes are tilted by a little."""

import numpy as np

import mbsvib as mv

Z = np.array([0.0, 0.0, 1.0])


class Tilted:
    """A model whose axes are tilted, and whose points are moved, at random by up to a tilt."""

    def __init__(self, tilt, seed=0):
        self.tilt, self.random = tilt, np.random.default_rng(seed)
        self.model = mv.Model("tilted")

    def off(self, vector):
        """A vector with a random one of the length of the tilt added to it, normal to it."""
        across = np.cross(vector, self.random.standard_normal(3))
        return vector + self.tilt * across / np.linalg.norm(across) * np.linalg.norm(vector)

    def body(self, name, *points):
        self.model.add_body(name, 1.0, (0.02, 0.03, 0.04), np.mean(points, axis=0))

    def joint(self, name, kind, first, second, point, axis=Z):
        self.model.add_joint(name, kind, first, second, point, axis=self.off(np.array(axis, float)))

    def spring(self, body, point):
        self.model.add_bushing("spring", "ground", body, point, (30.0, 40.0, 50.0, 10.0, 11.0, 12.0))


def four_bar(tilt, seed=0):
    a, b, c, d = (0, 0, 0), (0.2, 0.3, 0), (0.9, 0.6, 0), (1.0, 0, 0)
    scene = Tilted(tilt, seed)
    for name, ends in {"crank": (a, b), "coupler": (b, c), "rocker": (c, d)}.items():
        scene.body(name, *ends)
    for name, first, second, at in (("A", "ground", "crank", a), ("B", "crank", "coupler", b),
                                    ("C", "coupler", "rocker", c), ("D", "rocker", "ground", d)):  # fmt: skip
        scene.joint(name, "revolute", first, second, at)
    scene.spring("crank", a)
    return scene.model


def six_bar(tilt, seed=0):
    """A Watt linkage: a four-bar with a dyad from its coupler to ground; points in no plane of symmetry."""
    scene = Tilted(tilt, seed)
    p = {"A": (0, 0, 0), "B": (0.2, 0.3, 0), "C": (0.9, 0.6, 0), "D": (1.0, 0, 0), "E": (0.6, 0.9, 0),
         "F": (1.1, 1.2, 0), "G": (1.5, 0.1, 0)}  # fmt: skip
    for name, ends in {"crank": "AB", "coupler": "BC", "rocker": "CD", "link": "EF", "end": "FG"}.items():
        scene.body(name, *(p[end] for end in ends))
    for name, first, second in (("A", "ground", "crank"), ("B", "crank", "coupler"), ("C", "coupler", "rocker"),
                                ("D", "rocker", "ground"), ("E", "coupler", "link"), ("F", "link", "end"),
                                ("G", "end", "ground")):  # fmt: skip
        scene.joint(name, "revolute", first, second, p[name])
    scene.spring("end", p["F"])
    return scene.model


def slider_crank(tilt, seed=0):
    scene = Tilted(tilt, seed)
    scene.body("crank", (0, 0, 0), (0.2, 0.2, 0))
    scene.body("rod", (0.2, 0.2, 0), (0.8, 0, 0))
    scene.body("piston", (0.8, 0, 0))
    scene.joint("A", "revolute", "ground", "crank", (0, 0, 0))
    scene.joint("B", "revolute", "crank", "rod", (0.2, 0.2, 0))
    scene.joint("C", "revolute", "rod", "piston", (0.8, 0, 0))
    scene.joint("slide", "prismatic", "ground", "piston", (0.8, 0, 0), (1, 0, 0))
    scene.spring("piston", (0.8, 0, 0))
    return scene.model


def rails(tilt, seed=0):
    scene = Tilted(tilt, seed)
    scene.body("carriage", (0, 0.5, 0))
    scene.joint("left", "prismatic", "ground", "carriage", (0, 0, 0), (1, 0, 0))
    scene.joint("right", "prismatic", "ground", "carriage", (0, 1, 0), (1, 0, 0))
    scene.spring("carriage", (0, 0.5, 0))
    return scene.model


def spherical_linkage(tilt, seed=0):
    """Four hinges whose axes pass through the origin."""
    scene = Tilted(tilt, seed)
    axes = [(1.0, 0.1, 0.2), (0.7, 0.7, 0.5), (0.1, 1.0, 0.6), (-0.4, 0.8, 0.1)]
    points = [np.array(axis) / np.linalg.norm(axis) for axis in axes]
    for name, k in (("a", 0), ("b", 1), ("c", 2)):
        scene.body(name, points[k], points[k + 1])
    for k, (first, second) in enumerate((("ground", "a"), ("a", "b"), ("b", "c"), ("c", "ground"))):
        scene.joint(f"hinge{k}", "revolute", first, second, points[k], points[k])
    scene.spring("b", points[1])
    return scene.model


def door(tilt, seed=0):
    """Three hinges, tilted and beside the common line."""
    scene = Tilted(tilt, seed)
    scene.body("leaf", (0.4, 0, 0), (0.4, 0, 2))
    for k, height in enumerate((0.2, 1.0, 1.8)):
        x, y = 0.5 * tilt * scene.random.uniform(-1, 1, 2)
        scene.joint(f"hinge{k}", "revolute", "ground", "leaf", (x, y, height))
    scene.spring("leaf", (0, 0, 0))
    return scene.model


LINKAGES = [four_bar, six_bar, slider_crank, rails, spherical_linkage, door]
