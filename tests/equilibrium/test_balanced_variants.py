"""Variants of a model in equilibrium, all at once: as of each by itself, and of a pendulum in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.api.in_equilibrium import batch_in_equilibrium, in_equilibrium
from mbsvib.equations.matrices import MATRICES
from tests.equilibrium.test_moved import four_bar

G = 9.81


def pendulum():
    """A rod that hangs from a torsion spring, which holds it level, its centre of mass at 0.5 m."""
    model = mv.Model("pendulum", gravity=(0.0, 0.0, -G))
    model.add_body("rod", 1.0, (0.01, 0.1, 0.1), (0.5, 0.0, 0.0))
    model.add_joint("pin", "revolute", "ground", "rod", (0.0, 0.0, 0.0), axis=(0, -1, 0))
    model.add_torsion_spring("k", "ground", "rod", (0, -1, 0), 20.0)
    return model.equilibrium(preload="k")


def platform():
    """A plate on four springs, a mount and a leg that slides, turns and swings, under a follower load."""
    model = mv.Model("platform", gravity=(0.0, 0.3, -G))
    model.add_body("plate", 10.0, (0.5, 0.6, 1.0), (0.1, 0.0, 1.0))
    for i, (x, y) in enumerate(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))):
        model.add_spring(f"leg{i}", "ground", "plate", (1.2 * x, 1.1 * y, 0.0), (0.5 * x, 0.5 * y, 0.9), 3000.0, 2.0)
    model.add_body("rod", 1.0, (0.1, 0.1, 0.01), (0.0, 0.0, 0.5))
    model.add_joint("foot", "universal", "ground", "rod", (0.0, 0.0, 0.0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_joint("slide", "cylindrical", "rod", "plate", (0.0, 0.0, 0.8), axis=(0, 0, 1))
    turned = (0.2, 0.1, 0.0)
    model.add_bushing("mount", "ground", "plate", (0.1, 0.2, 1.0), (100, 200, 300, 50, 60, 70), orientation=turned)
    model.add_load("push", "plate", (3.0, 1.0, 2.0), (0.5, 0.4, 0.3), (0.1, 0.2, 1.1), follower=True)
    return model.equilibrium(preload=True)


def loop():
    """A loop of four bars with a redundant axis, under gravity in its plane, on a line spring; a wheel is geared."""
    model, c = four_bar(angle=0.8)
    model.gravity = (0.3, -G, 0.0)
    model.add_body("wheel", 0.5, (0.1, 0.1, 0.2), (2.0, 1.0, 0.0))
    model.add_joint("shaft", "revolute", "ground", "wheel", (2.0, 1.0, 0.0), axis=(0, 0, 1))
    model.add_gear("gear", "A", "shaft", -2.0)
    model.add_load("hang", "wheel", (0.0, -3.0, 0.0), position=(2.2, 1.0, 0.0))
    model.add_spring("s", "ground", "rocker", (1.6, 1.1, 0.0), tuple(c), 500.0, free_length=0.5)
    return model.equilibrium()


CASES = {
    "pendulum": (pendulum, {"rod.mass": [0.8, 1.3], "k.stiffness": [25.0, 18.0]}),
    "platform": (platform, {"plate.mass": [9.9, 10.1], "leg1.stiffness": [2990.0, 3020.0], "gravity.z": [-9.8, -9.82],
                            "mount.stiffness.rx": [48.0, 50.5], "push.force.x": [2.9, 3.1]}),
    "loop": (loop, {"crank.mass": [0.9, 1.2], "s.free_length": [0.49, 0.505]}),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", CASES)
def test_variants_are_those_balanced_one_by_one(name):
    make, values = CASES[name]
    model = make()
    arrays = {key: np.array(value, dtype=float) for key, value in values.items()}
    batch = batch_in_equilibrium(model, arrays)
    for i in range(2):
        own = {key: float(array[i]) for key, array in arrays.items()}
        there, expected = in_equilibrium(model.with_values(own), independent=batch.coordinates)
        assert there.bodies != model.bodies
        for key in MATRICES:
            found, wanted = getattr(batch, key)[i], getattr(expected, key)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max(initial=1e-300))


def test_pendulum_that_sags():
    masses = np.array([1.0, 1.2, 1.5])
    batch = batch_in_equilibrium(pendulum(), {"rod.mass": masses})
    for k, mass in zip(batch.K[:, 0, 0], masses.tolist(), strict=True):
        # the preload balances 1 kg
        angle = brentq(lambda q, m=mass: 0.5 * G - 20.0 * q - 0.5 * m * G * np.cos(q), -1.0, 1.0, xtol=1e-15)
        assert k == pytest.approx(20.0 - 0.5 * mass * G * np.sin(angle), rel=1e-12)


@pytest.mark.slow
def test_sweeps_balance_variants_at_once(monkeypatch):
    values = {"rod.mass": [1.0, 1.2, 1.5], "k.stiffness": [20.0, 24.0]}
    one_by_one = mv.sweep(pendulum(), values, {"f": lambda system: system.modes().frequencies}, workers=1)
    monkeypatch.setattr("mbsvib.studies.plants.in_equilibrium", None)
    assert mv.sweep(pendulum(), values, "modes.frequencies", workers=1)["modes.frequencies"] == pytest.approx(
        one_by_one["f"], rel=1e-11)  # fmt: skip


@pytest.mark.slow
def test_variants_that_would_snap_are_left_to_the_search():
    model = pendulum()
    with pytest.raises(mv.EquilibriumError, match=r"^variant 1: Newton's method does not contract"):
        batch_in_equilibrium(model, {"rod.mass": np.array([1.1, 30.0])})
    swept = mv.sweep(model, {"rod.mass": [1.1, 30.0]}, "modes.frequencies")
    for f, mass in zip(swept["modes.frequencies"][:, 0], (1.1, 30.0), strict=True):
        own = in_equilibrium(model.with_values({"rod.mass": mass}))[1]
        assert f == pytest.approx(own.modes().frequencies[0], rel=1e-11)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_arches_of_any_size_are_balanced_or_left_to_the_search(size):
    """Under 60 N, beyond its limit, a full step of Newton's method ends behind the snap, where steps contract again."""
    model = mv.Model("arch")
    model.add_body("crown", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.2 * size))
    model.add_joint("rail", "prismatic", "ground", "crown", axis=(0, 0, 1))
    for name, x in (("left", -size), ("right", size)):
        model.add_spring(name, "ground", "crown", (x, 0, 0), (0, 0, 0.2 * size), 1000.0 / size)
    model.add_load("weight", "crown", force=(0, 0, -0.01))
    model = model.equilibrium()
    free = np.hypot(1.0, 0.2)
    z = brentq(lambda z: 2000.0 * (free / np.hypot(1.0, z) - 1.0) * z - 1.0, 0.15, 0.2, xtol=1e-16)
    batch = batch_in_equilibrium(model, {"weight.force.z": np.array([-1.0])})
    stiffness = 2000.0 * (1.0 - free / np.hypot(1.0, z) ** 3) / size
    assert batch.K[0, 0, 0] == pytest.approx(stiffness, rel=1e-11)
    with pytest.raises(mv.EquilibriumError, match=r"^variant 1: Newton's method does not contract"):
        batch_in_equilibrium(model, {"weight.force.z": np.array([-1.0, -60.0])})


@pytest.mark.slow
def test_variants_whose_column_buckles_are_refused():
    """Upright, the column is in balance: 3 kg 0.5 m above its pin are more than its spring holds, as the search says.

    An arm beside it turns by 1 rad per N m, as a step does that assumes a stiffness of one in place of a negative one.
    """
    model = mv.Model("column", gravity=(0.0, 0.0, -G))
    model.add_body("column", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.5))
    model.add_joint("pin", "revolute", "ground", "column", (0.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_torsion_spring("k", "ground", "column", (0, 1, 0), 10.0)
    model.add_body("arm", 1.0, (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    model.add_joint("shaft", "revolute", "ground", "arm", (1.0, 0.0, 0.0), axis=(0, 0, 1))
    model.add_torsion_spring("soft", "ground", "arm", (0, 0, 1), 1.0)
    for name, torque in (("twist", 0.1), ("hold", -0.1)):
        model.add_load(name, "arm", torque=(0.0, 0.0, torque))
    twist = np.array([0.2, 0.2])
    batch = batch_in_equilibrium(model, {"column.mass": np.array([1.0, 2.0]), "twist.torque.z": twist})
    np.testing.assert_allclose(batch.K[1], np.diag((10.0 - G, 1.0)), rtol=0, atol=1e-12)
    with pytest.raises(mv.EquilibriumError, match="mostly along 'pin"):
        in_equilibrium(model.with_values({"column.mass": 3.0, "twist.torque.z": 0.2}))
    with pytest.raises(mv.EquilibriumError, match=r"^variant 1: Newton's method does not contract"):
        batch_in_equilibrium(model, {"column.mass": np.array([1.0, 3.0]), "twist.torque.z": twist})
