"""Derivatives of forces and moments in loaded joints of each kind, against differences of equilibria found anew."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.matrices import MATRICES
from tests.support.random_models import add_random_body, rotation

KINDS = {
    "fixed": {}, "revolute": {}, "prismatic": {}, "cylindrical": {}, "screw": {"pitch": 0.3}, "universal": {},
    "skew universal": {"axis": (1, 0.2, -0.5), "axis2": (0.4, 2.0, 1.0)}, "planar": {}, "spherical": {},
    "point_on_line": {}, "x and ry": {"free": ("x", "ry")},
}  # fmt: skip
STEP = 1e-3


def loaded(kind, swap):
    """A body on ground by a joint that carries forces and moments, a second body on the first, stiff mounts."""
    rng = np.random.default_rng(sum(map(ord, kind)))
    model = mv.Model(kind, gravity=(1.0, -3.0, -9.0))
    for name, at in (("a", (0.3, -0.2, 0.4)), ("b", (0.9, 0.5, -0.3))):
        add_random_body(model, rng, name, np.array(at))
        model.add_bushing(f"{name}.mount", "ground", name, np.array(at) + 0.1, (3e4, 2e4, 4e4, 3e3, 2e3, 4e3),
                          orientation=rotation(rng))  # fmt: skip
        model.add_load(f"{name}.load", name, 100 * rng.normal(size=3), 100 * rng.normal(size=3))
    words = dict(KINDS[kind])
    if "axis" not in words:
        words["orientation"] = rotation(rng)
    pair = ("a", "ground") if swap else ("ground", "a")
    own = None if "free" in words else kind.rpartition(" ")[2]
    model.add_joint("joint", own, *pair, (0.1, 0.2, 0.3), **words)
    model.add_joint("link", "universal", "a", "b", (0.7, 0.1, 0.2), orientation=rotation(rng))
    for i, way in enumerate(("x", "rx", "ry", "rz")):
        model.add_force_output(f"R{i}", "joint", way)
        model.add_force_output(f"L{i}", "link", way)
    model.add_input("F", "b", rng.normal(size=6), position=(1, 1, 1))
    model.add_output("y", "a", rng.normal(size=6))
    return model.equilibrium()


# both joints turned and moved at once: what is wrong in one number is wrong in the sum
TURN = {"orientation.rx": 1.0, "orientation.ry": -0.7, "orientation.rz": 0.4, "position.x": 0.3}


QUICK = {("revolute", False), ("skew universal", True), ("screw", True), ("x and ry", False), ("planar", False)}
CASES = [pytest.param(kind, swap, marks=() if (kind, swap) in QUICK else pytest.mark.slow)
         for kind in KINDS for swap in (False, True)]  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize(("kind", "swap"), CASES)
def test_orientation_and_position(kind, swap):
    model = loaded(kind, swap)
    system, known = model.linearize(), model.parameters
    rates = {f"{joint}.{field}": rate * sign for joint, sign in (("joint", 1.0), ("link", -1.3))
             for field, rate in TURN.items() if f"{joint}.{field}" in known}  # fmt: skip
    result = system.matrix_derivatives({"turned": rates})

    def at(change):
        moved = model.with_values({name: known[name] + change * rate for name, rate in rates.items()})
        return moved.equilibrium().linearize(independent=system.coordinates)

    ahead, back = at(STEP), at(-STEP)
    for key in MATRICES:
        expected = (getattr(ahead, key) - getattr(back, key)) / (2 * STEP)
        size = np.abs(expected).max(initial=0.0) + 1e-3 * np.abs(getattr(system, key)).max(initial=0.0)
        assert np.abs(getattr(result, key)[0] - expected).max(initial=0.0) <= 3e-5 * size, key
