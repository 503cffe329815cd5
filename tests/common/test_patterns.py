"""Names that look like patterns: a name with brackets is itself before it is a pattern."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.common.patterns import matching


def test_a_name_comes_before_what_fits_it_as_a_pattern():
    known = ["leg[1]", "leg1", "leg2", "base"]
    assert matching("leg[1]", known) == ["leg[1]"]
    assert matching("leg[12]", known) == ["leg1", "leg2"]
    assert matching("leg?", known) == ["leg1", "leg2"]
    assert matching("Base", known) == []


def hung(gravity=0.0):
    """2 kg on a bushing, guided along z."""
    model = mv.Model("hung", gravity=(0, 0, -gravity))
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("guide[1]", "prismatic", "ground", "mass", (0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("k[1]", "ground", "mass", (0, 0, 0), stiffness=(1e3, 1e3, 1e3, 0, 0, 0))
    return model


def test_preloads_of_directions():
    held = hung(9.81).equilibrium(preload="k[1].z")
    np.testing.assert_allclose(np.abs(held.springs["k[1]"].preload), [0, 0, 2 * 9.81, 0, 0, 0], atol=1e-12)


def test_joints_of_a_passive_design():
    assert list(isolation.passive(hung(), "mass", joints="guide[1]").joints) == ["guide[1]"]


def test_legs_of_a_platform():
    model = mv.Model("one")
    model.add_body("plate", 1.0, (0.1, 0.1, 0.1), (0, 0, 1))
    model.add_spring("k[1]", "ground", "plate", (0.2, 0, 0), (0.1, 0, 1), 1e3)
    assert [leg.name for leg in isolation.platform(model, "plate", legs="k[1]").legs] == ["k[1]"]


def test_what_urdf_leaves_out(tmp_path):
    model = hung()
    model.add_load("push[1]", "mass", (0, 0, 1.0))
    with pytest.warns(mv.LeftOutWarning):
        path = mv.save_urdf(model, tmp_path / "hung.urdf", leave=["k[1]", "push[1]"])
    assert mv.load_urdf(path).linearize().dof == 1
