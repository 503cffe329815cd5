"""Cycles of running machines against numbers and equations from elsewhere."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from mbsvib import library
from tests.support.sizes import few

ANGLES = 2 * np.pi * np.arange(72) / 72
TURN = 2 * np.pi


def running(model, drive="crank.rz", angles=ANGLES, speed=TURN, **others):
    return model.cycle(drive, angles, speed=speed, **others)


# rms of force, of moment about the crank's pivot and of torque, torques at 0, 90, 180, 270 degrees; 8 digits
MACHINES = {
    "Hoeken": (library.hoeken(), (4.0971675, 0.50430739, 0.30703909),
               (-0.50365614, 0.07402203, -0.06853892, 0.01480441)),
    "balanced": (library.hoeken(balance_radius=0.08), (0.0, 0.78971554, 0.44318766), None),
    "scraper": (library.carpet_scraper(), (116.8486, 40.30271, 57.707404), (-186.08200, 1.94988, 1.01873, -4.77800)),
}  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("case", MACHINES)
def test_shaking_and_torque(case):
    model, rms, torques = MACHINES[case]
    cycle = running(model)
    for quantity, value in zip(("force", "moment", "torque"), rms, strict=True):
        digits = len(str(value).replace("0.", "").replace(".", ""))
        assert cycle.rms(quantity) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits), abs=1e-12)
    if torques is not None:
        assert_allclose(cycle.torque[::18], torques, rtol=0, atol=0.51e-5 if case == "scraper" else 0.51e-8)


@pytest.mark.slow
def test_trajectory_of_a_puma():
    """q(t) = q0 + (pi/3)/10 (t - 10/(2 pi) sin(2 pi t/10)) in all joints, as cosines of 10 s."""
    t, rate = np.array([0.0, 2.5, 4.0]), np.pi / 3 / 10
    q = rate * (t - 10 / TURN * np.sin(TURN * t / 10))
    three = (q, rate * (1 - np.cos(TURN * t / 10)), rate * TURN / 10 * np.sin(TURN * t / 10))
    cycle = library.puma(gravity=(0, 0, -9.81)).cycle(motion={f"joint{i}.rz": three for i in range(1, 7)})
    expected = [0.175246642, 26.653983397, -4.636047183, -0.005167871, 0.007492049, 0.000005301]
    assert_allclose([cycle.torque[f"joint{i}.rz"][1] for i in range(1, 7)], expected, rtol=0, atol=0.51e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("model", "drives"),
    [(library.puma(), [f"joint{i}.rz" for i in range(1, 7)]),
     (library.stanford(), ["joint1.rz", "joint2.rz", "joint3.z", "joint4.rz", "joint5.rz", "joint6.rz"]),
     (library.gripper(), [f"joint{i}.rz" for i in range(1, 5)]), (library.hoeken(angle=0.4), ["rocker.rz"]),
     (library.carpet_scraper(angle=0.5), ["pin67.rz"]), (library.toggle(), ["rail.z"]),
     (library.toggle(), ["elbow.rz"]), (library.seven_r(), ["ball12.2.rz"]),
     (library.rssr(rocker_ball="universal"), ["ball23.ry"])],
    ids=lambda value: value.name if isinstance(value, mv.Model) else value[0],
)  # fmt: skip
def test_torque_from_rest_is_mass_times_acceleration(model, drives):
    """M of linearize, in another pose too, is what the drives feel as they start."""
    pose = {name: 0.05 * (i + 1) * (0.1 if name.endswith(".z") else 1.0) for i, name in enumerate(drives)}
    held = model.with_parts(springs={})
    exact = held.moved(pose).linearize(independent=drives)
    order = [exact.coordinates.index(name) for name in drives]
    mass = exact.M[np.ix_(order, order)]
    for i in range(len(drives)):
        motion = {name: (pose[name], 0.0, float(k == i)) for k, name in enumerate(drives)}
        cycle = held.cycle(motion=motion)
        assert_allclose([cycle.torques[name][0] for name in drives], mass[:, i], rtol=0, atol=1e-11 * abs(mass).max())


def test_a_pendulum_with_everything():
    """tau = (I + m l^2) q'' + m g l sin(q) + k q + c q' - M, M the moment of a load on it."""
    m, length, inertia, k, c, load = 1.3, 0.4, 0.02, 7.0, 0.3, 0.5
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", m, (inertia, inertia, 0.01), (0, 0, -length))
    model.add_joint("pin", "revolute", "ground", "bob", (0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("k", "ground", "bob", axis=(0, 1, 0), stiffness=k, damping=c)
    model.add_load("load", "bob", torque=(0, load, 0))
    q, qd, qdd = np.linspace(-2, 2, 9), np.linspace(0, 3, 9), np.linspace(5, -5, 9)
    cycle = model.cycle(motion={"pin.rz": (q, qd, qdd)})
    expected = (inertia + m * length**2) * qdd + m * 9.81 * length * np.sin(q) + k * q + c * qd - load
    assert_allclose(cycle.torque, expected, rtol=1e-13)
    # the pin carries the weight and what turns the bob about it
    at = np.column_stack([-length * np.sin(q), 0 * q, -length * np.cos(q)])
    acceleration = -(qd**2)[:, None] * at + qdd[:, None] * np.cross([0, 1, 0], at)
    assert_allclose(cycle.reactions["pin"][:, :3], m * (acceleration + np.array([0, 0, 9.81])), atol=1e-12)
    assert_allclose(cycle.reactions["pin"][:, 3:], 0, atol=1e-12)
    assert_allclose(cycle.shaking_force, -m * acceleration, atol=1e-12)
    assert_allclose(cycle.positions["bob"], at, atol=1e-15)
    assert cycle.peak("torque") == pytest.approx(abs(expected).max())
    assert not cycle.undetermined


@pytest.mark.slow
def test_geared_drive():
    """A wheel of inertia J on the crank's gear counts by the square of the ratio, and its tooth force turns it."""
    model = library.hoeken()
    model.add_body("wheel", 0.0, (1e-3, 1e-3, 2e-3), (0, 0.3, 0))
    model.add_joint("axle", "revolute", "ground", "wheel", (0, 0.3, 0), axis=(0, 0, 1))
    model.add_gear("mesh", "crank", "axle", 3.0)
    motion = {"crank.rz": (0.3, 2.0, 5.0)}
    with_wheel, without = model.cycle(motion=motion), library.hoeken().cycle(motion=motion)
    turned = 3.0
    assert_allclose(with_wheel.rates["axle.rz"], turned * 2.0, rtol=1e-13)
    assert_allclose(with_wheel.torque - without.torque, 2e-3 * turned**2 * 5.0, rtol=1e-11)
    by_wheel = model.cycle(motion={"axle.rz": (0.3 * turned, 2.0 * turned, 5.0 * turned)})
    assert_allclose(by_wheel.torque * turned, with_wheel.torque, rtol=1e-10)
    for name in ("pin12", "pin23", "rocker"):
        assert_allclose(by_wheel.reactions[name], without.reactions[name], atol=1e-11)


def test_a_wheel_geared_to_the_joint_at_which_its_loop_is_cut_else():
    """The drive feels the power of the wheel, J r^2 theta' theta''."""
    model = library.hoeken()
    model.add_body("wheel", 0.0, (1e-3, 1e-3, 2e-3), (0, 0.3, 0))
    model.add_joint("axle", "revolute", "ground", "wheel", (0, 0.3, 0), axis=(0, 0, 1))
    model.add_gear("mesh", "pin23", "axle", 3.0)
    t = np.array([-1e-4, 0.0, 1e-4])
    motion = {"crank.rz": (0.3 + 2.0 * t + 2.5 * t**2, 2.0 + 5.0 * t, 5.0 + 0.0 * t)}
    cycle = model.cycle(motion=motion)
    rate = cycle.rates["pin23.rz"]
    assert_allclose(cycle.rates["axle.rz"], 3.0 * rate, rtol=1e-11)
    power = 2e-3 * 9.0 * rate[1] * (rate[2] - rate[0]) / 2e-4
    without = library.hoeken().cycle(motion=motion).torque[1]
    assert 2.0 * (cycle.torque[1] - without) == pytest.approx(power, rel=1e-6)


def closed_form(crank, coupler, rocker, ground, angle):
    """Centres and directions of the three bars, as functions of the crank's angle, of a four-bar linkage."""
    a = lambda q: mp.matrix([crank * mp.cos(q), crank * mp.sin(q)])  # noqa: E731
    d = mp.matrix([ground, 0])

    def b(q):
        gap = d - a(q)
        distance = mp.norm(gap)
        along = (distance**2 + mp.mpf(coupler) ** 2 - mp.mpf(rocker) ** 2) / (2 * distance)
        across = mp.sqrt(mp.mpf(coupler) ** 2 - along**2)
        unit = gap / distance
        return a(q) + along * unit + across * mp.matrix([-unit[1], unit[0]])

    bars = [(lambda q: mp.zeros(2, 1), a), (a, b), (lambda q: d, b)]
    def pose(start, end, k):
        if k < 2:
            return lambda q: (start(q)[k] + end(q)[k]) / 2
        return lambda q: mp.atan2(end(q)[1] - start(q)[1], end(q)[0] - start(q)[0])

    values = [[mp.diff(pose(*ends, k), angle, order) for order in (0, 2)] for ends in bars for k in range(3)]
    return values, [a(angle), b(angle)]


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.3, 2.0, 4.4])
def test_pins_of_a_linkage_against_the_matrix_method(angle):
    """Nine equations of Newton and Euler for four pins and the torque, in closed-form accelerations."""
    with mp.workdps(30):
        values, pins = closed_form(0.1, 0.25, 0.25, 0.2, mp.mpf(angle))
        state = np.array([[float(v) for v in each] for each in values]).reshape(3, 3, 2)
        a, b = (np.array([float(v) for v in pin]) for pin in pins)
    at, acceleration = state[:, :2, 0], state[:, :, 1] * TURN**2
    matrix, right = np.zeros((9, 9)), np.zeros(9)
    lengths = [0.1, 0.25, 0.25]
    for i, length in enumerate(lengths):
        right[3 * i : 3 * i + 3] = 2 * length * np.array([*acceleration[i, :2], length**2 / 12 * acceleration[i, 2]])
    for k, (point, first, second) in enumerate([((0, 0), -1, 0), (a, 0, 1), (b, 1, 2), ((0.2, 0), -1, 2)]):
        for body, sign in ((second, 1.0), (first, -1.0)):
            if body >= 0:
                x, y = np.array(point) - at[body]
                matrix[3 * body : 3 * body + 3, 2 * k : 2 * k + 2] += sign * np.array([[1, 0], [0, 1], [-y, x]])
    matrix[2, 8] = 1.0
    solution = np.linalg.solve(matrix, right)
    cycle = running(library.hoeken(), angles=[angle])
    assert_allclose(cycle.torque, solution[8], rtol=1e-11)
    for k, name in enumerate(("crank", "pin12", "pin23", "rocker")):
        assert_allclose(cycle.reactions[name][0, :2], solution[2 * k : 2 * k + 2], atol=1e-11 * abs(solution).max())
        assert_allclose(cycle.reactions[name][0, 2:], 0, atol=1e-12)
    assert cycle.undetermined == dict.fromkeys(("crank", "pin12", "pin23", "rocker"), ("z", "rx", "ry"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "angles"),
    [(library.hoeken(), ANGLES), (library.hoeken(balance_radius=0.08), ANGLES), (library.carpet_scraper(), ANGLES),
     (library.seven_r(drive_stiffness=0.0), np.linspace(-0.6, 0.3, 12)),
     (library.rssr(rocker_ball="universal", drive_stiffness=0.0), np.linspace(-0.6, 0.3, 12))],
    ids=lambda value: value.name if isinstance(value, mv.Model) else "",
)  # fmt: skip
def test_the_ground_feels_the_shaking_force_and_moment(model, angles):
    """Reactions of the joints on the ground, and the drive's torque, against the rates of momentum."""
    cycle = running(model, angles=angles, about=(0.05, -0.2, 0.1))
    force, moment = np.zeros((len(angles), 3)), np.zeros((len(angles), 3))
    for joint in model.joints.values():
        if joint.first == "ground":
            wrench = -cycle.reactions[joint.name]
            force += wrench[:, :3]
            moment += wrench[:, 3:] + np.cross(np.subtract(joint.position, (0.05, -0.2, 0.1)), wrench[:, :3])
    moment[:, 2] -= cycle.torque
    assert_allclose(force, cycle.shaking_force, atol=1e-11 * max(abs(wrench[:, :3]).max(), abs(force).max()))
    assert_allclose(moment, cycle.shaking_moment, atol=1e-11 * abs(moment).max())
    assert bool(cycle.undetermined) is ("link7" in model.bodies or "pin12" in model.joints)


def test_velocities_are_those_of_the_positions():
    model = library.seven_r()
    fine = np.array([-1e-3, 0.0, 1e-3]) + 0.1
    cycle = running(model, angles=fine)
    for name in model.bodies:
        moved = (cycle.positions[name][2] - cycle.positions[name][0]) / 2e-3 * TURN
        assert_allclose(cycle.velocities[name][1, :3], moved, atol=1e-4 * abs(moved).max() + 1e-12)
        bent = (cycle.velocities[name][2] - cycle.velocities[name][0]) / 2e-3 * TURN
        assert_allclose(cycle.body_accelerations[name][1], bent, atol=1e-4 * abs(bent).max() + 1e-12)
    there = model.moved({"crank.rz": fine[1]})
    for name, body in there.bodies.items():
        assert_allclose(cycle.positions[name][1], body.position, atol=1e-13)
        assert_allclose(cycle.orientations[name][1], body.orientation, atol=1e-12)


def test_rotor_on_a_turning_arm():
    """Its angular momentum h turns with the arm: the ground feels -w x h."""
    model = mv.Model("gyro")
    model.add_body("arm", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("pin", "revolute", "ground", "arm", (0, 0, 0), axis=(0, 0, 1))
    model.add_rotor("wheel", "arm", speed=100.0, axis=(1, 0, 0), inertia=0.02)
    cycle = model.cycle("pin.rz", [0.0, np.pi / 2], speed=3.0)
    assert_allclose(cycle.shaking_moment, [[0, -6, 0], [6, 0, 0]], atol=1e-12)
    assert_allclose(-cycle.reactions["pin"][:, 3:], [[0, -6, 0], [6, 0, 0]], atol=1e-12)
    assert_allclose(cycle.torque, 0, atol=1e-13)


def rebuilt(model, turned=False, offset=(0.0, 0.0, 0.0)):
    """The same machine elsewhere, or with the bodies of every joint exchanged."""
    result = mv.Model("rebuilt")
    for body in model.bodies.values():
        result.add_body(body.name, body.mass, body.inertia, np.add(body.position, offset), body.orientation)
    for joint in model.joints.values():
        first, second = (joint.second, joint.first) if turned else (joint.first, joint.second)
        result.add_joint(joint.name, joint.kind, first, second, np.add(joint.position, offset), axis=joint.axis)
    return result


@pytest.mark.slow
def test_joints_the_other_way_round():
    model, angles = library.carpet_scraper(), ANGLES[::4]
    one = running(model, angles=angles)
    other = running(rebuilt(model, turned=True), angles=-angles, speed=-TURN)
    assert_allclose(other.torque, -one.torque, rtol=0, atol=1e-11 * one.peak("torque"))
    assert_allclose(other.shaking_moment, one.shaking_moment, rtol=0, atol=1e-11 * one.peak("moment"))
    for name, wrench in one.reactions.items():
        assert_allclose(other.reactions[name], -wrench, rtol=0, atol=1e-11 * abs(wrench).max())
    assert other.undetermined == one.undetermined


@pytest.mark.slow
@pytest.mark.parametrize("far", few([1e5, 1e2], 1))
def test_far_from_the_origin(far):
    """Points are rounded relative to the origin, and results as much: loops of a third of a metre still close."""
    model, angles = library.carpet_scraper(), ANGLES[::8]
    one, other = (running(each, angles=angles) for each in (model, rebuilt(model, offset=(far, -far, 0.0))))
    assert_allclose(other.torque, one.torque, rtol=0, atol=1e-13 * far * one.peak("torque"))
    assert_allclose(other.shaking_moment, one.shaking_moment, rtol=0, atol=1e-13 * far * one.peak("moment"))
    assert other.undetermined == one.undetermined


KINDS = [("screw", {"pitch": 0.02}), ("cylindrical", {}), ("prismatic", {}), ("revolute", {}), ("planar", {}),
         ("universal", {}), (None, {"free": ("x", "z", "ry")}), (None, {"free": ("y", "rx", "rz")})]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_what_joints_of_all_kinds_carry(seed):
    """Along a chain, a joint and its drives carry the inertia of all that is beyond; the joint alone does no work."""
    rng = np.random.default_rng(seed)
    model, before, chain = mv.Model("chain"), "ground", []
    for i in rng.permutation(len(KINDS))[:5]:
        kind, words = KINDS[i]
        name, at = f"b{i}", rng.uniform(-1, 1, 3)
        sizes = rng.uniform(0.1, 0.3, 3) ** 2
        model.add_body(name, rng.uniform(0.5, 2), sizes.sum() - sizes, at, rng.uniform(-1, 1, 3))
        model.add_joint(f"j{i}", kind, before, name, at + rng.uniform(-0.5, 0.5, 3),
                        orientation=rng.uniform(-1, 1, 3), **words)  # fmt: skip
        chain.append((model.joints[f"j{i}"], before, name))
        before = name
    names = [f"{joint.name}.{direction}" for joint, _, _ in chain for direction, _ in joint.freedom]
    motion = {name: rng.uniform(-0.7, 0.7, (3, 2)) for name in names}
    cycle = model.cycle(motion=motion, about=(0, 0, 0))
    for k, (joint, first, second) in enumerate(chain):
        body, turned = model.bodies[second], cycle.orientations[second]
        arm = np.array(body.orientation).T @ np.subtract(joint.point or body.position, body.position)
        point = cycle.positions[second] + turned @ arm
        total = np.zeros((2, 6))
        for _, _, beyond in chain[k:]:
            part, axes = model.bodies[beyond], cycle.orientations[beyond]
            spin, bend = cycle.velocities[beyond][:, 3:], cycle.body_accelerations[beyond][:, 3:]
            tensor = axes @ np.diag(part.inertia[:3]) @ axes.transpose(0, 2, 1)
            force = part.mass * cycle.body_accelerations[beyond][:, :3]
            moment = np.einsum("sij,sj->si", tensor, bend) + np.cross(spin, np.einsum("sij,sj->si", tensor, spin))
            total += np.hstack([force, moment + np.cross(cycle.positions[beyond] - point, force)])
        twist = np.zeros((2, 6))
        for end, sign in ((first, -1.0), (second, 1.0)):
            if end != "ground":
                velocity = cycle.velocities[end]
                at_point = velocity[:, :3] + np.cross(velocity[:, 3:], point - cycle.positions[end])
                twist += sign * np.hstack([at_point, velocity[:, 3:]])
        carried = cycle.reactions[joint.name]
        drives = [name for name in names if name.startswith(f"{joint.name}.")]
        power = sum(cycle.torques[name] * motion[name][1] for name in drives)
        scale = np.abs(total).max()
        assert_allclose((carried * twist).sum(axis=1), 0, atol=1e-11 * scale)
        assert_allclose((total * twist).sum(axis=1), power, atol=1e-11 * scale)
        left = total - carried  # what the drives do: moments of those that turn, forces of those that slide
        if all(name.rpartition(".")[2].startswith("r") for name in drives):
            assert_allclose(left[:, :3], 0, atol=1e-11 * scale)
        elif not any(name.rpartition(".")[2].startswith("r") for name in drives):
            assert_allclose(left[:, 3:], 0, atol=1e-11 * scale)
    assert not cycle.undetermined


@pytest.mark.slow
def test_a_cycle_as_a_file(tmp_path):
    cycle = library.hoeken().cycle("crank.rz", ANGLES, speed=TURN)
    lines = cycle.to_csv(tmp_path / "cycle.csv").read_text(encoding="utf-8").splitlines()
    names, numbers = lines[0].split(","), np.array([line.split(",") for line in lines[1:]], dtype=float)
    columns = dict(zip(names, numbers.T, strict=True))
    assert names[0] == "crank.rz"
    for name, values in (("crank.rz", cycle.angles), ("rocker.rz.rate", cycle.rates["rocker.rz"]),
                         ("crank.rz.torque", cycle.torque), ("shaking_moment.z", cycle.shaking_moment[:, 2]),
                         ("pin12.reaction.y", cycle.reactions["pin12"][:, 1])):  # fmt: skip
        assert_array_equal(columns[name], values)
    with pytest.raises(mv.errors.ExportError, match=r"cannot be written: .*Give the path of a file"):
        cycle.to_csv(tmp_path / "no folder" / "cycle.csv")


def test_a_joint_without_a_point_has_its_moment_at_the_centre_of_mass():
    """A slide that carries the weight beside it: its moment does not depend on where the origin is."""
    for offset in ((0.0, 0.0, 0.0), (3.0, -2.0, 1.0)):
        model = mv.Model("slide", gravity=(0.0, 0.0, -9.81))
        model.add_body("body", 2.0, (0.1, 0.1, 0.1), np.add(offset, (0.3, 0.0, 0.0)))
        model.add_joint("slide", "prismatic", "ground", "body", axis=(1, 0, 0))
        cycle = model.cycle(motion={"slide.z": ([0.0, 0.1], 0.0, 5.0)})
        assert_allclose(cycle.reactions["slide"], [[0.0, 0.0, 2.0 * 9.81, 0.0, 0.0, 0.0]] * 2, atol=1e-12)
        assert_allclose(cycle.torque, 10.0, rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1.0, 1e6])
@pytest.mark.parametrize("gear", [False, True])
def test_redundant_joints_and_gears_at_rest_share_forces_as_in_linear_models(gear, unit):
    """A parallelogram off its plane, whose rockers a gear couples once more; lengths in metres and in micrometres.

    The least norm is that of ``linearize().reactions``, over joints with what the gear transmits in them.
    """
    model = mv.Model("parallelogram", gravity=(0, -9.81 * unit, 4.0 * unit))
    for name, mass, position in (("a", 2.0, (0.05, 0.1, 0)), ("b", 3.0, (0.3, 0.2, 0.07)), ("c", 1.0, (0.55, 0.1, 0))):
        model.add_body(name, mass, unit**2 * np.array([0.01, 0.02, 0.025]), unit * np.array(position))
    joints = {"A": ("ground", "a", (0, 0)), "B": ("a", "b", (0.1, 0.2)), "C": ("b", "c", (0.6, 0.2)),
              "D": ("ground", "c", (0.5, 0))}  # fmt: skip
    for name, (first, second, (x, y)) in joints.items():
        model.add_joint(name, "revolute", first, second, (unit * x, unit * y, 0), axis=(0, 0, 1))
    model.add_torsion_spring("coil", "ground", "a", (0, 0, 1), 50.0 * unit**2)
    if gear:
        model.add_gear("mesh", "A", "D", 1.0)
    pose = model.moved({"A.rz": 0.3}).equilibrium(preload="coil")
    for other, angle in ((pose, 0.0), (model.with_parts(springs=pose.moved({"A.rz": -0.3}).springs), 0.3)):
        cycle = other.cycle("A.rz", [angle], speed=0.0)
        assert abs(cycle.torque[0]) < 1e-12 * unit**2
        for name, wrench in pose.linearize().reactions.items():
            expected = np.concatenate((wrench[:5], [0.0]))  # what drives and gears transmit is taken out
            assert_allclose(cycle.reactions[name][0] / unit ** np.repeat((1, 2), 3),
                            expected / unit ** np.repeat((1, 2), 3), rtol=0, atol=1e-10)  # fmt: skip
        assert ("x" in cycle.undetermined["A"]) is gear


def test_two_doors_on_one_carrier_share_as_each_would_alone():
    """Hinges at distances d on both sides of their middle carry F / 2 +- M x a / (4 d) and M / 4 each.

    F and M are the force and the moment across the axis a, about their middle, that hold the door: L = d of its loop.
    """
    model = mv.Model("doors", gravity=(0, 0, -9.81))
    model.add_body("carrier", 1.0, (0.1, 0.1, 0.1), (0.1, 0, 0))
    model.add_joint("turn", "revolute", "ground", "carrier", (0.3, 0.2, 0.1), axis=(1, 2, 0.7))
    doors = {"a": (2.0, 0.2, 0.0), "b": (5.0, 0.9, 1.3)}
    for name, (mass, d, y) in doors.items():
        model.add_body(name, mass, (0.1, 0.1, 0.1), (0.4, y, 0))
        for side, z in (("low", -d), ("high", d)):
            model.add_joint(f"{name}.{side}", "revolute", "carrier", name, (0, y, z), axis=(0, 0, 1))
    drives = {"turn.rz": (0.8, 0, 0), "a.low.rz": (0, 0, 0), "b.low.rz": (0, 0, 0)}
    cycle = model.cycle(motion=drives)
    axis = cycle.orientations["carrier"][0] @ [0.0, 0.0, 1.0]
    for name, (mass, d, _) in doors.items():
        force = np.array((0, 0, 9.81 * mass))
        moment = np.cross(cycle.orientations["carrier"][0] @ [0.4, 0, 0], force)
        moment -= axis * (axis @ moment)
        for side, sign in (("low", -1.0), ("high", 1.0)):
            expected = [*(0.5 * force + sign * np.cross(moment, axis) / (4 * d)), *(0.25 * moment)]
            assert_allclose(cycle.reactions[f"{name}.{side}"][0], expected, rtol=0, atol=1e-11)
