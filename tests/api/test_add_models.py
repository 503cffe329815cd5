"""Copies of models in models: they move as the original does, wherever they are, and as in a mirror."""

import warnings
from functools import partial

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import mbsvib as mv
from mbsvib.elements.families import FAMILIES
from mbsvib.elements.part import Part
from mbsvib.elements.ports import ForceOutput
from mbsvib.elements.rolling import Rolling
from mbsvib.linalg.rotations import exponential
from tests.hunt.generate import example

OMEGA = np.array([0.7, 11.0, 230.0])
TURN = exponential(np.array((0.4, -0.9, 0.6)))
SHIFT = (0.3, -1.2, 0.7)
# Outputs that are smaller are compared with this: where they measure what does not move, they are rounding.
NOTHING = 1e-6
MIRRORS = (None, "x", "y", "z")
# Two scenes of the hunt that have parts of nearly all families between them.
SOME = (10, 34)


def reflection(mirror):
    return np.diag([-1.0 if axis == mirror else 1.0 for axis in "xyz"])


def copied(model, mirror, **words):
    """A model of one copy, under the gravity that is turned and mirrored along."""
    gravity = None if model.gravity is None else TURN @ reflection(mirror) @ np.array(model.gravity)
    whole = mv.Model("whole", gravity)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.LeftOutWarning)
        whole.add_model("part", model, SHIFT, TURN, mirror=mirror, **words)
    return whole


def hunted(seed):
    found = example(seed)
    return None if found is None or found.error is not None else found.scene.model()


def determined(model):
    """A scene without forces in joints where redundant constraints leave them open."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", mv.UndeterminedForceWarning)
            model.linearize(method="dense")
    except mv.UndeterminedForceWarning:
        kept = {name: part for name, part in model.outputs.items() if not isinstance(part, ForceOutput)}
        return model.with_parts(outputs=kept)
    return model


def compare(model):
    """A scene and its copies answer alike, all inputs and outputs with their signs; False if it has no equations."""
    try:
        model = determined(model)
        expected = model.linearize(method="dense")
    except mv.MbsvibError:
        return False
    for mirror in MIRRORS:
        system = copied(model, mirror).linearize(method="dense")
        assert system.dof == expected.dof
        values = [case.modes().eigenvalues for case in (system, expected)]
        distances = np.abs(values[0][:, None] - values[1])
        assert distances[linear_sum_assignment(distances)].max(initial=0.0) <= 1e-8 * np.abs(values[0]).max(initial=1.0)
        try:
            before, after = (case.frequency_response(OMEGA) for case in (expected, system))
        except mv.MbsvibError:  # improper responses are refused by name
            continue
        size = np.maximum(np.abs(before).max(axis=(1, 2), initial=0.0, keepdims=True), NOTHING)
        np.testing.assert_allclose(after / size, before / size, rtol=0, atol=1e-7)
    return True


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.AccuracyWarning", "ignore::mbsvib.LargeDisplacementWarning")
@pytest.mark.parametrize("seed", SOME)
def test_random_scenes_move_alike_anywhere_and_in_a_mirror(seed):
    assert compare(hunted(seed))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.AccuracyWarning", "ignore::mbsvib.LargeDisplacementWarning")
def test_many_random_scenes_have_parts_of_all_families():
    models = [model for seed in range(60) if (model := hunted(seed)) is not None] + [on_a_road(), on_a_hub()]
    seen = {type(part) for model in models if compare(model)
            for group in model.groups().values() for part in group.values()}  # fmt: skip
    assert seen == {family.part for family in FAMILIES} - {Rolling}  # that of wheels is in tests/rolling


@pytest.mark.slow
def test_a_hub_turns_along_with_a_copy():
    assert compare(on_a_hub())


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.word)
def test_every_family_states_its_copies(family):
    assert family.part.roles or family.part.placed is not Part.placed, "a family states its roles, or placed()"


@pytest.mark.parametrize("mirror", ["w", np.array([1, 0, 0]), ["x"]])
def test_a_plane_that_is_none_is_refused(mirror):
    with pytest.raises(mv.ModelError, match=r"'p': mirror = .*expected 'x', 'y' or 'z'"):
        mv.Model().add_model("p", wheel(), mirror=mirror)


def test_a_part_that_states_none_is_refused_by_name(monkeypatch):
    model = wheel()
    monkeypatch.setattr(type(model.springs["tyre"]), "roles", {})
    with pytest.raises(mv.ModelError, match="spring 'strut': there are no copies of such parts"):
        mv.Model("car").add_model("left", model)


def wheel(y=0.0):
    """A wheel carrier on a swinging arm, below its own ground."""
    model = mv.Model("wheel")
    model.add_body("hub", 20.0, (0.4, 0.7, 0.5, 0.02, 0.03, -0.05), position=(0.02, 0.55 + y, 0.3))
    model.add_joint("pivot", "revolute", "ground", "hub", position=(0, 0.2 + y, 0.3), axis=(1, 0, 0))
    model.add_spring("strut", "ground", "hub", (0, 0.4 + y, 0.8), (0, 0.5 + y, 0.3), stiffness=3e4, damping=2e3)
    model.add_bushing("pad", "ground", "hub", (0.1, 0.5 + y, 0.4),
                      1e3 * (np.diag((9, 8, 7, 0.6, 0.5, 0.4)) + 0.1), orientation=(0.2, 0.1, -0.3))  # fmt: skip
    model.add_spring("tyre", "hub", "ground", (0, 0.55 + y, 0.0), (0, 0.55 + y, -0.1), stiffness=2e5, damping=50.0)
    model.add_input("push", "hub", "z")
    model.add_output("lift", "hub", "z")
    return model


def chassis():
    model = mv.Model("car")
    model.add_body("chassis", 500.0, (120.0, 600.0, 650.0), position=(0, 0, 0.6))
    model.add_bushing("air", "ground", "chassis", (0, 0, 0.6), (4e3, 5e3, 6e3, 700, 900, 800))
    return model


def car():
    model = chassis()
    for name, x in (("front", 1.2), ("rear", -1.3)):
        model.add_model(f"{name}.left", wheel(), (x, 0, 0), ground="chassis")
        model.add_model(f"{name}.right", wheel(), (x, 0, 0), ground="chassis", mirror="y")
    return model


def test_a_mirrored_pair_moves_evenly_or_oddly():
    """Each mode of a car that is symmetric left to right maps to itself or to its negative."""
    modes = car().linearize().modes()
    shapes, signs = modes.body_shapes, np.array((1, -1, 1, -1, 1, -1))
    parity = []
    for k in range(len(modes.frequencies)):
        before = np.concatenate([shapes[name][:, k] for name in ("chassis", "front.left.hub", "rear.left.hub")])
        after = np.concatenate([signs * shapes[name][:, k] for name in ("chassis", "front.right.hub",
                                                                        "rear.right.hub")])  # fmt: skip
        size = np.abs(before).max()
        parity.append(min((1, -1), key=lambda sign: np.abs(after - sign * before).max()))
        np.testing.assert_allclose(after / size, parity[-1] * before / size, rtol=0, atol=1e-8)
    assert sorted(set(parity)) == [-1, 1]
    assert len(parity) == 10


def placed(shift, x, y, z):
    return (1.0 + x, shift + y, z)


def test_copies_equal_a_model_made_by_hand():
    model, hand = chassis(), chassis()
    for name, y in (("one", 0.0), ("two", 0.4)):
        model.add_model(name, wheel(), (1.0, y, 0), ground="chassis")
        at = partial(placed, y)
        hand.add_body(f"{name}.hub", 20.0, (0.4, 0.7, 0.5, 0.02, 0.03, -0.05), position=at(0.02, 0.55, 0.3))
        hand.add_joint(f"{name}.pivot", "revolute", "chassis", f"{name}.hub", at(0, 0.2, 0.3), axis=(1, 0, 0))
        hand.add_spring(f"{name}.strut", "chassis", f"{name}.hub", at(0, 0.4, 0.8), at(0, 0.5, 0.3), 3e4, 2e3)
        hand.add_bushing(f"{name}.pad", "chassis", f"{name}.hub", at(0.1, 0.5, 0.4),
                         1e3 * (np.diag((9, 8, 7, 0.6, 0.5, 0.4)) + 0.1), orientation=(0.2, 0.1, -0.3))  # fmt: skip
        hand.add_spring(f"{name}.tyre", f"{name}.hub", "chassis", at(0, 0.55, 0.0), at(0, 0.55, -0.1), 2e5, 50.0)
        hand.add_input(f"{name}.push", f"{name}.hub", "z", relative_to="chassis")
        hand.add_output(f"{name}.lift", f"{name}.hub", "z", relative_to="chassis")
    systems = model.linearize(), hand.linearize()
    for matrix in ("M", "C", "K", "B", "Cq"):
        values = [getattr(system, matrix) for system in systems]
        np.testing.assert_allclose(*values, rtol=0, atol=1e-13 * np.abs(values[0]).max())
    assert systems[0].coordinates == systems[1].coordinates
    assert model.parameters.keys() == hand.parameters.keys()


def test_nested_copies_and_patterns():
    pair = mv.Model("pair")
    pair.add_model("left", wheel())
    pair.add_model("right", wheel(), mirror="y")
    train = chassis()
    train.add_model("train.axle1", pair, (1, 0, 0), ground="chassis")
    train.add_model("train.axle2", pair, (-1, 0, 0), (0, 0, np.pi), ground="chassis", mirror="x")
    assert "train.axle2.right.hub" in train.bodies
    system = train.linearize()
    assert "train.axle1.left.push" in system.inputs
    softer = train.with_values({"*.strut.stiffness": 1e4})
    assert {part.stiffness for name, part in softer.springs.items() if name.endswith(".strut")} == {1e4}
    assert len([name for name in train.parameters if name.endswith("strut.stiffness")]) == 4
    batch = train.linearize(values={"*.left.strut.stiffness": [1e4, 3e4]})
    np.testing.assert_allclose(batch[1].K, system.K, rtol=1e-12, atol=1e-6)
    sparse = train.linearize(method="sparse")
    np.testing.assert_allclose(sparse.frequency_response([20.0]), system.frequency_response([20.0]), rtol=1e-9,
                               atol=1e-18)  # fmt: skip


def test_files_hold_the_parts_in_full(tmp_path):
    model = car()
    again = mv.load(mv.save(model, tmp_path / "car.yaml"))
    assert all(dict(again.groups()[key]) == dict(group) for key, group in model.groups().items())


def drive():
    """A turn and a slide, coupled in all ways, with what has a sense of rotation."""
    model = mv.Model("drive")
    for name, x in (("screw", 0.0), ("pinion", 0.3), ("nut", 0.6), ("table", 0.9)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.2), position=(x, 0, 0.1))
    model.add_joint("thread", "screw", "ground", "nut", (0.6, 0, 0), axis=(0, 0, 1), pitch=0.01)
    model.add_joint("turn", "revolute", "ground", "screw", (0, 0, 0), axis=(0, 0, 1))
    model.add_joint("wheel", "revolute", "ground", "pinion", (0.3, 0, 0), orientation=(0.1, 0, 0))
    model.add_joint("slide", "prismatic", "ground", "table", axis=(1, 0, 0))
    model.add_gear("gear", "turn", "wheel", -2.0)
    model.add_rack("rack", "wheel", "slide", 0.05)
    model.add_coupler("tie", {"turn": 1.0, "thread": 3.0, "slide": 20.0})
    model.add_rotor("disk", "table", 50.0, (0, 0, 1), 0.01)
    model.add_load("twist", "nut", torque=(0.0, 0.0, 2.0), force=(0, 1, 0), position=(0.6, 0, 0.3))
    model.add_input("torque", "screw", "rz")
    return model


def test_signs_of_what_turns_in_a_mirror():
    model = mv.Model("two")
    model.add_model("m", drive(), mirror="x")
    assert model.joints["m.thread"].pitch == -0.01
    assert model.couplers["m.gear"].ratio == -2.0
    assert model.couplers["m.rack"].radius == -0.05
    assert dict(model.couplers["m.tie"].coefficients) == {"m.turn.rz": 1.0, "m.thread.rz": 3.0, "m.slide.z": -20.0}
    assert model.rotors["m.disk"].axis == (0.0, 0.0, -1.0)
    assert model.loads["m.twist"].torque == (0.0, 0.0, -2.0)
    assert model.loads["m.twist"].position == (-0.6, 0.0, 0.3)
    assert model.inputs["m.torque"].direction == (0.0, 0.0, 0.0, 0.0, 0.0, -1.0)
    np.testing.assert_array_equal(np.array(model.joints["m.slide"].axes)[:, 2], (-1, 0, 0))


def test_preloads_in_a_mirror():
    part, model = wheel(), mv.Model("two")
    part.add_bushing("pressed", "ground", "hub", (0, 0.5, 0.3), (1,) * 6, orientation=(0.3, -0.2, 0.5),
                     preload=(1, 2, 3, 4, 5, 6))  # fmt: skip
    before = np.array(part.springs["pressed"].rest_wrench)
    model.add_model("m", part, SHIFT, TURN, mirror="z")
    expected = TURN @ reflection("z") @ before.reshape(2, 3).T * (1.0, -1.0)
    np.testing.assert_allclose(model.springs["m.pressed"].rest_wrench, expected.T.ravel(), rtol=0, atol=1e-14)


def on_a_hub():
    """A blade and a pendulum that turn about an oblique axis."""
    model = mv.Model("rotor")
    model.add_hub("hub", 20.0, (0.2, -0.1, 1.0), position=(0.05, 0.02, 0.0))
    model.add_body("tip", 0.2, (1.2e-4, 2e-4, 2.9e-4, 1e-5, 0.0, 2e-5), position=(0.5, 0.1, 0.05))
    model.add_beam("blade", "hub", "tip", {"type": "rectangle", "width": 0.02, "height": 0.004},
                   {"E": 7e10, "nu": 0.3, "rho": 2700.0}, (0.05, 0, 0), (0.5, 0.1, 0.05), elements=2, beta=1e-4)
    model.add_input("f", "tip", (0.3, -0.5, 0.8))
    model.add_output("y", "tip", "y")
    model.add_output("v", "tip", (0, 0, 0, 1, 0, 0), quantity="velocity")
    return model


def on_a_road():
    """A wheel whose ground moves at the tyre and, in the axes of the bushing, at the pad."""
    part = wheel()
    part.add_motion_input("road", "tyre")
    part.add_motion_input("shake", "pad", direction="z", quantity="velocity")
    return part


def test_motion_inputs():
    assert compare(on_a_road())


def test_flexures_and_their_forces():
    part = wheel()
    part.add_body("stage", 1.0, (0.1, 0.2, 0.3), position=(0.1, 0.6, 0.5))
    part.add_flexure("leaf", "hub", "stage", {"type": "leaf", "length": 0.05, "width": 0.02, "thickness": 5e-4},
                     {"E": 2e11, "nu": 0.3, "rho": 7800.0}, (0.05, 0.6, 0.4), (0.3, 0.2, -0.4))  # fmt: skip
    for i, name in enumerate(part.composed["leaf"].element_names):
        part.add_force_output(f"force{i}", name, (1, 2, 3, 4, 5, 6))
    assert compare(part)


def test_forces_in_elements_keep_their_signs():
    part = wheel()
    for name, element, direction in (("pull", "strut", "z"), ("press", "pad", (1, 2, 3, 4, 5, 6)),
                                     ("shear", "pivot", (1, 2, 3, 4, 5, 0)), ("all", "ground", (1, 2, 3, 4, 5, 6)),
                                     ("sum", "hub", (1, 2, 3, 4, 5, 6))):  # fmt: skip
        part.add_force_output(name, element, direction)
    part.add_input("turn", "hub", (0, 0, 0, 1, 2, 3))
    assert compare(part)


def test_a_shift_alone_changes_no_axes_and_no_words():
    model = mv.Model("two")
    model.add_model("s", drive(), (0, 0, 2.0))
    assert model.joints["s.turn"].axis == (0.0, 0.0, 1.0)
    assert model.inputs["s.torque"].direction == "rz"
    assert model.bodies["s.nut"].position == (0.6, 0.0, 2.1)


def test_later_changes_of_the_original_do_not_reach_the_copy():
    part, model = wheel(), mv.Model("car")
    names = model.add_model("left", part)
    part.add_body("more", 1.0, (1, 1, 1))
    assert "left.more" not in model.bodies
    assert names == ("left.hub", "left.pivot", "left.strut", "left.pad", "left.tyre", "left.push", "left.lift")


def test_outputs_against_inertial_space_stay_so():
    part = wheel()
    part.add_output("shock", "hub", "z", quantity="acceleration", absolute=True)
    model = chassis()
    model.add_model("left", part, ground="chassis")
    assert model.outputs["left.shock"].relative_to == "ground"
    assert model.outputs["left.lift"].relative_to == "chassis"


def test_beams_strains_and_superelements():
    """A bent beam with a reduced model on its tip, against the original; K of the plate is full."""
    rng = np.random.default_rng(4)
    model = mv.Model("mast")
    model.add_beam("mast", "ground", None, {"type": "rectangle", "width": 0.02, "height": 0.03},
                   {"E": 2e9, "nu": 0.3, "rho": 2700.0}, nodes=[(0, 0, 0), (0.1, 0, 0.4), (0.1, 0.2, 0.9)],
                   y_axis=(0.2, 1.0, 0.1))  # fmt: skip
    rows = rng.normal(size=(14, 14))
    motion = np.zeros((14, 6))
    motion[:6], motion[6:12] = np.eye(6), np.eye(6)
    motion[6:9, 3:] = -np.array([[0, -0.2, 0.1], [0.2, 0, -0.3], [-0.1, 0.3, 0]])
    free = np.eye(14) - motion @ np.linalg.pinv(motion)
    K = 100.0 * free @ rows @ rows.T @ free
    model.add_superelement("plate", np.eye(14), 0.01 * K, 0.5 * (K + K.T), {"a": (0.1, 0.2, 0.9), "b": (0.4, 0.3, 1.1)},
                           bodies={"a": "mast.2"})  # fmt: skip
    model.add_strain_output("strain", "mast.e1", side="z")
    model.add_strain_output("width", "mast.e2", "end", "-y")
    for name, direction in (("F", "x"), ("M", (0, 0, 0, 1, 2, 3))):
        model.add_input(name, "plate.b", direction)
        model.add_output(name, "plate.b", direction)
    assert compare(model)
