"""Parameters: names, units, values, and a model with other ones."""

from collections.abc import Mapping
from math import cos, sin

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library
from mbsvib.elements import Body, Bushing, Joint, Spring
from mbsvib.linalg.rotations import exponential
from tests.support.random_models import closed_loops, open_trees
from tests.support.sizes import examples

FULL = np.diag([4e4, 3e4, 2e4, 30.0, 20.0, 10.0])
FULL[0, 5] = FULL[5, 0] = 50.0
ANY = st.one_of(open_trees(), closed_loops())


def everything():
    """One part of each kind."""
    model = mv.Model("everything")
    model.add_body("a", 2.0, (0.3, 0.4, 0.5), (0.1, 0.2, 0.3))
    model.add_body("a.b", 1.0, (0.1, 0.1, 0.1, 0.01, 0.02, 0.03), orientation=(0.1, 0.0, 0.0))
    model.add_joint("pin", "revolute", "ground", "a", (0, 0, 1), axis=(1, 1, 0))
    model.add_joint("slide", "prismatic", "a", "a.b", axis=(0, 0, 1))
    model.add_joint("nut", "screw", "ground", "a.b", (1, 0, 0), pitch=0.01)
    model.add_joint("cross", "universal", "ground", "a", (0, 1, 1), axis=(1, 0, 0), axis2=(1, 2, 0))
    model.add_bushing("pad", "ground", "a", (0, 0, 0), (1e4,) * 3 + (10.0,) * 3, orientation=(0, 0, 0.2))
    model.add_bushing("mat", "a", "a.b", (0, 0, 0), FULL, damping=(1.0,) * 6)
    model.add_spring("line", "ground", "a", (0, 0, 0), (0, 0, 2), 1e4)
    return model


def test_names_and_values():
    parameters = everything().parameters
    assert isinstance(parameters, Mapping)
    expected = {
        "a.mass": 2.0, "a.inertia.yy": 0.4, "a.inertia.xy": 0.0, "a.b.inertia.yz": 0.03, "a.position.z": 0.3,
        "a.b.orientation.rx": 0.0, "pin.position.z": 1.0, "slide.orientation.ry": 0.0, "nut.pitch": 0.01,
        "pad.stiffness.x": 1e4, "pad.stiffness.rz": 10.0, "pad.damping.ry": 0.0, "pad.orientation.rz": 0.0,
        "mat.stiffness.x": 4e4, "mat.stiffness.x.rz": 50.0, "mat.stiffness.y.rx": 0.0, "mat.damping.z": 1.0,
        "line.stiffness": 1e4, "line.damping": 0.0, "line.start.z": 0.0, "line.end.z": 2.0,
    }  # fmt: skip
    assert {name: parameters[name] for name in expected} == expected
    assert len(parameters) == len(set(parameters)) == 2 * 13 + 3 * 6 + 1 + 3 + 18 + (21 + 6 + 6) + 8
    for absent in ("slide.position.x", "pin.pitch", "mat.stiffness.rz.x", "line.stiffness.x", "ground.mass", "mass"):
        assert absent not in parameters


@pytest.mark.parametrize(("name", "expected"), [
    ("a.mass", "kg"), ("a.b.inertia.xy", "kg m^2"), ("a.position.x", "m"), ("line.start.x", "m"), ("line.end.z", "m"),
    ("pin.orientation.rx", "rad"), ("nut.pitch", "m/rad"), ("line.stiffness", "N/m"), ("line.damping", "N s/m"),
    ("pad.stiffness.z", "N/m"), ("pad.stiffness.rz", "N m/rad"), ("pad.damping.x", "N s/m"),
    ("pad.damping.rx", "N m s/rad"), ("mat.stiffness.x.y", "N/m"), ("mat.stiffness.x.rz", "N/rad"),
    ("mat.stiffness.rx.rz", "N m/rad"),
])  # fmt: skip
def test_units(name, expected):
    assert everything().parameters.units[name] == expected


def test_units_of_a_damping_matrix():
    model = mv.Model("m")
    model.add_body("a", 2.0, (0.3, 0.4, 0.5))
    model.add_bushing("mat", "ground", "a", (0, 0, 0), damping=FULL)
    assert model.parameters.units["mat.damping.x.rz"] == "N s/rad"
    assert model.parameters.units["mat.damping.rx"] == "N m s/rad"


def test_units_of_a_model():
    parameters = everything().parameters
    assert list(parameters.units) == list(parameters)
    assert parameters.units["line.damping"] == parameters.entry("line.damping").unit == "N s/m"
    assert {parameters.entry(name).part for name in parameters} == set(parameters.parts)


def test_unknown_names_suggest_the_nearest():
    model = library.stewart()
    with pytest.raises(mv.ModelError, match=r"Did you mean 'leg1\.k\.stiffness'\?") as caught:
        model.parameters["leg1.k.stifness"]
    assert isinstance(caught.value, KeyError)
    assert caught.value.element == "leg1.k.stifness"
    assert "leg1.k.stifness" not in model.parameters
    assert model.parameters.get("nothing.like.it") is None
    with pytest.raises(mv.ModelError, match="leg9"):
        model.with_values({"leg9.*": 1.0})
    with pytest.raises(mv.ModelError, match=r"model\.parameters"):
        model.parameters["leg1.k"]


def test_a_system_keeps_the_parameters_that_it_was_made_of():
    model = everything()
    model = model.with_parts(joints={k: part for k, part in model.joints.items() if k not in ("cross", "nut")})
    system = model.linearize()
    before = dict(system.parameters)
    assert before == dict(model.parameters)
    model.add_body("late", 1.0, (1, 1, 1))
    assert dict(system.parameters) == before
    assert "late.mass" in model.parameters


@pytest.mark.slow
@examples(20, slow=20)
@given(ANY)
def test_values_as_they_are_change_nothing(model):
    again = model.with_values(dict(model.parameters))
    assert dict(again.parameters) == dict(model.parameters)
    assert again.inputs == model.inputs
    assert again.outputs == model.outputs
    for name, part in model.springs.items():
        assert again.springs[name].constructor_kwargs().keys() == part.constructor_kwargs().keys()
    for name, joint in model.joints.items():
        assert_allclose(np.array(again.joints[name].axes), joint.axes, rtol=0, atol=1e-15)
        assert [d for d, _ in again.joints[name].freedom] == [d for d, _ in joint.freedom]


@pytest.mark.slow
@given(ANY, st.integers(0, 10**6))
def test_with_values_sets_what_it_names_and_nothing_else(model, seed):
    rng = np.random.default_rng(seed)
    parameters = model.parameters
    name = list(parameters)[rng.integers(len(parameters))]
    value = 1.01 * parameters[name] + 1e-3 * ("inertia" not in name)
    changed = model.with_values({name: value})
    expected = dict(parameters)
    if "orientation" not in name:  # which is counted from the new pose
        expected[name] = value
    assert dict(changed.parameters) == expected
    assert dict(model.parameters) == dict(parameters)
    entry = parameters.entry(name)
    same = [part for part in changed.parameters.parts.values() if part == parameters.parts[part.name]]
    assert {part.name for part in same} == set(parameters.parts) - {entry.part}


def test_a_small_rotation_turns_the_axes_about_world_axes():
    model, angle = everything(), 0.3
    turn = np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]])
    for name in ("pin", "slide", "nut", "pad", "mat", "a", "a.b", "cross"):
        part = model.parameters.parts[name]
        after = model.with_values({f"{name}.orientation.rz": angle}).parameters.parts[name]
        key = "axes" if isinstance(part, Joint) else "orientation"
        assert isinstance(part, Body | Bushing | Joint)
        assert_allclose(np.array(getattr(after, key)), turn @ getattr(part, key), rtol=0, atol=1e-15)
        if isinstance(part, Joint):
            for (_, before), (_, result) in zip(part.freedom, after.freedom, strict=True):
                assert_allclose(result[:3], turn @ before[:3], rtol=0, atol=1e-15)
                assert_allclose(result[3:], turn @ before[3:], rtol=0, atol=1e-15)


def test_rotations_are_the_exponential_map():
    rng = np.random.default_rng(4)
    vectors = np.concatenate([rng.normal(size=(3, 40)) * 10.0 ** rng.uniform(-12, 0.5, size=40), np.zeros((3, 1))], 1)
    for (x, y, z), result in zip(vectors.T, exponential(vectors.T), strict=True):
        with mpmath.workdps(40):
            exact = mpmath.expm(mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]), method="taylor")
        assert_allclose(result, np.array(exact.tolist(), dtype=float), rtol=0, atol=1e-15)
    assert_allclose(exponential(np.zeros(3)), np.eye(3), atol=0)


def test_patterns_tie_parameters_and_names_go_before_them():
    model = library.stewart()
    changed = model.with_values({"leg*.k.stiffness": 1e7, "leg2.k.stiffness": 2e7}).parameters
    assert [changed[f"leg{i}.k.stiffness"] for i in range(1, 7)] == [1e7, 2e7, 1e7, 1e7, 1e7, 1e7]
    with pytest.raises(mv.ModelError, match=r"both 'leg\*.k.stiffness' and '\*.stiffness' match 'leg1.k.stiffness'"):
        model.with_values({"leg*.k.stiffness": 1e7, "*.stiffness": 2e7})


@pytest.mark.parametrize(("name", "value", "words"), [
    ("a.mass", -1.0, "body 'a': mass = -1.0"), ("a.inertia.xx", 5.0, "no body has one that exceeds"),
    ("a.mass", float("nan"), "NaN"), ("line.stiffness", 0.0, "neither stiffness nor damping"),
    ("line.end.z", 0.0, "a point other than start"), ("a.mass", "heavy", "expected a finite number \\[kg\\]"),
])  # fmt: skip
def test_refused_values(name, value, words):
    with pytest.raises(mv.ModelError, match=words):
        everything().with_values({name: value})


def test_symmetric_partners_change_together():
    part = everything().with_values({"mat.stiffness.x.rz": 40.0, "mat.stiffness.y.z": 7.0}).springs["mat"]
    assert part.stiffness[0][5] == part.stiffness[5][0] == 40.0
    assert part.stiffness[1][2] == part.stiffness[2][1] == 7.0
    assert isinstance(everything().springs["line"], Spring)


def test_parameters_are_columns(tmp_path):
    model = mv.library.quarter_car()
    columns = model.parameters.columns()
    assert dict(zip(columns["parameter"].tolist(), columns["value"].tolist(), strict=True)) == dict(model.parameters)
    assert dict(zip(columns["parameter"].tolist(), columns["unit"].tolist(), strict=True))["body.mass"] == "kg"
    assert model.parameters.to_csv(tmp_path / "parameters.csv").read_text().startswith("parameter,value,unit\n")
