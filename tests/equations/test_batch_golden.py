"""Batches of the golden scenes: three variants in all kinds of parameters, each as it is by itself."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations import batch_assembly, loaded
from tests.api.test_plant_poses import welded_linkage
from tests.golden.store import scenes
from tests.responses.test_driven_joints import QUANTITIES, arm
from tests.support.loaded_models import loaded as loaded_model

KEYS = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D", "gyroscopic", "circulatory", "null_inertia")
COUNT = 3
# Loops that any other geometry locks: each of these variants is refused by itself.
LOCKED = ("hunt_174", "hunt_322", "hunt_33", "library_slider_crank")


def other_values(model, rng, share):
    """Values near those of the model, of some of its parameters."""
    own = [name for name in model.parameters if name.partition(".")[0] not in model.composed]
    names = [name for name in own if rng.random() < share] or own[:1]
    result = {}
    for name in names:
        value = model.parameters[name]
        size = abs(value) or 0.05
        spread = 0.001 * value if "inertia" in name else 0.05 * size
        if value or not any(word in name for word in ("damping", "mass")):  # all motions keep their mass and dampers
            result[name] = value + spread * rng.uniform(-1.0, 1.0, COUNT)
    return result


@pytest.fixture
def unbalanced(monkeypatch):
    """Let poses off balance pass: what is compared is the statement of their forces."""
    monkeypatch.setattr(loaded, "check_balance", lambda *_: None)


def cases():
    """All scenes; of those with beams and superelements, these stay as they are."""
    return [name for name in scenes() if name not in LOCKED]


@pytest.mark.few(3)
@pytest.mark.parametrize("name", cases())
@pytest.mark.usefixtures("unbalanced")
def test_variants_are_those_of_single_models(name):
    model, rng = mv.load(scenes()[name]), np.random.default_rng(11)
    compared = 0
    for few in (3, 8, 16):
        values = other_values(model, rng, few / len(model.parameters))
        if not values:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                nominal = model.linearize(method="dense")
                singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize(
                    independent=nominal.coordinates, method="dense") for i in range(COUNT)]  # fmt: skip
            except mv.errors.MbsvibError:
                continue
            batch = model.linearize(values=values)
        for i, single in enumerate(singles):
            assert_same(batch[i], single)
        compared += 1
    assert compared or model.composed, name


@pytest.mark.parametrize("kind", ["x rx rz", "universal"])
@pytest.mark.usefixtures("unbalanced")
def test_axes_of_a_cut_joint_that_couplers_measure(kind):
    model = loaded_model(3, bodies=3, loops=1, couplers=1, kinds=("free",), closing_kinds=(kind,))
    axes = [name for name in model.parameters if name.startswith("j3.orientation")]
    values = {name: [0.01 * k, -0.02 * k] for k, name in enumerate(axes, 1)}
    batch = model.linearize(values=values, cut=["j3"])
    for i in range(2):
        single = model.with_values({name: array[i] for name, array in values.items()})
        assert_same(batch[i], single.linearize(independent=batch.coordinates, cut=["j3"]))


def assert_same(system, single):
    assert system.coordinates == single.coordinates
    for key in KEYS:
        result, expected = getattr(system, key), getattr(single, key)
        if result is None or expected is None:
            left = expected if result is None else result
            assert left is None or np.abs(left).max() < 1e-13 * np.abs(single.K).max(), key
            continue
        allowed = 1e-11 * np.abs(expected).max(initial=0.0)
        np.testing.assert_allclose(result, expected, rtol=0, atol=allowed, err_msg=key)
    symmetric = system.K if system.circulatory is None else system.K - system.circulatory
    of_rows = system.elastic_rows.T @ (system.row_stiffness[:, None] * system.elastic_rows)
    np.testing.assert_allclose(of_rows, symmetric, rtol=0, atol=1e-13 * np.abs(symmetric).max(initial=1e-300))


def everything():
    """Two bodies with one element of each kind, under gravity and loads, in a loop."""
    model = mv.Model("everything", gravity=(0.0, 0.0, -9.81))
    model.add_body("a", 2.0, (1, 1, 1), position=(0, 0, 1))
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 2))
    model.add_bushing("foot", "ground", "a", (0, 0, 0), (1e4, 1e4, 1e4, 1e3, 1e3, 1e3), preload=(0, 0, 29.43, 0, 0, 0))
    model.add_joint("hinge", "revolute", "a", "b", (0, 0, 1.5), axis=(1, 0, 0))
    model.add_joint("slider", "point_on_plane", "ground", "b", (0, 0, 2), axis=(1, 0, 0))
    model.add_bushing("back", "a", "b", (0, 0, 1.5), np.diag((0, 0, 0, 900.0, 900.0, 900.0)))
    model.add_torsion_spring("twist", "a", "b", axis=(1, 0, 0), stiffness=10.0, preload=0.0)
    model.add_spring("stay", "ground", "b", (0, 0, 5), (0, 0, 2), 50.0, preload=0.0)
    model.add_inerter("flywheel", "a", "b", (0, 0, 1), (0, 1, 2), 0.1)
    model.add_rotor("wheel", "a", 30.0, (0, 0, 1), inertia=0.2)
    model.add_load("push", "a", force=(0, 0, 1.0))
    model.add_load("pull", "a", force=(0, 0, -1.0))
    model.add_maxwell("oil", "ground", "a", (1, 0, 0), (0, 0, 1), 300.0, 20.0, static_stiffness=40.0)
    model.add_input("F", "b", "y")
    model.add_base_motion("quake", "y")
    model.add_output("y", "b", "y")
    model.add_output("acceleration", "b", "y", quantity="acceleration")
    for element in ("foot", "back", "twist", "stay", "flywheel", "oil", "hinge", "slider", "a", "ground"):
        model.add_force_output(f"force in {element}", element, "rx" if element in ("back", "twist") else "z")
    return model


def test_other_parts_vary_beside_beams_all_at_once(monkeypatch):
    model = mv.library.cantilever()
    values = {f"tip.inertia.{axis}": [1.0, 1.5, 2.0] for axis in ("xx", "yy", "zz")}
    values["tip.mass"] = [900.0, 800.0, 1200.0]
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(3)]

    def refuse(*_):
        raise AssertionError("one variant after the other")

    monkeypatch.setattr(batch_assembly, "one_by_one", refuse)
    batch = model.linearize(values=values)
    for system, single in zip(batch, singles, strict=True):
        assert_same(system, single)


@pytest.mark.filterwarnings("ignore:.*does not determine the outputs")
def test_forces_of_least_norm_all_at_once(monkeypatch):
    """In a planar linkage of revolute joints, which is redundant in space."""
    model = mv.library.hoeken()
    for joint in list(model.joints):
        for direction in ("x", "y", "z", "rx"):
            model.add_force_output(f"{joint}.F{direction}", joint, direction)
    where = model.bodies["link2"].position
    model.add_bushing("k", "ground", "link2", where, (1e3, 2e3, 0.0, 0.0, 0.0, 5.0), damping=(3.0,) * 6)
    values = {name: model.parameters[name] * np.array([0.8, 1.1, 1.3]) for name in model.parameters
              if name.endswith((".mass", ".stiffness.x", ".stiffness.y")) and model.parameters[name]}  # fmt: skip
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(3)]

    def refuse(*_):
        raise AssertionError("one variant after the other")

    monkeypatch.setattr(batch_assembly, "one_by_one", refuse)
    batch = model.linearize(values=values)
    for system, single in zip(batch, singles, strict=True):
        assert_same(system, single)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*does not determine the outputs")
@pytest.mark.usefixtures("unbalanced")
def test_forces_of_least_norm_follow_places_and_loads(monkeypatch):
    """Across the plane of a loaded linkage only least norm says which pin carries what; also its derivative."""
    model = mv.library.four_bar()
    for joint in "ABC":
        for direction in ("y", "z", "rx", "rz"):
            model.add_force_output(f"{joint}.F{direction}", joint, direction)
    names = ["crank.position.y", "A.position.y", "crank.mass"]
    plant = model.compile(names)
    values = plant.nominal + np.array([[0.0, 0.0, 0.0], [0.02, -0.03, 0.1], [-0.01, 0.04, 0.3]])
    singles = [model.with_values(dict(zip(names, row.tolist(), strict=True))).linearize(independent=plant.coordinates)
               for row in values]  # fmt: skip
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    for system, single in zip(plant(values), singles, strict=True):
        assert_same(system, single)
    direction, step = np.array([0.3, -0.2, 0.1]), 1e-5
    tangent = plant.tangent(values[1], direction)
    ends = [plant(values[1] + sign * step * direction) for sign in (1.0, -1.0)]
    for key in ("Cq", "Ca", "D"):
        difference = (getattr(ends[0], key) - getattr(ends[1], key)) / (2.0 * step)
        np.testing.assert_allclose(getattr(tangent, key), difference, rtol=0, atol=1e-7 * np.abs(difference).max())


@pytest.mark.filterwarnings("ignore:.*does not determine the outputs")
@pytest.mark.usefixtures("unbalanced")
def test_points_of_welds_vary_at_once(monkeypatch):
    """Moments in them are about their own points."""
    model = welded_linkage()
    values = {name: model.parameters[name] + np.array([0.0, 0.1]) for name in ("weld.position.x", "weld.position.z")}
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(2)]
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    for system, single in zip(model.linearize(values=values), singles, strict=True):
        assert_same(system, single)
    assert np.abs(singles[0].Cq - singles[1].Cq).max() > 0.1


def test_sums_of_forces_on_bodies_beside_beams_all_at_once(monkeypatch):
    """The mass of beams acts on the bodies at their ends, also where the ground moves."""
    model = mv.library.cantilever()
    model.add_base_motion("quake", "z")
    for body in ("tip", "ground"):
        model.add_force_output(f"{body}.Fz", body, "z")
        model.add_force_output(f"{body}.Mx", body, "rx")
    values = {"tip.mass": [900.0, 800.0, 1200.0], "tip.position.y": np.array([0.0, 0.1, 0.3])}
    values["tip.position.y"] = values["tip.position.y"] + model.bodies["tip"].position[1]
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(3)]
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    for system, single in zip(model.linearize(values=values), singles, strict=True):
        assert_same(system, single)


@pytest.mark.parametrize("gravity", [None, (0.0, 0.0, -9.81)])
@pytest.mark.parametrize("order", range(3))
@pytest.mark.usefixtures("unbalanced")
def test_driven_coordinates_all_at_once(order, gravity, monkeypatch):
    model = arm(quantity=QUANTITIES[order], gravity=gravity)
    values = {name: model.parameters[name] * np.array([1.0, 1.1]) for name in (
        "upper.mass", "fore.mass", "flex.stiffness.ry", "tip.damping", "wheel.speed")}  # fmt: skip
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(2)]
    monkeypatch.setattr(batch_assembly, "one_by_one", None)
    batch = model.linearize(values=values)
    for system, single in zip(batch.ends, singles, strict=True):
        assert_same(system, single.ends)
        for each in (system, single.ends):
            assert each.provenance.reduction.matrix.shape == (2, 1)


def test_no_kind_of_element_is_linearized_one_variant_after_the_other(monkeypatch):
    model = everything()
    values = {"foot.stiffness.x": [1e4, 2e4], "back.stiffness.rx": [900.0, 800.0], "twist.stiffness": [10.0, 20.0],
              "stay.stiffness": [50.0, 60.0], "flywheel.inertance": [0.1, 0.2], "wheel.speed": [30.0, -90.0],
              "push.force.z": [1.0, 2.0], "pull.force.z": [-1.0, -2.0], "a.inertia.xx": [1.0, 0.9]}  # fmt: skip
    singles = [model.with_values({key: array[i] for key, array in values.items()}).linearize() for i in range(2)]

    def refuse(*_):
        raise AssertionError("one variant after the other")

    monkeypatch.setattr(batch_assembly, "one_by_one", refuse)
    batch = model.linearize(values=values)
    for system, single in zip(batch, singles, strict=True):
        assert_same(system, single)
    assert batch[1].explain() == singles[1].explain()
