"""Variants of Maxwell elements with other ends are computed at once."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equations.test_batch_beams import check_alone, check_tangents


def arms(**preload):
    """Two arms in a loop, with a Maxwell element between both and one to the ground."""
    model = mv.Model("arms")
    for name, x in (("a", 0.1), ("b", 0.5)):
        model.add_body(name, 2.0, (0.1, 0.2, 0.15), (x, 0.2, 0.3))
    model.add_bushing("mount", "ground", "a", (0, 0, 0), (1e4, 2e4, 3e4, 1e3, 2e3, 3e3))
    model.add_joint("hinge", "revolute", "a", "b", (0.3, 0.2, 0.3), axis=(0, 1, 0.2))
    model.add_joint("slide", "point_on_plane", "ground", "b", (0.6, 0.2, 0.3), axis=(0, 0, 1))
    model.add_maxwell("strut", "a", "b", (0.1, 0.2, 0.35), (0.5, 0.25, 0.4), 1e4, 1.0, 5e3, **preload)
    model.add_maxwell("damper", "b", "ground", (0.55, 0.2, 0.35), (0.5, 0.25, -0.4), 2e4, 30.0)
    model.add_input("F", "b", (1, 0, 1))
    model.add_base_motion("base", (1, 0.3, 0.2))
    model.add_output("x", "b", (0, 0, 1))
    model.add_output("a", "b", (0, 0, 1), quantity="acceleration")
    model.add_force_output("f", "strut", "z")
    return model


ENDS = [f"{name}.{end}.{axis}" for name in ("strut", "damper") for end in ("start", "end") for axis in "xyz"]


@pytest.mark.usefixtures("at_once")
def test_ends_are_as_alone():
    model, rng = arms(), np.random.default_rng(1)
    names = [*ENDS, "strut.stiffness"]
    check_alone(model, {name: model.parameters[name] * rng.uniform(0.9, 1.1, 3) for name in names})
    check_tangents(model, names)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("names", [["strut.end.x"], ENDS, ["strut.preload"], ["strut.preload", "strut.start.z"]])
def test_coefficients_that_do_not_vary_stay(names):
    """Small ones are no numbers of rows: the damping is 1 N s/m, and the preload is the first number that varies."""
    model = arms(preload=0.0)
    batch = model.linearize(values={name: np.full(2, model.parameters[name]) for name in names})
    single = model.linearize()
    for key in ("M", "C", "K"):
        np.testing.assert_allclose(getattr(batch[1], key), getattr(single, key), rtol=1e-14, atol=1e-9)
