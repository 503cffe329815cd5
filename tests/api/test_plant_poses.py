"""Plants whose values are also displacements of joint coordinates: as of models that are moved and linearized."""

import pickle

import numpy as np
import pytest
from mpmath import mp

import mbsvib as mv
from mbsvib import beams
from mbsvib.equations import batch_assembly, loaded
from mbsvib.equations.matrices import MATRICES
from tests.equilibrium.test_moved import four_bar
from tests.kinematics.test_dead_centre import rocker
from tests.superelements.test_loaded import NODES, Reference


def gantry():
    """A bridge and a head that slide level under gravity, on springs with preloads, turned by a loaded wheel."""
    model = mv.Model("gantry", gravity=(0.0, 0.0, -9.81))
    model.add_body("bridge", 30.0, (3.0, 1.0, 4.0), (0.1, 0.0, 1.0))
    model.add_body("head", 8.0, (0.3, 0.2, 0.1), (0.1, 0.3, 0.8))
    model.add_body("tool", 2.0, (0.02, 0.03, 0.01), (0.1, 0.3, 0.5))
    model.add_joint("rail", "prismatic", "ground", "bridge", (0.0, 0.0, 1.0), axis=(1, 0, 0))
    model.add_joint("slide", "prismatic", "bridge", "head", (0.1, 0.0, 0.8), axis=(0, 1, 0))
    model.add_joint("neck", "universal", "head", "tool", (0.1, 0.3, 0.7), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_torsion_spring("back", "head", "tool", (0, 0, 1), 5.0)
    for axis, sign in (((1, 0), 1.0), ((1, 0), -1.0), ((0, 1), 1.0)):
        end = np.array((0.1 + 0.1 * sign * axis[0], 0.3 + 0.1 * sign * axis[1], 0.5))
        model.add_bushing(f"guide{sign}{axis}", "head", "tool", end, (300, 200, 100, 3, 2, 1), (1, 2, 3, 0, 0, 0.1))
    model.add_bushing("slack", "head", "tool", (0.1, 0.3, 0.6), 10.0 * np.eye(6), orientation=(0.1, 0.2, 0.3))
    model.add_spring("pull", "head", "tool", (0.1, 0.3, 0.8), (0.1, 0.3, 0.5), 30.0, preload=15.0)
    model.add_load("weight", "tool", (0.0, 0.0, -20.0), position=(0.1, 0.3, 0.4))
    model.add_base_motion("floor", "z")
    model.add_input("push", "tool", "x")
    model.add_output("tip", "tool", "x", position=(0.1, 0.3, 0.4), quantity="acceleration", absolute=True)
    model.add_force_output("carried", "slide", "z")
    model.add_force_output("guided", "guide1.0(1, 0)", "x")
    return model


def swinging():
    """A pendulum, hanging or standing, with a spring along it and a preloaded bushing across."""
    model = mv.Model("pendulum", gravity=(0.0, 0.0, -9.81))
    model.add_body("rod", 1.0, (0.1, 0.1, 0.0), (0.0, 0.0, -0.5))
    model.add_joint("pin", "revolute", "ground", "rod", (0.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_spring("line", "ground", "rod", (0.0, 0.0, 2.0), (0.0, 0.0, -0.7), 30.0, 0.4, free_length=2.0)
    model.add_bushing("block", "ground", "rod", (0.0, 0.0, -0.4), (40.0, 50.0, 60.0, 0, 0, 0), (1, 2, 3, 0, 0, 0),
                      preload=(0, 2, 3, 0, 0, 0))  # fmt: skip
    return model


def geared():
    """A loop of four bars that all turn about z, with a wheel geared to its crank; its redundant rows stay."""
    model, _ = four_bar(angle=0.8)
    model.add_body("wheel", 0.5, (0.1, 0.1, 0.2), (2.0, 1.0, 0.0))
    model.add_joint("shaft", "revolute", "ground", "wheel", (2.0, 1.0, 0.0), axis=(0, 0, 1))
    model.add_gear("gear", "A", "shaft", -2.0)
    model.add_bushing("spring", "ground", "wheel", (2.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    return model


def flexible_arm():
    """A reduced elastic part with two modes on a hub, and a beam on one of its nodes; the ground moves."""
    reference = Reference(True)
    model = reference.model()
    model = model.with_parts(gravity=None, loads={})
    model.add_body("hand", 0.3, (0.01, 0.02, 0.03), (1.6, 0.2, 0.1))
    model.add_beam("beam", "part.right", "hand", beams.Circle(0.01), beams.Material(2e11, 7800.0, 0.3),
                   start=NODES["right"], end=(1.6, 0.2, 0.1), elements=2, beta=1e-4)  # fmt: skip
    model.add_base_motion("floor", "y")
    model.add_input("push", "hand", "y")
    model.add_output("tip", "hand", "y", quantity="acceleration", absolute=True)
    return model


def loaded_arm():
    """A beam on an upright hinge under gravity."""
    model = mv.Model("arm", gravity=(0.0, 0.0, -9.81))
    model.add_body("hub", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0))
    model.add_joint("hinge", "revolute", "ground", "hub", (0.0, 0.0, 0.0), axis=(0, 0, 1))
    model.add_beam("beam", "hub", None, beams.Circle(0.02), beams.Material(2e11, 7800.0, 0.3), start=(0.0, 0.0, 0.0),
                   end=(0.5, 0.0, 0.0), elements=1)  # fmt: skip
    return model


def braked():
    """A tool on a universal joint between dampers without stiffness, whose rows follow from the angles."""
    model = mv.Model("braked")
    model.add_body("tool", 2.0, (0.02, 0.03, 0.01), (0.1, 0.3, 0.5))
    model.add_joint("neck", "universal", "ground", "tool", (0.1, 0.3, 0.7), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_bushing("brake", "ground", "tool", (0.1, 0.3, 0.6), np.zeros(6), (1, 2, 3, 0.1, 0.5, 0.9),
                      orientation=(0.4, 0.2, 0.3))  # fmt: skip
    model.add_spring("line", "ground", "tool", (0.5, 0.0, 0.0), (0.1, 0.3, 0.4), 0.0, 2.0)
    return model


def welded_linkage():
    """A planar linkage in space with a bracket welded to its coupler, which carries a wheel; forces in all joints."""
    model, _ = four_bar(angle=0.8)
    coupler = model.bodies["coupler"].position
    model.add_body("bracket", 0.4, (0.02, 0.03, 0.04), np.add(coupler, (0.1, 0.2, 0.3)))
    model.add_joint("weld", "fixed", "coupler", "bracket", np.add(coupler, (0.05, 0.1, 0.15)))
    model.add_spring("pull", "ground", "bracket", (0.0, 2.0, 1.0), np.add(coupler, (0.1, 0.2, 0.3)), 20.0, preload=3.0)
    model.add_rotor("wheel", "bracket", 40.0, (0.6, 0.0, 0.8), inertia=0.03)
    for joint in ("A", "B", "C", "weld"):
        for direction in ("x", "z", "rx", "ry"):
            model.add_force_output(f"{joint}.F{direction}", joint, direction)
    return model


MODELS = {
    "dampers": (braked, ["neck.rx", "neck.ry"], ["tool.mass", "line.damping"], False),
    "stewart": (mv.library.stewart, ["leg1.slide.z", "leg4.slide.z"], ["leg*.k.stiffness"], True),
    "moved points": (mv.library.stewart, ["leg2.slide.z"], ["platform.position.x", "leg3.k.start.y"], True),
    "puma": (mv.library.puma, None, ["*.mass"], True),
    "hexapod": (mv.library.cubic_hexapod, None, ["*.mass"], True),
    "branches": (mv.library.tree, None, ["*.stiffness*"], True),
    "rssr": (mv.library.rssr, None, [], True),
    "gantry": (gantry, ["rail.z", "slide.z"], ["tool.mass", "pull.preload", "pull.stiffness", "guide*.stiffness.x",
                                               "weight.force.z"], False),
    "relaxed gantry": (gantry, ["rail.z", "slide.z"], ["guide*.damping.*", "back.stiffness", "slack.stiffness.*"],
                       True),
    "geared loop": (geared, ["A.rz"], ["spring.stiffness.rz"], True),
    "welded linkage": (welded_linkage, ["A.rz"], ["bracket.mass", "wheel.speed"], False),
    "redundant loop": (mv.library.hoeken, None, [], True),
    "loaded beam": (loaded_arm, ["hinge.rz"], ["hub.inertia.zz"], True),
    "beam and superelement": (flexible_arm, ["hinge.rz"], ["hub.inertia.yy", "k.stiffness.ry"], True),
}


def first_coordinate(model):
    return [model.linearize().coordinates[0]]


# Models of which each variant is made anew.
ANEW = ("moved points", "loaded beam")


@pytest.mark.few(3)
@pytest.mark.filterwarnings("ignore:.*does not determine the outputs")
@pytest.mark.parametrize("name", MODELS)
def test_matrices_are_those_of_the_moved_model(name, monkeypatch):
    make, pose, parameters, relaxed = MODELS[name]
    if make is welded_linkage:  # its poses are off balance
        monkeypatch.setattr(loaded, "check_balance", lambda *_: None)
    model = make()
    pose = pose or first_coordinate(model)
    plant = model.compile(parameters, pose=pose, relaxed=relaxed)
    assert plant.names[-len(pose) :] == tuple(pose)
    assert not plant.nominal[-len(pose) :].any()
    rng = np.random.default_rng(3)
    count = len(plant.names) - len(pose)
    values = np.tile(plant.nominal, (2, 1))
    values[:, :count] *= 1.0 + 0.01 * rng.normal(size=(2, count))
    values[:, :count] += np.where(plant.nominal[:count] == 0.0, 0.05, 0.0)  # coefficients that are 0 as described
    values[:, count:] = 0.02 * rng.normal(size=(2, len(pose)))
    if name not in ANEW:
        monkeypatch.setattr(batch_assembly, "one_by_one", None)
    batch = plant(values)
    for i, row in enumerate(values):
        own = dict(zip(plant.names, row.tolist(), strict=True))
        moves = {key: own.pop(key) for key in pose}
        there = (model.with_values(own) if own else model).moved(moves, relaxed=relaxed)
        expected = there.linearize(independent=plant.coordinates)
        for key in MATRICES:
            found, wanted = getattr(batch, key)[i], getattr(expected, key)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max(initial=1e-300))
        places = [[body.position for body in each.bodies.values()] for each in (
            batch.slice(i, i + 1)[0].provenance.origin, there)]  # fmt: skip
        np.testing.assert_allclose(*places, rtol=0, atol=1e-13)
        np.testing.assert_allclose(plant.system(row).K, batch.K[i], rtol=0, atol=1e-12 * np.abs(batch.K[i]).max())


def test_forces_of_springs_follow_from_their_deformation(monkeypatch):
    plant = swinging().compile(["line.stiffness", "block.preload.y", "rod.mass"], pose="pin.rz")
    values = np.array([[30.0, 2.0, 1.0, 0.0], [33.0, 2.2, 1.4, np.pi]])
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    batch = plant(values)
    # hanging and standing: gravity, the tension times lever arms, and the bushing's translation
    for k, (stiffness, _, mass, angle) in zip(batch.K[:, 0, 0], values, strict=True):
        sign = np.cos(angle)
        length = 2.0 + 0.7 * sign
        of_line = -stiffness * (length - 2.0) * 2.0 * 0.7 * sign / length
        of_block = 40.0 * 0.4**2 + 0.4 * sign * (60.0 * 0.4 * (1.0 - sign) - 3.0)
        assert k == pytest.approx(0.5 * 9.81 * mass * sign + of_line + of_block, rel=1e-12)
    with pytest.raises(mv.EquilibriumError, match=r"^variant 1: .* is not in balance"):
        plant([[30.0, 2.0, 1.0, 0.0], [30.0, 2.0, 1.0, 0.1]])


def hanging_crank():
    """A four-bar linkage whose rocker turns against a torsion spring of 10 N m/rad."""
    model, _ = four_bar(angle=0.8)
    model.add_bushing("spring", "ground", "rocker", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 10.0))
    return model


def test_stiffness_of_a_spring_at_the_rocker_over_the_angle_of_the_crank():
    plant = hanging_crank().compile("spring.stiffness.rz", pose="A.rz", independent=["A.rz"], relaxed=True)
    assert plant.units == ("N m/rad", "rad")
    angles = np.linspace(-1.5, 3.0, 4)
    values = np.stack((np.full(4, 10.0), angles), axis=-1)
    ratio = [(rocker(0.8 + a + 1e-6) - rocker(0.8 + a - 1e-6)) / 2e-6 for a in angles.tolist()]
    batch = pickle.loads(pickle.dumps(plant))(values)
    np.testing.assert_allclose(batch.K[:, 0, 0], 10.0 * np.square(ratio), rtol=1e-7)
    np.testing.assert_array_equal(batch.parameters["A.rz"], angles)
    assert not plant.loaded
    assert not hanging_crank().compile("spring.stiffness.rz", pose="A.rz").loaded  # its pose needs no balance


def test_joints_that_no_pose_can_say_are_refused_in_plants_too():
    model = mv.Model("turner")
    model.add_body("a", 1.0, (0.1, 0.2, 0.3), (0.1, 0.0, 0.2))
    model.add_joint("j", None, "ground", "a", (0.0, 0.0, 0.0), free=("z", "rx", "rz"))
    model.add_torsion_spring("k", "ground", "a", (0, 0, 1), 1.0)
    plant = model.compile("a.mass", pose=["j.rx", "j.rz"], relaxed=True)
    for refused in (lambda: model.moved({"j.rx": 0.3, "j.rz": 0.2}, relaxed=True), lambda: plant([1.0, 0.3, 0.2])):
        with pytest.raises(mv.ModelError, match="free rotations have turned against its locked translations"):
            refused()


def along(plant, x, k, step):
    """Derivatives of the matrices along number k of x, by differences of sixth order."""
    change = np.zeros(len(x))
    change[k] = step
    batch = plant([x + i * change for i in (-3, -2, -1, 1, 2, 3)])
    weights = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0 / step
    return {key: np.tensordot(weights, getattr(batch, key), 1) for key in MATRICES}


@pytest.mark.few(3)
@pytest.mark.parametrize("name", [name for name in MODELS if name not in ANEW])
@pytest.mark.filterwarnings("ignore:.*does not determine the outputs")
def test_derivatives_to_parameters_and_pose_coordinates(name, monkeypatch):
    make, pose, parameters, relaxed = MODELS[name]
    if make is welded_linkage:  # its poses are off balance
        monkeypatch.setattr(loaded, "check_balance", lambda *_: None)
    model = make()
    pose = pose or first_coordinate(model)
    plant = model.compile(parameters, pose=pose, relaxed=relaxed)
    x, rng = np.array(plant.nominal), np.random.default_rng(5)
    x[-len(pose) :] = 0.02 * rng.normal(size=len(pose))
    which = [*range(min(3, len(x) - len(pose))), *range(len(x) - len(pose), len(x))]
    tangent = plant.tangent(x, np.eye(len(x))[which])
    here = plant(x)
    for i, k in enumerate(which):
        step = 3e-4 if k >= len(x) - len(pose) else 1e-2 * (abs(x[k]) or 1.0)
        for key, expected in along(plant, x, k, step).items():
            size = np.abs(getattr(here, key)).max(initial=1e-300) / step
            np.testing.assert_allclose(getattr(tangent, key)[i], expected, rtol=1e-9, atol=1e-12 * size)


def test_derivatives_over_the_angle_of_a_loaded_pendulum():
    plant = swinging().compile(["line.stiffness", "block.preload.y", "rod.mass"], pose="pin.rz")
    # off the poses in balance, K is still the second derivative of the energy, here of gravity and of the line
    found = plant.tangent([[30.0, 2.0, 1.0, 0.0], [30.0, 2.0, 1.0, np.pi]], [0.0, 0.0, 0.0, 1.0]).K[:, 0, 0]

    def third(angle):
        def energy(a):
            line = mp.sqrt(4 + mp.mpf("0.49") + mp.mpf("2.8") * mp.cos(a)) - 2
            bushing = 20 * (mp.mpf("0.4") * mp.sin(a)) ** 2 + 30 * (mp.mpf("0.4") * (1 - mp.cos(a))) ** 2
            return mp.mpf("-4.905") * mp.cos(a) + 15 * line**2 + bushing

        return float(mp.diff(energy, angle, 3))

    np.testing.assert_allclose(found, [third(0), third(mp.pi)], rtol=0, atol=1e-10)


def test_gradients_of_eigenvalues_over_poses_and_parameters():
    plant = mv.library.stewart().compile("leg*.k.stiffness", pose="leg*.slide.z", relaxed=True)
    x = np.array(plant.nominal)
    x[6:] = [0.01, -0.04, 0.03, 0.0, 0.02, -0.01]
    values, slopes = plant.eigenvalues(x, gradient=True)
    several = plant.eigenvalues([plant.nominal, x], gradient=True)
    np.testing.assert_allclose(several[1][1], slopes, rtol=1e-9, atol=1e-9 * np.abs(slopes).max())
    for k in (0, 7, 8):
        step = 1e-3 * x[k] if k < 6 else 1e-4
        change = np.zeros(len(x))
        change[k] = step
        rows = plant.eigenvalues([x + i * change for i in (-3, -2, -1, 1, 2, 3)])
        expected = np.tensordot(np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0 / step, rows, 1)
        np.testing.assert_allclose(slopes[:, k], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert np.isfinite(values).all()


def test_poses_and_derivatives_that_there_are_none_of_are_refused_by_name():
    model = hanging_crank()
    plant = model.compile("spring.stiffness.rz", pose="D.*", relaxed=True)
    with pytest.raises(mv.ModelError, match=r"^variant 1: the loops closed by .* up to D\.rz = 0\.\d+ and no further"):
        plant([[10.0, -0.1], [10.0, 1.5]])
    moves = model.compile("A.position.x", pose="D.*", relaxed=True)
    for asked in (lambda: moves.tangent([0.0, 0.0], [1.0, 0.0]), lambda: moves.eigenvalues([0.0, 0.0], True)):
        with pytest.raises(mv.ModelError, match=r"derivatives to the pose coordinate 'D\.rz': poses are computed one"):
            asked()
    with pytest.raises(mv.ModelError, match=r"pose = 'D\.rx' matches no joint coordinate of model .* 'D\.rz'"):
        model.compile("spring.*", pose="D.rx")
    with pytest.raises(mv.ModelError, match=r"pose = \(\); expected names or patterns"):
        model.compile("spring.*", pose=())


def test_a_system_that_cannot_be_reached_is_told_once():
    model, _ = four_bar(angle=0.8)
    plant = model.compile([], pose="D.rz", relaxed=True)
    with pytest.raises(mv.ModelError, match=r"^variant 0: the loops closed by .* no further"):
        plant.system([1.5])
    np.testing.assert_allclose(plant.system([-0.1]).M, plant([-0.1]).M, rtol=1e-12, atol=0)
    assert isinstance(plant.system([-0.1]), mv.System)
