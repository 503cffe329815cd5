"""The compiled plant: matrices against single models, derivatives against the adjoint, and what it refuses."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from mbsvib import library
from tests.golden.store import scenes

KEYS = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")


def values_near(plant, seed=1, share=0.02):
    return plant.nominal + share * np.random.default_rng(seed).uniform(-1.0, 1.0, len(plant.names)) * (
        np.where(plant.nominal == 0.0, 0.05, np.abs(plant.nominal)))  # fmt: skip


def stewart():
    return library.stewart().compile(["platform.mass", "leg*.k.stiffness", "leg1.foot.position.*"])


@pytest.mark.parametrize("parameters", [
    ["leg*.k.stiffness"], ["leg*.k.*", "platform.mass", "platform.position.*", "platform.orientation.*"], "leg2.*",
])  # fmt: skip
def test_matrices_are_those_of_single_models(parameters):
    model = library.stewart()
    plant = model.compile(parameters)
    values = values_near(plant)
    single = model.with_values(dict(zip(plant.names, values, strict=True))).linearize(independent=plant.coordinates)
    result = plant(values)
    both = plant(np.array([plant.nominal, values]))
    for key in KEYS:
        expected = getattr(single, key)
        size = 1e-12 * np.abs(expected).max(initial=0.0)
        assert_allclose(getattr(result, key), expected, rtol=0.0, atol=size)
        assert_allclose(getattr(both, key)[1], expected, rtol=0.0, atol=size)
    assert plant.system(values).coordinates == plant.coordinates == single.coordinates
    assert_allclose(plant.modes(values).frequencies, single.modes().frequencies, rtol=1e-11)
    assert_array_equal(plant.eigenvalues([values])[0], plant.eigenvalues(values))


def test_order_of_the_names():
    plant = stewart()
    assert plant.names == ("platform.mass", *(f"leg{i}.k.stiffness" for i in range(1, 7)),
                           *(f"leg1.foot.position.{axis}" for axis in "xyz"))  # fmt: skip
    assert plant.units == ("kg", *("N/m",) * 6, *("m",) * 3)
    assert_array_equal(plant.nominal, [library.stewart().parameters[name] for name in plant.names])
    assert library.stewart().compile().names == tuple(library.stewart().parameters)


@pytest.mark.parametrize(("name", "parameters"), [
    ("stewart", ["leg*.k.*", "platform.mass", "leg1.foot.position.*"]),
    ("quarter_car", ["*.mass", "*.position.*", "*.stiffness", "*.damping", "*.end.*"]),
    ("cubic_hexapod", ["*.stiffness*", "*.mass"]), ("rotor_stator", ["*.stiffness*", "*.speed"]),
])  # fmt: skip
@pytest.mark.parametrize("share", [0.0, 0.03])
def test_gradients_of_eigenvalues(name, parameters, share):
    """At the nominal values, too, where the platform has pairs that coincide."""
    plant = library.build(name).compile(parameters)
    values = values_near(plant, share=share)
    eigenvalues, slopes = plant.eigenvalues(values, gradient=True)
    system = plant.system(values)
    assert_allclose(eigenvalues, system.modes().eigenvalues, rtol=1e-12)
    expected = system.eigenvalue_sensitivities(list(plant.names)).T
    assert slopes.shape == expected.shape == (len(eigenvalues), len(plant.names))
    known = np.isfinite(expected)
    assert_array_equal(np.isfinite(slopes), known)
    size = np.max(np.where(known, np.abs(expected), 0.0), axis=0)
    size += 1e-8 * np.abs(eigenvalues).max() / np.where(values == 0.0, 1.0, np.abs(values))
    error = np.abs(np.where(known, slopes - np.where(known, expected, 0.0), 0.0))
    assert (error <= 1e-7 * size).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("turned", [0.0, 0.3])
@pytest.mark.parametrize("name", [
    "library_stewart", "library_cubic_hexapod", "library_four_bar", "library_engine_on_mounts", "spatial_loop_12",
    "coupled_cut_universal", "redundant_spherical_distance", "hunt_27", "hunt_101", "hunt_109", "hunt_128", "hunt_192",
    "hunt_266",
])  # fmt: skip
def test_gradients_by_the_adjoint_are_those_by_complex_steps(name, turned, monkeypatch):
    """Of turned bodies, too, of eigenvalues that coincide, under loads, and with bodies that float."""
    model, rng = mv.load(scenes()[name]), np.random.default_rng(3)
    names = [item for item in rng.permutation(list(model.parameters)) if item.partition(".")[0] not in model.composed]
    plant = model.compile(names[:50])
    values = plant.nominal.copy()
    for k, item in enumerate(plant.names):
        part, _, field = item.partition(".")
        if part in model.bodies and field.startswith("orientation"):
            values[k] = turned * rng.uniform(-1.0, 1.0)
    results = []
    for worth in (np.inf, 0):
        monkeypatch.setattr("mbsvib.sensitivities.eigenvalues.WORTH_ADJOINT", worth)
        monkeypatch.setattr("mbsvib.sensitivities.eigenvalues.WORTH_ADJOINT_LOADED", worth)
        eigenvalues, slopes = plant.eigenvalues([values], gradient=True)
        results.append(slopes[0])
    steps, adjoint = results
    assert_array_equal(np.isnan(steps), np.isnan(adjoint))
    assert_array_equal(np.isinf(steps), np.isinf(adjoint))
    known = np.isfinite(steps)
    steps, adjoint = np.where(known, steps, 0.0), np.where(known, adjoint, 0.0)
    size = np.abs(steps).max(axis=0) + np.abs(eigenvalues).max() / np.where(values == 0.0, 1.0, np.abs(values))
    assert (np.abs(steps - adjoint) <= 1e-10 * size).all()


def test_systems_know_the_model_at_their_values():
    """Sensitivities to what no rule tells come of variants of it, such as those to the inertia of a spinning body."""
    model = library.rotor_stator()
    speed = 2.0 * model.parameters["spin.speed"]
    there = model.with_values({"spin.speed": speed})
    system = model.compile("spin.speed").system([speed])
    assert system.provenance.origin.parameters == there.parameters
    names = ["rotor.inertia.zz", "rotor.mass", "spin.speed"]
    result, expected = (each.eigenvalue_sensitivities(names) for each in (system, there.linearize()))
    assert (np.abs(result - expected) <= 1e-9 * np.abs(expected).max(axis=1, keepdims=True)).all()


@pytest.mark.slow
def test_derivatives_to_beams():
    """Complex steps through 120 deformations, each the only one of its row."""
    plant = library.cantilever().compile(["tube.rho", "tube.radius"])
    values, step = plant.nominal * [1.01, 0.99], 1e-4 * plant.nominal[1]
    near = values + step * np.array([[0.0, -1.0], [0.0, 1.0]])
    expected = np.subtract(*plant.eigenvalues(near)[::-1]) / (2.0 * step)
    slopes = plant.eigenvalues(values, gradient=True)[1][:, 1]
    assert np.abs(slopes - expected).max() < 1e-6 * np.abs(expected).max()
    stiffness = np.subtract(*plant(near).K[::-1]) / (2.0 * step)
    tangent = plant.tangent([values], [0.0, 1.0])
    assert np.abs(tangent.K[0] - stiffness).max() < 1e-6 * np.abs(stiffness).max()


def test_slopes_to_orientations_are_those_of_the_components():
    """Of rotation vectors from the nominal axes, at another one: central differences of fourth order."""
    plant = library.quarter_car().compile("*.orientation.*")
    values = values_near(plant, share=4.0)
    slopes, step = plant.eigenvalues(values, gradient=True)[1], 2.0**-9
    near = [plant.eigenvalues(values + step * k * np.eye(len(values))) for k in (-2, -1, 1, 2)]
    expected = np.tensordot(np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step), near, 1).T
    assert np.abs(slopes - expected).max() < 1e-8 * np.abs(slopes).max()
    assert np.abs(slopes).max() > 1.0


def test_a_free_body_has_infinite_slopes_to_the_ground_spring():
    model = mv.Model()
    model.add_body("a", mass=2.0, inertia=(1.0, 1.0, 1.0))
    model.add_joint("x", "prismatic", "ground", "a", axis=(1, 0, 0))
    model.add_body("b", mass=3.0, inertia=(1.0, 1.0, 1.0), position=(1.0, 0, 0))
    model.add_joint("y", "prismatic", "a", "b", axis=(1, 0, 0))
    model.add_spring("k", "a", "b", start=(0, 0, 0), end=(1, 0, 0), stiffness=6.0)
    eigenvalues, slopes = model.compile(["k.stiffness", "a.mass"]).eigenvalues([6.0, 2.0], gradient=True)
    omega = np.sqrt(6.0 * (1 / 2.0 + 1 / 3.0))
    oscillates = np.abs(eigenvalues) > 1e-9
    assert_allclose(np.abs(slopes[oscillates, 0]), omega / 12.0, rtol=1e-13)
    assert_allclose(np.abs(slopes[oscillates, 1]), 6.0 / (2.0 * omega * 4.0), rtol=1e-13)
    assert_array_equal(slopes[~oscillates], 0.0)


def test_tangents_along_several_directions():
    """The same as one after the other."""
    plant = mv.library.stewart().compile(["leg*.k.stiffness", "platform.position.z"])
    directions = np.random.default_rng(0).standard_normal((3, len(plant.names)))
    values = np.array([plant.nominal, 1.1 * plant.nominal])
    together = plant.tangent(values, directions)
    assert together.K.shape == (2, 3, 6, 6)
    for k, direction in enumerate(directions):
        one = plant.tangent(plant.nominal, direction)
        np.testing.assert_allclose(together.K[0, k], one.K, rtol=1e-12, atol=1e-12 * np.abs(one.K).max())
        np.testing.assert_allclose(plant.tangent(plant.nominal, directions).B[k], one.B, atol=1e-12)


def test_tangents_add_up():
    plant = stewart()
    values, direction = values_near(plant), np.arange(1.0, 11.0)
    together = plant.tangent(values, direction)
    parts = [plant.tangent(values, unit) for unit in np.eye(10)]
    for key in KEYS:
        expected = sum(rate * getattr(part, key) for rate, part in zip(direction, parts, strict=True))
        size = 1e-13 * np.abs(expected).max(initial=0.0) + 1e-300
        assert_allclose(getattr(together, key), expected, rtol=0.0, atol=size)
        assert_array_equal(getattr(plant.tangent([values, plant.nominal], direction), key)[0], getattr(together, key))


def test_responses_are_those_of_systems():
    plant = stewart()
    values, omega = np.array([values_near(plant, seed) for seed in range(3)]), np.array([10.0, 900.0])
    every = plant.frequency_response(values, omega, ["z", "x"], "F*")
    one = plant.frequency_response(values[1], omega, ["z", "x"], "F*")
    assert every.shape == (3, *one.shape)
    assert_allclose(every[1], one, rtol=0.0, atol=1e-12 * np.abs(one).max())
    single = plant.system(values[1])[["z", "x"], "F*"].frequency_response(omega)
    assert_allclose(one, single, rtol=0.0, atol=1e-12 * np.abs(one).max())


def test_plants_are_immutable_and_go_to_other_processes_and_threads():
    plant = stewart()
    values = [values_near(plant, seed) for seed in range(8)]
    other = pickle.loads(pickle.dumps(plant))
    alone = [plant(row).K for row in values]
    with ThreadPoolExecutor(4) as pool:
        for result, expected in zip(pool.map(lambda row: other(row).K, values), alone, strict=True):
            assert_array_equal(result, expected)
    with pytest.raises(AttributeError):
        plant.names = ()
    with pytest.raises(ValueError, match="read-only"):
        plant.nominal[0] = 1.0


def test_doubtful_ranks_are_decided_anew_and_counted():
    model = library.four_bar()
    plant = model.compile("*.position.*")
    start = plant.plans
    plant(plant.nominal)
    assert start == plant.plans == 1


@pytest.mark.parametrize(("values", "told"), [
    (np.ones(9), r"values have the shape \(9,\); expected \(10,\) or \(n, 10\)"),
    (np.ones((0, 10)), "expected"), (np.full(10, np.nan), r"values\[0\] = nan, of 'platform.mass'"),
    ([1j] * 10, "expected real numbers"), (-np.ones(10), "platform"),
])  # fmt: skip
def test_values_that_are_refused(values, told):
    with pytest.raises(mv.MbsvibError, match=told):
        stewart()(values)


def test_what_else_is_refused():
    model, plant = library.stewart(), stewart()
    with pytest.raises(mv.ModelError, match=r"there is no parameter 'leg1\.k\.stifness'"):
        model.compile("leg1.k.stifness")
    with pytest.raises(mv.ModelError, match="expected at least one"):
        model.compile([])
    with pytest.raises(mv.ModelError, match=r"direction has the shape \(3,\)"):
        plant.tangent(plant.nominal, np.ones(3))
    with pytest.raises(mv.ModelError, match="a batch of many variants"):
        plant.system([plant.nominal])
    with pytest.raises(mv.ResponseError, match="Fq"):
        plant.frequency_response(plant.nominal, [1.0], "z", "Fq")
    falling = mv.Model(gravity=(0, 0, -9.81))
    falling.add_body("a", mass=2.0, inertia=(1.0, 1.0, 1.0))
    falling.add_joint("z", "prismatic", "ground", "a")
    falling.add_spring("k", "ground", "a", start=(0, 0, -1), end=(0, 0, 0), stiffness=6.0, preload=-2.0 * 9.81)
    with pytest.raises(mv.EquilibriumError, match="variant 1"):
        falling.compile("a.mass")([[2.0], [3.0]])
