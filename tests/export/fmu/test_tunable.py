"""Tunable parameters: the same as a new linearization with other values, in both kinds of units."""

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.affine import affine
from tests.export.fmu.drive import held, names_of, unit, worst
from tests.export.plants import INERTIA, slider


def stewart_model():
    return library.stewart(ports="all")


def mass_on_spring():
    model = mv.Model("slider")
    model.add_body("mass", 2.0, INERTIA, (0, 0, 1))
    model.add_joint("guide", "prismatic", "ground", "mass", (0, 0, 0))
    model.add_spring("k", "ground", "mass", start=(0, 0, 0), end=(0, 0, 1), stiffness=1e4, damping=3.0)
    model.add_input("F", "mass", "z")
    return model


VALUES = {"leg1.k.stiffness": 5e6, "leg2.k.damping": 400.0, "platform.mass": 55.0, "leg3.upper.inertia.xx": 1.2e-5}


@pytest.fixture(scope="module")
def stewart_file(tmp_path_factory):
    model = stewart_model()
    known = set(model.parameters)
    assert set(VALUES) <= known, sorted(known)[:20]
    system = model.linearize()
    return model, mx.to_fmu(system, tmp_path_factory.mktemp("fmu") / "plant.fmu", ("2.0", "3.0"), tunable=tuple(VALUES))


@pytest.mark.parametrize("index", [0, 1])
def test_parameters_change_between_steps(stewart_file, index, tmp_path):
    model, file = stewart_file[0], stewart_file[1][index]
    assert validate_fmu(str(file)) == []
    changed = model.with_values(VALUES).linearize(model.linearize().coordinates)
    u = np.random.default_rng(3).standard_normal((100, len(changed.inputs)))
    inputs, outputs, result = names_of(file, "input"), names_of(file, "output"), []
    with unit(file, tmp_path / "plant") as plant:
        before = plant.get(list(VALUES))
        assert before.tolist() == [model.parameters[name] for name in VALUES]
        plant.set(dict.fromkeys(inputs, 0.0))
        plant.step(0.0, 1e-3)
        plant.set(VALUES)
        for k, row in enumerate(u):
            plant.set(dict(zip(inputs, row, strict=True)))
            plant.step((k + 1) * 1e-3, 1e-3)
            result.append(plant.get(outputs))
    # rounding of the physical matrices of a stiff platform decides, not the steps
    assert worst(np.array(result), held(changed.state_space(), 1e-3, u)) < 1e-9


def test_all_matrices_are_those_of_a_new_linearization(stewart_file, tmp_path):
    model, file = stewart_file[0], stewart_file[1][1]
    space = model.with_values(VALUES).linearize(model.linearize().coordinates).state_space()
    rng = np.random.default_rng(0)
    with unit(file, tmp_path / "plant", "me") as plant:
        plant.set(VALUES)
        plant.fmu.enterContinuousTimeMode()
        x, u = rng.standard_normal(len(space.states)), rng.standard_normal(len(space.inputs))
        dx = plant.derivatives(0.0, x, dict(zip(names_of(file, "input"), u, strict=True)))
        y = plant.get(names_of(file, "output"))
        for result, truth in ((dx, space.A @ x + space.B @ u), (y, space.C @ x + space.D @ u)):
            assert np.abs(result - truth).max() < 1e-10 * np.abs(truth).max()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_dependencies_are_those_of_the_matrices_at_any_values(version, tmp_path):
    """Two sliders in a row, a spring between them that has no stiffness yet, and dampers: zeros of A, B, C, D stay."""
    model = mass_on_spring()
    model.add_body("rider", 3.0, INERTIA, (0, 0, 2))
    model.add_joint("rail", "prismatic", "ground", "rider", (0, 0, 0))
    model.add_spring("between", "mass", "rider", start=(0, 0, 1), end=(0, 0, 2), stiffness=0.0, damping=2.0)
    model.add_output("a", "rider", "z", quantity="acceleration")
    model.add_output("z", "mass", "z")
    tunable = ("between.stiffness", "mass.mass")
    file = mx.to_fmu(model.linearize(), tmp_path / "sliders.fmu", version, tunable=tunable)
    space = model.with_values({"between.stiffness": 70.0, "mass.mass": 1.5}).linearize().state_space("physical")
    described = read_model_description(str(file))
    states, inputs = names_of(file, "state"), names_of(file, "input")
    assert states == list(space.states)
    for unknowns, of_states, of_inputs in (
        (described.derivatives, space.A, space.B),
        (described.outputs, space.C, space.D),
    ):
        for unknown, by_state, by_input in zip(unknowns, of_states, of_inputs, strict=True):
            named = {variable.name for variable in unknown.dependencies}
            assert named & {*states, *inputs} == {
                *(name for name, value in zip(states, by_state, strict=True) if value),
                *(name for name, value in zip(inputs, by_input, strict=True) if value),
            }


def test_derivatives_to_parameters_are_those_of_the_formula(tmp_path):
    """x'' = (u - k x - c x') / m of one mass; its acceleration is an output."""
    model = mass_on_spring()
    model.add_output("a", "mass", "z", quantity="acceleration")
    file = mx.to_fmu(model.linearize(), tmp_path / "slider.fmu", tunable=("k.stiffness", "k.damping", "mass.mass"))
    q, v, u, mass, k, c = 0.3, -0.2, 7.0, 2.5, 8e3, 4.0
    acceleration = (u - k * q - c * v) / mass
    formula = {"k.stiffness": -q / mass, "k.damping": -v / mass, "mass.mass": -acceleration / mass}
    parameters = [name for name in names_of(file, "parameter") if name in formula]
    assert set(parameters) == set(formula)
    with unit(file, tmp_path / "slider", "me") as plant:
        plant.set({"k.stiffness": k, "k.damping": c, "mass.mass": mass, "F": u})
        plant.set(dict(zip(names_of(file, "state"), (q, v), strict=True)))
        rates = [item.name for item in plant.description.modelVariables if item.name.startswith("der(")]
        seen = [plant.references[name] for name in (*rates, "a")]
        assert plant.get([*rates, "a"]) == pytest.approx([v, acceleration, acceleration], rel=1e-14)
        for name in parameters:
            forward = plant.fmu.getDirectionalDerivative(seen, [plant.references[name]], [2.0])
            assert forward == pytest.approx([0.0, 2 * formula[name], 2 * formula[name]], rel=1e-13)
        known = [plant.references[name] for name in (*parameters, *names_of(file, "state"), "F")]
        # fmpy takes as many sensitivities as there are unknowns where it is not told better
        backward = plant.fmu.getAdjointDerivative(seen, known, [1.0, 10.0, 100.0], nSensitivity=len(known))
        slopes = [110 * formula[name] for name in parameters]
        assert backward == pytest.approx([*slopes, -110 * k / mass, 1 - 110 * c / mass, 110 / mass], rel=1e-13)


def test_a_mass_of_zero_is_refused_when_it_is_set(tmp_path):
    file = mx.to_fmu(slider(), tmp_path / "slider.fmu", tunable=("mass.mass",))
    with unit(file, tmp_path / "slider") as plant:
        plant.set({"mass.mass": 0.0})
        with pytest.raises(Exception, match="fmi3GetFloat64 failed"):
            plant.get(["z"])
        plant.set({"mass.mass": 3.0})
        plant.step(0.0, 0.1)


@pytest.mark.parametrize("name", ["wheel.mass", "body.mass"])
def test_a_mass_that_rounding_leaves_is_none(name, tmp_path):
    """M = ((w + b, b), (b, b)) without w or b is singular; what b - b leaves of it is noise of 1e-16."""
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "car.fmu", tunable=("wheel.mass", "body.mass"))
    with unit(file, tmp_path / "car") as plant:
        for small in (0.0, 1e-300):
            plant.set({name: small})
            with pytest.raises(Exception, match="failed"):
                plant.get(["body.z"])
        plant.set({name: 1e-6})        # small, and a mass all the same
        plant.get(["body.z"])


def test_states_beyond_all_numbers_are_an_error(tmp_path):
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "car.fmu", tunable=("tyre.stiffness",))
    with unit(file, tmp_path / "car") as plant:
        plant.set({"tyre.stiffness": -1e12, "load": 1.0})
        with pytest.raises(Exception, match="failed"):
            plant.step(0.0, 1.0)
        plant.set({"tyre.stiffness": 1e5})
        plant.step(0.0, 1e-3)
        assert np.isfinite(plant.get(["body.z"])).all()


def test_slopes_are_those_of_every_matrix():
    system = library.quarter_car().linearize()
    result = affine(system, ["*.stiffness", "*.damping", "*.mass"], "test")
    values = {name: result.values[i] * (1.5 + 0.1 * i) for i, name in enumerate(result.names)}
    changed = library.quarter_car().with_values(values).linearize(system.coordinates)
    shift = np.array(list(values.values())) - result.values
    for label in result.slopes:
        expected = getattr(changed, label)
        guess = getattr(system, label) + np.tensordot(shift, result.slopes[label], 1)
        assert guess == pytest.approx(expected, rel=1e-13, abs=1e-13 * max(np.abs(expected).max(initial=0), 1e-300))


def test_stiffness_without_value_gets_its_slope():
    system = slider(stiffness=0.0)
    assert affine(system, ["k.stiffness"], "test").slopes["K"] == pytest.approx(np.ones((1, 1, 1)), rel=1e-15)


def loaded():
    """A pendulum: its mass is also its load."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 2.0, INERTIA, (0, 0, -1))
    model.add_joint("pin", "revolute", "ground", "bob", (0, 0, 0), axis=(0, 1, 0))
    model.add_input("F", "bob", "x")
    model.add_output("x", "bob", "x")
    return model


def test_mass_under_gravity_is_tuned_with_its_weight(tmp_path):
    file = mx.to_fmu(loaded().linearize(), tmp_path / "pendulum.fmu", tunable=("bob.mass",))
    space = loaded().with_values({"bob.mass": 5.0}).linearize().state_space()
    with unit(file, tmp_path / "pendulum", "me") as plant:
        plant.set({"bob.mass": 5.0})
        plant.fmu.enterContinuousTimeMode()
        assert plant.derivatives(0.0, [0.3, 0.0], {"F": 0.0}) == pytest.approx(space.A @ [0.3, 0.0], rel=1e-12)


@pytest.mark.parametrize(
    ("tunable", "words"),
    [
        (("platform.position.z",), r"'platform\.position\.z' cannot be tuned.*platform\.mass"),
        (("leg1.foot.position.x",), r"not affine in it\. They would be in stiffness.*with_values"),
    ],
)
def test_what_is_not_affine_is_refused_by_name(tunable, words, tmp_path):
    with pytest.raises(mv.ExportError, match=words):
        mx.to_fmu(stewart_model().linearize(), tmp_path / "plant.fmu", tunable=tunable)
    assert not list(tmp_path.iterdir())


def test_an_unknown_parameter_is_told():
    with pytest.raises(mv.ModelError, match=r"no parameter 'k\.stifness'.*Did you mean"):
        mx.to_fmu(slider(), "slider.fmu", tunable=("k.stifness",))


def test_what_has_no_parameters_is_refused(tmp_path):
    system = slider()
    path = tmp_path / "slider.fmu"
    with pytest.raises(mv.ExportError, match="StateSpace knows no parameters"):
        mx.to_fmu(system.state_space(), path, tunable=("k.stiffness",))
    with pytest.raises(mv.ExportError, match="to_fmu: tunable = 3; expected a name, or a list of names"):
        mx.to_fmu(system, path, tunable=3)
    with pytest.raises(mv.ExportError, match="realization = 'modal' with tunable"):
        mx.to_fmu(system, path, tunable=("k.stiffness",), realization="modal")
    with pytest.raises(mv.ExportError, match="control, which knows no parameters"):
        mx.to_fmu(mx.to_control(system), path, tunable=("k.stiffness",))
    with pytest.raises(mv.ExportError, match=r"that model\.linearize\(\) returned"):
        mx.to_fmu(system.reachable(), path, tunable=("k.stiffness",))
