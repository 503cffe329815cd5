"""Variables as functions of parameters: what ties move, by how much, and how fast."""

from dataclasses import dataclass
from typing import Any

import mpmath as mp
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib import studies as st
from mbsvib.linalg.rotations import exponential, jacobian
from mbsvib.studies.design import design
from mbsvib.studies.plants import Systems


@dataclass(frozen=True)
class Power:
    """k = scale x^2 and c = scale y x: two variables, neither of them linear."""

    scale: float

    @property
    def start(self):
        known = car().parameters
        x = (known["suspension.stiffness"] / self.scale) ** 0.5
        return {"x": x, "y": known["suspension.damping"] / (self.scale * x)}

    @property
    def units(self):
        return {"x": "m"}

    def values(self, at):
        at = self.start | at
        return {"suspension.stiffness": self.scale * at["x"] ** 2, "suspension.dam*": self.scale * at["x"] * at["y"]}

    def rates(self, at):
        full = self.start | at
        x, y = self.scale * full["x"], self.scale * full["y"]
        rates = {"x": {"suspension.stiffness": 2 * x, "suspension.damping": y}, "y": {"suspension.damping": x}}
        return {name: rates[name] for name in at}


def car():
    return library.quarter_car()


def test_systems_at_values_are_those_of_rebuilt_models():
    """Of the plant at rest, whose parts turn from the same axes; values are refused in the words of models."""
    model = library.quarter_car()
    at = {"suspension.stiffness": 3e4, "body.mass": 250.0, "wheel.orientation.rx": 0.2, "wheel.orientation.ry": -0.1}
    variables = design(model, [*at])
    systems = Systems(model, variables)
    rebuilt = model.with_values(at).linearize()
    system = systems.at(at)
    assert systems.compiled is not None
    assert system.provenance.origin.parameters == rebuilt.provenance.origin.parameters
    result, expected = (each.eigenvalue_sensitivities(variables.rates(at)) for each in (system, rebuilt))
    assert np.allclose(result, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    with pytest.raises(mv.ModelError) as refusal:
        systems.at({**at, "body.mass": -1.0})
    with pytest.raises(mv.ModelError) as of_model:
        model.with_values({**at, "body.mass": -1.0})
    assert str(refusal.value) == str(of_model.value)
    assert Systems(library.four_bar(), design(library.four_bar(), ["crank.mass"])).compiled is None


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.0099, 0.0101, 0.7, 3.0])
def test_turning_rates_of_rotation_vectors(angle):
    # J dw = axial of dR R^T; fifty digits
    w, dw = angle * np.array([2.0, -1.0, 2.0]) / 3.0, np.array([0.3, 0.5, -0.2])
    with mp.workdps(50):
        def turned(t):
            x, y, z = (mp.mpf(float(a)) + t * mp.mpf(float(b)) for a, b in zip(w, dw, strict=True))
            return mp.expm(mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]))

        h = mp.mpf(10) ** -15
        spin = (turned(h) - turned(-h)) / (2 * h) * turned(0).T
        exact = np.array([float(spin[2, 1]), float(spin[0, 2]), float(spin[1, 0])])
    assert np.allclose(jacobian(w) @ dw, exact, rtol=1e-14, atol=1e-15)


def test_linear_maps_and_functions_add_what_they_change():
    model = car()
    k = model.parameters["suspension.stiffness"]
    power, line = Power(1e4), {"suspension.stiffness": 100.0, "tyre.stiffness": 10.0}
    selected = design(model, ["x", "line", "y"], {"x": power, "y": power, "line": line})
    assert selected.start == power.start | {"line": 0.0}
    assert selected.units == {"x": "m"}
    at = {"x": np.array([1.0, 2.0]), "line": np.array([3.0, 0.0]), "y": np.array([0.1, 0.2])}
    result = selected.values(at)
    assert np.allclose(result["suspension.stiffness"], [1e4 + 300.0, 4e4], rtol=1e-15)
    assert np.allclose(result["suspension.damping"], [1e3, 4e3], rtol=1e-15)
    rates = selected.rates({"x": 2.0, "line": 0.0, "y": 0.2})
    assert list(rates) == ["x", "line", "y"]
    assert rates["x"] == {"suspension.stiffness": 4e4, "suspension.damping": 2e3}
    assert rates["line"] == line
    # one of several variables alone: the others are where they start
    single = design(model, ["x"], {"x": power, "y": power}).values({"x": 2.0})
    assert single["suspension.damping"] == 1e4 * 2.0 * power.start["y"]
    assert design(model, ["line"], {"line": line}).values({"line": 1.0})["suspension.stiffness"] == k + 100.0


def test_names_go_before_patterns_in_rates_as_in_values():
    rates = design(car(), ["*.stiffness", "tyre.stiffness"]).rates({"*.stiffness": 1.0, "tyre.stiffness": 2.0})
    assert rates == {"*.stiffness": {"suspension.stiffness": 1.0}, "tyre.stiffness": {"tyre.stiffness": 1.0}}


def turned_arm():
    """A hinge between flexures whose axis may be turned about all three axes."""
    model = mv.Model("arm")
    model.add_body("arm", 2.0, (0.3, 0.2, 0.1), (0.4, 0.0, 0.1), orientation=(0.1, 0.2, 0.3))
    model.add_joint("hinge", "revolute", "ground", "arm", (0, 0, 0), axis=(0.1, 0.3, 1.0))
    model.add_bushing("flexure", "ground", "arm", (0.3, 0.1, 0.0), stiffness=(1e3, 4e3, 2e3, 10.0, 30.0, 20.0))
    return model


def test_orientations_turn_from_where_they_are():
    # two components of one rotation vector at once, away from zero: rates are angular velocities, not of components
    model = turned_arm()
    names = ["hinge.orientation.rx", "hinge.orientation.ry", "flexure.orientation.rz", "flexure.orientation.rx"]
    at = dict(zip(names, (0.4, -0.7, 0.5, 0.9), strict=True))
    exact = st.frequency().gradient(model.with_values(at).linearize(), design(model, names).rates(at))[0]
    for name, slope in zip(names, exact, strict=True):
        up, down = (model.with_values(at | {name: at[name] + h}).linearize().modes().frequencies[0]
                    for h in (1e-5, -1e-5))  # fmt: skip
        assert slope == pytest.approx((up - down) / 2e-5, rel=1e-7), name


@pytest.mark.parametrize("size", [0.02, 1.0])
def test_sensitivities_of_a_turned_model_are_slopes_of_the_values_given(size):
    """By the maps of ``rates_at``; by the names alone they are rotations from where the parts are."""
    model = turned_arm()
    at = {"hinge.orientation.rx": 0.4 * size, "hinge.orientation.ry": -0.7 * size, "arm.mass": 2.5}
    system = model.with_values(at).linearize()
    assert system.parameters["hinge.orientation.rx"] == 0.0
    given = system.mode_sensitivities(st.rates_at(model, at)).frequencies[:, 0]
    for name, slope in zip(at, given, strict=True):
        up, down = (model.with_values(at | {name: at[name] + h}).linearize().modes().frequencies[0]
                    for h in (1e-5, -1e-5))  # fmt: skip
        assert slope == pytest.approx((up - down) / 2e-5, rel=2e-6), name
        up, down = (model.with_values(at).with_values({name: system.parameters[name] + h}).linearize().modes()
                    .frequencies[0] for h in (1e-5, -1e-5))  # fmt: skip
        assert system.mode_sensitivities([name]).frequencies[0, 0] == pytest.approx((up - down) / 2e-5, rel=2e-6), name
    with pytest.raises(mv.ModelError, match="rates_at: values"):
        st.rates_at(model, {})


@pytest.mark.slow
def test_functions_are_searched_and_swept():
    model, power = car(), Power(1e4)
    result = st.optimize(model, {"x": (0.5, 3.0), "y": (-0.01, 3.0)}, (st.frequency(1) - 1.3) ** 2 * 100
                        + (st.damping_ratio(1) - 0.3) ** 2, ties={"x": power, "y": power})  # fmt: skip
    assert result.success
    assert result.start == power.start
    modes = result.model.linearize().modes()
    assert modes.frequencies[0] == pytest.approx(1.3, rel=1e-5)
    assert modes.damping_ratios[0] == pytest.approx(0.3, rel=1e-5)
    assert result.parameters["suspension.stiffness"] == 1e4 * result.values["x"] ** 2
    assert "x [m]" in str(result)
    swept = st.sweep(model, {"x": [1.0, result.values["x"]], "y": result.values["y"]}, "modes.frequencies",
                     ties={"x": power, "y": power})  # fmt: skip
    assert np.allclose(swept["modes.frequencies"][1], modes.frequencies, rtol=1e-12)
    off = st.tolerances(model, {"x": "1 %"}, st.frequency(1), samples=10, ties={"x": power})
    assert off.tolerance["x"] == pytest.approx(0.01 * power.start["x"], rel=1e-15)


@dataclass(frozen=True)
class Odd:
    moved: Any
    slopes: Any

    def values(self, _):
        return self.moved

    def rates(self, _):
        return self.slopes


STIFF = "suspension.stiffness"


@pytest.mark.parametrize(
    ("tie", "message"),
    [
        (7.0, "an object with values"),
        ({}, "an object with values"),
        (Odd({}, {"x": {STIFF: 1.0}}), "values = {}; expected a mapping"),
        (Odd({STIFF: np.nan}, {"x": {STIFF: 1.0}}), "NaN"),
        (Odd({STIFF: 1.0}, {"z": {STIFF: 1.0}}), "rates of 'z', which it was not given"),
        (Odd({STIFF: 1.0}, {"x": {STIFF: np.inf}}), "infinity"),
        (Odd({STIFF: 1.0}, {"x": {"tyre.stiffness": 1.0}}), "rates of 'tyre.stiffness', and no values"),
        (Odd({"suspension.stifness": 1.0}, {"x": {STIFF: 1.0}}), "Did you mean 'suspension.stiffness'"),
    ],
)
def test_mistakes_are_told(tie, message):
    with pytest.raises(mv.ModelError, match=message):
        design(car(), ["x"], {"x": tie})


def test_what_has_values_of_its_own_is_not_tied_too():
    with pytest.raises(mv.ModelError, match=r"moves 'suspension\.damping', which has values of its own"):
        design(car(), ["x", "suspension.damping"], {"x": Power(1.0)})
    with pytest.raises(mv.ModelError, match="Did you mean 'x1'"):
        design(car(), ["x1"], {"x": Power(1.0), "x1": {STIFF: 1.0}})


def test_ties_of_another_model_are_refused():
    other = car().with_values({STIFF: 1.0})
    with pytest.raises(mv.ModelError, match=r"'suspension\.stiffness' is .*, and 1 in the model; make"):
        design(other, ["x"], {"x": Power(1e4)})


def test_rotation_vectors_are_those_of_changes():
    w = np.array([0.3, -0.2, 0.5])
    step = 1e-6 * np.array([1.0, 2.0, -1.0])
    (first, second), local = (exponential(w + s * step) for s in (1, -1)), 2 * jacobian(w) @ step
    assert np.allclose(first @ second.T, exponential(local), atol=1e-15)
