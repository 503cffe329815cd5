"""Results go to other processes and back, whatever was asked of them before."""

import pickle
from functools import cache, partial

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import mbsvib as mv
from mbsvib import isolation, library, studies
from mbsvib.campbell import campbell
from tests.isolation.scenes import active_strut
from tests.studies.test_trade_off import X, Y, distances, plate


def sent(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("name", ["quarter_car", "cubic_hexapod"])
def test_a_system_after_its_sensitivities(name):
    system = library.build(name).linearize()
    before = system.mode_sensitivities().frequencies
    other = sent(system)
    assert_array_equal(other.mode_sensitivities().frequencies, before)
    assert_array_equal(other.K, system.K)
    parameter = next(iter(system.parameters))
    assert_array_equal(sent(system).mode_sensitivities([parameter]).frequencies,
                       system.mode_sensitivities([parameter]).frequencies)  # fmt: skip


@pytest.mark.slow
def test_a_run():
    pytest.importorskip("casadi")
    run = library.slider_crank().simulate(np.linspace(0.0, 0.1, 6), {"torque": lambda t: 0.1 * t})
    other = sent(run)
    assert repr(other) == repr(run)
    for mine, theirs in ((run.outputs, other.outputs), (run.coordinates, other.coordinates), (run.rates, other.rates)):
        assert list(mine) == list(theirs)
        for name in mine:
            assert_array_equal(theirs[name], mine[name])
    assert_array_equal(other.energy.kinetic, run.energy.kinetic)
    for name, (turned, shifted) in run.frames().items():
        assert_array_equal(other.frames()[name][0], turned)
        assert_array_equal(other.frames()[name][1], shifted)
    coordinate = next(iter(run.coordinates))
    middle = float(run.coordinates[coordinate][2:4].mean())
    assert_array_equal(other.crossings(coordinate, middle), run.crossings(coordinate, middle))
    with pytest.raises(TypeError):
        other.outputs["new"] = 0.0


@pytest.mark.slow
def test_a_cycle():
    pytest.importorskip("casadi")
    model = library.slider_crank()
    cycle = model.cycle("A.rz", np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False), speed=3.0)
    before = cycle.sensitivities().shaking_force
    other = sent(cycle)
    assert_array_equal(other.torque, cycle.torque)
    assert_array_equal(other.sensitivities().shaking_force, before)
    for name, wrench in cycle.reactions.items():
        assert_array_equal(other.reactions[name], wrench)


def stewart():
    return library.stewart_isolator()


@cache
def active():
    return isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")


def loop():
    return active().with_gains(isolation.force_feedback(active(), 300.0, 1.0))


def used(result, *questions):
    """A result of which something was asked, so that it holds what it computed."""
    for question in questions:
        question(result)
    return result


W = np.array([1.0, 10.0])
MASSES, CAR = {"body.mass": np.linspace(300.0, 400.0, 3)}, library.quarter_car
def ranged(system, variables):
    """A quantity of one's own."""
    return system.poles().real.max(keepdims=True), np.zeros((1, len(variables)))


def quantities():
    """Quantities of all kinds, what is made of them, and the models of which they are."""
    f, x, car = studies.frequency(), studies.frequency(1), CAR(suspension_damping=1e3, tyre_damping=9.0)
    for asked in (x + 1.0, 1.0 - x, 2.0 * x / f[1], -x, x**2, f[1:], x.log(), f.sum(), studies.largest(x, 3.0),
                  studies.smallest(f), x <= 2.0, f.between(1.0, 2.0), x.equals(3.0), studies.damping_ratio([1, 2]),
                  studies.placement({1: 2.0}), studies.gain("body.z", "road", [0.0, 2.0]),
                  studies.peak("body.z", "road"), studies.rms("body.z", {"load": 1.0}),
                  studies.given(ranged, "fastest pole")):  # fmt: skip
        yield asked, car.linearize()
    passive = isolation.passive(library.cubic_hexapod(damping=2.0), "platform")
    noisy = [getattr(passive, name)({"z": 1e-6}, band=(1.0, 9.0)) for name in ("rms", "stroke", "force")]
    for asked in (passive.peak(), passive.index([3.0]), passive.sag(), passive.compliance(2.0), *noisy):
        yield asked, passive.scene.system
    cycle = studies.cycle("A.rz", np.linspace(0.0, 6.0, 5), speed=1.0)
    for asked in (cycle, cycle.mean_square("force"), cycle.rms("torque"), studies.variable("body.mass")):
        yield asked, None


@pytest.mark.slow
def test_quantities_and_constraints():
    for asked, system in quantities():
        other = sent(asked)
        assert repr(other) == repr(asked)
        if system is not None:
            expected, value = (one.quantity(system) if isinstance(one, studies.Constraint) else one(system)
                               for one in (asked, other))  # fmt: skip
            assert_array_equal(value, expected)


RESULTS = {
    "model": (stewart, lambda r: r.linearize().K),
    "system": (lambda: used(stewart().linearize(), lambda s: s.modes(), lambda s: s.frequency_response(W)),
               lambda r: r.frequency_response(W)),
    "matrices": (lambda: stewart().linearize().matrix_derivatives(), lambda r: r.factors(r.variables[0], "K")[0]),
    "mode sensitivities": (lambda: stewart().linearize().mode_sensitivities(), lambda r: r.frequencies),
    "shapes": (lambda: used(CAR().linearize().mode_sensitivities("*.mass"), lambda r: r.shapes), lambda r: r.shapes),
    "modes": (lambda: stewart().linearize().modes(), lambda r: r.frequencies),
    "state space": (lambda: stewart().linearize().state_space(), lambda r: r.A),
    "state modes": (lambda: stewart().linearize().state_space().modes(), lambda r: r.eigenvalues),
    "reduced": (lambda: stewart().linearize().state_space().reduced(4), lambda r: r.frequency_response(W)),
    "norm": (lambda: CAR(suspension_damping=1e3, tyre_damping=9.0).linearize().hinf_norm("body.z", "load", "*.mass"),
             lambda r: r.slopes),
    "step": (lambda: CAR(suspension_damping=1e3).linearize().step_info("body.z", "load"), lambda r: r.settling_time),
    "shares": (lambda: stewart().linearize().stiffness_shares(), str),
    "range": (lambda: CAR().linearize().linear_range(), str),
    "sparse": (lambda: used(library.cubic_hexapod().linearize(method="sparse"), lambda s: s.modes(2)),
               lambda r: r.frequency_response(W)),
    "some modes": (lambda: library.cubic_hexapod().linearize(method="sparse").modes(2), lambda r: r.eigenvalues),
    "sparse sensitivities": (lambda: library.cubic_hexapod().linearize(method="sparse").mode_sensitivities(modes=2),
                             lambda r: r.frequencies),
    "batch": (lambda: used(CAR().linearize(values=MASSES), lambda b: b.modes()), lambda r: r.frequency_response(W)),
    "batch modes": (lambda: CAR().linearize(values=MASSES).modes(), lambda r: r.frequencies),
    "active": (active, lambda r: r.system.K),
    "loop": (lambda: used(loop(), lambda r: r.margins(), lambda r: r.response(W)), lambda r: r.response(W)),
    "loop of matrices": (lambda: CAR().linearize().feedback([[-1e3]], "travel", "actuator"), lambda r: r.poles()),
    "sampled loop": (lambda: used(loop().sampled(1e3), lambda r: r.response(W)), lambda r: r.response(W)),
    "from sample to sample": (lambda: loop().sampled(1e3).sample_to_sample, lambda r: r.A),
    "margins": (lambda: loop().margins(), lambda r: r.gain),
    "controller": (lambda: isolation.force_feedback(active(), 300.0, 1.0), lambda r: r.at(1j * W)),
    "collocation": (lambda: isolation.collocation(active()), str),
    "root locus": (lambda: isolation.root_locus(active(), partial(isolation.force_feedback, active(), leak=1.0),
                                                [10.0, 300.0]), str),
    "isolation": (lambda: active().isolation([1.0, 30.0]), lambda r: r.index),
    "vibration": (lambda: loop().sampled(1e4).isolation([1.0]).under({"z": 1e-6}, band=(1.0, 50.0)),
                  lambda r: r.acceleration),
    "platform": (lambda: isolation.platform(library.cubic_hexapod(), "platform"), str),
    "passive": (lambda: isolation.passive(library.cubic_hexapod(), "platform"), str),
    "struts": (lambda: isolation.struts(library.cubic_hexapod(), "platform"), str),
    "sweep": (lambda: mv.sweep(CAR(), MASSES, "modes.frequencies"), str),
    "tracks": (lambda: mv.track(CAR(), MASSES), str),
    "tolerances": (lambda: studies.tolerances(CAR(), {"body.mass": 3.0}, studies.frequency(1), samples=20), str),
    "optimum": (lambda: studies.optimize(CAR(suspension_damping=1e2), {"suspension.damping": (10.0, 1e4)},
                                         -studies.damping_ratio(1)), str),
    "trade off": (lambda: studies.trade_off(plate(), {X: (0.5, 3.0), Y: (0.5, 3.0)}, distances(), divisions=2), str),
    "campbell": (lambda: campbell(library.rotor_stator(), [0.0, 100.0]), str),
    "path": (lambda: library.toggle(angle=0.284).path("base.rz", [0.0, -0.01]), str),
}  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize("name", RESULTS)
def test_every_result(name):
    make, answer = RESULTS[name]
    result = make()
    other = sent(result)
    assert (type(other), str(other)) == (type(result), str(result))
    expected, got = answer(result), answer(other)
    assert (got == expected) if isinstance(expected, str) else np.array_equal(got, expected)
