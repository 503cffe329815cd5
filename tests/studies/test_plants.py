"""Studies of plants around each system: closed loops, exact derivatives through them, gains as variables."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from mbsvib.errors import ModelError
from mbsvib.library import quarter_car
from mbsvib.studies.derivatives import Differences, OfLoop, OfSystem
from mbsvib.studies.design import design
from mbsvib.studies.evaluation import DesignPoint
from mbsvib.studies.plants import Systems, plant_of
from mbsvib.studies.search import Search, scales
from tests.studies.test_optimize import two

FLOOR = {"load": [(2.0, 1.0), (8.0, 0.5)]}
CAR = quarter_car(suspension_damping=300.0)
CAR_VARIABLES = ("g", "suspension.damping", "body.mass")


def law(g, tau=0.02):
    """A spring of g N/m behind a filter."""
    return mv.StateSpace.from_arrays([[-1 / tau]], [[1.0]], [[-g / tau]], [[0.0]], outputs=["actuator"],
                                     inputs=["travel"])  # fmt: skip


def sprung(system, g=3e3):
    return system.feedback([[-g]], ["travel"], ["actuator"])


def filtered(system, g=3e3):
    return system.feedback(law(g), ["travel"], ["actuator"], noise=True)


def heavier(system, g=20.0):
    """Feedback of acceleration: the loop has no equations of second order."""
    return system.feedback([[-g]], ["body.az"], ["actuator"])


def designed(system, g=3e3):
    """A controller that depends on the mass of the body."""
    return filtered(system, g * system.M[0, 0] / 300.0)


def sampled(system, g=3e3):
    return system.feedback(law(g), ["travel"], ["actuator"]).sampled(200.0)


def selected(system):
    return system[["body.z"], ["load"]]


QUANTITIES = {
    "rms": st.rms("body.z", FLOOR), "white": st.rms("body.z", {"load": 1.0}), "peak": st.peak("body.z", "load"),
    "band": st.rms("body.z", FLOOR, (1.0, 5.0)), "gain": st.gain("body.z", "load", [1.0, 3.0]),
    "damping": st.damping_ratio(), "frequency": st.frequency(),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "form", "quantities"), [
    (sprung, OfLoop, ["rms", "damping"]), (filtered, OfLoop, ["white", "band", "peak", "gain", "damping", "frequency"]),
    (heavier, OfLoop, ["gain", "damping"]),
    pytest.param(designed, Differences, ["gain"], marks=pytest.mark.slow),
    pytest.param(sampled, Differences, ["white"], marks=pytest.mark.slow),
    (selected, OfSystem, ["gain", "frequency"])])  # fmt: skip
def test_derivatives_are_differences_of_the_exact_plant(plant, form, quantities):
    """Differences of fourth order, along one direction of the logarithms of all variables."""
    names = CAR_VARIABLES if plant is not selected else CAR_VARIABLES[1:]
    bounds, around = dict.fromkeys(names, (1.0, 1e6)), plant_of(plant, names, CAR)
    variables = design(CAR, names, None, around.gains)
    observed = {name: QUANTITIES[name] for name in quantities}
    search = Search(Systems(CAR, variables, around), scales(variables, bounds, None),
                    next(iter(observed.values()))[0], (), observed)  # fmt: skip
    point = search.point(np.zeros(len(names)))
    assert isinstance(point.derivatives, form)
    slopes = {name: quantity.at(point).slope for name, quantity in observed.items()}
    step, direction = 2e-3, np.array([0.3, 0.8, -0.7])[-len(names) :]
    ends = [search.observations(k * step * direction) for k in (-2, -1, 1, 2)]
    for name in quantities:
        values = [end[name] for end in ends]
        expected = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        size = np.abs(slopes[name]).max()
        np.testing.assert_allclose(slopes[name] @ direction, expected, rtol=1e-6, atol=1e-7 * size, err_msg=name)


def test_a_gain_beside_a_spring_is_as_a_second_spring():
    """A gain of the relative displacement acts as a spring: the optimum of their sum is that of the one spring."""
    target = st.placement({1: 1.5})
    spring = mv.optimize(CAR, {"suspension.stiffness": (1e4, 1e5)}, target)
    gain = mv.optimize(CAR, {"g": (1e2, 1e5)}, target, plant=sprung)
    stiffness = CAR.parameters["suspension.stiffness"]
    assert gain.values["g"] + stiffness == pytest.approx(spring.values["suspension.stiffness"], rel=1e-5)
    assert gain.plant.modes().frequencies[0] == pytest.approx(1.5, rel=1e-6)
    assert gain.parameters == {}


@pytest.mark.slow
def test_damping_and_gain_together_reach_a_constraint_at_the_loop():
    """The damper does what the gain leaves: 2 zeta w m = c + g of a velocity gain, closed form of one mass."""
    model = two()
    model.add_input("F", "slow", "x")
    model.add_output("v", "slow", "x", quantity="velocity")

    def plant(system, g=1.0):
        return system.feedback([[-g]], ["v"], ["F"])

    result = mv.optimize(model, {"g": (0.1, 100.0), "slow.spring.damping": (0.5, 1.0)}, st.variable("g"),
                         st.damping_ratio(1) >= 0.2, plant=plant)  # fmt: skip
    mass, k = model.parameters["slow.mass"], model.parameters["slow.spring.stiffness"]
    assert result.success
    assert result.values["slow.spring.damping"] == pytest.approx(1.0, rel=1e-6)
    assert result.values["g"] == pytest.approx(0.4 * np.sqrt(k * mass) - 1.0, rel=1e-5)


@pytest.mark.slow
def test_tolerances_of_a_loop_are_those_of_the_springs_it_stands_for():
    share = {"g": "5 %", "suspension.stiffness": "2 %"}  # variables keep this order
    of = {"f": st.frequency(), "z": st.gain("body.z", "load", 1.0)}
    loop = mv.tolerances(CAR, share, of, samples=10, plant=sprung)
    model = quarter_car(suspension_damping=300.0)
    k = model.parameters["suspension.stiffness"]
    model = model.with_values({"suspension.stiffness": k + 3e3})
    springs = mv.tolerances(model, {"g": 150.0, "k": 0.02 * k}, of, samples=10, ties={
        "k": {"suspension.stiffness": 1.0}, "g": {"suspension.stiffness": 1.0}})  # fmt: skip
    for name in ("nominal", "first", "worst", "shares", "sampled", "linear"):
        np.testing.assert_allclose(getattr(loop, name), getattr(springs, name), rtol=1e-8, err_msg=name)


def test_close_modes_of_a_loop_split_as_those_of_springs():
    """Equal masses on equal springs: the link splits their modes, here in the loop as in the mechanism."""

    def pair(link):
        model = mv.Model("pair")
        for name, place in (("a", 0.0), ("b", 1.0)):
            model.add_body(name, mass=1.0, inertia=(1, 1, 1), position=(place, 0, 0))
            model.add_joint(f"{name}.slide", "prismatic", "ground", name, position=(place, 0, 0), axis=(1, 0, 0))
            model.add_spring(f"{name}.k", "ground", name, start=(place - 1, 0, 0), end=(place, 0, 0), stiffness=100.0,
                             damping=0.2)  # fmt: skip
        if link:
            model.add_spring("link", "a", "b", start=(0, 0, 0), end=(1, 0, 0), stiffness=0.01)
        model.add_input("F", "b", "x", relative_to="a")
        model.add_output("gap", "b", "x", relative_to="a")
        return model

    share = {"a.k.stiffness": 1.0, "b.k.stiffness": 1.0}

    def linked(system):
        """The same link, behind a filter of 1 us, so that the loop has states."""
        space = mv.StateSpace.from_arrays([[-1e6]], [[1e6]], [[-0.01]], [[0.0]])
        return system.feedback(space, ["gap"], ["F"])

    loop = mv.tolerances(pair(False), share, st.frequency([1, 2]), samples=20, plant=linked)
    springs = mv.tolerances(pair(True), share, st.frequency([1, 2]), samples=20)
    assert loop.close_modes.all()
    np.testing.assert_allclose(loop.linear, springs.linear, rtol=1e-6)
    np.testing.assert_allclose(loop.first, springs.first, rtol=1e-4)


def test_modes_of_loops_keep_their_names_through_a_crossing():
    """Two masses that do not act on each other: one frequency is that of k + g, at any filter."""
    model = two()
    model.add_input("F", "slow", "x")
    model.add_output("x", "slow", "x")
    space = mv.StateSpace.from_arrays([[-1e5]], [[1e5]], [[-1.0]], [[0.0]])

    def plant(system, g=0.0):
        return system.feedback(mv.StateSpace.from_arrays(space.A, space.B, g * space.C, space.D), ["x"], ["F"])

    k = model.parameters["slow.spring.stiffness"]
    g = np.linspace(1.0, 800.0, 7)
    result = mv.track(model, {"g": g}, {"across": 1, "along": 2}, plant=plant)
    assert np.allclose(result.mode("across"), np.sqrt(k + g) / (2 * np.pi), rtol=1e-3)
    assert np.allclose(result.mode("along"), 20.0 / (2 * np.pi), rtol=1e-9)
    static = mv.track(model, {"g": g}, {"across": 1, "along": 2},
                      plant=lambda system, g: system.feedback([[-g]], ["x"], ["F"]))  # fmt: skip
    assert np.allclose(static.mode("across"), np.sqrt(k + g) / (2 * np.pi), rtol=1e-12)


def test_sweeps_vary_gains(tmp_path):
    g, file = np.array([1e3, 2e3]), tmp_path / "gains.jsonl"
    loops = mv.sweep(CAR, {"g": g}, "poles", plant=sprung, file=file)
    k = CAR.parameters["suspension.stiffness"]
    springs = mv.sweep(CAR, {"suspension.stiffness": k + g}, "poles")
    np.testing.assert_allclose(np.sort_complex(loops["poles"]), np.sort_complex(springs["poles"]), rtol=1e-9)
    with pytest.raises(ModelError, match="another study"):
        mv.sweep(CAR, {"g": 2 * g}, "poles", plant=sprung, file=file)


def test_gradients_of_a_loop_alone():
    """A quantity of a loop has the derivatives of its own mechanism."""
    loop = filtered(CAR.linearize())
    quantity, name = st.rms("body.z", FLOOR), "suspension.damping"
    value = CAR.parameters[name]
    ends = [quantity(filtered(CAR.with_values({name: value * (1 + side)}).linearize())) for side in (-1e-4, 1e-4)]
    assert quantity.gradient(loop, name)[0, 0] == pytest.approx((ends[1] - ends[0]) / (2e-4 * value), rel=1e-6)


def test_quantities_of_ones_own_have_derivatives_to_gains():
    """They had the derivative 0: what the function returns is that to parameters of the mechanism."""
    names = ("g", "body.mass")
    around = plant_of(filtered, names, CAR)
    point = DesignPoint.at(Systems(CAR, design(CAR, names, None, around.gains), around),
                           {"g": 3e3, "body.mass": 300.0}, np.ones(2), np.array([3e3, 300.0]))  # fmt: skip
    own = st.given(lambda loop, rates: (loop.modes().frequencies, np.zeros((len(loop.modes()), len(rates)))), "own")
    assert own.at(point).slope == pytest.approx(st.frequency(range(1, len(point.modes) + 1)).at(point).slope, rel=1e-6)


def test_what_cannot_be_asked_is_refused():
    with pytest.raises(ModelError, match="'gain' has no default"):
        mv.optimize(CAR, {"suspension.damping": (1.0, 2.0)}, QUANTITIES["rms"], plant=lambda system, gain: system)
    with pytest.raises(ModelError, match="give start"):
        mv.optimize(CAR, {"g": (1.0, 2.0)}, QUANTITIES["rms"], plant=lambda system, g: sprung(system, g))
    with pytest.raises(ModelError, match="cannot be followed"):
        mv.optimize(CAR, {"g": (1e3, 4e3)}, st.frequency(1), plant=sampled)
    with pytest.raises(ModelError, match="function of a system"):
        mv.tolerances(CAR, {"suspension.damping": 1.0}, plant=3.0)
