"""Nonlinear time response: closed forms, conservation, small motion, and what is refused."""

import csv
import os
import signal
import sys
import threading

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mbsvib as mv


def lamp():
    """An arm on a hinge that a spring holds up against its weight: the quadratic terms of its motion are large."""
    model = mv.Model("lamp", gravity=(0, 0, -9.81))
    model.add_body("arm", 1.5, (0.01, 0.05, 0.05), (0.3, 0, 0.1))
    model.add_joint("hinge", "revolute", "ground", "arm", (0, 0, 0), axis=(0, 1, 0))
    model.add_spring("spring", "ground", "arm", (0, 0, 0.5), (0.4, 0, 0.1), 300.0, 4.0)
    model.add_input("F", "arm", "z")
    model.add_output("z", "arm", "z", position=(0.6, 0, 0.1))
    model.add_output("pull", "arm", "ry", quantity="velocity")
    model.add_force_output("tension", "spring")
    return model.equilibrium(preload="spring")


@pytest.mark.slow
def test_small_motion_is_the_linear_response_to_second_order():
    model, t = lamp(), np.linspace(0.0, 1.0, 101)
    shape = np.sin(7.0 * t) * t
    linear = model.linearize().time_response(t, shape[None], hold="first")
    sizes, errors = np.array([0.4, 0.2, 0.1, 0.05]), []
    for size in sizes:
        run = model.simulate(t, {"F": size * shape}, tolerance=1e-10)
        errors.append([np.abs(run[name] - size * linear[i]).max() for i, name in enumerate(("z", "pull", "tension"))])
    slopes = np.diff(np.log(errors), axis=0) / np.diff(np.log(sizes))[:, None]
    np.testing.assert_allclose(slopes, 2.0, atol=0.06)


@pytest.mark.slow
def test_all_elements_in_small_motion():
    """Maxwell elements, inerters, torsion springs, bushings, rotors and gears against the exact linear response."""
    model = mv.Model("all")
    model.add_body("a", 2.0, (0.02, 0.03, 0.04), (0.0, 0.0, 0.2))
    model.add_body("wheel", 0.3, (0.001, 0.001, 0.002), (0.1, 0.0, 0.2))
    model.add_body("pinion", 0.1, (0.0002, 0.0002, 0.0003), (0.2, 0.0, 0.2))
    model.add_joint("axle", "revolute", "a", "wheel", (0.1, 0, 0.2), axis=(0, 0, 1))
    model.add_joint("shaft", "revolute", "a", "pinion", (0.2, 0, 0.2), axis=(0, 0, 1))
    model.add_gear("gear", "axle.rz", "shaft.rz", -3.0)
    model.add_bushing("mount", "ground", "a", (0, 0, 0), (900, 800, 700, 20, 30, 40), (2, 2, 2, 0.1, 0.1, 0.1))
    model.add_torsion_spring("t", "a", "wheel", (0, 0, 1), 0.4, 0.001)
    model.add_maxwell("m", "ground", "a", (0.3, 0.1, 0), (0.1, 0, 0.2), 500.0, 20.0, static_stiffness=100.0)
    model.add_inerter("i", "ground", "a", (-0.3, 0.1, 0), (-0.1, 0, 0.2), 0.7)
    model.add_rotor("r", "a", 300.0, (1, 0, 0), inertia=1e-3)
    for d in ("x", "rz"):
        model.add_input(f"in.{d}", "a", d)
    model.add_output("y", "a", "y")
    model.add_output("ry", "a", "ry")
    model.add_output("turn", "pinion", "rz", relative_to="a")
    model.add_output("acceleration", "a", "z", quantity="acceleration")
    model.add_force_output("maxwell", "m")
    model.add_force_output("moment", "mount", "rz")
    model.add_force_output("inerter", "i")
    t = np.linspace(0.0, 0.5, 51)
    u = 1e-5 * np.array([np.sin(9 * t), np.cos(5 * t)])
    linear = model.linearize().time_response(t, u, hold="first")
    run = model.simulate(t, {"in.x": u[0], "in.rz": u[1]}, tolerance=1e-10)
    for i, name in enumerate(model.outputs):
        np.testing.assert_allclose(run[name], linear[i], rtol=0, atol=2e-4 * np.abs(linear[i]).max(), err_msg=name)


@pytest.mark.slow
def test_geared_wheels_over_many_turns():
    model = mv.Model("gears")
    for name, x, inertia in (("wheel", 0.0, 0.02), ("pinion", 0.3, 0.003)):
        model.add_body(name, 1.0, (inertia, inertia, inertia), (x, 0, 0))
        model.add_joint(f"{name}.axle", "revolute", "ground", name, (x, 0, 0), axis=(0, 0, 1))
        model.add_output(f"{name}.turn", name, "rz")
    model.add_gear("mesh", "wheel.axle.rz", "pinion.axle.rz", -4.0)
    model.add_input("torque", "wheel", "rz")
    t = np.linspace(0.0, 4.0, 41)
    run = model.simulate(t, {"torque": lambda t: 1.0 + np.cos(3.0 * t)})
    angle = (0.5 * t**2 + (1.0 - np.cos(3.0 * t)) / 9.0) / (0.02 + 16 * 0.003)
    np.testing.assert_allclose(run["wheel.turn"], angle, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(run["pinion.turn"], -4.0 * angle, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(run.energy.supplied, run.energy.total, rtol=1e-7, atol=1e-8)
    # ten turns of the wheel: what crosses is told by the rates too
    passes = run.crossings("wheel.turn", 10.0 * 2.0 * np.pi)
    at = run.model.simulate([0.0, float(passes[0])], {"torque": lambda t: 1.0 + np.cos(3.0 * t)})
    assert at["wheel.turn"][-1] == pytest.approx(20.0 * np.pi, rel=1e-7)


@pytest.mark.slow
def test_tumbling_body_keeps_its_angular_momentum():
    """A free body that turns about its middle axis flips over and over; rotation vectors start anew on the way."""
    model = mv.Model("top")
    inertia = np.array([0.01, 0.02, 0.03])
    model.add_body("top", 1.0, inertia, (0.1, 0.2, 0.3))
    for d in ("rx", "ry", "rz"):
        model.add_output(d, "top", d, quantity="velocity")
    t = np.linspace(0.0, 6.0, 61)
    run = model.simulate(t, initial={"top.rx": (0, 0.02), "top.ry": (0, 9.0), "top.rz": (0, 0.01), "top.x": (0.0, 1.0)})
    rotation, _ = run.frames()["top"]
    spin = np.array([run["rx"], run["ry"], run["rz"]]).T
    momentum = np.einsum("tij,j,tkj,tk->ti", rotation, inertia, rotation, spin)
    np.testing.assert_allclose(momentum, [inertia * (0.02, 9.0, 0.01)] * len(t), rtol=0, atol=1e-8)
    assert np.ptp(rotation[:, 1, 1]) > 1.0  # it has flipped
    np.testing.assert_allclose(run.coordinates["top.x"], t, atol=1e-9)
    assert np.abs(run.energy.balance).max() < 1e-8 * run.energy.total[0]
    assert len({id(sample.chart) for sample in run.trace.samples}) > 3


@pytest.mark.slow
def test_four_bar_turns_over_with_coordinates_chosen_anew():
    """The longest bar and the shortest are longer than the others together: every bar swings to and fro."""
    pins = ((0.0, 0.0), (0.0868, 0.4924), (0.65, 0.55), (1.0, 0.0))
    model = mv.library.four_bar(pins=pins).with_parts(springs={}, outputs={})
    run = model.simulate(np.linspace(0.0, 2.0, 201), initial={"A.rz": (0.0, 12.0)})
    for values in run.coordinates.values():
        assert np.ptp(values) > 0.5
    assert len({tuple(sample.chart.independent) for sample in run.trace.samples}) > 1
    assert np.abs(run.energy.balance).max() < 1e-7 * run.energy.kinetic.max()
    closures = [run.trace.session.loops.scaled(s.state.q, s.chart.bases)[0] for s in run.trace.samples]
    assert np.abs(closures).max() < 1e-12
    # the pose after a turn is one that moved() finds too
    k = 5
    there = model.moved({"A.rz": float(run.coordinates["A.rz"][k])})
    rotation, shift = run.frames()["coupler"]
    place = rotation[k] @ np.array(model.bodies["coupler"].position) + shift[k]
    np.testing.assert_allclose(place, there.bodies["coupler"].position, atol=1e-11)


def bars(crank):
    """Angles of the library's four-bar, B, C and D of A = ``crank``, from the pose as described on."""
    path = np.concatenate((np.linspace(0.0, crank, 200), [crank - 1e-5, crank + 1e-5]))
    a, b, c, d = 0.0, 0.2 + 0.25j, 1.05 + 0.65j, 1.2
    tip = a + (b - a) * np.exp(-1j * path)  # the joints turn about y, from z to x
    reach = np.abs(d - tip)
    along = (np.abs(c - b) ** 2 - np.abs(c - d) ** 2 + reach**2) / (2.0 * reach)
    knee = tip + (along + 1j * np.sqrt(np.abs(c - b) ** 2 - along**2)) * (d - tip) / reach
    coupler, rocker = (-np.unwrap(np.angle(part / part[0])) for part in (knee - tip, knee - d))
    angles = np.array([path, coupler - path, rocker - coupler, -rocker])
    return angles[:, 199], (angles[:, 201] - angles[:, 200]) / 2e-5


@pytest.mark.slow
@pytest.mark.parametrize("crank", [2.5, -7.0])
def test_initial_values_follow_through_loops(crank):
    """As the crank is turned there from the pose as described, also by more than a whole turn; and what follows."""
    model, h = mv.library.four_bar(), 1e-3
    for body, direction in (("rocker", "ry"), ("coupler", "x")):
        for quantity in ("velocity", "acceleration"):
            model.add_output(f"{body} {quantity}", body, direction, quantity=quantity)
    run = model.simulate(h * np.arange(5), initial={"A.rz": (crank, -2.0)}, tolerance=1e-11)
    for body in ("rocker", "coupler"):  # an acceleration is the slope of the velocity
        slope = run[f"{body} velocity"] @ [1.0, -8.0, 0.0, 8.0, -1.0] / (12.0 * h)
        assert run[f"{body} acceleration"][2] == pytest.approx(slope, rel=1e-6)
    angles, rates = bars(crank)
    names = ("A.rz", "B.rz", "C.rz", "D.rz")
    np.testing.assert_allclose([run.coordinates[name][0] for name in names], angles, atol=1e-10)
    np.testing.assert_allclose([run.rates[name][0] for name in names], -2.0 * rates, atol=1e-7)


@pytest.mark.slow
def test_rotation_vectors_of_a_ball_joint_and_their_rates():
    """The vector turns one body against the other, beyond half a turn, and its rate is its slope."""
    model = mv.Model("ball", gravity=(0, 0, -9.81))
    model.add_body("arm", 2.0, (0.03, 0.02, 0.04), (0.2, 0.0, 0.0))
    model.add_body("top", 1.0, (0.01, 0.02, 0.025), (0.5, 0.1, 0.2), orientation=(0.2, -0.4, 0.3))
    model.add_joint("hinge", "revolute", "ground", "arm", (0, 0, 0), axis=(0, 1, 0.3))
    model.add_joint("ball", "spherical", "arm", "top", (0.4, 0.1, 0.1), axis=(1, 2, -2))
    h, names = 1e-3, ("ball.rx", "ball.ry", "ball.rz")
    start = dict(zip(names, [(0.4, 3.0), (-0.3, 9.0), (0.5, -6.0)], strict=True))
    t = (np.linspace(0.0, 0.6, 13)[1:, None] + h * np.arange(-2, 3)).ravel()
    run = model.simulate(np.concatenate(([0.0], t)), initial=start, tolerance=1e-9)
    vector, rate = (np.array([part[name] for name in names]) for part in (run.coordinates, run.rates))
    np.testing.assert_allclose(np.transpose((vector[:, 0], rate[:, 0])), list(start.values()), atol=1e-12)
    frames = run.frames()
    turn = Rotation.from_matrix(frames["arm"][0].transpose(0, 2, 1) @ frames["top"][0])
    axes = np.array(model.joints["ball"].axes)
    np.testing.assert_allclose(turn.as_matrix(), Rotation.from_rotvec(vector.T @ axes.T).as_matrix(), atol=1e-9)
    clusters = vector[:, 1:].reshape(3, -1, 5)
    slope = clusters @ np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * h)
    np.testing.assert_allclose(rate[:, 1:].reshape(3, -1, 5)[:, :, 2], slope, rtol=1e-5, atol=1e-5)
    assert np.linalg.norm(vector, axis=0).max() > 1.5 * np.pi


@pytest.mark.slow
def test_pendulum_from_a_large_angle():
    """Period 4 sqrt(l/g) K(sin(a/2)) of a point mass."""
    from scipy.special import ellipk

    model = mv.library.pendulum_chain(1)
    run = model.simulate(np.linspace(0.0, 6.0, 121), initial={"pin1.rz": 2.0}, tolerance=1e-10)
    passes = run.crossings("pin1.rz")
    period = 4.0 * np.sqrt(1.0 / model.gravity[2] * -1.0) * ellipk(np.sin(1.0) ** 2)
    np.testing.assert_allclose(np.diff(passes)[::1], 0.5 * period, rtol=1e-9)
    np.testing.assert_allclose(passes[0], 0.25 * period, rtol=1e-9)


@pytest.fixture
def interruptible():
    """Ctrl-C interrupts Python, also where the tests run in the background of a shell that ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_within_the_integrator_ends_the_run():
    """CVODES turns it into an error of its own, after which the run went on."""
    model, reached = mv.library.pendulum_chain(3), []

    def press(done, _):
        reached.append(done)
        if done == 8:  # the last interval takes minutes
            threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()

    t = np.concatenate((np.linspace(0.0, 0.4, 9), [1e4]))
    with pytest.warns(RuntimeWarning, match="interrupted at t = 0.4 s"):
        run = model.simulate(t, initial={"pin1.rz": 2.0}, progress=press)
    assert not run.complete
    assert reached == list(range(1, 9))
    assert run.energy.balance == pytest.approx(np.zeros(9), abs=1e-6)
    assert repr(run.energy).startswith(f"Energy({len(run.energy.parts)} parts, 9 times, off by ")


def test_an_interrupted_run_keeps_what_it_has():
    def stop(done, total):
        if done == 5:
            raise KeyboardInterrupt

    with pytest.warns(RuntimeWarning, match="interrupted at t = 0.5 s"):
        run = lamp().simulate(np.linspace(0.0, 2.0, 21), {"F": 1.0}, progress=stop)
    assert not run.complete
    assert len(run) == 6
    assert "interrupted" in repr(run)


def test_a_step_that_cannot_be_taken_says_when_and_why():
    """A bushing that is wound up: its moment ends at half a turn."""
    model = mv.Model("wound")
    model.add_body("b", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("hinge", "revolute", "ground", "b", (0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 0, 1e-3, 1e-3, 1e-3))
    with pytest.raises(mv.SimulationError, match="'k' is turned so far that its moment is no longer") as caught:
        model.simulate(np.linspace(0.0, 2.0, 201), initial={"hinge.rz": (0.0, 2.0)})
    error = caught.value
    assert error.coordinate == "hinge.rz"
    assert 1.45 < error.time < 1.6
    assert 0.0 < error.run.coordinates["hinge.rz"][-1] < 3.2
    assert not error.run.complete


def flat_toggle():
    """Two equal bars in line between a pin and a slider: rigid loops that are singular as described."""
    model = mv.Model("flat")
    for name, x in (("left", 0.5), ("right", 1.5)):
        model.add_body(name, 1.0, (0.01, 0.1, 0.1), (x, 0, 0))
    model.add_body("slider", 1.0, (0.01,) * 3, (2.0, 0, 0))
    model.add_joint("a", "revolute", "ground", "left", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("b", "revolute", "left", "right", (1, 0, 0), axis=(0, 0, 1))
    model.add_joint("c", "revolute", "right", "slider", (2, 0, 0), axis=(0, 0, 1))
    model.add_joint("rail", "fixed", "ground", "slider")
    return model


REFUSED = [
    (lambda m: m.simulate([0.0]), "t with .*two or more times in ascending order"),
    (lambda m: m.simulate([0.0, 1.0, 0.5]), "ascending order"),
    (lambda m: m.simulate([0.0, 1.0], {"G": 1.0}), "'G' is not an input"),
    (lambda m: m.simulate([0.0, 1.0], {"F": [1.0, 2.0, 3.0]}), "2 samples, one for each time"),
    (lambda m: m.simulate([0.0, 1.0], {"F": lambda t: np.nan}), "input 'F' is not finite at t = 0 s"),
    (lambda m: m.simulate([0.0, 1.0], [1.0]), "a mapping of inputs"),
    (lambda m: m.simulate([0.0, 1.0], initial={"hing.rz": 1.0}), "Did you mean 'hinge.rz'"),
    (lambda m: m.simulate([0.0, 1.0], initial=1.0), "a mapping of joint coordinates"),
    (lambda m: m.simulate([0.0, 1.0], without="wind"), "'wind' is not a load"),
    (lambda m: m.simulate([0.0, 1.0], tolerance=0.0), "tolerance = 0"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_bad_arguments_are_refused_by_name(call, words):
    with pytest.raises(mv.ModelError, match=words):
        call(lamp())


def test_models_without_a_statement_are_refused_by_name():
    with pytest.raises(mv.ModelError, match="rotor 'spin': body 'top' itself spins"):
        mv.library.sleeping_top().simulate([0.0, 1.0])
    turning = lamp()
    turning.add_base_motion("rock", "ry")
    with pytest.raises(mv.ModelError, match="base motion 'rock' turns the ground"):
        turning.simulate([0.0, 1.0], {"rock": 1.0})
    with pytest.raises(mv.SingularPoseError, match=r"another number of degrees of freedom .* model.moved\(\{'"):
        flat_toggle().simulate([0.0, 1.0])
    geared = mv.library.four_bar()
    for name, pair in (("g1", ("A.rz", "B.rz")), ("g2", ("C.rz", "D.rz"))):
        geared.add_gear(name, *pair, 1.0)
    with pytest.raises(mv.ModelError, match=r"coupler 'g\d': all joints of the loop that '[ABCD]' closes are coupled"):
        geared.simulate([0.0, 1.0])
    massless = mv.Model("massless")
    massless.add_body("b", 0.0, (0, 0, 0))
    massless.add_joint("rail", "prismatic", "ground", "b", axis=(1, 0, 0))
    massless.add_spring("k", "ground", "b", (-1, 0, 0), (0, 0, 0), 10.0)
    with pytest.raises(mv.ModelError, match=r"the motion 'rail.z' has no inertia"):
        massless.simulate([0.0, 1.0])


def test_a_beam_between_two_moving_bodies_is_refused():
    """Both have pins of their own to the ground, so that neither carries the beam."""
    model = mv.Model("two")
    for name, x in (("a", 0.0), ("b", 1.0)):
        model.add_body(name, 1.0, (0.1,) * 3, (x, 0, 0))
        model.add_joint(f"{name}.pin", "revolute", "ground", name, (x, 0, -0.2), axis=(0, 1, 0))
    model.add_beam("rod", "a", "b", {"type": "circle", "radius": 0.01}, {"E": 2.1e11, "nu": 0.3, "rho": 7800},
                   (0, 0, 0), (1, 0, 0), elements=2)  # fmt: skip
    with pytest.raises(mv.ModelError, match=r"'rod' bends between the moving bodies 'a' and 'b'.*neither carries it"):
        model.simulate([0.0, 1.0])


@pytest.mark.parametrize("kind", ["contact", "friction"])
def test_contact_is_refused_with_a_way_out(kind):
    with pytest.raises(mv.ModelError, match=f"joint 'c': kind = '{kind}'.*to_exudyn.* contact and friction"):
        lamp().add_joint("c", kind, "ground", "arm", (0, 0, 0))


@pytest.mark.slow
def test_what_a_run_tells(tmp_path, monkeypatch):
    model = lamp()
    model.add_base_motion("shake", "z")
    model.add_output("absolute", "arm", "z", absolute=True)
    run = model.simulate(np.linspace(0.0, 0.2, 5), {"F": [0.0, 1.0, 2.0, 1.0, 0.0]})
    with pytest.raises(mv.ResponseError, match="output 'absolute': an absolute displacement would integrate"):
        run["absolute"]
    with pytest.raises(mv.ResponseError, match="Did you mean 'z'"):
        run["zz"]
    with pytest.raises(mv.ResponseError, match="'leg' is not a part with energy"):
        run.energy.of("leg")
    assert repr(run) == "Run('lamp': 5 times to 0.2 s, 1 coordinate, 3 outputs)"
    with pytest.raises(ValueError, match="read-only"):
        run["z"][0] = 1.0
    with open(run.to_csv(tmp_path / "run.csv"), newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["z"]) for row in rows] == run["z"].tolist()
    assert {"time", "hinge.rz", "energy.kinetic", "energy.supplied"} < set(rows[0])
    np.testing.assert_allclose(run.energy.of("arm") + run.energy.of("spring"), run.energy.total, rtol=1e-12)
    figure = run.plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["displacement [m]", "angular velocity [rad/s]", "force [N]",
                                                           "energy [J]"]  # fmt: skip
    with pytest.raises(mv.ResponseError, match="'hing' is neither"):
        run.plot("hing")
    motion = run.animate(view="y", frames=3)
    assert motion.save(tmp_path / "run.gif").stat().st_size > 1000
    np.testing.assert_allclose(motion.points(0.0), motion.scene.points, atol=1e-12)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(mv.ExportError, match="needs pandas"):
        run.to_dataframe()


def test_strong_dampers_do_not_bind_the_steps():
    """A damper that stops its motion within a nanosecond, and a slow spring beside it."""
    model = mv.Model("stiff")
    for name, x, damping in (("fast", 1.0, 1e9), ("slow", 2.0, 0.1)):
        model.add_body(name, 1.0, (0.1,) * 3, (x, 0, 0))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"{name}.k", "ground", name, (0, 0, 0), (x, 0, 0), 40.0, damping)
    t = np.linspace(0.0, 3.0, 31)
    run = model.simulate(t, initial={"fast.rail.z": 0.1, "slow.rail.z": 0.1})
    assert run.trace.session.integrator.stiff
    np.testing.assert_allclose(run.coordinates["fast.rail.z"], 0.1 * np.exp(-40e-9 * t), rtol=1e-8)
    rate, omega = 0.05, np.sqrt(40.0 - 0.05**2)
    slow = 0.1 * np.exp(-rate * t) * (np.cos(omega * t) + rate / omega * np.sin(omega * t))
    np.testing.assert_allclose(run.coordinates["slow.rail.z"], slow, rtol=0, atol=2e-8)


@pytest.mark.slow
def test_beams_that_bend_far_are_warned_of():
    model = mv.Model("ruler")
    model.add_body("tip", 0.2, (1e-4,) * 3, (0.5, 0, 0))
    model.add_beam("b", "ground", "tip", {"type": "rectangle", "width": 0.02, "height": 0.001},
                   {"E": 2.1e11, "nu": 0.3, "rho": 7800}, (0, 0, 0), (0.5, 0, 0), elements=1)  # fmt: skip
    model.add_load("pull", "tip", (0, 0, -0.3))
    with pytest.warns(mv.LargeDisplacementWarning, match="'b' bends by"):
        model.simulate(np.linspace(0.0, 1.0, 11), tolerance=1e-5)
