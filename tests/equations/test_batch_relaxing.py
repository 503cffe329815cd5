"""Variants of connections whose stiffness depends on frequency are computed at once, as each of them is alone."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations.batch_one_by_one import Separating
from mbsvib.errors import ModelError

FACTOR = mv.Dynamic.of_words({"static": 0.9, "viscous": 1e-4, "weights": [0.8, 0.3], "times": [0.02, 1e-3]})
NAMES = ("mount.stiffness.x", "mount.stiffness.rz", "mount.damping.y", "mount.g1", "mount.tau2", "leg.stiffness",
         "leg.damping", "leg.g2", "leg.tau1", "coil.stiffness", "coil.damping", "coil.g1", "coil.tau2")  # fmt: skip
KEYS = ("M", "C", "K", "B", "Cq", "Cv")


def scene(gravity=None, stiffness=(6e3, 4e3, 0.0, 30.0, 0.0, 50.0), **leg):
    """Two bodies with a mount of two idle directions, a leg and a torsion spring between them."""
    model = mv.Model("scene", gravity=gravity)
    model.add_body("b", 2.0, (0.01, 0.02, 0.03), position=(0.1, 0.2, 0.3))
    model.add_body("c", 1.0, (0.02, 0.02, 0.03), position=(0.4, 0.2, 0.3))
    model.add_bushing("base", "ground", "b", (0, 0, 0), (1e4, 1e4, 1e4, 100, 100, 100))
    model.add_bushing("soft", "b", "c", (0.3, 0.2, 0.3), (1e3, 1e3, 1e3, 10, 10, 10))
    model.add_bushing("mount", "b", "c", (0.3, 0.1, 0.3), stiffness, (1, 2, 0, 0.1, 0, 0.2), (0.1, 0.2, 0.3),
                      dynamic=FACTOR)  # fmt: skip
    model.add_spring("leg", "c", "ground", (0.5, 0.2, 0.3), (0.6, 0.1, -0.4), 3e3, 2.0, dynamic=FACTOR, **leg)
    model.add_torsion_spring("coil", "b", "c", (0.3, 0.4, 0.8), 70.0, 0.3, dynamic=FACTOR)
    model.add_input("F", "b", "x")
    model.add_output("x", "c", (1, 2, 3))
    for name, direction in (("mount", (1, 2, 3, 0.1, 0.2, 0.3)), ("leg", "z"), ("coil", "rz")):
        model.add_force_output(f"f.{name}", name, direction)
    return model


def variants(model, names=NAMES, count=4):
    rng = np.random.default_rng(3)
    return {name: model.parameters[name] * rng.uniform(0.7, 1.4, count) for name in names}


def alone(model, values, i):
    return model.with_values({name: float(array[i]) for name, array in values.items()}).linearize()


def same(batch, model, values):
    for i in range(len(next(iter(values.values())))):
        one = alone(model, values, i)
        for key in KEYS:
            expected = getattr(one, key)
            size = np.abs(expected).max(initial=0.0)
            np.testing.assert_allclose(getattr(batch[i], key), expected, rtol=1e-12, atol=1e-12 * size)


@pytest.mark.few(1)
@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("names", [NAMES, *[(name,) for name in NAMES], ("soft.stiffness.x", "leg.g1")])
def test_at_once_they_are_as_alone(names):
    model = scene()
    values = variants(model, names)
    same(model.linearize(values=values), model, values)


@pytest.mark.usefixtures("at_once")
def test_inertia_and_places_vary_beside_them_at_once(monkeypatch):
    """What relaxes has no mass, whatever the bodies weigh and wherever they are."""
    model = scene()
    values = {name: model.parameters[name] * np.array([1.0, 0.95, 0.9]) for name in ("b.mass", "b.inertia.zz")}
    values["b.position.x"] = model.parameters["b.position.x"] + np.array([0.0, 0.01, -0.02])
    values["mount.stiffness.x"] = model.parameters["mount.stiffness.x"] * np.array([1.0, 1.2, 0.7])
    same(model.linearize(values=values), model, values)
    monkeypatch.setattr(Separating, "separated", None)
    model.linearize(values=values)


@pytest.mark.slow
@pytest.mark.usefixtures("at_once")
def test_compiled_plants_and_their_derivatives():
    model = scene()
    plant = model.compile(parameters=list(NAMES))
    point = np.array([model.parameters[name] for name in plant.names])
    step = 1e-4
    for k, name in enumerate(plant.names):
        sides = []
        for side in (-1.0, 1.0):
            at = point.copy()
            at[k] *= 1.0 + side * step
            sides.append(plant(at))
        tangent = plant.tangent(point, np.eye(len(point))[k])
        for key in ("C", "K", "Cq", "Cv"):
            difference = (getattr(sides[1], key) - getattr(sides[0], key)) / (2.0 * step * point[k])
            size = max(np.abs(difference).max(), 1e-6 * np.abs(getattr(sides[0], key)).max() / point[k])
            np.testing.assert_allclose(getattr(tangent, key) / size, difference / size, rtol=0.0, atol=1e-6,
                                       err_msg=f"{name} {key}")  # fmt: skip


@pytest.mark.parametrize("what", ["loaded", "free length", "from zero"])
def test_where_more_follows_them_they_are_taken_one_by_one(what):
    """Forces at the pose, and rows that the model as described has not."""
    names = NAMES
    if what == "free length":
        model = mv.Model("leg")
        model.add_body("b", 2.0, (1, 1, 1), position=(0, 0, 0.5))
        model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
        model.add_spring("k", "ground", "b", (0, 0, 0), (0, 0, 0.5), 900.0, free_length=0.5, dynamic=FACTOR)
        names = ("k.g1", "k.stiffness")
    elif what == "loaded":
        model = mv.Model("leg", gravity=(0, 0, -9.81))
        model.add_body("b", 2.0, (1, 1, 1), position=(0.1, 0, 0.5))
        model.add_joint("j", "revolute", "ground", "b", (0, 0, 0.5), axis=(0, 1, 0))
        model.add_spring("k", "ground", "b", (0.1, 0, 0), (0.1, 0, 0.5), 900.0, preload=-2 * 9.81, dynamic=FACTOR)
        names = ("k.g1", "k.stiffness")
    else:
        model = scene()
    values = variants(model, names)
    if what == "from zero":
        values["mount.stiffness.z"] = np.array([0.0, 1e3, 2e3, 3e3])
        with pytest.raises(ModelError, match=r"massless|without mass"):
            model.linearize(values=values)
        return
    same(model.linearize(values=values), model, values)


def test_wrong_values_are_refused_by_name():
    with pytest.raises(ModelError, match="'leg'"):
        scene().linearize(values={"leg.stiffness": [1e3, -1e3]})
    with pytest.raises(ModelError, match=r"Dynamic.*times|tau"):
        scene().linearize(values={"coil.tau1": [0.1, 0.0]})
