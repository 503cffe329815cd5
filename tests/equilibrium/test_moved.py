"""Other poses: joints of every kind moved by finite amounts, against the exact constraints; loops; what goes along."""

from copy import copy

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.equilibrium import moved as moved_module
from mbsvib.equilibrium.motion import posed_model
from mbsvib.linalg.rotations import exponential
from tests.support.lagrangian import Lagrangian
from tests.support.random_models import KINDS, add_random_body, add_random_joint, planar, seeds, spatial
from tests.support.sizes import examples, few


def pose_of(model, before):
    """Centres and rotations of the bodies since ``before``, as the exact equations take them."""
    turns = [np.array(body.orientation) @ np.array(before.bodies[name].orientation).T
             for name, body in model.bodies.items()]  # fmt: skip
    return np.array([body.position for body in model.bodies.values()]), np.array(turns)


def check_pose(model, there):
    """Joints are assembled, and the model there allows the motions, forces and tangents of the exact equations."""
    exact, fresh = Lagrangian(model).at(pose_of(there, model)), Lagrangian(there).at()
    size = 1.0 + max(np.abs(body.position).max() for body in model.bodies.values())
    assert np.abs(exact.phi).max(initial=0.0) < 1e-12 * size
    force = np.abs(exact.gradient).max(initial=1e-3)
    assert np.allclose(exact.gradient, fresh.gradient, rtol=0, atol=1e-11 * force)
    motion = null_space(exact.jacobian)
    assert np.abs(fresh.jacobian @ motion).max(initial=0.0) < 1e-10 * size
    assert np.linalg.matrix_rank(fresh.jacobian, tol=1e-8) == np.linalg.matrix_rank(exact.jacobian, tol=1e-8)
    if np.abs(exact.residual).max(initial=0.0) < 1e-9 * force or not len(exact.phi):
        first, second = (motion.T @ local.tangent @ motion for local in (exact, fresh))
        assert np.allclose(first, second, rtol=0, atol=1e-10 * np.abs(exact.tangent).max(initial=1e-3))


def null_space(matrix):
    _, values, vectors = np.linalg.svd(matrix) if len(matrix) else (0, np.zeros(0), np.eye(matrix.shape[1]))
    return vectors[int(np.sum(values > 1e-8)):].T


def single(kind, seed=0, swap=False):
    """A body on one joint, and a second one behind it."""
    rng = np.random.default_rng(seed)
    model = mv.Model()
    for name in ("near", "far"):
        add_random_body(model, rng, name, rng.uniform(-1, 1, size=3))
    first, second = ("near", "ground") if swap else ("ground", "near")
    while True:
        add_random_joint(model, rng, "joint", kind, first, second, np.array([0.2, 0.1, -0.3]))
        if kind != "custom" or len(model.joints["joint"].free) not in (0, 6):
            break
        model = single("fixed", seed + 1)
        model = model.with_parts(joints={k: part for k, part in model.joints.items() if k != "joint"})
    model.add_joint("weld", "fixed", "near", "far")
    return model


def values_of(model, rng, size=0.7):
    """Values for all coordinates of a tree."""
    return {name: float(rng.uniform(-size, size)) for name in posed_model(model).coordinates.names}


@pytest.mark.few(6)
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("fixed", "custom")])
@pytest.mark.parametrize("seeds", few([range(1), range(1, 3)], 1))
def test_every_kind_of_joint_stays_assembled_and_stays_the_same_joint(kind, swap, seeds):
    for seed in seeds:
        model = single(kind, seed, swap)
        there = model.moved(values_of(model, np.random.default_rng(seed)))
        check_pose(model, there)
        joint = there.joints["joint"]
        assert (joint.kind, joint.pitch, joint.free) == (model.joints["joint"].kind, model.joints["joint"].pitch,
                                                         model.joints["joint"].free)  # fmt: skip
        assert there.linearize().coordinates == model.linearize().coordinates


# the axes across a rod are no body's, so that its coordinates are others in another pose
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("fixed", "custom", "distance")])
def test_two_steps_of_one_joint_are_one(kind):
    model = single(kind, 4, swap=True)
    values = values_of(model, np.random.default_rng(1))
    half = {name: value / 2 for name, value in values.items()}
    once, twice = model.moved(values), model.moved(half).moved(half)
    for name in model.bodies:
        assert np.allclose(once.bodies[name].position, twice.bodies[name].position, rtol=0, atol=1e-14)
        assert np.allclose(once.bodies[name].orientation, twice.bodies[name].orientation, rtol=0, atol=1e-14)
    back = once.moved({name: -value for name, value in values.items()}) if kind != "universal" else model
    assert np.allclose(back.bodies["far"].position, model.bodies["far"].position, rtol=0, atol=1e-14)


@pytest.mark.slow
@examples(10, slow=40)
@given(seeds())
def test_random_trees_against_the_exact_constraints(seed):
    kinds = tuple(kind for kind in KINDS if kind != "custom")
    model = spatial(seed, bodies=3, kinds=kinds, ports=False)
    model = without_springs(model)
    check_pose(model, model.moved(values_of(model, np.random.default_rng(seed))))


def without_springs(model):
    return model.with_parts(springs={})


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", few(range(8), 4))
def test_planar_loops_in_space_stay_closed(seed):
    model = without_springs(planar(seed, bodies=4, loops=1, ports=False))
    system = model.linearize()
    there = model.moved({system.coordinates[0]: 0.25})
    check_pose(model, there)
    assert there.linearize().dof == system.dof
    assert len(there.linearize().redundant) == len(system.redundant)


def four_bar(ground=1.0, crank=0.3, coupler=0.9, rocker=0.7, angle=0.8):
    """A four-bar linkage in the x-y plane, assembled with its crank at an angle."""
    a, d = np.zeros(3), np.array([ground, 0.0, 0.0])
    b = crank * np.array([np.cos(angle), np.sin(angle), 0.0])
    gap = d - b
    length = np.linalg.norm(gap)
    along = (coupler**2 - rocker**2 + length**2) / (2 * length)
    up = np.array([-gap[1], gap[0], 0.0]) / length
    c = b + along * gap / length + np.sqrt(coupler**2 - along**2) * up
    model = mv.Model("four-bar")
    for name, (p, q) in {"crank": (a, b), "coupler": (b, c), "rocker": (d, c)}.items():
        model.add_body(name, 1.0, (1e-3, 1e-2, 1e-2), (p + q) / 2,
                       orientation=(0, 0, np.arctan2(*(q - p)[1::-1])))  # fmt: skip
    z = {"axis": (0, 0, 1)}
    model.add_joint("A", "revolute", "ground", "crank", a, **z)
    model.add_joint("B", "revolute", "crank", "coupler", b, **z)
    model.add_joint("C", "revolute", "coupler", "rocker", c, **z)
    model.add_joint("D", "revolute", "rocker", "ground", d, **z)
    return model, c


@pytest.mark.parametrize("by", [0.4, -1.1, 2 * np.pi])
def test_four_bar_follows_its_crank(by):
    model, _ = four_bar()
    expected, c = four_bar(angle=0.8 + by)
    there = model.moved({"A.rz": by})
    assert there.joints["C"].position == pytest.approx(c, abs=1e-12)
    for name, body in expected.bodies.items():
        assert there.bodies[name].position == pytest.approx(body.position, abs=1e-12)
        assert np.allclose(there.bodies[name].orientation, body.orientation, rtol=0, atol=1e-12)


@pytest.mark.parametrize("joint", ["A", "B", "C", "D"])
def test_any_joint_of_a_loop_can_be_the_one_that_moves(joint):
    model, _ = four_bar()
    there = model.moved({f"{joint}.rz": -0.05})
    check_pose(model, there)
    part = model.joints[joint]
    turn = {"ground": 0.0} | {name: np.arctan2(*np.array(body.orientation)[1::-1, 0])
                              - np.arctan2(*np.array(model.bodies[name].orientation)[1::-1, 0])
                              for name, body in there.bodies.items()}  # fmt: skip
    assert turn[part.second] - turn[part.first] == pytest.approx(-0.05, abs=1e-12)


def test_a_pose_out_of_reach_says_how_far_it_goes():
    model, _ = four_bar(crank=0.7, rocker=0.3)  # this crank only rocks
    with pytest.raises(mv.ModelError, match=r"moved: the loops closed by \w+ can be closed up to A.rz = ") as caught:
        model.moved({"A.rz": 2.0})
    assert caught.value.element == "A.rz"
    reached = float(str(caught.value).split("A.rz = ")[1].split()[0])
    limit = np.arccos((1.0 + 0.7**2 - 1.2**2) / 1.4)  # coupler and rocker in line
    assert 0.8 + reached == pytest.approx(limit, abs=1e-3)


def test_a_parallelogram_that_gets_flat_is_said_to_be_singular():
    """It was said to stay open by 4e-16 of its size."""
    model = mv.Model("parallelogram")
    for name, position in (("crank", (0, 0.5, 0)), ("rod", (0.5, 1, 0)), ("rocker", (1, 0.5, 0))):
        model.add_body(name, 1.0, (0.01, 0.02, 0.02), position=position)
    for name, first, second, position in (("A", "ground", "crank", (0, 0, 0)), ("B", "crank", "rod", (0, 1, 0)),
                                          ("C", "rod", "rocker", (1, 1, 0)), ("D", "rocker", "ground", (1, 0, 0))):
        model.add_joint(name, "revolute", first, second, position=position)
    with pytest.raises(mv.ModelError, match=r"up to A\.rz = 1\.57\d* and no further; there they come to a singular"):
        model.moved({"A.rz": 1.6})


@pytest.mark.slow
def test_stewart_platform_turned_about_its_axis():
    model = mv.library.stewart()
    names = model.linearize().coordinates
    there = model.moved({names[0]: 0.05, names[1]: -0.03}, relaxed=True)
    moved = without_springs(model)
    check_pose(moved, without_springs(there))


def test_a_spring_gets_its_tension_and_a_relaxed_one_does_not():
    model = mv.Model()
    model.add_body("bob", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("hinge", "revolute", "ground", "bob", (0.0, 0.0, 0.0))
    model.add_spring("k", "ground", "bob", (1.0, 1.0, 0.0), (1.0, 0.0, 0.0), 50.0, preload=3.0)
    model.add_input("push", "bob", "x", position=(2.0, 0.0, 0.0))
    there = model.moved({"hinge.rz": np.pi / 2})
    assert there.springs["k"].end == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    assert there.springs["k"].preload == pytest.approx(3.0)
    assert there.inputs["push"].position == pytest.approx((0.0, 2.0, 0.0), abs=1e-15)
    assert there.inputs["push"].direction == "x"
    further = model.moved({"hinge.rz": -np.pi / 2})
    assert further.springs["k"].preload == pytest.approx(3.0 + 50.0 * (np.sqrt(5.0) - 1.0))
    assert model.moved({"hinge.rz": -np.pi / 2}, relaxed=True).springs["k"].preload == 3.0
    assert model.springs["k"].end == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("seed", few(range(6), 3))
def test_springs_and_bushings_follow_their_finite_law(seed):
    """A free body that is moved anywhere: forces and tangents of the model there are those of the exact law."""
    rng = np.random.default_rng(seed)
    model = mv.Model()
    add_random_body(model, rng, "a", rng.uniform(-1, 1, size=3))
    add_random_body(model, rng, "b", rng.uniform(-1, 1, size=3))
    matrix = rng.normal(size=(6, 6))
    model.add_bushing("full", "a", "b", (0.3, 0.1, -0.2), 100 * (matrix + matrix.T), preload=rng.normal(size=6))
    model.add_bushing("six", "ground", "b", (0.0, 0.1, 0.2), 100 * rng.random(6), orientation=rng.normal(size=3))
    model.add_spring("line", "b", "a", (1.0, 0.0, 0.3), (0.0, 2.0, 0.1), 70.0, free_length=1.5)
    there = model.moved(values_of(model, rng))
    exact, fresh = Lagrangian(model).at(pose_of(there, model)), Lagrangian(there).at()
    assert np.allclose(exact.gradient, fresh.gradient, rtol=0, atol=1e-12 * np.abs(exact.gradient).max())
    assert np.allclose(exact.tangent, fresh.tangent, rtol=0, atol=1e-12 * np.abs(exact.tangent).max())


def test_loads_that_follow_turn_and_dead_ones_do_not():
    model = mv.Model()
    model.add_body("arm", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("hinge", "revolute", "ground", "arm", (0.0, 0.0, 0.0))
    model.add_load("dead", "arm", force=(1.0, 0.0, 0.0), position=(2.0, 0.0, 0.0))
    model.add_load("thrust", "arm", force=(0.0, 1.0, 0.0), torque=(1.0, 0.0, 0.0), follower=True)
    there = model.moved({"hinge.rz": np.pi / 2})
    assert there.loads["dead"].force == (1.0, 0.0, 0.0)
    assert there.loads["dead"].position == pytest.approx((0.0, 2.0, 0.0), abs=1e-15)
    assert there.loads["thrust"].force == pytest.approx((-1.0, 0.0, 0.0), abs=1e-15)
    assert there.loads["thrust"].torque == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)


def test_custom_joints_that_no_words_describe_there_are_refused_by_name():
    model = mv.Model()
    model.add_body("part", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("odd", None, "ground", "part", (0.0, 0.0, 0.0), free=("y", "rx", "ry"))
    assert model.moved({"odd.ry": 0.3}).joints["odd"].free == ("y", "rx", "ry")
    with pytest.raises(mv.ModelError, match="joint 'odd': its free rotations have turned against its locked"):
        model.moved({"odd.rx": 0.3})


def test_unknown_coordinates_and_values_are_refused():
    model, _ = four_bar()
    with pytest.raises(mv.ModelError, match=r"'A.rx' is not a joint coordinate .* Did you mean 'A.rz'"):
        model.moved({"A.rx": 0.1})
    with pytest.raises(mv.ModelError, match=r"moved: A\.rz = 'far'"):
        model.moved({"A.rz": "far"})
    with pytest.raises(mv.ModelError, match="all joints of the loop"):
        model.moved({f"{name}.rz": 0.1 for name in "ABCD"})
    with pytest.raises(mv.ModelError, match=r"moved: loops and couplers leave no choice for A\.rz, B\.rz"):
        model.moved({"A.rz": 0.1, "B.rz": 0.1})


def test_floating_bodies_move_by_their_own_coordinates():
    model = mv.Model()
    model.add_body("bird", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    there = model.moved({"bird.z": 2.0, "bird.rz": 0.5})
    assert there.bodies["bird"].position == (1.0, 0.0, 2.0)
    assert np.allclose(there.bodies["bird"].orientation, exponential(np.array([0.0, 0.0, 0.5])), rtol=0, atol=1e-16)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", few(range(10), 5))
def test_spatial_loops_stay_closed(seed):
    kinds = ("cylindrical", "universal", "spherical", "planar", "screw", "revolute", "distance", "point_on_line")
    model = without_springs(spatial(seed, bodies=4, loops=1, kinds=kinds, ports=False))
    names = model.linearize().coordinates
    if names:
        check_pose(model, model.moved({names[0]: 0.05, names[-1]: 0.02}))


def test_a_bushing_is_followed_up_to_half_a_turn():
    model = mv.Model()
    model.add_body("door", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("hinge", "revolute", "ground", "door", (0.0, 0.0, 0.0))
    model.add_bushing("k", "ground", "door", (0.0, 0.0, 0.0), (0, 0, 0, 0, 0, 5.0))
    assert model.moved({"hinge.rz": 2.9}).springs["k"].preload[5] == pytest.approx(-14.5, rel=1e-14)
    with pytest.raises(mv.ModelError, match="bushing 'k': is turned by 178 degrees, where its moment is no longer"):
        model.moved({"hinge.rz": 3.1})
    assert model.moved({"hinge.rz": 3.1}, relaxed=True).springs["k"].preload is None


def test_ranks_of_loops_are_decided_once_for_many_poses(monkeypatch):
    calls, real = [], moved_module.reduce

    def counted(*arguments):
        calls.append(arguments)
        return real(*arguments)

    monkeypatch.setattr(moved_module, "reduce", counted)
    model = mv.library.stewart()
    lengths = [f"leg{k}.slide.{model.joints['leg1.slide'].freedom[0][0]}" for k in range(1, 7)]
    heights = [model.moved(dict.fromkeys(lengths, step)).bodies["platform"].position[2] for step in (0.0, 1e-3, 2e-3)]
    assert len(calls) == 1
    # legs of one length move the platform straight up: h^2 = l^2 - r^2, r the horizontal distance of their ends
    arm = np.subtract(model.joints["leg1.head"].position, model.joints["leg1.foot"].position)
    length, height = np.linalg.norm(arm) + np.array([0.0, 1e-3, 2e-3]), model.bodies["platform"].position[2]
    assert_allclose(heights, height - arm[2] + np.sqrt(length**2 - arm[0] ** 2 - arm[1] ** 2), rtol=1e-13)


def test_what_is_added_after_a_move_moves_too():
    """The tree and the ranks of a pose are kept until a part is added."""
    model = mv.Model("arms")
    model.add_body("a", 1.0, (1, 1, 1), (1, 0, 0))
    model.add_joint("first", "revolute", "ground", "a", (0, 0, 0), axis=(0, 0, 1))
    values = {"first.rz": np.pi / 2}
    assert_allclose(model.moved(values, cut=()).bodies["a"].position, (0, 1, 0), atol=1e-15)
    other = copy(model)
    model.add_body("b", 1.0, (1, 1, 1), (3, 0, 0))
    model.add_joint("second", "revolute", "a", "b", (2, 0, 0), axis=(0, 0, 1))
    for cut in ((), None):
        there = model.moved(values, cut=cut)
        assert_allclose(there.bodies["b"].position, (0, 3, 0), atol=1e-15)
        assert "b" not in other.moved(values, cut=cut).bodies


def test_axes_of_joints_turn_with_their_first_bodies():
    """Forces in a joint are along axes that the first body carries, whether or not the joint is given by its axis."""
    model = mv.Model("arm")
    model.add_body("a", 1.0, (0.1, 0.2, 0.3), (0.5, 0.0, 0.0))
    model.add_body("b", 1.0, (0.1, 0.2, 0.3), (1.5, 0.0, 0.0))
    model.add_joint("j1", "revolute", "ground", "a", (0.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_joint("j2", "revolute", "a", "b", (1.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_bushing("k1", "ground", "a", (0.0, 0.0, 0.0), (0, 0, 0, 0, 100, 0))
    model.add_bushing("k2", "a", "b", (1.0, 0.0, 0.0), (0, 0, 0, 0, 100, 0))
    model.add_input("push", "b", "x")
    model.add_force_output("along", "j2", "x")
    model.add_force_output("across", "j2", "y")
    there = model.moved({"j1.rz": 0.7, "j2.rz": 0.2}, relaxed=True)
    # a rigid body passes the force on: (1, 0, 0) in axes turned about y of the world by 0.7
    np.testing.assert_allclose(there.linearize().D[:, 0], [np.cos(0.7), -np.sin(0.7)], rtol=0, atol=1e-12)
    plant = model.compile("b.mass", pose=["j1.rz", "j2.rz"], relaxed=True)
    np.testing.assert_allclose(plant([1.0, 0.7, 0.2]).D[:, 0], [np.cos(0.7), -np.sin(0.7)], rtol=0, atol=1e-12)


@pytest.mark.parametrize("bushing", [False, True])
@pytest.mark.parametrize("angle", [4.0, -7.0])
def test_springs_that_are_wound_beyond_their_limit_on_the_way_are_refused(bushing, angle):
    """The angle between two poses does not tell how often a spring was turned: 4 rad are not -2.28 rad."""
    model = wound(4.0, bushing=bushing)
    with pytest.raises(mv.ModelError, match=r"'coil'.* turned by 1[78]\d degrees"):
        model.moved({"hinge.rz": angle})
    with pytest.raises(mv.ModelError, match=r"'coil'.* turned by 1[78]\d degrees"):
        model.compile("disk.mass", pose="hinge.rz")([1.0, angle])
    assert model.moved({"hinge.rz": angle}, relaxed=True).springs["coil"].preload is None
    half = model.moved({"hinge.rz": 0.4 * angle}).springs["coil"].preload
    twice = model.moved({"hinge.rz": 0.4 * angle}).moved({"hinge.rz": 0.4 * angle}).springs["coil"].preload
    assert_allclose(np.ravel(twice)[-1], 2 * np.ravel(half)[-1], rtol=1e-12)


def test_springs_behind_a_gear_are_wound_by_its_ratio():
    model = wound(4.0, gear=5.0)
    assert_allclose(model.moved({"shaft.rz": 0.3}).springs["coil"].preload, -4.0 * 1.5, rtol=1e-12)
    with pytest.raises(mv.ModelError, match="'coil'"):
        model.moved({"shaft.rz": 0.9})


def test_equilibria_beyond_the_limit_of_a_spring_are_refused_for_it():
    """Behind a gear of 20 the spring would turn by 4 rad."""
    model = wound(2.0 * np.cos(0.2) / (20.0**2 * 0.2), gear=20.0)
    model.add_load("weight", "pinion", (0, -2.0, 0), position=(2, 0, 0))
    with pytest.raises(mv.EquilibriumError, match="a spring would turn beyond its limit of 172 degrees"):
        model.equilibrium()
    with pytest.raises(mv.EquilibriumError, match="a spring would turn beyond its limit of 172 degrees"):
        model.with_parts(loads={}).path("shaft.rz", [0.2])


def test_dampers_about_an_axis_turn_without_limit():
    model = wound(0.0, damping=0.1)
    assert model.moved({"hinge.rz": 3.1}).moved({"hinge.rz": 9.0}).springs["coil"] == model.springs["coil"]


def wound(stiffness, damping=0.0, gear=None, bushing=False):
    """A disk on a hinge with a spring about it, and a shaft that drives it."""
    model = mv.Model("wound")
    model.add_body("disk", 1.0, (0.1, 0.1, 0.1))
    model.add_joint("hinge", "revolute", "ground", "disk", (0, 0, 0), axis=(0, 0, 1))
    if bushing:
        model.add_bushing("coil", "ground", "disk", (0, 0, 0), (0, 0, 0, 0, 0, stiffness))
    else:
        model.add_torsion_spring("coil", "ground", "disk", (0, 0, 1), stiffness, damping)
    if gear is not None:
        model.add_body("pinion", 1.0, (0.1, 0.1, 0.1))
        model.add_joint("shaft", "revolute", "ground", "pinion", (1, 0, 0), axis=(0, 0, 1))
        model.add_gear("mesh", "shaft", "hinge", gear)
    return model
