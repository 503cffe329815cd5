"""Trade-offs against fronts in closed form, curved either way, and against bounded least squares."""

import csv

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import plots, studies
from tests.studies.test_balancing import NAMES, SHAPES, least_squares, run, weighted_hoeken

X, Y = "plate.mass", "k.stiffness"


def plate():
    model = mv.Model("plate")
    model.add_body("plate", 2.0, (1, 1, 1))
    model.add_joint("slide", "prismatic", "ground", "plate", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_spring("k", "ground", "plate", start=(0, 0, -1), end=(0, 0, 0), stiffness=2.0)
    return model


def distances():
    """Squared distances of two variables from (1, 1) and from (2, 1): the front is the line between."""
    x, y = studies.variable(X), studies.variable(Y)
    return {"left": (x - 1.0) ** 2 + (y - 1.0) ** 2, "right": (x - 2.0) ** 2 + (y - 1.0) ** 2}


def test_two_distances():
    front = studies.trade_off(plate(), {X: (0.5, 3.0), Y: (0.5, 3.0)}, distances(), divisions=8)
    assert len(front) == 9
    left, right = front.values.values()
    assert np.sqrt(left) + np.sqrt(right) == pytest.approx(np.ones(9), abs=1e-5)
    assert front.variables[X] == pytest.approx(1.0 + np.sqrt(left), abs=1e-5)
    assert front.variables[Y] == pytest.approx(np.ones(9), abs=1e-5)
    w = front.weights[1:-1]
    # where w_1 n_1 = w_2 n_2, but for the share of the sum
    assert front.values["left"][1:-1] / right[1:-1] == pytest.approx(w[:, 1] / w[:, 0], rel=0.02)
    assert front.ideal == pytest.approx({"left": 0.0, "right": 0.0}, abs=1e-9)
    assert front.began == {"left": 2.0, "right": 1.0}
    assert all(front.optima[i].model.parameters[X] == front.variables[X][i] for i in range(9))


def test_a_front_that_no_weighted_sum_finds():
    """x against 1 - x^2, of x = mass - 1: sums of both are least at one of the two ends only."""
    x = studies.variable(X) - 1.0
    front = studies.trade_off(plate(), {X: (1.2, 2.0)}, {"a": x, "b": 1.0 - x**2}, divisions=10)
    assert len(front) == 11
    assert front.values["b"] == pytest.approx(1.0 - front.values["a"] ** 2, abs=1e-9)
    assert np.diff(front.values["a"]).max() < 0.2


@pytest.mark.slow
def test_quantities_of_the_equations_and_a_constraint():
    """A lighter plate against a lower frequency, no stiffer than a bound: f = sqrt(k / m) / 2 pi."""
    quantities = {"mass": studies.variable(X), "f": studies.frequency(1)}
    bounds = {X: (1.0, 4.0), Y: (1.0, 9.0)}
    front = studies.trade_off(plate(), bounds, quantities, studies.variable(Y) >= 4.0, divisions=4)
    assert front.variables[Y] == pytest.approx(np.full(5, 4.0), rel=1e-5)
    assert front.values["f"] == pytest.approx(np.sqrt(4.0 / front.values["mass"]) / (2 * np.pi), rel=1e-5)
    assert front.values["mass"][[0, -1]] == pytest.approx([1.0, 4.0], rel=1e-5)


@pytest.mark.slow
def test_quantities_of_a_loop_around_each_system():
    """A gain c of velocity against damping: that of a plate is c / 2 sqrt(k m), k = 2."""
    model = plate()
    model.add_output("plate.vz", "plate", "z", quantity="velocity")
    model.add_input("force", "plate", "z")
    quantities = {"gain": studies.variable("c"), "loss": -studies.damping_ratio(1)}
    front = studies.trade_off(model, {"c": (0.1, 1.0), X: (1.0, 4.0)}, quantities, divisions=4,
                              plant=lambda system, c=0.5: system.feedback([[-c]], ["plate.vz"], ["force"]))  # fmt: skip
    assert front.began["loss"] == pytest.approx(-0.5 / (2.0 * np.sqrt(2.0 * 2.0)), rel=1e-12)
    assert front.variables[X] == pytest.approx(np.ones(5), rel=1e-6)
    assert front.values["loss"] == pytest.approx(-front.values["gain"] / (2.0 * np.sqrt(2.0)), rel=1e-6)
    assert front.values["gain"][[0, -1]] == pytest.approx([0.1, 1.0], rel=1e-6)
    assert front.optima[0].plant.modes().damping_ratios == pytest.approx(-front.values["loss"][0], rel=1e-12)


def test_quantities_that_agree_have_one_design():
    x = studies.variable(X)
    front = studies.trade_off(plate(), {X: (1.0, 4.0)}, {"a": x, "b": 2.0 * x}, divisions=3)
    assert len(front) == 1
    assert front.left_out["same as others"] == 3
    assert "1 design of 4 local searches; not on the front: 3 same as others" in str(front)


@pytest.mark.slow
def test_force_against_moment_against_torque(tmp_path):
    """All samples are linear in the masses: a design on the front is a least square of some weights."""
    model, machine = weighted_hoeken(), run()
    quantities = {what: machine.mean_square(what) for what in SHAPES}
    front = studies.trade_off(model, dict.fromkeys(NAMES, (0.0, 5.0)), quantities, divisions=2)
    assert 3 <= len(front) <= 6
    assert front.ideal["force"] == pytest.approx(0.0, abs=1e-8)
    cycle = machine.cycle(model)
    for weights in ({"force": 1.0, "moment": 0.3, "torque": 0.1}, {"force": 0.1, "moment": 0.1, "torque": 1.0}):
        least = machine.cycle(model.with_values(dict(zip(NAMES, least_squares(model, NAMES, weights), strict=True))))
        sums = sum(weight / cycle.rms(what) ** 2 * (front.values[what] - least.rms(what) ** 2)
                   for what, weight in weights.items())  # fmt: skip
        assert sums.min() >= -1e-9
    reached = machine.cycle(front.optima[1].model)
    assert [front.values[what][1] for what in SHAPES] == pytest.approx([reached.rms(what) ** 2 for what in SHAPES])
    with open(front.to_csv(tmp_path / "front.csv"), encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["moment"]) for row in rows] == front.values["moment"].tolist()
    figure = plots.trade_off(front)
    assert [axes.get_xlabel() for axes in figure.axes[:3]] == ["mean square force [N²]"] * 2 + [
        "mean square moment [(N m)²]"]  # fmt: skip
    assert figure.axes[0].collections[0].get_offsets().tolist() == list(
        map(list, zip(front.values["force"], front.values["moment"], strict=True)))  # fmt: skip


def test_progress():
    seen = []
    studies.trade_off(plate(), {X: (0.5, 3.0), Y: (0.5, 3.0)}, distances(), divisions=2,
                      progress=lambda done, total: seen.append((done, total)))  # fmt: skip
    assert seen == [(k, 5) for k in range(1, 6)]


def test_optimize_tells_other_quantities():
    distance = (studies.variable(X) - 1.0) ** 2
    best = studies.optimize(plate(), {X: (0.5, 3.0)}, distance, observed={"f": studies.frequency(1)})
    assert best.values[X] == pytest.approx(1.0, rel=1e-5)
    assert best.observed["f"] == pytest.approx([np.sqrt(2.0 / best.values[X]) / (2 * np.pi)], rel=1e-12)
    assert "f: 0.22507" in str(best)


@pytest.mark.parametrize(
    ("words", "said"),
    [({"quantities": {"a": studies.variable(X)}}, "two or more quantities"), ({"divisions": 0}, "divisions = 0"),
     ({"quantities": {"a": 1, "b": 2}}, r"quantities\['a'\] = 1; expected a quantity"), ({"divisions": 2.5}, "a whole"),
     ({"quantities": {"a": studies.variable(X), "b": studies.variable("mass")}}, "variable.'mass'.*no such variable")],
)  # fmt: skip
def test_mistakes_are_named(words, said):
    with pytest.raises(mv.ModelError, match=said):
        studies.trade_off(plate(), {X: (0.5, 3.0)}, **({"quantities": distances()} | words))
