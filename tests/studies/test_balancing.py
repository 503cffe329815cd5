"""Balancing of running machines: quantities of cycles, counterweights, equimomental systems and trade-offs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

import mbsvib as mv
from mbsvib import library, studies
from mbsvib.errors import ModelError
from tests.support.slow_cases import some

TURN = 2 * np.pi
ANGLES = TURN * np.arange(24) / 24
SHAPES = {"force": "shaking_force", "moment": "shaking_moment", "torque": "torque"}


def cycle_of(model):
    return model.cycle("crank.rz", ANGLES, speed=TURN)


def run():
    return studies.cycle("crank.rz", ANGLES, speed=TURN)


def weighted_hoeken():
    """Points of no mass yet, 80 mm opposite to the crank and the rocker."""
    model, full = library.hoeken(), library.hoeken(balance_radius=0.08)
    places = {f"link{i}": (0.0, full.bodies[f"counterweight{i}"].position) for i in (1, 3)}
    return studies.with_counterweights(model, places)


def least_squares(model, names, weights, bounds=(0.0, 5.0)):
    """The same problem as bounded least squares: all samples are linear in the masses."""
    cycle, zero = cycle_of(model), dict.fromkeys(names, 0.0)
    before = cycle_of(model.with_values(zero))
    each = [cycle_of(model.with_values(zero | {name: 1.0})) for name in names]
    rows, right = [], []
    for what, weight in weights.items():
        scale = np.sqrt(weight) / cycle.rms(what)
        start = before.values(what).ravel()
        columns = [one.values(what).ravel() - start for one in each]
        rows.append(scale * np.array(columns).T)
        right.append(-scale * start)
    return lsq_linear(np.concatenate(rows), np.concatenate(right), bounds=bounds, tol=1e-14).x


NAMES = ("link1.counterweight.mass", "link3.counterweight.mass")


@pytest.mark.slow
def test_the_force_alone_is_balanced_as_berkof_and_lowen_do():
    model = weighted_hoeken()
    best = studies.optimize(model, dict.fromkeys(NAMES, (0.0, 5.0)), run().mean_square("force"))
    assert_allclose([best.values[name] for name in NAMES], [0.4375, 1.5625], rtol=1e-5)
    cycle = cycle_of(best.model)
    assert cycle.rms("force") < 1e-4
    exact = cycle_of(library.hoeken(balance_radius=0.08))
    assert cycle.rms("moment") == pytest.approx(exact.rms("moment"), rel=1e-5)
    assert best.success


WEIGHTS = [{"force": 1.0, "moment": 1.0, "torque": 1.0}, {"force": 1.0, "moment": 0.1}, {"moment": 1.0, "force": 0.01},
           {"force": 0.2, "torque": 1.0}]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("weights", some(WEIGHTS, WEIGHTS[0]))
def test_weighted_optimum_is_that_of_least_squares(weights):
    model, machine = weighted_hoeken(), run()
    best = studies.optimize(model, dict.fromkeys(NAMES, (0.0, 5.0)), machine.weighted(model, weights))
    expected = least_squares(model, NAMES, weights)
    assert_allclose([best.values[name] for name in NAMES], expected, rtol=1e-5, atol=1e-6)
    assert "weighted mean square" in str(best)


@pytest.mark.slow
def test_trade_off_of_force_moment_and_torque():
    """Less of one is more of another, and no design of the front is better in all."""
    model, machine = weighted_hoeken(), run()
    reached = []
    for weight in (0.0, 0.5, 0.9, 0.98, 1.0):
        rest = 0.5 * (1.0 - weight)
        objective = machine.weighted(model, {"force": weight, "moment": rest, "torque": rest})
        best = studies.optimize(model, dict.fromkeys(NAMES, (0.0, 5.0)), objective)
        cycle = cycle_of(best.model)
        reached.append([cycle.rms(what) for what in SHAPES])
    front = np.array(reached)
    assert (np.diff(front[:, 0]) < 1e-9).all()
    assert (np.diff(np.hypot(front[:, 1] / 0.504, front[:, 2] / 0.307)) > -1e-9).all()
    for one in front:
        assert not any((other < one - 1e-6).all() for other in front)
    start = cycle_of(model)
    assert front[0, 0] > 0.5 * start.rms("force")
    assert front[-1, 0] < 1e-3


@pytest.mark.slow
def test_a_bound_on_one_and_the_least_of_another():
    model, machine = weighted_hoeken(), run()
    best = studies.optimize(model, dict.fromkeys(NAMES, (0.0, 5.0)), machine.mean_square("moment"),
                            machine.rms("force") <= 2.0)  # fmt: skip
    cycle = cycle_of(best.model)
    assert cycle.rms("force") == pytest.approx(2.0, rel=1e-6)
    assert best.constraints["rms force [N] <= 2"] == pytest.approx(2.0, rel=1e-6)


@pytest.mark.slow
def test_mass_redistribution():
    """Seven points on coupler and rocker each, their masses free: less of all three at once."""
    model = studies.equimomental(library.hoeken(), ["link2", "link3"], points=7, reach=4.0)
    variables = dict.fromkeys(model.parameters.matching("link?.?.mass"), (0.0, 1.0))
    machine, start = run(), cycle_of(library.hoeken())
    best = studies.optimize(model, variables, machine.weighted(model, {"force": 1, "moment": 1, "torque": 1}))
    cycle = cycle_of(best.model)
    assert all(cycle.rms(what) < start.rms(what) for what in SHAPES)
    expected = least_squares(model, tuple(variables), {"force": 1, "moment": 1, "torque": 1}, (0.0, 1.0))
    found = cycle_of(model.with_values(dict(zip(variables, expected, strict=True))))
    objective = sum((found.rms(what) / start.rms(what)) ** 2 for what in SHAPES)
    assert best.objective == pytest.approx(objective, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("points", [4, 7])
def test_equimomental_systems_move_alike(points):
    for model in (library.hoeken(), library.seven_r()):
        replaced = studies.equimomental(model, points=points)
        assert sum(body.mass for body in replaced.bodies.values()) == pytest.approx(
            sum(body.mass for body in model.bodies.values()))  # fmt: skip
        angles = np.linspace(-0.5, 0.3, 5)
        one, two = (each.cycle("crank.rz", angles, speed=TURN) for each in (model, replaced))
        assert_allclose(two.torque, one.torque, rtol=1e-10)
        assert_allclose(two.shaking_force, one.shaking_force, atol=1e-10 * one.peak("force"))
        assert_allclose(two.shaking_moment, one.shaking_moment, atol=1e-10 * one.peak("moment"))
        assert_allclose(replaced.linearize().M, model.linearize().M, rtol=1e-10)
    some = studies.equimomental(library.hoeken(), "link2", points=points)
    assert some.bodies["link2"].mass == 0.0
    assert some.bodies["link1"].mass > 0.0


@pytest.mark.slow
def test_machines_under_gravity_are_balanced_too():
    """Nothing holds the crank at rest: there are no linear equations, and none are needed."""
    model = studies.with_counterweights(library.hoeken(gravity=(0, -9.81, 0)), {"link1": (0.0, (-0.08, 0, 0))})
    best = studies.optimize(model, {NAMES[0]: (0.0, 5.0)}, run().mean_square("torque"))
    machine = run()
    around = [machine.mean_square("torque")(model.with_values({NAMES[0]: best.values[NAMES[0]] + step}))
              for step in (-1e-3, 0.0, 1e-3)]  # fmt: skip
    assert around[1] < around[0]
    assert around[1] < around[2]
    assert around[1] == pytest.approx(best.objective, rel=1e-12)


@pytest.mark.slow
def test_gradients_of_quantities():
    model = weighted_hoeken()
    names = [*NAMES, "pin12.position.y"]
    found = {what: run().mean_square(what).gradient(model, names)[0] for what in SHAPES}
    here = cycle_of(model)
    for i, name in enumerate(names):
        there = cycle_of(model.with_values({name: model.parameters[name] + 1e-5}))
        for what in SHAPES:
            slope = (there.rms(what) ** 2 - here.rms(what) ** 2) / 1e-5
            assert found[what][i] == pytest.approx(slope, rel=2e-3, abs=1e-9)
    # of a system that was linearized, and beside its frequencies
    system = library.rssr(rocker_ball="universal").linearize()
    machine = studies.cycle("crank.rz", [0.0, 0.1], speed=TURN)
    both = machine.rms("torque") / studies.frequency(1)
    cycle = library.rssr(rocker_ball="universal").cycle("crank.rz", [0.0, 0.1], speed=TURN)
    assert both(system) == pytest.approx(cycle.rms("torque") / 4.10414839, rel=1e-8)


def test_several_drives_are_summed():
    arm = library.two_link()
    machine = studies.cycle(motion={"joint1.rz": ([0, 1], 1, 0), "joint2.rz": ([0, 1], 2, 0)})
    assert machine.weighted(arm, {"torque": 2.0})(arm) == pytest.approx(4.0)
    assert machine.rms("torque", "joint2.rz")(arm) == machine.cycle(arm).rms("torque", "joint2.rz")


def test_a_cycle_beside_a_loop_is_that_of_its_mechanism():
    model, machine = library.hoeken(), studies.cycle("pin12.rz", [0.0, 0.3], speed=2.0)
    model.add_output("rate", "link1", "rz", quantity="velocity")
    torque, expected = machine.rms("torque"), machine.cycle(model).rms("torque")
    loop = model.linearize().feedback([[-1.0]], "rate", "torque")
    assert [torque(loop), torque(loop.sampled(1e3))] == pytest.approx([expected, expected], rel=1e-12)
    with pytest.raises(ModelError, match="no model was linearized to has none"):
        torque(loop.state_space())


@pytest.mark.parametrize(
    ("ask", "said"),
    [(lambda m: run().rms("forse"), r"quantity = 'forse'.*Did you mean 'force'"),
     (lambda m: run().weighted(m, {}), "weights = {}"), (lambda m: run().weighted(m, {"force": -1.0}), "not negative"),
     (lambda m: run().weighted(m, {"power": 1.0}), "quantity = 'power'"),
     (lambda m: studies.equimomental(m, "link9"), r"'link9' is not a body of model 'hoeken'.*Did you mean 'link.'"),
     (lambda m: studies.equimomental(m, points=5), "points = 5; expected 4 or 7"),
     (lambda m: studies.equimomental(m, reach=0.5), "reach = 0.5"),
     (lambda m: studies.equimomental(library.seven_r(), "ball12.part1"), "'ball12.part1' has no mass"),
     (lambda m: studies.with_counterweights(m, {"link9": (1, (0, 0, 0))}), "'link9' is not a body"),
     (lambda m: studies.with_counterweights(m, {"link1": 1.0}), "a mass"),
     (lambda m: studies.with_counterweights(m, {"link1": (-1.0, (0, 0, 0))}), "body 'link1.counterweight': mass"),
     (lambda m: studies.with_counterweights(m, {}), "weights = {}")],
)  # fmt: skip
def test_mistakes_are_named(ask, said):
    with pytest.raises(mv.ModelError, match=said):
        ask(library.hoeken())
