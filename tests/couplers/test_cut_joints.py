"""Coordinates of cut joints under couplers, each kind of joint, against 50 digits; the same in batches and sparse."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.couplers.test_couplers import four_bar
from tests.support.compare import assert_same_matrices
from tests.support.exact import Exact
from tests.support.random_models import add_random_body, add_random_spring, rotation

FACTORS = (1.0, -0.7, 1.9)
CUT = {
    "revolute": {}, "prismatic": {}, "cylindrical": {}, "screw": {"pitch": 0.3}, "planar": {}, "spherical": {},
    "point_on_line": {}, "universal": {}, "skew universal": {}, "x and ry": {"free": ("x", "ry")},
}  # fmt: skip


def loop(kind, swap, coupled=True):
    """Ground - a (free) - b (cylindrical) - ground by the joint ``cut``, three of whose coordinates are coupled."""
    rng = np.random.default_rng(sum(map(ord, kind)))
    model = mv.Model(kind)
    centres = {"ground": np.zeros(3), "a": np.array((0.4, -0.2, 0.5)), "b": np.array((1.1, 0.3, -0.4))}
    for name in ("a", "b"):
        add_random_body(model, rng, name, centres[name])
        add_random_spring(model, rng, f"{name}.k", "ground", name, centres[name], True, False, False)
    model.add_joint("base", "free", "ground", "a", centres["a"] + 0.1, orientation=rotation(rng))
    model.add_joint("link", "cylindrical", "a", "b", centres["b"] - 0.2, axis=(1, 2, -1))
    words = dict(CUT[kind])
    if kind == "skew universal":
        words |= {"axis": (1, 0.2, -0.5), "axis2": (0.4, 2.0, 1.0)}
    else:
        words["orientation"] = rotation(rng)
    pair = ("b", "ground") if swap else ("ground", "b")
    own = None if "free" in words else kind.rpartition(" ")[2]
    joint = model.add_joint("cut", own, *pair, (0.9, 0.6, -0.1), **words)
    names = [name for name, _ in joint.freedom][: 3 * coupled]
    for i, (name, other) in enumerate(zip(names, ("base.ry", "link.z", "base.x"), strict=False)):
        model.add_coupler(f"c{i}", {f"cut.{name}": 1.0, other: FACTORS[i], "link.rz": 0.3})
    model.add_input("F", "b", rng.normal(size=6), position=(1, 1, 1))
    model.add_output("y", "a", rng.normal(size=6))
    return model


@pytest.mark.few(5)
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kind", CUT)
def test_coordinates_of_cut_joints_against_fifty_digits(kind, swap):
    model = loop(kind, swap)
    system, reference = model.linearize(cut=["cut"]), Exact(model)
    assert system.cut_joints == ("cut",)
    assert system.dof == reference.dof > 0
    assert_same_matrices(system, reference, 1e-11)
    omega = np.array([3.0, 40.0])
    expected = system.frequency_response(omega)
    assert_allclose(model.linearize(cut=["cut"], method="sparse").frequency_response(omega), expected, rtol=1e-8)


@pytest.mark.few(2)
@pytest.mark.parametrize("coefficients", [False, True])
@pytest.mark.parametrize("kind", ["universal", "skew universal", "screw", "x and ry"])
def test_every_variant_of_a_coupled_cut_joint(kind, coefficients):
    """Axes and points that change from variant to variant, by themselves and with coefficients."""
    model = loop(kind, False)
    values = {"cut.orientation.rx": np.array([0.0, 0.1, -0.2]), "cut.position.y": np.array([0.6, 0.5, 0.7]),
              "c0.coefficient.1": np.array([1.0, 1.2, 0.8]), "link.position.z": np.array([0.2, 0.0, 0.1])}  # fmt: skip
    if not coefficients:
        del values["c0.coefficient.1"]
    batch = model.linearize(values=values, cut=["cut"])
    for i in range(3):
        single = model.with_values({name: array[i] for name, array in values.items()})
        system = single.linearize(cut=["cut"], independent=batch.coordinates)
        for key in ("M", "C", "K", "B", "Cq"):
            assert_allclose(getattr(batch, key)[i], getattr(system, key), rtol=1e-10, atol=1e-10)
        assert_same_matrices(system, Exact(single), 1e-11)


@pytest.mark.parametrize("kind", ["universal", "skew universal", "cylindrical"])
def test_a_coupler_of_two_equal_joints_is_redundant_in_all_poses(kind):
    """Two joints at one place between the same bodies do the same: of these couplers all but one say nothing new."""
    model = loop(kind, False, coupled=False)
    cut = model.joints["cut"]
    model.add_joint(**cut.constructor_kwargs() | {"name": "twin"})
    for i, (name, _) in enumerate(cut.freedom):
        model.add_coupler(f"same{i}", {f"cut.{name}": 1.0, f"twin.{name}": -1.0, "base.x": FACTORS[i]})
    system, reference = model.linearize(cut=["cut"]), Exact(model)
    assert "cut" in system.cut_joints
    assert (system.dof, len(system.redundant)) == (reference.dof, reference.redundant)
    assert_same_matrices(system, reference, 1e-11)


@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
def test_a_variant_that_is_nearly_singular_goes_through_the_decisions_of_a_single_pose():
    """Coupler and rocker all but in line in variant 2, where the crank's angle is next to a dead point."""
    model = four_bar(((0, 0, 0), (0.3, 1, 0), (1.5, 1.2, 0), (2, 0, 0)))
    model.add_body("arm", 0.5, (0.02, 0.02, 0.03), (0.5, -0.5, 0))
    model.add_joint("arm.j", "revolute", "ground", "arm", (0, -0.5, 0))
    model.add_bushing("arm.k", "ground", "arm", (0, -0.5, 0), (0, 0, 0, 0, 0, 9.0))
    model.add_gear("mesh", "arm.j", "j2", 0.7)
    values = {"j2.position.x": np.array([1.5, 1.6, 1.15, 1.4]), "j2.position.y": np.array([1.2, 1.25, 0.50001, 1.1])}
    words = {"cut": ["j2"], "independent": ["j0.rz"]}
    batch = model.linearize(values=values, **words)
    for i in range(4):
        single = model.with_values({name: array[i] for name, array in values.items()}).linearize(**words)
        assert_allclose(batch.M[i], single.M, rtol=1e-12)
        assert_allclose(batch.K[i], single.K, rtol=1e-12)
    with pytest.warns(mv.NearSingularWarning, match="^variant 2: .*nearly singular"):
        model.linearize(values=values | {"j2.position.y": np.array([1.2, 1.25, 0.5 + 4e-6, 1.1])}, **words)
    with pytest.raises(mv.SingularPoseError, match=r"^variant 2: independent: j0\.rz at a dead centre"):
        model.linearize(values=values | {"j2.position.y": np.array([1.2, 1.25, 0.5 + 1e-6, 1.1])}, **words)
