"""The benchmark bicycle: printed eigenvalues, closed formulas in 40 digits, steps, loops and derivatives."""

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.library import bicycle
from tests.rolling.whipple import coefficients, eigenvalues, state_matrix

ACCURACY = 1e-11
# Table 2 of the source: weave (real, imaginary) or two real ones, capsize, castering
PRINTED = {
    0: (-3.13164324790656, 3.13164324790656, -5.53094371765393, 5.53094371765393),
    1: (3.52696170990070 + 0.80774027519930j, 3.52696170990070 - 0.80774027519930j, -3.13423125066578,
        -7.11008014637442),
    2: (2.68234517512745 + 1.68066296590675j, 2.68234517512745 - 1.68066296590675j, -3.07158645641514,
        -8.67387984831735),
    3: (1.70675605663975 + 2.31582447384325j, 1.70675605663975 - 2.31582447384325j, -2.63366137253667,
        -10.35101467245920),
    4: (0.41325331521125 + 3.07910818603206j, 0.41325331521125 - 3.07910818603206j, -1.42944427361326,
        -12.15861426576447),
    5: (-0.77534188219585 + 4.46486771378823j, -0.77534188219585 - 4.46486771378823j, -0.32286642900409,
        -14.07838969279822),
    6: (-1.52644486584142 + 5.87673060598709j, -1.52644486584142 - 5.87673060598709j, -0.00406690076970,
        -16.08537123098026),
    7: (-2.13875644258362 + 7.19525913329805j, -2.13875644258362 - 7.19525913329805j, 0.10268170574766,
        -18.15788466125262),
    8: (-2.69348683581097 + 8.46037971396931j, -2.69348683581097 - 8.46037971396931j, 0.14327879765713,
        -20.27940894394569),
    9: (-3.21675402252485 + 9.69377351531791j, -3.21675402252485 - 9.69377351531791j, 0.15790184030917,
        -22.43788559040858),
    10: (-3.72016840437287 + 10.90681139476287j, -3.72016840437287 - 10.90681139476287j, 0.16105338653172,
         -24.62459635017404),
}  # fmt: skip


def ordered(values):
    return np.array(sorted(values, key=lambda z: (round(z.real, 9), z.imag)))


def poles(model):
    """The eigenvalues that are not 0, and how many are exactly 0."""
    values = model.linearize().poles()
    return ordered(values[values != 0.0]), int((values == 0.0).sum())


def off(values, exact):
    return np.abs(values - exact).max() / np.abs(exact).max()


def test_coefficients_of_the_reference_are_the_printed_ones():
    printed = ([80.81722, 2.31941332208709, 2.31941332208709, 0.29784188199686],
               [0.0, 33.86641391492494, -0.85035641456978, 1.68540397397560],
               [-80.95, -2.59951685249872, -2.59951685249872, -0.80329488458618],
               [0.0, 76.59734589573222, 0.0, 2.65431523794604])  # fmt: skip
    for matrix, values in zip(coefficients(), printed, strict=True):
        np.testing.assert_allclose([float(value) for value in matrix], values, rtol=1e-14, atol=1e-13)


@pytest.mark.few(2)
@pytest.mark.parametrize("speed", PRINTED)
def test_eigenvalues_are_the_printed_ones_and_those_of_extended_precision(speed):
    got, zeros = poles(bicycle(speed=speed))
    assert zeros == 6  # place, heading, two wheel angles, speed
    np.testing.assert_allclose(got, ordered(np.array(PRINTED[speed], dtype=complex)), rtol=0, atol=1e-12)
    assert off(got, eigenvalues(speed)) < ACCURACY
    for value, exact in zip(got, eigenvalues(speed), strict=True):
        assert abs(value - exact) < ACCURACY * abs(exact)


@pytest.mark.parametrize("changes", [
    ({"trail": -0.03}, {"c": mp.mpf("-0.03")}), ({"tilt": 0.0}, {"lam": mp.mpf(0)}),
    ({"wheel_base": 1.3, "front_radius": 0.2}, {"w": mp.mpf("1.3"), "rF": mp.mpf("0.2")}),
    ({"rear_radius": 0.6, "gravity": (0, 0, -1.62)}, {"rR": mp.mpf("0.6"), "g": mp.mpf("1.62")}),
])  # fmt: skip
def test_other_bicycles(changes):
    ours, theirs = changes
    got, zeros = poles(bicycle(speed=3.7, **ours))
    assert zeros == 6
    assert off(got, eigenvalues(mp.mpf("3.7"), **theirs)) < ACCURACY


@pytest.mark.slow
def test_weave_and_capsize_speeds():
    def largest(speed, oscillates):
        values = poles(bicycle(speed=speed))[0]
        return values[(np.abs(values.imag) > 0.0) == oscillates].real.max()

    assert brentq(largest, 4.0, 5.0, args=(True,), xtol=1e-9) == pytest.approx(4.29238253634111, abs=1e-7)
    assert brentq(largest, 5.5, 6.5, args=(False,), xtol=1e-9) == pytest.approx(6.02426201538837, abs=1e-7)


def turned(angle, flipped, speed=4.6):
    """The bicycle that goes in another direction on a plane that is upright if ``flipped``."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    if flipped:
        turn = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]) @ turn
    plain = bicycle(speed=speed)
    model = mv.Model("turned", turn @ plain.gravity, travel=turn @ plain.travel)
    for body in plain.bodies.values():
        model.add_body(body.name, body.mass, body.inertia, turn @ body.position, turn)
    for joint in plain.joints.values():
        model.add_joint(joint.name, "revolute", joint.first, joint.second, turn @ joint.position,
                        axis=turn @ joint.axis)  # fmt: skip
    for wheel in plain.rolling.values():
        model.add_rolling(wheel.name, wheel.body, wheel.radius, -(turn @ wheel.axis), turn @ wheel.normal)
    return model


@pytest.mark.parametrize(("angle", "flipped"), [(0.7, False), (np.pi, False), (-1.1, True)])
def test_any_direction_of_travel_and_plane_gives_the_same(angle, flipped):
    got, zeros = poles(turned(angle, flipped))
    assert zeros == 6
    assert off(got, eigenvalues(mp.mpf("4.6"))) < ACCURACY


def test_backwards():
    assert off(poles(bicycle(speed=-5.0))[0], eigenvalues(-5)) < ACCURACY


def test_states_and_what_is_ignorable_are_named():
    system = bicycle().linearize()
    assert system.states == ("steer.rz", "rear_axle.rz", "front_axle.rz", "frame.x", "frame.y", "frame.rx", "frame.rz",
                             "d(steer.rz)/dt", "d(frame.x)/dt", "d(frame.rx)/dt")  # fmt: skip
    assert set(system.ignorable) == {"frame.x", "frame.y", "frame.rz", "rear_axle.rz", "front_axle.rz",
                                     "d(frame.x)/dt"}  # fmt: skip
    assert system.tied == ("frame.z", "frame.ry")
    assert set(system.driven) == {"frame.y", "frame.rz", "rear_axle.rz", "front_axle.rz"}
    weight = 9.81 * 94.0
    np.testing.assert_allclose(sum(system.contact_forces.values()), (0.0, 0.0, weight), rtol=1e-13, atol=1e-10)
    at = 0.3 * 85 + 0.9 * 4 + 1.02 * 3
    assert system.contact_forces["front"][2] == pytest.approx(9.81 * at / 1.02, rel=1e-12)
    assert system.spins["rear"] == pytest.approx(5.0 / 0.3)
    assert "spins at 16.6667 rad/s" in system.explain()
    assert "eigenvalue 0: rear_axle.rz" in system.explain()


def test_speeds_that_are_asked_for_are_states():
    system = bicycle().linearize(independent=["frame.rz", "frame.rx", "rear_axle.rz"])
    assert system.states[-3:] == ("d(rear_axle.rz)/dt", "d(frame.rx)/dt", "d(frame.rz)/dt")
    values = system.poles()
    assert off(ordered(values[values != 0.0]), eigenvalues(5)) < ACCURACY
    with pytest.raises(mv.ModelError, match=r"'steer.z' is not a coordinate"):
        bicycle().linearize(independent=["steer.z"])
    with pytest.raises(mv.ModelError, match=r"speed of 'frame.rz' follows from the others"):
        bicycle().linearize(independent=["frame.rx", "frame.rz", "frame.x", "steer.rz"])
    with pytest.raises(mv.ModelError, match=r"'frame.z' follows from the others"):
        bicycle().linearize(independent=["frame.z", "frame.ry", "frame.rx"])


def test_responses_are_those_of_the_closed_form():
    """Lean and steer by torques: s^2 M + s v C1 + g K0 + v^2 K2. Our lean is theirs, our steering the other way."""
    omega = np.array([0.3, 3.0, 20.0])
    got = bicycle().linearize().frequency_response(omega, ["lean", "steer.angle"], ["lean.torque", "steer.torque"])
    flip = mp.diag([1, -1])
    for k, w in enumerate(omega):
        mass, c1, k0, k2 = coefficients()
        s = mp.mpc(0, w)
        exact = flip * (s * s * mass + 5 * s * c1 + mp.mpf("9.81") * k0 + 25 * k2) ** -1 * flip
        exact = np.array([[complex(exact[i, j]) for j in range(2)] for i in range(2)])
        np.testing.assert_allclose(got[:, :, k], exact, rtol=0, atol=1e-11 * np.abs(exact).max())


@pytest.mark.slow
def test_sensitivities_to_the_speed_are_exact():
    system = bicycle().linearize()
    values, slopes = system.modes().eigenvalues, system.mode_sensitivities("travel.x").eigenvalues[0]
    step = mp.mpf(10) ** -12
    for value, slope in zip(values, slopes, strict=True):
        if value == 0.0:
            assert slope == 0.0
            continue
        root = [min(mp.eig(state_matrix(5 + sign * step), left=False, right=False), key=lambda z, v=value: abs(z - v))
                for sign in (1, -1)]  # fmt: skip
        exact = complex((root[0] - root[1]) / (2 * step))
        assert abs(slope - exact) < 1e-10 * abs(exact)
    np.testing.assert_array_equal(system.eigenvalue_sensitivities(["travel.x"])[0], slopes)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "theirs"), [("frame.mass", "mB"), ("fork.mass", "mH"), ("frame.inertia.zz", "Bzz")])
def test_sensitivities_to_other_parameters(name, theirs):
    system = bicycle().linearize()
    slopes = system.mode_sensitivities([name]).eigenvalues[0]
    nominal = mp.mpf({"mB": "85", "mH": "4", "Bzz": "2.8"}[theirs])
    step = mp.mpf(10) ** -12
    for value, slope in zip(system.modes().eigenvalues, slopes, strict=True):
        if value != 0.0:
            a, b = (min(mp.eig(state_matrix(5, **{theirs: nominal + d}), left=False, right=False),
                        key=lambda z, v=value: abs(z - v)) for d in (step, -step))  # fmt: skip
            assert abs(slope - complex((a - b) / (2 * step))) < 1e-8 * np.abs(slopes).max()


def test_a_rider_who_steers_into_the_fall_stabilises_it():
    """Steer torque by lean rate, Schwab, Kooijman & Meijaard: to the same side as the lean, which steers to it."""
    system = bicycle(speed=3.5).linearize()
    moving = system.poles()[system.poles() != 0.0]
    assert moving.real.max() > 0.9
    loop = system.feedback(np.array([[-10.0]]), sensors=["lean.rate"], actuators=["steer.torque"])
    closed = loop.poles()
    assert np.sort(closed.real)[-7] < -0.1  # all but the six that are 0
    mass, c1, k0, k2 = coefficients()
    damping = mp.mpf("3.5") * c1
    damping[1, 0] -= 10  # our steering is the other way
    exact = mp.eig(_companion(mass, damping, mp.mpf("9.81") * k0 + mp.mpf("12.25") * k2), left=False, right=False)
    exact = ordered(np.array([complex(value) for value in exact]))
    np.testing.assert_allclose(ordered(closed[np.argsort(np.abs(closed))[6:]]), exact, rtol=0, atol=1e-9)


def _companion(mass, damping, stiffness):
    a = mp.zeros(4)
    a[0, 2] = a[1, 3] = 1
    a[2:, :2], a[2:, 2:] = -(mass**-1) * stiffness, -(mass**-1) * damping
    return a


def test_time_response_from_an_initial_lean_decays_at_a_stable_speed():
    system = bicycle(speed=5.0).linearize()
    start = np.zeros(10)
    start[system.states.index("frame.rx")] = 0.05
    t = np.linspace(0.0, 30.0, 301)
    lean, = system.time_response(t, np.zeros((3, len(t))), initial=start, outputs="lean")
    assert lean[0] == pytest.approx(0.05)
    assert abs(lean[-1]) < 1e-4


def test_forces_in_joints_balance_the_frame():
    """m a = F + force at the rear axle + force at the steering; J alpha = M + their torques about the centre.

    All depend on the forces at the contacts. Forces and torques are in axes that lean with the frame.
    """
    model, s = bicycle(), 2j
    for k, d in enumerate("xyz"):
        model.add_output(f"q{d}", "frame", d)
        for name, word in (("a", d), ("b", f"r{d}")):
            model.add_output(f"{name}{d}", "frame", word, quantity="acceleration")
        model.add_output(f"r{d}", "frame", f"r{d}")
        model.add_input(f"F{d}", "frame", d)
        model.add_input(f"M{d}", "frame", f"r{d}")
        for joint in ("rear_axle", "steer"):
            for name, part in (("force", 0), ("torque", 3)):
                row = np.zeros(6)
                row[part : part + 3] = np.array(model.joints[joint].axes)[k] * (1.0, 1.0, part == 0)
                if row.any():  # about the axis of the joint there is no torque
                    model.add_force_output(f"{joint}.{name}.{d}", joint, row)
    got = dict(zip(model.outputs, model.linearize().frequency_response([s.imag])[:, :, 0], strict=True))
    plain = bicycle().linearize().frequency_response([s.imag], ["lean", "steer.rate"])[:, :, 0]
    np.testing.assert_allclose([got["lean"][:3], got["steer.rate"][:3]], plain, rtol=1e-9, atol=1e-12)
    inputs = list(model.inputs)

    def of(names):
        return np.array([got.get(names.format(d), np.zeros(len(inputs))) for d in "xyz"])

    applied = np.zeros((6, len(inputs)))
    for i, name in enumerate(("Fx", "Fy", "Fz", "Mx", "My", "Mz")):
        applied[i, inputs.index(name)] = 1.0
    applied[1, inputs.index("side.force")] = applied[3, inputs.index("lean.torque")] = 1.0
    steer = np.array(model.joints["steer"].axes)[:, 2]
    applied[3:, inputs.index("steer.torque")] = -steer  # on the fork against the frame
    force, torque = applied[:3].astype(complex), applied[3:].astype(complex)
    for joint in ("rear_axle", "steer"):
        # an output is positive where it pulls the first body, the frame, to the second
        pull, arm = of(f"{joint}.force.{{}}"), np.array(model.joints[joint].position) - model.bodies["frame"].position
        force += pull
        torque += of(f"{joint}.torque.{{}}") + np.cross(arm, pull, axis=0)
        assert np.abs(pull).max(axis=1).min() > 0.01
    force[1] -= 85.0 * 9.81 * got["lean"]  # the weight that they hold leans along
    np.testing.assert_allclose(of("a{}"), s**2 * of("q{}"), rtol=0, atol=1e-9)
    np.testing.assert_allclose(of("b{}"), s**2 * of("r{}"), rtol=0, atol=1e-9)
    np.testing.assert_allclose(85.0 * of("a{}"), force, rtol=0, atol=1e-8)
    xx, yy, zz, xy, xz, yz = model.bodies["frame"].inertia
    tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    np.testing.assert_allclose(tensor @ of("b{}"), torque, rtol=0, atol=1e-8)
