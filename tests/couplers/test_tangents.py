"""Couplers that are only tangents of nonlinear relations: linear equations without load, and nothing else."""

import numpy as np
import pytest

import mbsvib as mv

SLOPE = 1.75


@pytest.fixture
def model():
    """Two slides along x and y that x = 1.75 y ties, and a third one along z beside them."""
    result = mv.Model("slides")
    for name, mass, axis, stiffness in (("a", 2.0, (1, 0, 0), 30.0), ("b", 3.0, (0, 1, 0), 5.0),
                                        ("c", 1.0, (0, 0, 1), 7.0)):  # fmt: skip
        result.add_body(name, mass, (1.0, 1.0, 1.0), (0.5, 0.0, 0.0))
        result.add_joint(f"{name}.slide", "prismatic", "ground", name, axis=axis)
        result.add_bushing(f"{name}.k", "ground", name, (0.0, 0.0, 0.0), [stiffness] * 3 + [0.0] * 3)
    result.add_coupler("tie", {"a.slide": 1.0, "b.slide": -SLOPE}, tangent=True)
    return result


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_linear_equations_are_those_of_the_tangent(model, method):
    system = model.linearize(method=method)
    modes = system.modes(2) if method == "sparse" else system.modes()
    squares = (2 * np.pi * modes.frequencies) ** 2
    np.testing.assert_allclose(np.sort(squares), sorted(((30 * SLOPE**2 + 5) / (2 * SLOPE**2 + 3), 7.0)), rtol=1e-12)
    assert model.equilibrium().couplers["tie"].tangent  # nothing loads it, so that it stays where it is
    assert model.moved({"c.slide.z": 0.3}).couplers == model.couplers


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("load", ["gravity", "load", "preload"])
def test_loads_are_refused(model, method, load):
    if load == "gravity":
        model.gravity = (0.0, 0.0, -9.81)
    elif load == "load":
        model.add_load("push", "a", (1.0, 0.0, 0.0))
    else:
        model = model.replace("a.k", preload=(1.0, 0, 0, 0, 0, 0))
    told = r"coupler 'tie': it is the tangent of a nonlinear relation, whose curvature .* gravity=\(0, 0, 0\)"
    with pytest.raises(mv.ModelError, match=told):
        model.linearize(method=method)
    with pytest.raises(mv.ModelError, match=told):
        model.equilibrium()


@pytest.mark.slow
def test_other_poses_are_refused(model):
    told = "coupler 'tie': it is the tangent .* joint 'a.slide' has moved by 0.175 m.* load_mjcf"
    with pytest.raises(mv.ModelError, match=told):
        model.moved({"b.slide.z": 0.1})
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': it is the tangent .* which a path leaves"):
        model.path("b.slide.z", [0.1])


def test_turned_joints_are_refused():
    model = mv.Model("wheels")
    for name in "ab":
        model.add_body(name, 1.0, (1.0, 1.0, 1.0), (1.0, 0.0, 0.0))
        model.add_joint(name + "r", "revolute", "ground", name, (0.0, 0.0, 0.0), axis=(0, 0, 1))
    model.add_coupler("tie", {"ar": 1.0, "br": -2.0}, tangent=True)
    with pytest.raises(mv.ModelError, match=r"joint 'ar' has moved by 0\.2 rad"):
        model.moved({"br.rz": 0.1})
    assert model.moved({"br.rz": 0.0}).couplers == model.couplers


def test_runs_are_refused(model):
    pytest.importorskip("casadi", reason="CasADi is not installed: pip install 'mbsvib[casadi]'")
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': it is the tangent .* which finite motions leave"):
        model.simulate([0.0, 1.0], initial={"c.slide.z": 0.1})


def test_it_is_true_or_false(model):
    with pytest.raises(mv.ModelError, match="tangent = 1; expected True or False"):
        model.add_coupler("other", {"a.slide": 1.0, "c.slide": 2.0}, tangent=1)
