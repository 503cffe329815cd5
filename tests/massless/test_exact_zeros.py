"""Outputs that massless nodes cannot change are exactly zero."""

import numpy as np
import pytest

import mbsvib as mv
from tests.support.random_models import rotation

POINT = (0.51, 1.1, -0.6)


def test_a_node_moves_with_the_only_body_that_holds_it():
    """Its velocity relative to that body is zero: as rounding it would not change smoothly with any parameter."""
    axes = rotation(np.random.default_rng(4))
    model = mv.Model("node")
    model.add_body("arm", 2.0, (0.3, 0.2, 0.25), (0.2, 0.3, 0.1))
    model.add_joint("pivot", "universal", "ground", "arm", (0.1, -0.2, 0.3), axes)
    model.add_bushing("hold", "ground", "arm", (0.15, 0.1, 0.3), (0, 0, 0, 30, 40, 50), orientation=axes)
    model.add_body("node", 0.0, (0.0, 0.0, 0.0), (0.5, 0.7, -0.4))
    model.add_bushing("tie", "arm", "node", (0.6, 0.5, -0.3), (900, 500, 200, 90, 5800, 1700),
                      orientation=rotation(np.random.default_rng(5)))  # fmt: skip
    model.add_output("relative", "node", "z", position=POINT, relative_to="arm", quantity="velocity")
    model.add_output("absolute", "node", "z", position=POINT, quantity="velocity")
    system = model.linearize(method="dense")
    assert not system.Cv[0].any()
    assert system.Cv[1].all()


@pytest.mark.few(4)
@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("kind", ["universal", "homokinetic", "point_on_line", "planar", "spherical", "screw"])
def test_joints_carry_nothing_along_their_free_directions(kind, method):
    """As rounding, such outputs would be derivatives of forces on massless nodes, and were refused."""
    axes = rotation(np.random.default_rng(4))
    model = mv.Model("free directions")
    for name, at in (("a", (0.2, 0.3, 0.1)), ("b", (0.5, 0.3, 0.6))):
        model.add_body(name, 2.0, (0.3, 0.2, 0.25), at)
        model.add_bushing(f"hold {name}", "ground", name, (0.1, 0.2, 0.3), (1e3, 2e3, 3e3, 30, 40, 50))
    joint = model.add_joint("j", kind, "a", "b", (0.3, 0.3, 0.4), axes, pitch=0.1 if kind == "screw" else None)
    model.add_body("node", 0.0, (0.0, 0.0, 0.0), (0.5, 0.7, -0.4))
    model.add_bushing("tie", "a", "node", (0.6, 0.5, -0.3), (9, 5, 2, 9, 5, 1), (1, 2, 3, 4, 5, 6), axes)
    model.add_input("F", "node", "x")
    free = [np.linalg.solve(np.kron(np.eye(2), axes), twist) for _, twist in joint.freedom]
    for i, twist in enumerate([*free, np.ones(6)]):
        model.add_force_output(f"F{i}", "j", twist)
    system = model.linearize(method=method)
    rows = [system.Cq, system.Cv, system.Ca] if method == "dense" else [rows.toarray() for rows in system.output_rows]
    rows = np.hstack([*rows, system.D])
    assert not rows[:-1].any()
    assert rows[-1].any()
