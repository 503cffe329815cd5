"""Forces that redundant constraints leave open: of least norm, whatever the frame, the order, the names and the cut."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.self_stress import of_loops
from tests.couplers.test_couplers import PARALLEL, four_bar, shafts
from tests.loads.test_joint_forces import with_all_joint_forces
from tests.support import overconstrained
from tests.support.least_norm import at_rest, joint_wrenches
from tests.support.loaded_models import held
from tests.support.random_models import planar, rotation
from tests.support.restated import restated

pytestmark = pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
MASS, WIDTH, HEIGHT, G = 10.0, 0.8, 1.6, 9.81
# of single loops, as two tell more than one at a tenth of the time
SOME = ("bennett", "cardan", "wedge", "differential screw")


def door(names=("low", "high"), hinge="revolute"):
    """A door of 0.8 m, its centre in the middle between two hinges 1.6 m apart."""
    model = mv.Model("door", gravity=(0, 0, -G))
    model.add_body("leaf", MASS, (0.5, 0.9, 0.4), (WIDTH / 2, 0, 1.0))
    for name, z in zip(names, (1.0 - HEIGHT / 2, 1.0 + HEIGHT / 2), strict=True):
        model.add_joint(name, hinge, "ground", "leaf", (0, 0, z), axis=(0, 0, 1))
    model.add_bushing("closer", "ground", "leaf", (0, 0, 1.0), (0, 0, 0, 0, 0, 10.0))
    return model


def redundant(name):
    return held(overconstrained.ALL[name]()[0])


def reactions(model, **words):
    return model.linearize(**words).reactions


@pytest.mark.parametrize("by", [np.eye(3), np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]]])
@pytest.mark.parametrize("names", [("low", "high"), ("high", "low")])
def test_each_hinge_of_a_door_carries_half(by, names):
    """Half of the weight; of the couple M = m g b / 2 forces M / 2h and moments M / 4 each, as L = h / 2."""
    result = reactions(restated(door(names), by, (3.0, -2.0, 5.0)))
    couple = MASS * G * WIDTH / 2
    for name, sign in zip(names, (1.0, -1.0), strict=True):
        force, moment = (sign * couple / (2 * HEIGHT), 0, MASS * G / 2), (0, -couple / 4, 0)
        assert result[name] == pytest.approx([*(by @ force), *(by @ moment)], rel=1e-13, abs=1e-13)


def test_ball_joints_carry_no_moment():
    """Two balls hold a door as hinges without moments would; only what acts along their line is left open."""
    result = reactions(door(hinge="spherical"))
    couple = MASS * G * WIDTH / 2
    for name, sign in (("low", 1.0), ("high", -1.0)):
        assert result[name] == pytest.approx([sign * couple / HEIGHT, 0, MASS * G / 2, 0, 0, 0], rel=1e-13, abs=1e-13)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", overconstrained.ALL)
def test_at_rest_against_absolute_coordinates(name):
    model = redundant(name)
    expected = joint_wrenches(model, at_rest(model))
    result = list(reactions(model).values())
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", overconstrained.ALL)
def test_in_motion_against_absolute_coordinates(name):
    """A push that nothing but inertia resists."""
    model = with_all_joint_forces(overconstrained.ALL[name]()[0])
    model = model.with_parts(springs={})
    push = np.array((1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    model.add_input("push", list(model.bodies)[-1], push)
    system = model.linearize()
    acceleration = np.linalg.solve(system.M, system.B[:, 0])
    applied = np.zeros((len(system.bodies), 6))
    for k, body in enumerate(model.bodies.values()):
        moved = system.body_motion[k] @ acceleration
        applied[k] = -np.array([*(body.mass * moved[:3]), *(np.array(body.inertia[:3]) * moved[3:])])
    applied[-1] += push
    expected = joint_wrenches(model, applied)
    inside = [-part @ np.array(joint.axes) for joint, wrench in zip(model.joints.values(), expected, strict=True)
              for part in (wrench[:3], wrench[3:])]  # fmt: skip
    result = system.Ca @ acceleration + system.D[:, 0]
    np.testing.assert_allclose(result, np.ravel(inside), rtol=0, atol=1e-9 * np.abs(expected).max())


def test_what_couplers_transmit_counts():
    """A gear that a parallelogram implies, whose moments go through the pins."""
    model = four_bar(PARALLEL)
    model.add_gear("equal", "j0", "j3", -1.0)
    model = held(model)
    expected = joint_wrenches(model, at_rest(model))
    assert np.abs(expected[0, 5]) > 1e-3 * np.abs(expected).max()
    for cut in (None, ["j0"], ["j1"], ["j3"]):
        result = np.array(list(reactions(model, cut=cut).values()))
        np.testing.assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def backwards(name):
    return name[::-1]


def assert_same_forces(model, other, by):
    """Reactions, frequencies and responses of all force outputs of two models, the other one turned and renamed."""
    one, two = model.linearize(), other.linearize()
    size = max(np.abs(wrench).max() for wrench in one.reactions.values())
    for name, wrench in one.reactions.items():
        result = two.reactions[backwards(name)].reshape(2, 3) @ by
        np.testing.assert_allclose(result.reshape(-1), wrench, rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(two.modes().frequencies, one.modes().frequencies, rtol=1e-9)
    omega = 0.7 * one.modes().natural[:1] + 1.0
    before, after = (dict(zip(system.outputs, system.frequency_response(omega)[:, 0, 0], strict=True))
                     for system in (one, two))  # fmt: skip
    size = max(map(abs, before.values()))
    assert max(abs(after[name] - value) for name, value in before.items()) < 1e-9 * size


@pytest.mark.few(2)
@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize("seed", range(2))
def test_frame_order_and_names_make_no_difference(name, seed):
    model = with_all_joint_forces(redundant(name))
    model.add_input("push", list(model.bodies)[-1], (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    by = rotation(np.random.default_rng(seed))
    assert_same_forces(model, restated(model, by, (5.0, -3.0, 8.0), seed, backwards), by)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", SOME)
def test_the_cut_makes_no_difference(name):
    """Nor do the coordinates that are then independent."""
    model = with_all_joint_forces(redundant(name))
    model.add_input("push", list(model.bodies)[-1], (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    first = model.linearize()
    expected, size = first.frequency_response([3.0, 500.0]), max(map(np.linalg.norm, first.reactions.values()))
    for joint in model.joints:
        system = model.linearize(cut=[joint])
        for name, wrench in system.reactions.items():
            np.testing.assert_allclose(wrench, first.reactions[name], rtol=0, atol=1e-9 * size)
        result = system.frequency_response([3.0, 500.0])
        assert np.abs(result - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_loops_with_a_weld_in_common_share_their_forces(method):
    """Two gates between the ground and one welded post: no coordinate is common to the loops, the weld's wrench is."""
    model = mv.Model("gates", gravity=(0, 0, -G))
    model.add_body("post", 5.0, (1, 1, 1), (0.2, 0.1, 0.5))
    model.add_joint("weld", "fixed", "ground", "post", (0, 0, 0))
    for k, x in enumerate((1.0, -2.0)):
        model.add_body(f"gate{k}", 3.0 + k, (1, 1, 1), (x, 0.3, 1.0))
        model.add_joint(f"low{k}", "revolute", "post", f"gate{k}", (x, 0, 0.4), axis=(0, 0, 1))
        model.add_joint(f"high{k}", "revolute", f"gate{k}", "ground", (x, 0, 1.7), axis=(0, 0, 1))
        model.add_bushing(f"closer{k}", "ground", f"gate{k}", (x, 0, 1.0), (0, 0, 0, 0, 0, 10.0))
        model.add_input(f"push{k}", f"gate{k}", (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    with_all_joint_forces(model)
    if method == "dense":
        expected = joint_wrenches(model, at_rest(model))
        for cut in (None, ["weld", "low0"], ["low1", "high0"]):
            result = np.array(list(reactions(model, cut=cut).values()))
            np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    expected = model.linearize().frequency_response([2.0])
    for cut in (None, ["weld", "low0"]):
        result = model.linearize(method=method, cut=cut).frequency_response([2.0])
        np.testing.assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_joints_that_lock_nothing_make_no_difference(method):
    """Beside a door and a gate: a free joint between them, whether the tree goes through it or it closes a loop."""
    model = door()
    model.add_body("gate", 3.0, (0.2, 0.3, 0.4), (2.0, 0.3, 1.0))
    model.add_joint("between", "free", "leaf", "gate", (5.0, 4.0, -3.0))
    for name, z in (("below", 0.3), ("above", 1.5)):
        model.add_joint(name, "revolute", "gate", "ground", (2.0, 0, z), axis=(0, 0, 1))
    model.add_bushing("spring", "ground", "gate", (2.0, 0, 1.0), (0, 0, 0, 0, 0, 20.0))
    model.add_load("wind", "gate", (1.0, 2.0, 3.0))
    model.add_bushing("hold", "ground", "gate", (2.0, 0.3, 1.0), preload=(-1.0, -2.0, 0, 0, 0, 0))
    model.add_input("push", "gate", (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    for name in ("low", "below", "above"):
        model.add_force_output(f"{name} moment", name, "rx")
    cuts = (["between", "low", "below"], ["low", "above", "below"], ["high", "low", "above"],
            ["high", "between", "above"])  # fmt: skip
    result = [model.linearize(method=method, cut=cut).frequency_response([2.0]) for cut in cuts]
    np.testing.assert_allclose(result, [result[0]] * len(cuts), rtol=0, atol=1e-9 * np.abs(result[0]).max())
    if method == "dense":
        forces = [list(reactions(model, cut=cut).values()) for cut in cuts]
        np.testing.assert_allclose(forces, [forces[0]] * len(cuts), rtol=0, atol=1e-9 * np.abs(forces[0]).max())
    else:
        expected = model.linearize(method="dense").frequency_response([2.0])
        np.testing.assert_allclose(result[0], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_states_of_self_stress_are_found_once(monkeypatch):
    model, found = with_all_joint_forces(mv.library.four_bar()), []
    monkeypatch.setattr("mbsvib.equations.statics.of_loops",
                        lambda *scene: found.append(of_loops(*scene)) or found[-1])  # fmt: skip
    assert model.linearize().redundant
    assert [len(states) for states in found] == [1]


def test_units_make_no_difference():
    """Lengths in millimetres: the same forces, moments in N mm."""
    model = redundant("bennett")
    lengths = {name: 1e3 * value for name, value in model.parameters.items() if ".position." in name}
    lengths |= {name: 1e3 * value for name, value in model.parameters.items() if ".preload.r" in name}
    result, expected = reactions(model.with_values(lengths)), reactions(model)
    size = max(map(np.linalg.norm, expected.values()))
    for name, wrench in expected.items():
        np.testing.assert_allclose(result[name] / np.repeat((1.0, 1e3), 3), wrench, rtol=0, atol=1e-9 * size)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", overconstrained.ALL)
def test_stiffness_does_not_depend_on_the_choice(name, monkeypatch):
    """Ten times as much self-stress as there are forces: constraints that are redundant nearby do no work on it."""
    model = redundant(name)
    expected = model.linearize()
    size = max(map(np.linalg.norm, expected.reactions.values()))

    def stressed(self, wrench, added_amount=None):
        result = wrench.copy()
        result[:, self.joints] += 10 * size * self.states.sum(axis=2)[..., None]
        return result

    monkeypatch.setattr("mbsvib.equations.self_stress.SelfStress.minimum_norm", stressed)
    actual = restated(model).linearize()
    assert max(map(np.linalg.norm, actual.reactions.values())) > 3 * size
    np.testing.assert_allclose(actual.K, expected.K, rtol=0, atol=1e-11 * max(np.abs(expected.K).max(), size))


def test_another_machine_makes_no_difference():
    """Machines that only ground joins have lengths of their own."""
    model, both = door(), door()
    both.add_body("far", 1.0, (1, 1, 1), (100.0, 0, 0))
    for k in range(3):
        both.add_joint(f"rail{k}", "prismatic", "ground", "far", (100.0, 5.0 * k, 0), axis=(0, 1, 0))
    for name, wrench in reactions(model).items():
        np.testing.assert_array_equal(reactions(both)[name], wrench)


def warned(model, **words):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        system = model.linearize(**words)
    return system, [str(item.message) for item in caught if item.category is mv.UndeterminedForceWarning]


@pytest.mark.few(1)
@pytest.mark.parametrize("by", [np.eye(3), rotation(np.random.default_rng(1))])
@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_outputs_that_are_left_open_are_named(method, by):
    """Of a planar linkage the forces out of its plane, and moments in it; sums and what acts in the plane is told."""
    model = restated(mv.library.four_bar(), by)
    for direction in ("x", "y", "z", "rx", "ry"):
        model.add_force_output(f"pin.{direction}", "A", direction)
        model.add_force_output(f"sum.{direction}", "coupler", direction)
        model.add_force_output(f"ground.{direction}", "ground", direction)
    system, stated = warned(model, method=method)
    assert len(stated) == 1
    for word in ("model 'four_bar'", "outputs pin.z, pin.rx, pin.ry:", "joints A, B, C, D", "bushing", "explain()"):
        assert word in stated[0]
    assert "outputs that depend on it: pin.z, pin.rx, pin.ry\n" in system.explain()
    assert "does not determine all forces in A, B, C, D" in system.explain()


def test_parts_name_their_own_outputs_that_are_left_open():
    model = mv.library.four_bar()
    for direction in ("x", "z", "rx"):
        model.add_force_output(f"pin.{direction}", "A", direction)
    system, _ = warned(model)
    assert "outputs that depend on it: pin.z\n" in system.reachable(outputs=["pin.x", "pin.z"]).explain()
    assert "outputs that depend on it" not in system.reachable(outputs=["pin.x"]).explain()


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_outputs_that_are_determined_are_not_warned_of(method):
    """Those of joints outside of loops, and of loops that are not redundant."""
    model = door()
    model.add_body("handle", 1.0, (0.1, 0.1, 0.1), (0.7, 0.1, 1.0))
    model.add_joint("pivot", "revolute", "leaf", "handle", (0.7, 0, 1.0), axis=(0, 1, 0))
    model.add_bushing("return", "leaf", "handle", (0.7, 0, 1.0), (0, 0, 0, 0, 50.0, 0), preload=(0, 0, 0, 0, 0, 0))
    model = model.replace("handle", position=(0.7, 0.1, 1.0))
    model.add_force_output("grip", "pivot", "z")
    model.add_force_output("weight", "leaf", "z")
    assert not warned(model, method=method)[1]
    free = mv.library.stewart(ports="none")
    free.add_force_output("foot", next(iter(free.joints)), "x")
    assert not warned(free, method=method)[1]
    model.add_force_output("hinge", "low", "z")
    assert len(warned(model, method=method)[1]) == 1


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_what_couplers_alone_share_is_no_force_in_joints(method):
    """Gears of a train that closes leave open what each of them transmits, but not what the shafts carry."""
    model = shafts(3)
    for name, first, second, ratio in (("ab", 0, 1, -2.0), ("bc", 1, 2, -3.0), ("ac", 0, 2, 6.0)):
        model.add_gear(name, f"s{first}.j", f"s{second}.j", ratio)
    model.add_input("push", "s0", (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
    for k in range(3):
        model.add_force_output(f"torque{k}", f"s{k}.j", "rz")
        model.add_force_output(f"thrust{k}", f"s{k}.j", "z")
    closed, stated = warned(model, method=method)
    assert len(closed.redundant) == 1
    assert not stated
    open_ = restated(model)
    open_ = open_.with_parts(couplers={name: part for name, part in open_.couplers.items() if name != "ac"})
    expected = open_.linearize(method=method).frequency_response([2.0])
    np.testing.assert_allclose(closed.frequency_response([2.0]), expected, rtol=1e-12, atol=1e-14)


def test_batches_warn_once():
    model = door()
    model.add_force_output("hinge", "low", "z")
    batch, stated = warned(model, values={"leaf.mass": [5.0, 10.0]})
    assert len(stated) == 1
    assert len(batch) == 2


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_planar_loop_under_load(seed):
    """Random planar loops with sliders, two of which hang together, against absolute coordinates."""
    model = held(planar(seed, 5, 2, damped=False, ports=False), seed)
    expected = joint_wrenches(model, at_rest(model))
    for cut in (None, [list(model.joints)[-1]]):
        result = np.array(list(reactions(model, cut=cut).values()))
        np.testing.assert_allclose(result, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
