"""Variants of beams and flexures with other materials, sections, damping and places are computed at once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.errors import ModelError
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import Variants

STEEL, COUNT = {"E": 2e11, "rho": 7800.0, "nu": 0.3}, 4
SECTIONS = {
    "properties": {"A": 1e-3, "Iy": 2e-7, "Iz": 1e-7, "J": 2.5e-7, "ky": 0.8, "kz": 0.7},
    "circle": {"type": "circle", "radius": 0.02},
    "tube": {"type": "tube", "radius": 0.02, "wall": 0.003, "ky": 0.5},
    "rectangle": {"type": "rectangle", "width": 0.03, "height": 0.02},
}
SHAPES = {
    "leaf": {"type": "leaf", "length": 0.05, "width": 0.02, "thickness": 0.001},
    "notch": {"type": "notch", "radius": 0.004, "width": 0.02, "thickness": 0.001},
    "elliptic": {"type": "elliptic", "length": 0.01, "depth": 0.003, "width": 0.02, "thickness": 0.001},
    "corner_filleted": {"type": "corner_filleted", "length": 0.012, "radius": 0.003, "width": 0.02,
                        "thickness": 0.001},
}  # fmt: skip
KEYS = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")


def beam(kind, material=STEEL, shear=True, gravity=None, **damping):
    """Two bodies on a bent beam with a free joint between them, so that a loop is closed by it."""
    model = mv.Model("beam", gravity=gravity)
    model.add_body("tip", 3.0, (0.1, 0.2, 0.3), position=(1.0, 0.2, 0.1))
    model.add_beam("bar", "ground", "tip", SECTIONS[kind], material, nodes=[(0, 0, 0), (0.4, 0, 0), (0.8, 0.2, 0.1)],
                   shear=shear, y_axis=(0.1, 1, 0.3), **damping)  # fmt: skip
    model.add_spring("line", "ground", "tip", (0, 0.5, 0), (0.8, 0.2, 0.1), 1e5, 3.0)
    return with_ports(model, "bar.e2")


def flexure(kind, material=STEEL, shear=False, gravity=None, **damping):
    """A stage on two flexures of different widths, of which the second one closes a loop."""
    model = mv.Model("flexure", gravity=gravity)
    model.add_body("tip", 3.0, (0.1, 0.2, 0.3), position=(0.02, 0, 0.05))
    model.add_flexure("bar", "ground", "tip", SHAPES[kind], material, (0, 0, 0), ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
                      shear=shear, **damping)  # fmt: skip
    model.add_flexure("other", "ground", "tip", SHAPES["leaf"], material, (0.0, 0.0, 0.1))
    return with_ports(model, "bar.e1")


def columns(kind, material=STEEL, shear=True, gravity=None, **damping):
    """A body on a vertical beam between two ends and on one along an axis, with a beam that has a free end."""
    model = mv.Model("columns", gravity=gravity)
    model.add_body("tip", 3.0, (0.1, 0.2, 0.3), position=(0.1, 0.0, 0.55))
    section = SECTIONS[kind]
    model.add_beam("bar", "ground", "tip", section, material, (0, 0, 0), (0, 0, 0.5), elements=2, y_axis=(0, 1, 0),
                   shear=shear, **damping)  # fmt: skip
    model.add_beam("axis", "ground", "tip", section, material, (0.2, 0.1, 0), axis=(0.1, 0, 1), length=0.5, elements=1,
                   y_axis=(0.2, 1, 0), shear=shear, **damping)  # fmt: skip
    model.add_beam("free", "tip", None, section, material, (0.2, 0, 0.5), (0.4, 0.3, 0.6), elements=2, shear=shear,
                   **damping)  # fmt: skip
    model.add_output("end", "free.2", (1, 2, 3))
    return with_ports(model, "bar.e2")


def with_ports(model, element, body="tip"):
    model.add_input("F", body, (1, 2, 3, 0.1, 0.2, 0.3))
    model.add_base_motion("base", (1, 0.3, 0.2))
    model.add_output("x", body, (1, 2, 3))
    model.add_output("a", body, "y", quantity="acceleration")
    model.add_force_output("f", element, (1, 2, 3, 0.1, 0.2, 0.3))
    return model


def scenes():
    """Model, and the names of what varies."""
    for kind in SECTIONS:
        for shear, material in ((True, STEEL), (False, {"E": 7e10, "rho": 2700.0, "G": 2.6e10})):
            yield f"{kind}-{shear}", (beam, kind, material, shear, {"alpha": 0.4, "beta": 1e-4})
    for kind in SHAPES:
        yield kind, (flexure, kind, STEEL, kind == "leaf", {"alpha": 0.4, "beta": 1e-4})
    for kind in ("rectangle", "properties"):
        yield f"{kind} columns", (columns, kind, STEEL, kind == "properties", {"alpha": 0.4, "beta": 1e-4})
    yield "modal", (columns, "tube", STEEL, False, {"damping_ratio": 0.02})
    yield "modal leaf", (flexure, "leaf", STEEL, True, {"damping_ratio": 0.02})


CASES = dict(scenes())


def case(name):
    build, kind, material, shear, damping = CASES[name]
    model = build(kind, material, shear, **damping)
    return model, [full for full in model.parameters if full.startswith(("bar.", "axis.", "free."))
                   and (model.parameters[full] or is_place(model, full))]  # fmt: skip


def is_place(model, name):
    return model.parameters.entry(name).field in {"start", "end", "position", "orientation"}


def scattered(model, names, rng):
    """Values of some numbers by name, places within 2 mm or 2 mrad."""
    return {one: model.parameters[one] + rng.uniform(-2e-3, 2e-3, COUNT) if is_place(model, one) else
            model.parameters[one] * rng.uniform(0.8, 1.25, COUNT) for one in names}  # fmt: skip


def check_alone(model, values):
    """Compare a batch, and a plant with one variant after the other, with models by themselves."""
    batch, plant = model.linearize(values=values), model.compile(list(values))
    for i in range(len(batch)):
        chosen = {one: float(array[i]) for one, array in values.items()}
        alone, single = model.with_values(chosen).linearize(), plant(list(chosen.values()))
        for key in KEYS:
            expected = getattr(alone, key)
            size = np.abs(expected).max(initial=0.0)
            assert_allclose(getattr(batch[i], key), expected, rtol=1e-12, atol=1e-13 * size, err_msg=key)
            assert_allclose(getattr(single, key), expected, rtol=1e-12, atol=1e-13 * size, err_msg=key)


def check_tangents(model, names):
    """Compare complex steps with differences of fourth order of models by themselves."""
    plant, step = model.compile(names), 1e-3
    sizes = [0.02 if is_place(model, one) else model.parameters[one] for one in names]
    rates = sizes * np.random.default_rng(5).uniform(-1.0, 1.0, len(names))
    tangent = plant.tangent(plant.nominal, rates)

    def at(share):
        return model.with_values(dict(zip(names, (plant.nominal + share * rates).tolist(), strict=True))).linearize()

    systems = {share: at(share * step) for share in (-2, -1, 1, 2)}
    for key in KEYS:
        far, near = (getattr(systems[k], key) - getattr(systems[-k], key) for k in (2, 1))
        expected = (8.0 * near - far) / (12.0 * step)
        assert_allclose(getattr(tangent, key), expected, atol=3e-9 * max(np.abs(getattr(at(0.0), key)).max(), 1e-300))


@pytest.mark.few(2)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("name", CASES)
def test_at_once_they_are_as_alone(name):
    model, names = case(name)
    assert len(names) >= 5
    values = scattered(model, names, np.random.default_rng(4))
    values["tip.mass"] = np.linspace(1.0, 4.0, COUNT)
    values["tip.position.y"] = np.linspace(-0.1, 0.1, COUNT)
    check_alone(model, values)


@pytest.mark.few(2)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("name", CASES)
def test_their_tangents_are_slopes_between_variants(name):
    model, names = case(name)
    check_tangents(model, names)


@pytest.mark.few(1)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("build", [lambda: columns("tube"), lambda: loaded_beam("tube"), lambda: flexure("leaf")])
def test_damping_and_poissons_ratio_begin_at_zero(build):
    model = build().with_values({"bar.nu": 0.0})
    names = ["bar.alpha", "bar.beta", "bar.damping_ratio", "bar.nu"]
    check_alone(model, {name: scale * np.array([0.0, 1.0, 0.5]) for name, scale in zip(names, (0.3, 1e-4, 0.02, 0.3),
                                                                                       strict=True)})  # fmt: skip
    plant, rates = model.compile(names), np.array([0.3, 1e-4, 0.02, 0.0])
    tangent = plant.tangent(plant.nominal, rates)
    for key in ("M", "C", "K"):  # linear in all of them
        slope = getattr(plant(rates), key) - getattr(plant(np.zeros(4)), key)
        assert_allclose(getattr(tangent, key), slope, atol=1e-11 * np.abs(getattr(plant(rates), key)).max())


def test_what_else_varies_is_computed_alone():
    """Axes that jump, and strain that follows the section."""
    model = beam("tube")
    model.add_beam("upright", "tip", None, SECTIONS["rectangle"], STEEL, (1, 0.2, 0.1), (1, 0.2, 0.5), elements=1)
    assert model.compile(["upright.end.x"])._plan.one_by_one
    check_alone(model, {"upright.end.x": np.array([1.0, 1.1])})
    model = beam("circle")
    model.add_strain_output("eps", "bar.e1")
    assert model.compile(["bar.radius"])._plan.one_by_one
    assert not model.compile(["tip.mass"])._plan.one_by_one


@pytest.mark.parametrize(("model", "name", "values", "message"), [
    (beam("tube"), "bar.wall", [0.003, 0.03], r"variant 1: .*wall = 0\.03"),
    (beam("tube"), "bar.E", [1e11, -1e11], r"variant 1: .*E = -100000000000"),
    (flexure("leaf"), "bar.thickness", [1e-3, 0.03], r"variant 1: .*at most the width"),
    (flexure("notch"), "bar.thickness", [1e-3, 1e-7], r"variant 1: .*of the depth of the cuts"),
    (columns("tube"), "bar.end.z", [0.5, 0.0], r"variant 1: .*A beam needs a length"),
    (columns("tube"), "axis.length", [0.5, -0.5], r"variant 1: .*a positive number"),
])  # fmt: skip
def test_what_one_cannot_have_is_refused_by_its_number(model, name, values, message):
    with pytest.raises(ModelError, match=message):
        model.linearize(values={name: np.array(values)})


def test_shafts_between_spinning_bodies_stay_axisymmetric():
    """A batch refuses what a model by itself does."""
    model = mv.Model("shaft")
    for k, x in ((1, 0.0), (2, 0.3)):
        model.add_body(f"disk{k}", 2.0, (0.02, 0.01, 0.01), (x, 0, 0))
        model.add_bushing(f"bearing{k}", "ground", f"disk{k}", (x, 0, 0), (1e6, 1e5, 1e5, 0, 0, 0))
        model.add_rotor(f"spin{k}", f"disk{k}", 100.0, (1, 0, 0))
    section = {"A": 1e-4, "Iy": 1e-9, "Iz": 1e-9, "J": 2e-9}
    model.add_beam("shaft", "disk1", "disk2", section, STEEL, (0, 0, 0), (0.3, 0, 0), elements=1)
    for name, values in (("shaft.Iy", [1e-9, 2e-9]), ("shaft.end.y", [0.0, 0.01])):
        with pytest.raises(ModelError, match=r"variant 1: rotor 'spin1': 'shaft.e1'"):
            model.linearize(values={name: values})


def loaded_beam(kind="tube", gravity=(1.0, -2.0, -9.0), **damping):
    """A chain of two beams and a hinge under weights, a load and a preloaded spring."""
    model = beam(kind, gravity=gravity, **damping)
    model.add_body("end", 1.0, (0.1, 0.1, 0.1), position=(1.5, 0.4, 0.2))
    model.add_beam("rod", "tip", "end", SECTIONS["circle"], STEEL, start=(1.0, 0.2, 0.1), end=(1.5, 0.4, 0.2),
                   elements=3, shear=True)  # fmt: skip
    model.add_load("push", "end", force=(50.0, 20.0, -30.0), torque=(1.0, 2.0, 3.0))
    model.add_spring("pull", "ground", "end", (2.0, 0.0, 1.0), (1.5, 0.4, 0.2), 1e4, preload=-40.0)
    return model


def loaded_loop(kind="leaf"):
    """A stage on two flexures, statically indeterminate under its weight."""
    model = flexure(kind, gravity=(-9.0, 1.0, -2.0))
    model.add_load("push", "tip", force=(5.0, -2.0, -3.0))
    return model


def loaded_crank():
    """A beam in a loop of hinges, whose forces are those of least energy along the coordinate that is left."""
    model = mv.Model("crank", gravity=(0.0, 0.0, -9.81))
    for name, at in (("a", (0.0, 0.0, 0.5)), ("b", (1.0, 0.0, 0.5))):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), position=at)
        model.add_joint(f"{name}.hinge", "revolute", "ground", name, (at[0], 0, 0), axis=(0, 1, 0))
        model.add_bushing(f"{name}.k", "ground", name, (at[0], 0, 0), (0, 0, 0, 0, 2e3, 0))
    model.add_beam("bar", "a", "b", SECTIONS["rectangle"], STEEL, start=(0, 0, 1), end=(1, 0, 1), elements=2)
    return with_ports(model, "bar.e2", "b")


LOADED = {
    "chain": (loaded_beam, ("bar.E", "bar.wall", "bar.rho", "bar.nu", "rod.radius", "rod.rho", "gravity.x", "gravity.z",
                            "push.force.x", "push.torque.y", "pull.preload", "tip.mass", "tip.position.y",
                            "line.stiffness", "rod.start.y", "rod.end.x", "rod.end.z")),
    "leaf": (loaded_loop, ("bar.E", "bar.thickness", "bar.width", "bar.rho", "other.thickness", "gravity.x",
                           "push.force.z", "tip.mass", "bar.length", "other.position.x", "bar.orientation.ry")),
    "notch": (lambda: loaded_loop("notch"), ("bar.E", "bar.thickness", "bar.rho", "gravity.x", "tip.position.x",
                                             "bar.radius", "bar.position.z", "other.length")),
    "crank": (loaded_crank, ("bar.E", "bar.width", "bar.rho", "a.mass", "gravity.z", "a.k.stiffness.ry")),
}  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("name", LOADED)
def test_loaded_ones_are_as_alone(name):
    build, names = LOADED[name]
    model, rng = build(), np.random.default_rng(6)
    check_alone(model, scattered(model, names, rng))


@pytest.mark.few(2)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("name", LOADED)
def test_tangents_of_loaded_ones_are_slopes_between_variants(name):
    build, names = LOADED[name]
    check_tangents(build(), names)


def test_forces_that_are_not_stated_for_variants_are_computed_alone():
    """Beams that are bent in the loaded pose, weights on them, and gravity where the model has none."""
    model = loaded_beam()
    assert not model.compile(["bar.E"])._plan.one_by_one
    bent = model.equilibrium()
    for name in ("bar.E", "tip.mass", "pull.preload", "tip.position.x"):
        assert bent.compile([name])._plan.one_by_one, name
    still = beam("tube", gravity=(0.0, 0.0, 0.0))
    assert still.compile(["gravity.z"])._plan.one_by_one
    check_alone(still, {"gravity.z": np.array([-9.0, -1.0])})


@pytest.mark.usefixtures("at_once")
def test_forces_in_bent_beams_stay_where_nothing_else_loads_them():
    bent = loaded_beam().equilibrium()
    names = ["line.stiffness", "line.damping", "end.inertia.xx"]
    check_alone(bent, {name: bent.parameters[name] * np.array([1.0, 1.2, 0.9]) for name in names})
    check_tangents(bent, names)


@pytest.mark.slow
def test_derivatives_of_bent_beams_are_those_of_differences(monkeypatch):
    """Steps along some parameters leave the others, and the motion of the pose, to differences."""
    system = loaded_beam().equilibrium().linearize()
    names = ["line.stiffness", "line.damping", "end.inertia.xx", "tip.mass"]
    directions = [Direction(name, ((name, 1.0),)) for name in names]
    stepped = Variants(system).slopes(directions)
    monkeypatch.setattr(Variants, "_add_tangents", lambda *_: None)
    differenced = Variants(system).slopes(directions)
    for key in ("M", "C", "K"):
        assert_allclose(stepped[key], differenced[key], rtol=1e-7, atol=1e-9 * np.abs(differenced[key]).max())


def test_forces_of_other_parts_beside_loaded_beams_are_checked():
    """The stiffness of a relaxing spring with a free length changes its force: such a variant is out of balance."""
    model, at = loaded_beam(), (3.5, 0.0, 0.0)
    factor = mv.Dynamic.of_words({"static": 1.0, "viscous": 0.0, "weights": [0.8], "times": [0.02]})
    model.add_body("arm", 1.0, (0.1, 0.1, 0.1), position=(3.0, 0.0, 0.0))
    model.add_joint("pin", "revolute", "ground", "arm", (3.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_spring("rubber", "ground", "arm", (3.5, 0.0, 0.5), at, 1e4, free_length=0.4, dynamic=factor)
    model.add_spring("hold", "ground", "arm", (3.5, 0.0, -0.5), at, 1e4, preload=1e4 * 0.1)
    check_alone(model, {"rubber.stiffness": np.array([1e4, 1e4]), "bar.E": np.array([2e11, 1e11])})
    with pytest.raises(mv.EquilibriumError, match=r"variant 1: .*arm"):
        model.linearize(values={"rubber.stiffness": np.array([1e4, 1.1e4])})
