"""What loads a model: words, parameters, changes, files, refusals, and that nothing is paid without it."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations import wrenches
from mbsvib.library import hinged_rod, trifilar_pendulum
from mbsvib.studies import sweep


def loaded():
    model = mv.Model("loaded", gravity=(0, 0, -10.0))
    model.add_body("mass", 2.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "mass")
    model.add_spring("up", "ground", "mass", (0, 0, 0), (0, 0, 1), 100.0, preload=-8.0)
    model.add_spring("free", "ground", "mass", (0, 0, 0), (0, 0, 1), 50.0, free_length=1.1)
    model.add_bushing("mount", "ground", "mass", (0, 0, 1), preload=(0, 0, 4.0, 0, 0, 1.0))
    model.add_load("lift", "mass", force=(1, 2, 3.0), position=(0, 0.5, 1))
    return model


def test_all_forces_count_in_the_balance():
    system = loaded().linearize()  # -20 + 8 + 5 + 4 + 3 = 0
    assert system.provenance.statics.imbalance < 1e-15
    assert system.K[0, 0] == pytest.approx(150.0, rel=1e-14)


def test_parameters_have_names_units_and_values():
    model = loaded()
    expected = {"up.preload": (-8.0, "N"), "free.free_length": (1.1, "m"), "mount.preload.z": (4.0, "N"),
                "mount.preload.rz": (1.0, "N m"), "lift.force.y": (2.0, "N"), "lift.torque.x": (0.0, "N m"),
                "lift.position.y": (0.5, "m")}  # fmt: skip
    for name, (value, unit) in expected.items():
        assert (model.parameters[name], model.parameters.units[name]) == (value, unit)
    assert "up.free_length" not in model.parameters


def test_changes_keep_loads_and_gravity():
    model = loaded().with_values({"lift.force.z": 2.0, "up.preload": -9.0})
    assert (model.gravity, model.loads["lift"].force) == ((0, 0, -10.0), (1, 2, 2.0))
    assert model.linearize().dof == 1
    with pytest.raises(mv.EquilibriumError, match=", 1 N missing"):
        model.replace("up", preload=-8.0).linearize()
    with pytest.raises(mv.EquilibriumError, match=r", -5 N missing"):
        model.replace("free", free_length=1.2).linearize()


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_files_bring_everything_back(tmp_path, suffix):
    model = loaded()
    back = mv.load(mv.save(model, tmp_path / f"model{suffix}"))
    assert back.gravity == model.gravity
    assert dict(back.loads) == dict(model.loads)
    assert dict(back.springs) == dict(model.springs)
    assert (back.linearize().K == model.linearize().K).all()


def test_a_changed_model_is_seen():
    """What is kept of the loads is kept only as long as all parts are the same."""
    model = loaded()
    before = model.linearize().K.copy()
    model.add_load("more", "mass", force=(0, 0, 5.0))
    with pytest.raises(mv.EquilibriumError, match=r", -5 N missing"):
        model.linearize()
    model.add_load("less", "mass", force=(0, 0, -5.0))
    assert np.array_equal(model.linearize().K, before)


def test_without_loads_no_statics_are_done(monkeypatch):
    monkeypatch.setattr(wrenches, "applied_wrenches", None)
    model = mv.library.stewart()
    weightless = mv.Model(model.name, gravity=(0, 0, 0))
    for group in model.groups().values():
        for part in group.values():
            getattr(weightless, mv.api.model.ADDERS[type(part)])(**part.constructor_kwargs())
    system, other = model.linearize(), weightless.linearize()
    assert system.provenance.statics is None
    assert all((getattr(system, key) == getattr(other, key)).all() for key in ("M", "C", "K", "B"))


def test_gears_carry_what_pendulums_weigh():
    """Two arms at 45 degrees hold each other through a gear: V'' = -m g d (sin a + r^2 sin b ...) in closed form."""
    m, d, g, angle = 2.0, 0.5, 10.0, 0.7
    model = mv.Model("gear", gravity=(0, 0, -g))
    for k, (x, side) in enumerate(((0.0, 1.0), (3.0, 1.0))):
        at = np.array([x + side * d * np.sin(angle), 0, -d * np.cos(angle)])
        model.add_body(f"arm{k}", m, (0.1, 0.1, 0.1), position=at)
        model.add_joint(f"pin{k}", "revolute", "ground", f"arm{k}", position=(x, 0, 0), axis=(0, 1, 0))
    model.add_gear("mesh", "pin0", "pin1", ratio=-1.0)
    system = model.linearize()
    assert system.dof == 1
    assert system.K[0, 0] == pytest.approx(2 * m * g * d * np.cos(angle), rel=1e-12)
    torque = m * g * d * np.sin(angle)
    moments = [system.reactions[f"pin{k}"][4] for k in range(2)]
    assert np.abs(moments) == pytest.approx([torque, torque])


def test_gravity_is_a_parameter():
    model = hinged_rod()
    assert [name for name in model.parameters if name.startswith("g")] == ["gravity.x", "gravity.y", "gravity.z"]
    assert (model.parameters["gravity.z"], model.parameters.units["gravity.z"]) == (-9.81, "m/s^2")
    moon = model.with_values({"gravity.z": -1.62})
    assert moon.gravity == (0.0, 0.0, -1.62)
    assert moon.bodies == model.bodies
    earth, there = model.linearize(), moon.linearize()
    assert there.K[0, 0] / earth.K[0, 0] == pytest.approx(1.62 / 9.81, rel=1e-14)
    assert earth.parameters["gravity.z"] == -9.81
    assert model.with_values({"gravity.?": 0.0}).linearize().K.tolist() == [[0.0]]
    with pytest.raises(mv.ModelError, match=r"'gravity.z': value = nan"):
        model.with_values({"gravity.z": float("nan")})
    with pytest.raises(mv.ModelError, match=r"no parameter 'gravity\.w'"):
        model.with_values({"gravity.w": 1.0})
    result = sweep(model, {"gravity.z": [-1.0, -4.0]}, of="modes.frequencies")
    frequencies = result["modes.frequencies"][:, 0]
    assert frequencies[1] == pytest.approx(2 * frequencies[0], rel=1e-14)


def test_gravity_is_no_parameter_where_there_is_none_or_where_a_part_is_called_so():
    model = mv.Model("weightless")
    model.add_body("gravity", 1.0, (1, 1, 1))
    assert "gravity.z" not in model.parameters
    model.gravity = (0.0, 0.0, -9.81)
    assert "gravity.z" not in model.parameters
    assert model.with_values({"gravity.mass": 2.0}).gravity == (0.0, 0.0, -9.81)


def test_loads_are_parameters_of_systems_too():
    model = mv.Model("held", gravity=(0, 0, -10.0))
    model.add_body("lamp", 2.0, (1, 1, 1))
    model.add_load("wire", "lamp", force=(0, 0, 20.0))
    assert model.linearize().parameters["wire.force.z"] == 20.0


def through_the_centre(seed, off=0.0):
    """A wheel on an axle of any direction, through its centre of mass or beside it, and a bob on a ball joint."""
    rng = np.random.default_rng(seed)
    down, axis, hook, hub = (rng.normal(size=3) for _ in range(4))
    down, axis = down / np.linalg.norm(down), axis / np.linalg.norm(axis)
    aside = np.cross(axis, down)
    model = mv.Model("tilted", gravity=9.81 * down)
    model.add_body("wheel", 2.0, (0.1, 0.1, 0.1), position=hub)
    model.add_joint("axle", "revolute", "ground", "wheel", hub - 1.3 * axis + off * aside, axis=axis)
    model.add_body("bob", 1.0, (0.01, 0.01, 0.01), position=hook + 0.3 * down)
    model.add_joint("ball", "spherical", "ground", "bob", hook, axis=down)
    return model


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(8))
def test_weights_on_axes_through_their_centres_are_in_balance(seed):
    """Their levers are rounding, which no force cancels: two of three such wheels, and all such bobs, were refused."""
    model = through_the_centre(seed)
    swing = np.sqrt(9.81 * 0.3 / (0.01 + 0.09)) / (2 * np.pi)
    modes = model.linearize().modes()
    assert modes.frequencies[:2].tolist() == [0.0, 0.0]
    assert modes.stable
    for item in (modes, model.linearize(method="sparse").modes(4)):
        assert item.frequencies[:2] == pytest.approx([0, 0], abs=1e-7)
        assert item.frequencies[2:] == pytest.approx([swing] * 2, rel=1e-12)
    assert len(model.equilibrium(report=True).residuals) == 1  # nothing to search for
    assert model.linearize(values={"wheel.mass": [1.0, 2.0]}).modes().frequencies[:, 3] == pytest.approx(swing)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_weight_a_micrometre_beside_its_axis_is_not_in_balance(method):
    with pytest.raises(mv.EquilibriumError, match=r"moment on body 'wheel', .* N m missing about z of joint 'axle'"):
        through_the_centre(1, off=1e-6).linearize(method=method)


def test_a_tiny_pendulum_far_away_keeps_its_stiffness():
    """A nanogram on a micrometre, a kilometre from the origin, beside a tonne: its weight is told by its own."""
    model = mv.Model("far", gravity=(0.6 * 9.81, 0, -0.8 * 9.81))
    for name, mass, length, y in (("tiny", 1e-12, 1e-6, 0.0), ("heavy", 1e3, 1.0, 5.0)):
        hook = np.array([1024.0, y, 0.5])
        moment = mass * length**2
        model.add_body(name, mass, (moment,) * 3, position=hook + length * np.array([0.6, 0, -0.8]))
        model.add_joint(f"{name}.j", "revolute", "ground", name, hook, axis=(0, 1, 0))
    exact = [np.sqrt(9.81 / 2) / (2 * np.pi), np.sqrt(9.81 / 2e-6) / (2 * np.pi)]
    assert model.linearize().modes().frequencies == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_pendulum_turns_freely_about_the_vertical_whatever_its_axes(seed):
    """No coordinate is the vertical one: its stiffness is what two others add and take away again."""
    rng = np.random.default_rng(seed)
    down, hook = rng.normal(size=(2, 3))
    down /= np.linalg.norm(down)
    model = mv.Model("bob", gravity=9.81 * down)
    model.add_body("bob", 1.0, (0.01, 0.01, 0.01), position=hook + 0.3 * down)
    model.add_joint("ball", "spherical", "ground", "bob", hook, axis=rng.normal(size=3))
    model.add_body("top", 1.0, (0.02, 0.03, 0.04), position=hook)
    model.add_joint("centre", "spherical", "ground", "top", hook, axis=rng.normal(size=3))
    modes = model.linearize().modes()
    assert modes.rigid == 4
    assert modes.frequencies[:4].tolist() == [0.0] * 4
    assert modes.frequencies[4:] == pytest.approx([np.sqrt(9.81 * 0.3 / 0.1) / (2 * np.pi)] * 2, rel=1e-13)
    assert modes.stable


def test_a_sway_that_symmetry_keeps_apart_is_apart_exactly():
    """The platform of a trifilar pendulum swings along x by itself: no rounding couples it with its yaw."""
    system = trifilar_pendulum().linearize()
    assert not system.K[0, 1:].any()
    assert system.reachable("yaw", "torque").coordinates == ("wire1.y", "wire1.rz")
