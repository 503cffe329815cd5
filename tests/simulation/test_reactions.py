"""Forces in joints, on bodies and on the ground, and in beams, as outputs of runs."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library

SIX = ("x", "y", "z", "rx", "ry", "rz")


def with_forces(model, *elements):
    for element in elements:
        for direction in SIX:
            model.add_force_output(f"{element}:{direction}", element, direction)
    return model


def pendulum():
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 2.0, (0.1, 0.1, 0.1), (0.0, 0.0, -0.7))
    model.add_joint("pivot", "revolute", "bob", "ground", (0, 0, 0), axis=(0, 1, 0))
    return model


def test_the_pivot_of_a_pendulum():
    """Turned by a, the bob has m (g cos a + L a'^2) along the rod and -m (g sin a + L a'') across, in its own axes."""
    model = with_forces(pendulum(), "pivot", "bob", "ground")
    run = model.simulate(np.linspace(0.0, 2.0, 41), initial={"pivot.rz": (2.5, 1.0)}, tolerance=1e-10)
    angle, rate = -run.coordinates["pivot.rz"], run.rates["pivot.rz"]  # that of the ground against the bob
    m, g, length, inertia = 2.0, 9.81, 0.7, 0.1
    bend = -m * g * length * np.sin(angle) / (inertia + m * length**2)
    across, along = -m * (g * np.sin(angle) + length * bend), m * (g * np.cos(angle) + length * rate**2)
    at_rest = np.array([0.0, 0.0, m * g])
    expected = np.array(model.joints["pivot"].axes).T @ (np.array([across, 0 * across, along]) - at_rest[:, None])
    assert np.ptp(along) > 5 * m * g
    assert list(run.outputs) == list(model.outputs)
    np.testing.assert_allclose([run[f"pivot:{d}"] for d in "xyz"], expected, atol=1e-7)
    np.testing.assert_allclose([run[f"pivot:{d}"] for d in ("rx", "ry", "rz")], 0.0, atol=1e-9)
    np.testing.assert_allclose(run["bob:ry"], inertia * bend, atol=1e-8)
    for direction in "xyz":
        np.testing.assert_allclose(run[f"ground:{direction}"], -run[f"bob:{direction}"], atol=1e-8)


def slider_on_arm():
    """A slider across its weight on an arm that a bushing holds; both joints carry much in the pose."""
    model = mv.Model("sliders", gravity=(0, 0, -9.81))
    model.add_body("a", 2.0, (0.1, 0.2, 0.3), (0.2, 0.1, 0.0))
    model.add_body("b", 1.0, (0.1, 0.07, 0.05), (0.5, 0.0, 0.1))
    model.add_joint("rail", "prismatic", "ground", "a", axis=(1, 0, 0))
    model.add_joint("shaft", "cylindrical", "a", "b", (0.3, 0.1, 0.0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "a", (0.2, 0.1, 0.0), (500, 0, 0, 0, 0, 0))
    model.add_bushing("k2", "a", "b", (0.3, 0.1, 0.0), (0, 300, 0, 0, 50, 0), preload=(0, 0, 0, 0, -9.81 * 0.2, 0))
    model.add_input("F", "b", "x")
    return with_forces(model, "rail", "shaft", "ground", "a", "b")


def geared_arms():
    model = mv.Model("geared", gravity=(0, 0, -9.81))
    model.add_body("a", 2.0, (0.1, 0.2, 0.3), (0.0, 0.0, -0.2))
    model.add_body("b", 1.0, (0.1, 0.07, 0.05), (0.5, 0.0, -0.1))
    model.add_joint("j1", "revolute", "ground", "a", (0, 0, 0), axis=(0, 1, 0))
    model.add_joint("j2", "revolute", "ground", "b", (0.5, 0, 0), axis=(0, 1, 0))
    model.add_gear("gear", "j1.rz", "j2.rz", 2.0)
    model.add_input("M", "b", "ry")
    return with_forces(model, "j1", "j2", "ground", "b")


def spinning():
    model = pendulum()
    model.add_rotor("wheel", "bob", 200.0, (0, 0, 1), inertia=0.01)
    model.add_base_motion("shake", "x")
    return with_forces(model, "pivot", "ground", "bob")


MODELS = {
    "slider_on_arm": slider_on_arm, "geared_arms": geared_arms, "spinning": spinning,
    "slider_crank": lambda: with_forces(library.slider_crank(), "A", "B", "C", "rail", "ground"),
    "rssr": lambda: with_forces(library.rssr(), "crank", "rocker", "ball12", "ball23", "ground"),
    "stewart_isolator": lambda: with_forces(library.stewart_isolator(), "leg1.foot", "leg1.slide", "leg6.head"),
    "trifilar_pendulum": lambda: with_forces(library.trifilar_pendulum(), "wire1", "wire3", "ground"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.errors.UndeterminedForceWarning")
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "stewart_isolator"))
                                  for name in MODELS])  # fmt: skip
def test_small_motion_is_linear_to_second_order(name):
    """Joints of the tree and joints that are cut, rods, gears, rotors, sums; the rest falls with the square."""
    model = MODELS[name]()
    system = model.linearize()
    omega = np.abs(system.modes().eigenvalues)
    t = np.linspace(0.0, np.pi / np.median(omega[omega > 1e-6]), 6)
    start, off = np.random.default_rng(0).normal(size=system.dof), []
    for size in (1e-3, 2.5e-4):
        u = np.full((len(system.inputs), len(t)), size)
        run = model.simulate(t, dict(zip(system.inputs, u, strict=True)), tolerance=1e-11,
                             initial=dict(zip(system.coordinates, size * start, strict=True)))  # fmt: skip
        linear = system.time_response(t, u, initial=(size * start, 0 * start))
        told = [name for name in system.outputs if name in run.outputs]
        expected = {name: linear[system.outputs.index(name)] for name in told}
        off.append({name: np.abs(run[name] - expected[name]).max() for name in told})
        largest = max(np.abs(value).max() for value in expected.values())
    assert sum(":" in name for name in told) >= 12
    for name in told:
        assert off[1][name] <= max(off[0][name] / 14.0, 1e-9 * largest), name


def four_bar():
    model = mv.Model("four-bar")
    model.add_body("crank", 1.0, (0.01, 0.02, 0.02), (0.0, 0.0, 0.1))
    model.add_body("rod", 2.0, (0.05, 0.1, 0.1), (0.3, 0.0, 0.3))
    model.add_body("rocker", 1.5, (0.02, 0.04, 0.04), (0.6, 0.0, 0.2))
    hinges = (("A", "ground", "crank", (0, 0, 0)), ("B", "crank", "rod", (0, 0, 0.2)),
              ("C", "rod", "rocker", (0.6, 0, 0.4)), ("D", "ground", "rocker", (0.6, 0, 0)))  # fmt: skip
    for name, first, second, at in hinges:
        model.add_joint(name, "revolute", first, second, at, axis=(0, 1, 0))
    return with_forces(model, "A", "D", "ground")


@pytest.mark.slow
def test_forces_of_large_motion_balance():
    """The ground feels its two joints; what the redundant hinges leave open, out of the plane, is not told."""
    model = four_bar()
    run = model.simulate(np.linspace(0.0, 0.5, 11), initial={"A.rz": (0.0, 8.0)}, tolerance=1e-10)
    assert np.ptp(run.coordinates["A.rz"]) > 0.5
    total = np.zeros((3, 11))
    for joint in ("A", "D"):
        with pytest.raises(mv.ResponseError, match=f"'{joint}:z': redundant joints leave this force undetermined"):
            run[f"{joint}:z"]
        in_plane = np.array([run[f"{joint}:{d}"] for d in ("x", "y")])
        total += np.array(model.joints[joint].axes)[:, :2] @ in_plane
    assert np.abs(total).max() > 10.0
    np.testing.assert_allclose([run[f"ground:{d}"] for d in "xyz"], total, atol=1e-7)


def test_hinges_in_line():
    """Two hinges of a door share the wrenches that each could carry alone: only their sum is determined."""
    model = mv.Model("door", gravity=(0, 3.0, -9.81))
    model.add_body("door", 20.0, (1.0, 1.5, 0.6), (0.4, 0.0, 1.0))
    model.add_joint("low", "revolute", "ground", "door", (0, 0, 0.3), axis=(0, 0, 1))
    model.add_joint("high", "revolute", "ground", "door", (0, 0, 1.7), axis=(0, 0, 1))
    with_forces(model, "low", "high", "ground", "door")
    run = model.simulate(np.linspace(0.0, 0.8, 9), tolerance=1e-10)
    assert run.coordinates["low.rz"][-1] > 0.5
    for joint in ("low", "high"):
        assert f"{joint}:rz" in run.outputs
        for direction in SIX[:5]:
            with pytest.raises(mv.ResponseError, match="undetermined; a bushing in place of one of them"):
                run[f"{joint}:{direction}"]
    for direction in "xyz":
        np.testing.assert_allclose(run[f"ground:{direction}"], -run[f"door:{direction}"], atol=1e-8)
    assert np.abs(run["ground:x"]).max() > 5.0


@pytest.mark.slow
def test_a_force_ends_a_run():
    model, t = with_forces(pendulum(), "pivot"), np.linspace(0.0, 2.0, 41)
    free = model.simulate(t, initial={"pivot.rz": 1.0})
    name = max((f"pivot:{d}" for d in "xyz"), key=lambda name: np.ptp(free[name]))
    level = 0.5 * (free[name][0] + free[name][8])
    run = model.simulate(t, initial={"pivot.rz": 1.0}, until={name: level})
    assert run.time[-1] < t[8]
    assert run[name][-1] == pytest.approx(level, rel=1e-6)


def beam_with_an_arm():
    model = mv.Model("beam")
    model.add_body("tip", 0.5, (0.01, 0.01, 0.01), (1.0, 0.0, 0.0))
    model.add_beam("beam", "ground", "tip", {"type": "rectangle", "width": 0.02, "height": 0.01},
                   {"E": 2.1e9, "nu": 0.3, "rho": 7800.0}, (0, 0, 0), (1, 0, 0), elements=2, beta=1e-4)  # fmt: skip
    model.add_body("arm", 1.0, (0.1, 0.2, 0.2), (1.0, 0.0, -0.3))
    model.add_joint("pin", "revolute", "tip", "arm", (1.0, 0.0, 0.0), axis=(0, 1, 0))
    model.add_strain_output("top", "beam.e1")
    model.add_strain_output("side", "beam.e2", side="-y", at="end")
    model.add_input("F", "arm", "x")
    model.add_input("G", "tip", "y")
    return with_forces(model, "pin", "beam.e2", "ground")


@pytest.mark.slow
def test_strains_and_forces_of_beams():
    model = beam_with_an_arm()
    system, t, off = model.linearize(), np.linspace(0.0, 0.05, 9), []
    for size in (0.5, 0.125):
        run = model.simulate(t, {"F": np.full(9, size), "G": np.full(9, size)}, tolerance=1e-9)
        linear = system.time_response(t, np.full((2, 9), size))
        off.append(np.abs([run[name] - linear[i] for i, name in enumerate(system.outputs)]).max(axis=1))
        sizes = np.abs(linear).max(axis=1)
    assert np.all(off[1] <= np.maximum(off[0] / 13.0, 1e-9 * sizes.max()))
    assert (sizes[[system.outputs.index(name) for name in ("top", "side", "beam.e2:x", "ground:rz")]] > 1e-7).all()
    model.add_force_output("sum", "tip", "x")
    with pytest.raises(mv.ResponseError, match="no sums of forces on bodies of models with beams"):
        model.simulate(t[:2])["sum"]


@pytest.mark.slow
def test_the_moment_on_the_ground_is_that_of_forces_at_points_that_have_moved():
    """Minus the rate of the angular momentum of a bob of 1 kg on a carriage: forces and reactions meet in it."""
    model = mv.Model("crane")
    model.add_body("carriage", 2.0, (0.1, 0.1, 0.1), (1, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "carriage", (1, 0, 0), axis=(1, 0, 0))
    model.add_body("bob", 1.0, (0.1, 0.1, 0.1), (1, 1, 0))
    model.add_joint("pin", "revolute", "carriage", "bob", (1, 0, 0), axis=(0, 0, 1))
    for direction in ("x", "y"):
        model.add_input(f"F{direction}", "bob", direction)
        model.add_output(direction, "bob", direction)
        model.add_output(f"a{direction}", "bob", direction, quantity="acceleration")
    model.add_output("spin", "bob", "rz", quantity="acceleration")
    model.add_force_output("moment", "ground", "rz")
    run = model.simulate(np.linspace(0.0, 1.0, 11), {"Fx": np.full(11, 3.0), "Fy": np.full(11, 1.0)})
    expected = (1 + run["y"]) * run["ax"] - (1 + run["x"]) * run["ay"] - 0.1 * run["spin"]
    np.testing.assert_allclose(run["moment"], expected, atol=1e-6)
