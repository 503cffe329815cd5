"""Tuning against closed forms, searches by other means, and properties that every optimum has."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.errors import ModelError, ResponseError
from mbsvib.tuning import searching
from mbsvib.tuning.goals import as_goals
from mbsvib.tuning.searching import Descent
from mbsvib.tuning.tuning import _problem

T, G = mv.tunable, mv.goals
M, K = 2.0, 8.0


def oscillator(k=K, m=M, c=0.0):
    return mv.System.from_matrices([[m]], [[c]], [[k]], B=[[1.0]], Cq=[[1.0], [0.0]], Cv=[[0.0], [1.0]], inputs=["F"],
                                   outputs=["x", "v"])  # fmt: skip


def chain(payload=1.0):
    model = mv.Model("chain", gravity=None)
    for name, mass, z in (("base", 3.0, 0.1), ("payload", payload, 0.2)):
        model.add_body(name, mass=mass, inertia=(1.0, 1.0, 1.0), position=(0, 0, z))
        model.add_joint(f"{name}.slide", "prismatic", "ground", name, position=(0, 0, 0), axis=(0, 0, 1))
    model.add_spring("k1", "ground", "base", start=(0, 0, 0), end=(0, 0, 0.1), stiffness=400.0, damping=0.5)
    model.add_spring("k2", "base", "payload", start=(0, 0, 0.1), end=(0, 0, 0.2), stiffness=100.0, damping=0.2)
    model.add_input("F", "base", "z")
    model.add_output("v", "base", "z", quantity="velocity")
    model.add_output("x", "payload", "z")
    model.add_output("xb", "base", "z")
    return model


def dense_norm(loop, outputs, inputs, scale=1.0):
    space = loop.state_space()[outputs, inputs]
    w = np.concatenate(([0.0], scale * np.geomspace(1e-2, 1e3, 20001)))
    g = space.C @ np.linalg.solve(1j * w[:, None, None] * np.eye(len(space.A)) - space.A, space.B) + space.D
    return float(np.linalg.svd(g, compute_uv=False)[:, 0].max())


@pytest.mark.few(1)
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_skyhook_of_least_rms_has_its_closed_form(unit):
    """White force S and sensor noise n: rms^2 = (S + c^2 n) / (4 c k) is least at c = sqrt(S / n), in any unit."""
    design = mv.tune(oscillator(), T.gain("F", "v"), [G.rms("x", {"F": 4.0 * unit**2, "v.noise": 0.01 * unit**2})],
                     starts=1)  # fmt: skip
    assert design.values["F/v.gain"] == pytest.approx(-20.0, rel=1e-4)
    assert design.objective == pytest.approx(unit * np.sqrt(8.0 / (4.0 * 20.0 * K)), rel=1e-8)
    assert "minimised" in str(design)
    assert len(design.history) >= 2


def test_least_resonance_with_a_bounded_gain():
    """x/F under a velocity gain c that is bounded: the peak is 1 / (2 zeta sqrt(1 - zeta^2) k) at the bound."""
    design = mv.tune(oscillator(), T.gain("F", "v", bounds={"gain": (-4.0, -0.1)}), [G.hinf("x", "F")], starts=2)
    c = 4.0
    zeta = c / (2.0 * np.sqrt(K * M))
    assert design.objective == pytest.approx(1.0 / (K * 2.0 * zeta * np.sqrt(1.0 - zeta**2)), rel=1e-5)


@pytest.mark.slow
def test_gains_that_nothing_limits_are_told():
    """The peak of x/F falls on with the gain of x, whose limit is rounding."""
    plant = oscillator(c=1.0)
    design = mv.tune(plant, T.gain("F", "x"), [G.hinf("x", "F")], starts=1)
    assert "Nothing limits the gains: a pole of the loop is at" in str(design)
    assert "1 value; " in str(design)
    bounded = mv.tune(plant, T.gain("F", "x", bounds={"gain": (-4.0, -0.1)}), [G.hinf("x", "F")], starts=1)
    assert "Nothing limits" not in str(bounded)


@pytest.mark.slow
def test_damping_limit_is_reached_and_no_more_where_it_costs():
    """Noise alone would want c = 2; a damping ratio of 0.4 needs c = 0.8 sqrt(k m)."""
    goals = [G.rms("x", {"F": 0.04, "v.noise": 0.01}), G.damping(0.4)]
    design = mv.tune(oscillator(), T.gain("F", "v"), goals, starts=1)
    assert design.achieved["damping >= 0.4"] >= 0.4
    assert design.values["F/v.gain"] == pytest.approx(-0.8 * np.sqrt(K * M), rel=1e-4)
    assert design.success
    assert design.loop.damping_ratios.min() == pytest.approx(0.4, rel=1e-4)


def test_limit_that_no_value_reaches_is_said():
    design = mv.tune(oscillator(c=0.1), T.gain("F", "v", bounds={"gain": (-0.5, 0.0)}), [G.damping(0.9)], starts=1)
    assert not design.success
    assert "not reached" in str(design)


def check_gradient(problem, seed=3):
    """Compare the gradient with differences along random directions, which contain every entry."""
    rng = np.random.default_rng(seed)
    x = problem.unknowns.begin(None) + 0.03 * rng.normal(size=len(problem.names))
    value, slope = problem.objective(x, 1.0)
    assert np.isfinite(value)
    for along in rng.normal(size=(2, len(x))):
        low, high = (problem.objective(x + side * 1e-5 * along, 1.0)[0] for side in (-1.0, 1.0))
        size = 1e-6 * np.linalg.norm(slope) * np.linalg.norm(along)
        assert slope @ along == pytest.approx((high - low) / 2e-5, rel=1e-5, abs=size), problem.goals[0].label


@pytest.mark.slow
def test_gradients_of_all_goals_equal_differences():
    model = chain()
    goals = [G.hinf("x", "F"), G.rms(["x", "v"], {"F": 2.0, "v.noise": 1e-3, "F.noise": [(0.1, 1e-2), (9.0, 1e-3)]}),
             G.damping(0.9), G.margin(0.99)]  # fmt: skip
    structure = T.pid("F", "xb") + T.gain("F", "v")
    for goal in goals:
        check_gradient(_problem(model, structure, as_goals(goal), {"k2.damping": (0.1, 5.0),
                                                                   "k1.stiffness": (100, 900)}))  # fmt: skip


@pytest.mark.slow
def test_values_are_those_of_loops_closed_anew(monkeypatch):
    monkeypatch.setattr(searching, "RESTARTS", 0)
    system = chain().linearize()
    design = mv.tune(system, T.gain("F", "xb"), [G.hinf("x", "F"), G.margin(0.6)], starts=1)
    loop = system.feedback(design.controller)
    assert loop.stable
    assert design.achieved["hinf x / F"] == pytest.approx(dense_norm(loop, "x", "F"), rel=1e-5)
    assert design.objective == design.achieved["hinf x / F"]
    peak = np.abs(loop.sensitivity(np.geomspace(1e-2, 1e3, 4001))).max()
    assert 0.6 <= design.achieved["margin >= 0.6"] <= 1.0 / peak * (1.0 + 1e-9)
    assert design.achieved["margin >= 0.6"] == pytest.approx(0.6, rel=1e-4)


@pytest.mark.slow
def test_decentral_controllers_come_near_the_best_of_all(monkeypatch):
    """Six oscillators of 30 values on the Stewart platform: Riccati equations bisected to 1e-9 give 0.392709 at least.

    Forces and displacements along the axes, each of unit static gain; cost of commands 0.3, noise of sensors 0.05.
    """
    monkeypatch.setattr(searching, "RESTARTS", 2)
    monkeypatch.setattr(searching, "LONG", 600)  # a minute of CPU; a whole search goes on to 0.394
    space = library.stewart().linearize().state_space("modal")
    unit = np.sqrt(np.diag(space.C @ np.linalg.solve(-space.A, space.B)))
    b, c, none, one = space.B / unit, space.C / unit[:, None], np.zeros((12, 6)), np.eye(6)
    d = np.kron([[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.0, 0.05, 0.0]], one)
    outputs, inputs = ([f"{kind}{k}" for kind in kinds for k in range(6)] for kinds in
                       (("y", "cost", "seen"), ("force", "noise", "u")))  # fmt: skip
    plant = mv.StateSpace.from_arrays(space.A, np.hstack((b, none, b)), np.vstack((c, none.T, c)), d, inputs, outputs)
    law = T.diagonal([T.state_space(2, f"u{k}", f"seen{k}", "modal") for k in range(6)])
    design = mv.tune(plant, law, G.hinf(["y?", "cost?"], ["force?", "noise?"]), starts=1, workers=1)
    loop = plant.feedback(design.controller)
    assert len(design.values) == 30
    assert loop.poles().real.max() < 0.0
    assert 0.39270 < design.objective <= 0.42  # where a short search ends depends on rounding: 0.3935 and 0.4124 seen
    assert dense_norm(loop, outputs[:12], inputs[:12], 1e4) == pytest.approx(design.objective, rel=1e-5)


@pytest.mark.slow
def test_common_controller_is_no_better_than_one_at_home():
    plants = [oscillator(), oscillator(k=40.0, m=5.0)]
    goals = [G.rms("x", {"F": 4.0, "v.noise": 0.05})]
    common = mv.tune(plants, T.gain("F", "v"), goals, starts=1)
    homes = [mv.tune(plant, T.gain("F", "v"), goals, starts=1).objective for plant in plants]
    assert common.objective >= max(homes) * (1.0 - 1e-9)
    assert common.objective == pytest.approx(max(homes), rel=1e-6)  # the soft one decides
    assert len(common.loop) == len(common.model) == 2
    assert "worst of 2 plants" in str(common)


@pytest.mark.slow
def test_codesign_is_no_worse_than_sequential_design():
    goals, bounds = [G.rms("x", {"F": 1.0, "v.noise": 1e-2})], {"k2.damping": (0.1, 5.0)}
    alone = mv.tune(chain(), T.gain("F", "v"), goals, starts=1)
    both = mv.tune(chain(), T.gain("F", "v"), goals, bounds, starts=1, initial=alone.values)
    assert both.objective < 0.99 * alone.objective
    assert 0.1 <= both.values["k2.damping"] <= 5.0
    assert both.model.parameters["k2.damping"] == pytest.approx(both.values["k2.damping"])
    again = both.model.linearize().feedback(both.controller, noise=True)
    assert again.rms("x", {"F": 1.0, "v.noise": 1e-2})["x"] == pytest.approx(both.objective, rel=1e-9)


@pytest.mark.slow
def test_fast_system_reaches_the_optimum_of_a_grid_of_a_slow_one():
    """Gains of position and velocity: least peak of x/F and of x/noise, against a search over a grid."""
    goals, best = [G.hinf("x", "F"), G.hinf("x", "x.noise", weight=0.02)], np.inf
    w = np.geomspace(0.1, 100.0, 800)
    for kx in np.linspace(0.0, 100.0, 41):
        for kv in np.linspace(5.0, 60.0, 41):
            g = 1.0 / np.abs(K + kx - M * w**2 + 1j * w * kv)
            best = min(best, max(g.max(), 1.0 / (K + kx), 0.02 * (g * kx).max(), 0.02 * kx / (K + kx)))
    rate = 1e4
    system = mv.System.from_matrices([[M]], [[0.0]], [[K * rate**2]], B=[[rate**2]], Cq=[[1.0], [0.0]],
                                     Cv=[[0.0], [1.0]], inputs=["F"], outputs=["x", "v"])  # fmt: skip
    design = mv.tune(system, T.gain("F", ["x", "v"]), goals, starts=1)
    assert design.objective <= best * (1.0 + 1e-6)
    assert design.objective == pytest.approx(best, rel=3e-2)


@pytest.mark.slow
def test_unstable_plants_are_stabilised_first():
    upside_down = mv.StateSpace.from_arrays([[0.0, 1.0], [4.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]],
                                            inputs=["F"], outputs=["x"])  # fmt: skip
    design = mv.tune(upside_down, T.pid("F", "x", terms="pd"), [G.hinf("x", ["F", "x.noise"]), G.margin(0.4)],
                     starts=2)
    assert (design.loop.poles().real < 0.0).all()
    assert design.achieved["margin >= 0.4"] >= 0.4


def test_mode_out_of_reach_is_named():
    system = mv.System.from_matrices(np.eye(2), np.zeros((2, 2)), np.diag([4.0, 9.0]), B=[[1.0], [0.0]], Cq=np.eye(2),
                                     inputs=["F"], outputs=["x", "y"])  # fmt: skip
    with pytest.raises(ResponseError, match=r"no actuator reaches the mode at 0\.4775 Hz"):
        mv.tune(system, T.pid("F", "x", terms="pd"), [G.hinf("x", "F")], starts=1)


def test_structure_that_cannot_stabilise_is_said():
    free = mv.System.from_matrices([[1.0]], [[0.0]], [[0.0]], B=[[1.0]], Cq=[[1.0]], inputs=["F"], outputs=["x"])
    with pytest.raises(ResponseError, match="none of 2 starts was stabilised by this structure"):
        mv.tune(free, T.gain("F", "x"), [G.hinf("x", "F")], starts=2)


@pytest.mark.parametrize(("arguments", "words"), [
    ((oscillator(), T.gain("F", "w"), [G.damping(0.1)]), "sensor 'w': system 'system' has no such sensor"),
    ((oscillator(), T.gain("G", "x"), [G.damping(0.1)]), "'G'"),
    ((oscillator(), T.gain("F", "x"), []), "goals"),
    ((oscillator(), T.gain("F", "x"), [G.hinf("z")]), "'z'"),
    (([], T.gain("F", "x"), [G.damping(0.1)]), "plant"),
    ((oscillator(), T.gain("F", "x"), [G.damping(0.1)], {"k.damping": (1, 2)}), "parameters are those of a model"),
    ((oscillator(), T.gain("F", "v"), [G.rms("v", {"v.noise": 1.0, "q": 1.0})]), "'q'"),
])  # fmt: skip
def test_refusals(arguments, words):
    with pytest.raises((ModelError, ResponseError), match=words):
        mv.tune(*arguments, starts=1)


@pytest.mark.parametrize("make", [lambda: G.damping(1.5), lambda: G.margin(0.0), lambda: G.hinf("x", "F", weight=-1.0)])
def test_goals_refuse_numbers_that_make_no_sense(make):
    with pytest.raises(ModelError):
        make()


def test_a_search_does_not_end_above_its_start(monkeypatch):
    """Barriers and penalties may lead descents away from a good start: here all of them do."""
    monkeypatch.setattr(searching, "bfgs", lambda function, x, *_: Descent(x + 0.5, np.inf, (np.inf,)))
    start = {"F/v.gain": -20.0}
    told = []
    design = mv.tune(oscillator(), T.gain("F", "v"), [G.rms("x", {"F": 4.0, "v.noise": 0.01})], starts=1, initial=start,
                     progress=lambda done, most: told.append((done, most)))  # fmt: skip
    assert design.values == pytest.approx(start)
    assert told == [(k, 10) for k in range(1, len(design.history) + 2)]


@pytest.mark.slow
def test_gains_of_a_resonator_of_200_pg():
    """PD control against white force and noise of the sensor, at 16 kHz: nearly as good as the optimal estimate of x,
    whose error is 3.77706e-11 m by its Riccati equation.
    """
    plant = mv.System.from_matrices([[2e-10]], [[2e-7]], [[2.0]], B=[[1.0]], Cq=[[1.0]], inputs=["F"], outputs=["x"])
    noise = {"F": 1e-24, "x.noise": 1e-26}
    design = mv.tune(plant, T.pid("F", "x", terms="pd"), [G.rms("x", noise), G.margin(0.5)], starts=1)
    kp, kd, tau = (design.values[f"F/x.{name}"] for name in ("kp", "kd", "tau"))
    a3, a2, a1, a0 = 2e-10 * tau, 2e-10 + 2e-7 * tau, 2e-7 + (2.0 - kp) * tau - kd, 2.0 - kp

    def square(b1, b0):  # of (b1 s + b0) / (a3 s^3 + a2 s^2 + a1 s + a0), James, Nichols & Phillips (1947)
        return (b1**2 * a0 * a3 + b0**2 * a2 * a3) / (2.0 * a0 * a3 * (a1 * a2 - a0 * a3))

    rms = np.sqrt(0.5 * (noise["F"] * square(tau, 1.0) + noise["x.noise"] * square(kp * tau + kd, kp)))
    assert design.achieved["rms x"] == pytest.approx(rms, rel=1e-6)
    assert design.achieved["rms x"] == pytest.approx(3.77706e-11, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("kp", "kd"), [(-30.0, -2.0), (-3e3, -10.0)])
def test_an_rms_beside_fast_poles_is_found_by_quadrature(kp, kd):
    """A belt drive under PD control with a tau of 1 ns: moments lost digits, and finished searches were refused."""
    tau, k, c, motor, drum, r, big = 1e-9, 4e5, 20.0, 5e-5, 0.8, 0.02, 0.2
    tie = np.array([[r * r, -r * big], [-r * big, big * big]])
    plant = mv.System.from_matrices(np.diag([motor, drum]), c * tie, k * tie, B=[[1.0], [0.0]], Cq=np.eye(2),
                                    inputs=["T"], outputs=["q", "Q"])  # fmt: skip
    lag = mv.StateSpace.from_arrays([[-1 / tau]], [[1 / tau]], [[-kd / tau]], [[kp + kd / tau]], ["q"], ["T"])
    loop = plant.feedback(lag, noise=True)
    goal = G.rms("Q", {"T": 1e-6, "q.noise": 1e-14})
    with pytest.raises(ResponseError, match="rounding cannot tell apart"):
        loop.rms("Q", goal.floor)
    w = 2.0 * np.pi * (f := np.concatenate(([0.0], np.geomspace(1e-3, 1e11, 200_001))))
    law, spring = kp + kd * 1j * w / (tau * 1j * w + 1.0), k + 1j * w * c
    both = (spring * r * r - w * w * motor - law) * (spring * big * big - w * w * drum) - (spring * r * big) ** 2
    density = np.abs(spring * r * big / both) ** 2 * (1e-6 + np.abs(law) ** 2 * 1e-14)
    assert goal.of(loop).value == pytest.approx(np.sqrt(np.trapezoid(density, f)), rel=1e-5)
