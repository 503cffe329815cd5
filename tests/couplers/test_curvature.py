"""Couplers of nonlinear relations, known to second order at one pose: linear equations there, and nothing else."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations import batch_assembly

SLOPE, CURVATURE = 1.75, 4.0


@pytest.fixture
def model():
    """Two slides along x and y that x = 1.75 y + 2 y^2 ties, and a third one along z beside them."""
    result = mv.Model("slides")
    for name, mass, axis, stiffness in (("a", 2.0, (1, 0, 0), 30.0), ("b", 3.0, (0, 1, 0), 5.0),
                                        ("c", 1.0, (0, 0, 1), 7.0)):  # fmt: skip
        result.add_body(name, mass, (1.0, 1.0, 1.0), (0.5, 0.0, 0.0))
        result.add_joint(f"{name}.slide", "prismatic", "ground", name, axis=axis)
        result.add_bushing(f"{name}.k", "ground", name, (0.0, 0.0, 0.0), [stiffness] * 3 + [0.0] * 3)
    result.add_coupler("tie", {"a.slide": 1.0, "b.slide": -SLOPE}, curvature={"b.slide": -CURVATURE})
    return result


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_linear_equations_are_those_of_the_tangent(model, method):
    system = model.linearize(method=method)
    modes = system.modes(2) if method == "sparse" else system.modes()
    squares = (2 * np.pi * modes.frequencies) ** 2
    np.testing.assert_allclose(np.sort(squares), sorted(((30 * SLOPE**2 + 5) / (2 * SLOPE**2 + 3), 7.0)), rtol=1e-12)
    assert model.equilibrium().couplers == model.couplers  # nothing loads it, so that it stays where it is
    assert model.moved({"c.slide.z": 0.3}).couplers == model.couplers


def loaded(model, gravity):
    """The model under gravity along x, y and z, held by preloads."""
    model.gravity = gravity
    return model.equilibrium(preload="*.k")


def test_forces_at_rest_make_stiffness_of_the_curvature(model):
    """The tie carries f along x and stretches, with x = 1.75 y + 2 y^2: second derivative of the potential energy."""
    model = loaded(model, (4.0, -3.0, 0.0))
    preload = [model.springs[f"{name}.k"].preload for name in "ab"]
    # V(y) = sum of k q^2 / 2 - (p + m g) q, q = (1.75 y + 2 y^2, y), p the force of the spring on its body
    along = [-preload[0][0] - 2.0 * 4.0, -preload[1][1] + 3.0 * 3.0]
    np.testing.assert_allclose(along[0] * SLOPE + along[1], 0.0, atol=1e-12)  # balance
    K = 30 * SLOPE**2 + 5 + CURVATURE * along[0]
    system = model.linearize(independent=["b.slide.z", "c.slide.z"])
    np.testing.assert_allclose(system.K, np.diag((K, 7.0)), rtol=1e-12)
    assert abs(CURVATURE * along[0]) > 1.0


def test_variants_have_the_stiffness_of_their_own_forces_all_at_once(model, monkeypatch):
    model = loaded(model, (4.0, -3.0, 0.0))
    # the preload that the weight of the heavier slide needs
    values = {"b.mass": [3.0, 3.5], "b.k.preload.y": model.springs["b.k"].preload[1] + np.array([0.0, 1.5])}
    values["a.k.stiffness.x"] = [30.0, 33.0]
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(2)]
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    for K, single in zip(model.linearize(values=values).K, singles, strict=True):
        np.testing.assert_allclose(K, single.K, rtol=1e-13)


def test_other_poses_are_refused(model):
    told = "coupler 'tie': its relation is not linear .* joint 'a.slide' has moved by 0.175 m.* load_mjcf"
    with pytest.raises(mv.ModelError, match=told):
        model.moved({"b.slide.z": 0.1})
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': its relation is not linear .* which a path leaves"):
        model.path("b.slide.z", [0.1])


def test_turned_joints_are_refused():
    model = mv.Model("wheels")
    for name in "ab":
        model.add_body(name, 1.0, (1.0, 1.0, 1.0), (1.0, 0.0, 0.0))
        model.add_joint(name + "r", "revolute", "ground", name, (0.0, 0.0, 0.0), axis=(0, 0, 1))
    model.add_coupler("tie", {"ar": 1.0, "br": -2.0}, curvature={"br": 0.0})
    with pytest.raises(mv.ModelError, match=r"joint 'ar' has moved by 0\.2 rad"):
        model.moved({"br.rz": 0.1})
    assert model.moved({"br.rz": 0.0}).couplers == model.couplers


def test_runs_are_refused(model):
    pytest.importorskip("casadi", reason="CasADi is not installed: pip install 'mbsvib[casadi]'")
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': its relation is not linear .* which finite motions leave"):
        model.simulate([0.0, 1.0], initial={"c.slide.z": 0.1})


def test_equilibrium_elsewhere_and_sparse_loads_are_refused(model):
    model.gravity = (4.0, -3.0, 0.0)
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': its relation is not linear .* equilibrium\(preload=...\)"):
        model.equilibrium()
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': .* sparse equations have no stiffness"):
        model.equilibrium(preload="*.k").linearize(method="sparse")


def test_redundant_constraints_are_refused(model):
    """A second coupler with the same tangent: nobody knows which of both carries what."""
    model.add_coupler("twin", {"a.slide": 2.0, "b.slide": -2.0 * SLOPE}, curvature={"b.slide": 1.0})
    model.gravity = (4.0, -3.0, 0.0)
    with pytest.raises(mv.ModelError, match="coupler 'tie': redundant constraints share its force at rest"):
        model.equilibrium(preload="*.k").linearize()


@pytest.mark.parametrize("name", ["a.k.stiffness.x", "b.k.stiffness.y", "a.inertia.xx"])
def test_derivatives_under_load_are_those_of_differences(model, name):
    model = loaded(model, (4.0, -3.0, 0.0))
    got = model.linearize().mode_sensitivities([name]).frequencies[0]
    above, below = (model.with_values({name: model.parameters[name] + h}).linearize().modes().frequencies
                    for h in (1e-4, -1e-4))  # fmt: skip
    np.testing.assert_allclose(got, (above - below) / 2e-4, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["tie.coefficient.2", "a.mass", "gravity.x", "a.k.preload.x"])
def test_derivatives_through_an_equilibrium_that_moves_are_refused(model, name):
    """They need the third derivative of the relation."""
    system = loaded(model, (4.0, -3.0, 0.0)).linearize()
    with pytest.raises(mv.ModelError, match=r"coupler 'tie': .* derivatives to parameters that move the equilibrium"):
        system.mode_sensitivities([name])


@pytest.mark.parametrize(("curvature", "told"), [
    (1.0, "curvature = 1.0; expected a second derivative"), ({}, "expected a second derivative"),
    ({"a.rz": 1.0}, "curvature = 'a.rz'"), ({"a.slide": None}, "curvature = None; expected a finite number"),
])  # fmt: skip
def test_faulty_curvatures_are_refused(model, curvature, told):
    with pytest.raises(mv.ModelError, match=told):
        model.add_coupler("other", {"a.slide": 1.0, "c.slide": 2.0}, curvature)
