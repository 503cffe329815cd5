"""Actuated legs and closed loops: closed forms of the classical laws, and python-control's feedback."""

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import MASS, OMEGA, active_strut, one_axis, relaxing_hexapod, stiff_isolator, two_masses


def strut(**words):
    return isolation.actuated(active_strut(**words), "payload", "leg", directions="z")


def oscillating(loop):
    return np.sort_complex(loop.poles())


def test_force_feedback_on_a_massless_strut():
    plant = isolation.actuated(one_axis(0.0), "payload", directions="z")
    for gain in (0.3 * OMEGA, OMEGA, 3 * OMEGA):
        loop = plant.with_gains(isolation.force_feedback(plant, gain))
        exact = np.sort_complex(np.append(np.roots([1, gain, OMEGA**2]), 0.0))
        assert np.allclose(oscillating(loop), exact, rtol=1e-12, atol=1e-11)
        assert loop.stable


def test_patterns_name_the_sensors_of_controllers():
    """A pattern was taken apart into letters, or kept as the name of a sensor: the controller fitted no plant."""
    plant = isolation.actuated(library.cubic_hexapod(), "platform", ["leg1.k", "leg2.k"])
    sensors = ["leg1.k.force", "leg2.k.force"]
    for given in ("leg[12].*.force", ["leg[12].*.force"]):
        law = isolation.lqg(plant, given, 1e-3)
        assert law.inputs == tuple(sensors)
        np.testing.assert_array_equal(law.B, isolation.lqg(plant, sensors, 1e-3).B)
    assert isolation.controller([[2.0]], "leg1.k.force", "leg1.k.actuator").inputs == ("leg1.k.force",)


def test_collocation_of_any_system():
    """Two masses in line: the force and the motion of one are collocated, with one zero between two poles; 1 by 2 has
    no zero, and its phase reaches -360 degrees.
    """
    model = two_masses()
    for k, body in enumerate(("stage", "payload"), 1):
        model.add_input(f"f{k}", body, "z")
        model.add_output(f"v{k}", body, "z", quantity="velocity")
    here, there = isolation.collocation(model.linearize(), [("f1", "v1"), ("f1", "v2")]).pairs
    assert (here.dual, here.interlaced, here.passive) == (True, True, True)
    assert here.zeros == pytest.approx([np.sqrt(1e4 / 9.0) / (2 * np.pi)], rel=1e-9)
    assert (there.dual, there.interlaced, there.passive) == (False, False, False)
    assert len(there.zeros) == 0


@pytest.mark.parametrize("name", ["base.z", "load.z", "mount.actuator"])
def test_an_input_of_the_name_of_a_port_is_named_as_such(name):
    """The message asked for another name of a port that the user had not added."""
    model = one_axis(0.0)
    model.add_input(name, "payload", "z")
    with pytest.raises(mv.ModelError, match=f"input '{name}' of model '.*' has the name of a port that the study"):
        isolation.actuated(model, "payload", directions="z")


@pytest.mark.slow
def test_most_damping_of_force_feedback_in_closed_form():
    pole, zero = np.sqrt(1.2e5 / MASS), np.sqrt(3e4 / MASS)
    gain, ratio = isolation.force_feedback_optimum(pole, zero)
    assert ratio == pytest.approx((pole - zero) / (2 * zero), rel=1e-14)
    plant = strut()
    loop = plant.with_gains(isolation.force_feedback(plant, gain))
    assert loop.damping_ratios == pytest.approx([ratio], rel=1e-9)
    assert np.allclose(oscillating(loop), np.sort_complex(np.roots([1, gain, pole**2, gain * zero**2])), rtol=1e-9)
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), np.linspace(0, 2 * gain, 201))
    assert locus.best() == pytest.approx((gain, ratio), rel=1e-4)
    assert np.allclose(np.abs(locus.zeros), zero, rtol=1e-12)
    with pytest.raises(mv.ResponseError, match="0 < zero < pole"):
        isolation.force_feedback_optimum(1.0, 2.0)


@pytest.mark.slow
def test_decentralised_force_feedback_reaches_the_closed_form_in_every_mode():
    # a bushing as isotropic as the legs leaves shapes as they are, so that each mode is a strut of its own
    model = library.cubic_hexapod(edge=0.2, stiffness=1e6, damping=0.0)
    soft = 0.3 * np.array([2e6, 2e6, 2e6, 2e4, 2e4, 8e4])
    model.add_bushing("beside", "ground", "platform", model.bodies["platform"].position, stiffness=soft)
    plant = isolation.actuated(model, "platform")
    pole = np.abs(plant.system.poles())[::2]
    zero = pole * np.sqrt(0.3 / 1.3)
    pairs = [isolation.force_feedback_optimum(*item) for item in zip(pole, zero, strict=True)]
    gains = np.unique([0.0, *(gain for gain, _ in pairs)])
    locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), gains)
    for mode, (gain, ratio) in enumerate(pairs, 1):
        assert locus.best(mode) == pytest.approx((gain, ratio), rel=1e-6)
    assert "54.08" in str(locus)
    assert np.allclose(np.sort(locus.zeros.imag)[6:], np.sort(zero), rtol=1e-12)


@pytest.mark.parametrize("turned", [False, True])
def test_velocity_feedback_is_a_damper_and_skyhook_one_to_the_sky(turned):
    plant, gain = strut(turned=turned), 800.0
    loop = plant.with_gains(isolation.velocity_feedback(plant, gain))
    k = 1.2e5
    f = np.geomspace(1.0, 200.0, 30)
    s = 2j * np.pi * f
    damped = (gain * s + k) / (MASS * s**2 + gain * s + k)
    assert np.allclose(loop.isolation(f).transmissibility[2, 0], damped, rtol=1e-11, atol=0)
    loop = plant.with_gains(isolation.skyhook(plant, gain, leak=0.0))
    sky = k / (MASS * s**2 + gain * s + k)
    assert np.allclose(loop.isolation(f).transmissibility[2, 0], sky, rtol=1e-11, atol=0)
    assert loop.stable


def test_white_noise_on_a_skyhook_in_closed_form():
    plant, gain, level = strut(), 800.0, 3e-4
    loop = plant.with_gains(isolation.skyhook(plant, gain))
    w = np.sqrt(1.2e5 / MASS)
    zeta = gain / (2 * np.sqrt(1.2e5 * MASS))
    # integral of |w^2 / (w^2 - x^2 + 2 i zeta w x)|^2 over f from 0: w / (8 zeta)
    exact = level * w / (8 * zeta)
    result = loop.isolation([1.0]).under({"z": level})
    assert result.acceleration[2] ** 2 == pytest.approx(exact, rel=1e-10)


def test_modal_skyhook_gives_the_ratios_that_are_asked_for():
    # without dampers of their own and with struts of no mass the suspension modes have no others beside them
    model = library.cubic_hexapod(damping=0.0)
    plant = isolation.actuated(model, "platform")
    loop = plant.with_gains(isolation.skyhook(plant, 0.3, "modal"))
    assert np.allclose(loop.damping_ratios, 0.3, rtol=1e-9)
    ratios = np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.4])
    loop = plant.with_gains(isolation.skyhook(plant, ratios, "modal"))
    assert np.allclose(loop.damping_ratios, ratios, rtol=1e-9)
    assert np.allclose(plant.stiffness, plant.stiffness.T)
    inverse = np.linalg.inv(plant.isolation([0.0]).compliance[:, :, 0].real)
    assert np.allclose(plant.stiffness, inverse, rtol=1e-9, atol=1e-6)


def test_several_loops_against_the_feedback_of_python_control():
    plant = isolation.actuated(library.stewart(), "platform")
    inner = isolation.force_feedback(plant, 2000.0, leak=50.0)
    outer = isolation.skyhook(plant, 0.2, "modal", leak=20.0)
    loop = plant.with_gains(inner, outer)
    g = plant.system.state_space("modal")
    y, u = ([names.index(n) for n in which] for names, which in
            ((g.outputs, loop.sensors), (g.inputs, loop.actuators)))  # fmt: skip
    full = control.ss(g.A, g.B[:, u], g.C[y], g.D[np.ix_(y, u)])
    law = control.ss(*(getattr(loop.law, part) for part in "ABCD"))
    poles = control.feedback(full, law, sign=1).poles()
    assert np.allclose(np.sort(np.abs(poles)), np.sort(np.abs(loop.poles())), rtol=1e-7, atol=1e-3)
    space = loop.state_space()
    w = 2 * np.pi * np.array([100.0, 790.0, 1100.0, 4000.0])
    flat = [space.C @ np.linalg.solve(1j * x * np.eye(len(space.A)) - space.A, space.B) + space.D for x in w]
    g = loop.frequency_response(w)
    size = np.abs(g).max(axis=(1, 2), keepdims=True)
    assert (np.abs(g - np.moveaxis(flat, 0, 2)) <= 1e-9 * size).all()


@pytest.mark.slow
def test_unstable_loops_are_told_with_the_mode():
    plant = isolation.actuated(library.cubic_hexapod(), "platform")
    loop = plant.with_gains(isolation.velocity_feedback(plant, -2000.0))
    assert not loop.stable
    with pytest.raises(mv.ResponseError, match=r"not stable with DVF: .*mode 6 \(159.* Hz, platform rz\)"):
        loop.isolation([1.0, 2.0])
    assert "Unstable: mode" in str(loop)
    assert "no margins" in str(loop.margins([1.0, 10.0]))
    assert "..." not in str(loop.margins([1.0, 10.0]))


def test_noncollocated_feedback_drives_a_mode():
    plant = isolation.actuated(two_masses(c1=0.0, c2=0.0), "payload", "lower", directions="z")
    report = isolation.collocation(plant)
    by_sensor = {pair.sensor.split(".")[1]: pair for pair in report.pairs}
    assert by_sensor["rate"].passive
    assert by_sensor["force"].passive
    assert by_sensor["rate"].interlaced
    assert not by_sensor["acceleration"].dual
    assert not by_sensor["acceleration"].passive
    assert not by_sensor["acceleration"].interlaced
    assert "destabilize others" in str(report)
    loop = plant.with_gains(isolation.skyhook(plant, 20.0))
    assert len(loop.growing) == 1


def test_poles_and_zeros_interlace_in_closed_form():
    m1, m2, k1, k2 = 4.0, 9.0, 3e4, 1e4
    plant = isolation.actuated(two_masses(c1=0.0, c2=0.0), "payload", "lower", directions="z")
    poles = np.sqrt(np.linalg.eigvals(np.diag([1 / m1, 1 / m2]) @ [[k1 + k2, -k2], [-k2, k2]])) / (2 * np.pi)
    rate, tension = isolation.collocation(plant, [("lower.actuator", f"lower.{x}") for x in ("rate", "force")]).pairs
    assert np.allclose(rate.poles, np.sort(poles), rtol=1e-12)
    stroke = isolation.collocation(plant, [("lower.actuator", "lower.stroke")]).pairs[0]
    assert (stroke.dual, stroke.interlaced, stroke.passive) == (rate.dual, rate.interlaced, rate.passive) == (True,) * 3
    # rate: the stage held; tension: the lower spring gone
    assert np.allclose(rate.zeros, [np.sqrt(k2 / m2) / (2 * np.pi)], rtol=1e-10)
    assert np.allclose(tension.zeros, [np.sqrt(k2 / m2 + k2 / m1) / (2 * np.pi)], rtol=1e-12)
    assert tension.interlaced


def test_zeros_of_the_tension_of_a_preloaded_leg_keep_its_preload():
    """Without its stiffness along the line the tension T still holds the mass across it by T / L."""
    mass, k, side, tension = 2.0, 3e4, 1e4, 500.0
    model = mv.Model("guyed")
    model.add_body("payload", mass, (1, 1, 1), (0, 0, 0))
    model.add_joint("plane", None, "ground", "payload", (0, 0, 0), free=("x", "z"))
    for name, x in (("left", -1.0), ("right", 1.0)):
        model.add_spring(name, "ground", "payload", (x, 0, 0), (0, 0, 0), k, preload=tension)
    model.add_spring("brace", "ground", "payload", (-0.6, 0, -0.8), (0, 0, 0), side)
    plant = isolation.actuated(model, "payload", directions=["x", "z"])
    pair = isolation.collocation(plant, [("left.actuator", "left.force")]).pairs[0]
    line = np.outer((0.6, 0.8), (0.6, 0.8))
    across = side * line + np.diag([0.0, 2.0 * tension])
    for found, along in ((pair.poles, 2.0 * k), (pair.zeros, k)):
        exact = np.sqrt(np.linalg.eigvalsh(across + np.diag([along, 0.0])) / mass) / (2 * np.pi)
        np.testing.assert_allclose(found, exact, rtol=1e-9)


@pytest.mark.slow
def test_symmetric_legs_are_collocated():
    plant = isolation.actuated(stiff_isolator(), "platform")
    for pair in isolation.collocation(plant, [("leg2.k.actuator", f"leg2.k.{x}") for x in ("force", "rate")]).pairs:
        assert pair.dual
        assert pair.interlaced
        assert pair.passive
    other = isolation.collocation(plant, [("leg2.k.actuator", "leg3.k.rate")]).pairs[0]
    assert not other.dual
    assert not other.passive


@pytest.mark.slow
def test_relaxation_legs_may_be_active():
    plant = isolation.actuated(relaxing_hexapod(), "platform")
    loop = plant.with_gains(isolation.skyhook(plant, 0.3, "modal"))
    assert loop.stable
    assert loop.isolation().amplification < plant.isolation().amplification
    assert "platform rz" in str(loop).splitlines()[-3]  # not what creeps, which is counted below
    pair = isolation.collocation(plant, [("leg1.k.actuator", "leg1.k.force")]).pairs[0]
    assert (pair.dual, pair.interlaced, pair.passive) == (True, None, True)
    space, s = loop.state_space(), 300.0j
    flat = space.C @ np.linalg.solve(s * np.eye(len(space.A)) - space.A, space.B) + space.D
    assert np.allclose(loop.frequency_response([300.0])[:, :, 0], flat, rtol=0, atol=1e-11 * np.abs(flat).max())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"legs": ["leg1.j"]}, "is not a line spring, Maxwell element, prismatic joint or.*Did you mean 'leg1.k'"),
    ],
)
def test_legs_are_checked(words, message):
    with pytest.raises(mv.ModelError, match=message):
        isolation.actuated(library.stewart(), "platform", **words)


def test_laws_are_checked():
    plant = strut()
    with pytest.raises(mv.ResponseError, match="no controller"):
        plant.with_gains()
    with pytest.raises(mv.ResponseError, match=r"names the sensor 'leg\.rat'.*Did you mean 'leg\.rate'"):
        plant.with_gains(isolation.controller([[1.0]], ["leg.rat"], ["leg.actuator"]))
    with pytest.raises(mv.ResponseError, match="names the actuator"):
        plant.with_gains(isolation.controller([[1.0]], ["leg.rate"], ["leg.motor"]))
    with pytest.raises(mv.ResponseError, match=r"shape \(1, 2\)"):
        isolation.controller([[1.0, 2.0]], ["leg.rate"], ["leg.actuator"])
    with pytest.raises(mv.ResponseError, match="it is discrete"):
        isolation.controller(control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1), ["leg.rate"], ["leg.actuator"])
    with pytest.raises(mv.ResponseError, match="a gain"):
        isolation.force_feedback(plant, [1.0, 2.0])
    with pytest.raises(mv.ResponseError, match="leak"):
        isolation.force_feedback(plant, 1.0, leak=-1.0)
    with pytest.raises(mv.ResponseError, match="'legs' or 'modal'"):
        isolation.skyhook(plant, 1.0, "sky")
    loop = plant.with_gains(isolation.controller([[-1.0]], ["leg.force"], ["leg.actuator"]))
    with pytest.raises(mv.ResponseError, match="algebraic loop"):
        loop.poles()
    with pytest.raises(mv.ResponseError, match="ascending"):
        isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), [1.0, 0.5])


@pytest.mark.slow
def test_pairs_are_columns():
    plant = isolation.actuated(mv.library.cubic_hexapod(damping=2.0), "platform")
    report = isolation.collocation(plant, [("leg1.k.actuator", "leg1.k.force"), ("leg1.k.actuator", "leg2.k.force")])
    columns = report.columns()
    assert list(columns) == ["actuator", "sensor", "collocated", "interlaced", "passive"]
    assert columns["passive"].tolist() == [True, False]
    assert columns["sensor"].tolist() == ["leg1.k.force", "leg2.k.force"]
