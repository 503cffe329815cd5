"""Driven joints: against the same mechanism with a force at the joint, joints that are locked, and formulas."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError, ResponseError
from mbsvib.files import load, save
from mbsvib_export import to_exudyn

QUANTITIES = ("displacement", "velocity", "acceleration")
ABOUT_Y = (0, 0, 0, 0, 1, 0)
OMEGA = np.array([0.7, 3.0, 11.0])
S = 1j * OMEGA
INERTIA = (1.0, 1.0, 1.0)


def arm(drive="motion", quantity="displacement", gravity=None):
    """Two links, the first of which a motion, a torque or nothing (a fixed joint) turns."""
    model = mv.Model("arm", gravity=gravity)
    model.add_body("upper", 2.0, (0.02, 0.03, 0.04), (0.3, 0, 0.1))
    model.add_body("fore", 1.0, (0.01, 0.012, 0.02), (0.8, 0.1, 0.1))
    model.add_joint("elbow", "revolute", "upper", "fore", (0.6, 0, 0.1), axis=(0, 0.6, 0.8))
    model.add_bushing("flex", "upper", "fore", (0.6, 0, 0.1), stiffness=(0, 0, 0, 10, 20, 30),
                      damping=(0, 0, 0, 0.1, 0.2, 0.3))
    model.add_spring("tip", "ground", "fore", (1, 1, 0), (0.9, 0.1, 0.1), stiffness=50.0, damping=0.4)
    model.add_rotor("wheel", "fore", 30.0, (1, 0, 0), inertia=0.02)
    frame = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    if drive == "none":
        model.add_joint("shoulder", "fixed", "ground", "upper", (0, 0, 0), orientation=frame)
    else:
        model.add_joint("shoulder", "revolute", "ground", "upper", (0, 0, 0), orientation=frame)
    if drive == "motion":
        model.add_motion_input("drive", "shoulder", quantity)
    elif drive == "torque":
        model.add_input("drive", "upper", ABOUT_Y, position=(0, 0, 0))
    model.add_input("F", "fore", (1, 2, 3, 0.1, 0.2, 0.3))
    for key in QUANTITIES:
        model.add_output(key, "fore", (1, 2, 3, 0.1, 0.2, 0.3), quantity=key)
    model.add_force_output("support", "shoulder", (1, 2, 3, 4, 5, 0))
    model.add_force_output("spring", "tip")
    model.add_force_output("floor", "ground", (1, 2, 3, 0, 0, 0))
    model.add_force_output("torque", "shoulder", "rz")
    if drive == "torque":
        model.add_output("angle", "upper", ABOUT_Y, position=(0, 0, 0))
    return model


def by_torque(order):
    """G_yu = G_yT / G_aT of the free joint, and the torque 1 / G_aT, which is negative where it pulls together."""
    free = arm("torque").linearize().frequency_response(OMEGA)
    angle, rest = free[-1], free[:-1].copy()
    by_motion, by_force = rest[:, 0] / angle[0], rest[:, 1] - rest[:, 0] * angle[1] / angle[0]
    by_motion[-1], by_force[-1] = -1.0 / angle[0], angle[1] / angle[0]
    return np.stack((by_motion / S**order, by_force), axis=1)


@pytest.mark.parametrize("order", range(3))
def test_responses_are_those_of_a_torque_that_makes_this_motion(order):
    system = arm(quantity=QUANTITIES[order]).linearize()
    assert system.coordinates == ("elbow.rz",)
    assert system.input_units == (("rad", "rad/s", "rad/s^2")[order], "N + N m")
    np.testing.assert_allclose(system.frequency_response(OMEGA), by_torque(order), rtol=1e-9)


def test_a_drive_at_rest_is_a_fixed_joint():
    driven, fixed = arm().linearize(), arm("none").linearize()
    for key in "MCK":
        np.testing.assert_allclose(getattr(driven, key), getattr(fixed, key), rtol=1e-14)
    np.testing.assert_allclose(driven.frequency_response(OMEGA, inputs="F"),
                               fixed.frequency_response(OMEGA, inputs="F"), rtol=1e-11)
    np.testing.assert_allclose(driven.B0[:, 1], fixed.B[:, 0], rtol=1e-14)
    assert "driven by motion inputs: shoulder.rz" in driven.explain()


PROPER = ({"displacement"}, {"displacement", "velocity"}, {*QUANTITIES, "support", "spring", "floor", "torque"})


@pytest.mark.few(2)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("order", range(3))
def test_state_spaces_exist_where_no_derivative_is_needed(order, realization):
    system = arm(quantity=QUANTITIES[order]).linearize()
    for name in system.outputs:
        # the spring feels positions and, by its damper, rates
        proper = name in PROPER[order] or (name == "spring" and order == 1)
        if not proper:
            with pytest.raises(ResponseError, match=rf"'{name}' needs the derivative of input 'drive'.*'acceleration'"):
                system[name, :].state_space(realization)
            continue
        space = system[name, :].state_space(realization)
        assert space.states[2:] == ("drive.displacement", "drive.velocity")[:order]
        np.testing.assert_allclose(space.frequency_response(OMEGA), system[name, :].frequency_response(OMEGA),
                                   rtol=1e-9)


def crane(quantity="acceleration", gravity=9.81):
    """A trolley that is driven along x with a load of 3 kg on a rope of 2 m."""
    model = mv.Model("crane", gravity=(0, 0, -gravity))
    model.add_body("trolley", 7.0, (1, 1, 1), (0, 0, 2.0))
    model.add_body("load", 3.0, (0, 0, 0), (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "trolley", (0, 0, 2.0), axis=(1, 0, 0))
    model.add_joint("rope", "revolute", "trolley", "load", (0, 0, 2.0), axis=(0, -1, 0))
    model.add_motion_input("drive", "rail.z", quantity)
    model.add_output("swing", "load", (0, 0, 0, 0, -1, 0))
    model.add_output("x", "load", "x")
    model.add_force_output("push", "rail", "z")
    return model


def test_a_crane_swings_as_its_formula_tells():
    """l a'' + g a = -x'' with the angle a of the rope; the drive pushes (7 + 3) x'' + 3 l a''."""
    system = crane().linearize()
    swing = -1.0 / (9.81 - 2.0 * OMEGA**2)
    push = 10.0 - 3.0 * 2.0 * OMEGA**2 * swing
    expected = [swing, -1.0 / OMEGA**2 + 2.0 * swing, -push]
    np.testing.assert_allclose(system.frequency_response(OMEGA)[:, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(system.modes().frequencies, [np.sqrt(9.81 / 2.0) / (2.0 * np.pi)], rtol=1e-13)
    t = np.linspace(0.0, 3.0, 31)
    rate = np.sqrt(9.81 / 2.0)
    np.testing.assert_allclose(system.time_response(t, np.ones(31), outputs="swing")[0],
                               -(1.0 - np.cos(rate * t)) / 9.81, atol=1e-13)
    moved = crane("displacement").linearize()
    zeros = moved.transmission_zeros("x", "drive")
    np.testing.assert_allclose(zeros, [], atol=1e-9)  # x of the load: g / (l s^2 + g)
    np.testing.assert_allclose(np.abs(moved.transmission_zeros("push", "drive")[-2:]), np.sqrt(9.81 / 2 * 10 / 7),
                               rtol=1e-9)


def test_drives_hold_their_joints_under_loads():
    """The elbow hangs, the shoulder is held level by its drive: no preload, and the equilibrium leaves it there."""
    model = mv.Model("held", gravity=(0, 0, -9.81))
    model.add_body("upper", 2.0, (0.02, 0.03, 0.04), (0.5, 0, 0))
    model.add_body("fore", 1.0, (0.01, 0.02, 0.03), (1.1, 0, -0.4))
    model.add_joint("shoulder", "revolute", "ground", "upper", (0, 0, 0), axis=(0, 1, 0))
    model.add_joint("elbow", "revolute", "upper", "fore", (1.0, 0, 0), axis=(0, 1, 0))
    model.add_motion_input("drive", "shoulder", "acceleration")
    model.add_force_output("torque", "shoulder", "rz")
    with pytest.raises(mv.EquilibriumError, match="elbow"):
        model.linearize()
    there = model.equilibrium()
    assert there.bodies["upper"].position == (0.5, 0, 0)
    assert there.bodies["fore"].position[0] == pytest.approx(1.0)
    system, length = there.linearize(), np.hypot(0.1, 0.4)
    inertia = 0.02 + length**2
    np.testing.assert_allclose(system.modes().frequencies[0] * 2 * np.pi, np.sqrt(9.81 * length / inertia), rtol=1e-9)
    slopes = system.eigenvalue_sensitivities(["fore.mass"])[0]
    above, below = (model.with_values({"fore.mass": 1.0 + h}).equilibrium().linearize().poles() for h in (1e-5, -1e-5))
    np.testing.assert_allclose(slopes, (above - below) / 2e-5, rtol=1e-6)


def four_bar():
    """A crank of 0.1 m that a motion turns, with a spring on the rocker and a body on the coupler by a spring."""
    model = mv.Model("four-bar")
    points = {"a": (0, 0, 0), "b": (0, 0.1, 0), "c": (0.3, 0.25, 0), "d": (0.3, 0, 0)}
    for name, start, end in (("crank", "a", "b"), ("coupler", "b", "c"), ("rocker", "d", "c")):
        middle = (np.array(points[start]) + points[end]) / 2
        model.add_body(name, 1.0, (0.01, 0.01, 0.01), middle)
    for name, first, second in (("a", "ground", "crank"), ("b", "crank", "coupler"), ("c", "coupler", "rocker"),
                                ("d", "ground", "rocker")):
        model.add_joint(name, "revolute", first, second, points[name], axis=(0, 0, 1))
    model.add_body("mass", 0.5, (0, 0, 0), (0.15, 0.4, 0))
    model.add_joint("slide", "prismatic", "coupler", "mass", (0.15, 0.4, 0), axis=(0, 1, 0))
    model.add_bushing("soft", "coupler", "mass", (0.15, 0.4, 0), stiffness=(0, 800.0, 0, 0, 0, 0))
    model.add_output("rocker", "rocker", "rz")
    return model


@pytest.mark.parametrize("joint", ["a", "b", "c", "d"])
def test_loops_are_cut_so_that_the_driven_joint_is_in_the_tree(joint):
    """w_d / w_a = (b x n) / (d x n) by the coupler's direction n; others from the rates of the loop by hand."""
    points = np.array([(0, 0), (0, 0.1), (0.3, 0.25), (0.3, 0)])
    # relative rates r of a, b, c and -d close the loop: sum r = 0, sum r p = 0
    equations = np.vstack((np.ones(4), points.T)) * np.array([1, 1, 1, -1])
    rates = np.linalg.svd(equations)[2][-1]
    model = four_bar()
    model.add_motion_input("drive", joint)
    system = model.linearize()
    assert joint not in system.cut_joints
    assert system.coordinates == ("slide.z",)
    expected = rates[3] / rates["abcd".index(joint)]
    np.testing.assert_allclose(system.frequency_response([1.0])[0, 0, 0], expected, rtol=1e-12)


def test_mechanisms_without_other_freedom_are_kinematics():
    model = four_bar()
    joints, bodies = dict(model.joints), dict(model.bodies)
    del joints["slide"], bodies["mass"]
    model = model.with_parts(joints=joints, bodies=bodies, springs={})
    model.add_motion_input("drive", "a", "velocity")
    model.add_force_output("torque", "a", "rz")
    system = model.linearize()
    assert system.dof == 0
    space = system["rocker", :].state_space()
    assert space.states == ("drive.displacement",)
    free = model.with_parts(inputs={}).linearize(independent=["a.rz"])
    np.testing.assert_allclose(system.frequency_response(OMEGA)[1, 0], -1j * OMEGA * free.M[0, 0], rtol=1e-12)


@pytest.mark.slow
def test_variants_plants_and_slopes_take_drives_along():
    model = arm(quantity="acceleration")
    system = model.linearize()
    values = {"fore.mass": np.array([0.5, 1.0, 1.7]), "elbow.position.x": np.array([0.5, 0.6, 0.65])}
    batch, plant = model.linearize(values=values), model.compile(list(values))
    for i in range(3):
        variant = model.with_values({name: float(array[i]) for name, array in values.items()}).linearize()
        np.testing.assert_allclose(batch[i].frequency_response(OMEGA), variant.frequency_response(OMEGA), rtol=1e-11)
        matrices = plant([array[i] for array in values.values()])
        np.testing.assert_allclose(matrices.B, variant.ends.B, rtol=1e-12)
        np.testing.assert_allclose(matrices.D, variant.ends.D, rtol=1e-12, atol=1e-13)
    names, h = ["fore.mass", "elbow.position.x", "tip.damping", "shoulder.orientation.rx"], 1e-5
    eigenvalues = system.eigenvalue_sensitivities(names)
    responses = system.frequency_response_sensitivities(OMEGA, names)
    for k, name in enumerate(names):
        value = model.parameters[name]
        above, below = (model.with_values({name: value + step}).linearize() for step in (h, -h))
        np.testing.assert_allclose(eigenvalues[k], (above.poles() - below.poles()) / (2 * h), rtol=1e-6, atol=1e-7)
        slope = (above.frequency_response(OMEGA) - below.frequency_response(OMEGA)) / (2 * h)
        np.testing.assert_allclose(responses[k], slope, rtol=1e-6, atol=1e-6)


def test_files_and_copies_keep_drives(tmp_path):
    model = arm(quantity="velocity")
    save(model, tmp_path / "arm.yaml")
    same = load(tmp_path / "arm.yaml")
    assert same.inputs == model.inputs
    both = mv.Model("pair")
    both.add_body("table", 5.0, (1, 1, 1), (0, 0, -1))
    both.add_joint("leg", "prismatic", "ground", "table", (0, 0, 0), axis=(0, 0, 1))
    both.add_model("left", model.with_parts(outputs={"velocity": model.outputs["velocity"]}), ground="table")
    both.add_model("right", model.with_parts(outputs={"velocity": model.outputs["velocity"]}), mirror="y",
                   position=(0, -3, 0))
    system = both.linearize()
    assert system.inputs == ("left.drive", "left.F", "right.drive", "right.F")
    # mirrored, a turn changes its sign
    alone = model.linearize().frequency_response(OMEGA, "velocity", "drive")
    np.testing.assert_allclose(system.frequency_response(OMEGA, "right.velocity", "right.drive"), -alone, rtol=1e-10)


def test_what_cannot_be_driven_is_refused_by_name():
    model = arm()
    with pytest.raises(ModelError, match=r"'drive' does not drive"):
        model.add_motion_input("again", "shoulder.rz")
    with pytest.raises(ModelError, match=r"coordinate of joint 'elbow': 'elbow.rz'"):
        model.add_motion_input("again", "elbow.x")
    with pytest.raises(ModelError, match=r"'elbo' is no element of this model; expected a joint"):
        model.add_motion_input("again", "elbo")
    model.add_body("ball", 1.0, INERTIA, (0, 0, 1))
    model.add_joint("ball joint", "spherical", "ground", "ball", (0, 0, 0.5))
    with pytest.raises(ModelError, match=r"'ball joint.rx', 'ball joint.ry', 'ball joint.rz'"):
        model.add_motion_input("again", "ball joint")
    assert model.add_motion_input("yaw", "ball joint", direction="rz").element == "ball joint.rz"
    model = arm()
    with pytest.raises(ModelError, match=r"method='sparse'.*'shoulder.rz'"):
        model.linearize(method="sparse")
    with pytest.raises(ModelError, match=r"motion input 'drive': a driven joint has no statement in finite motion"):
        model.simulate([0.0, 0.1])
    with pytest.raises(ModelError, match=r"'drive': coordinate 'shoulder.rz'.*is not in model"):
        model.with_parts(joints={"elbow": model.joints["elbow"]}, outputs={}).linearize()
    pendulum = mv.Model("pendulum")
    pendulum.add_body("bob", 1.0, INERTIA, (0, 0, -1.0))
    pendulum.add_joint("hinge", "revolute", "ground", "bob", (0, 0, 0), axis=(0, 1, 0))
    pendulum.add_motion_input("drive", "hinge")
    with pytest.raises(mv.ExportError, match=r"drive: coordinate 'hinge.rz' is driven"):
        to_exudyn(pendulum)
    loop = four_bar()
    for name in "abcd":
        loop.add_motion_input(name, name)
    with pytest.raises(ModelError, match=r"all joints of the loop .* are driven"):
        loop.linearize()


def test_a_driven_direction_of_a_ball_joint_is_held_in_statics():
    """A pendulum on a ball joint whose turn about x is driven swings about y only."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 1.0, (0.1, 0.1, 0.1), (0, 0, -1.0))
    model.add_joint("ball", "spherical", "ground", "bob", (0, 0, 0))
    model.add_motion_input("tilt", "ball.rx")
    model.add_load("wind", "bob", force=(2.0, 0, 0))
    there = model.equilibrium()
    assert there.bodies["bob"].position[0] == pytest.approx(2.0 / np.hypot(2.0, 9.81))
    assert set(there.linearize().coordinates) == {"ball.ry", "ball.rz"}


@pytest.mark.slow
def test_certificates_know_models_with_motion_inputs():
    assert mv.certify(arm()).verdict == "passed"
