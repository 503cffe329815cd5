"""The tests of a stranger: a force law, an output, a curved joint and an export of one file and one row each.

References are closed forms, or the equation of motion by another integrator.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.io import mmread

import mbsvib as mv
from mbsvib.elements import by_law, spring
from mbsvib.elements.connection import ENDS, LINE, Connection
from mbsvib.elements.deformations import Law, length, twist
from mbsvib.elements.families import EXPANSIONS, Family
from mbsvib.elements.joint_kinds import STRAIGHT, Kind, Motion, displaced_on_sphere, open_by
from mbsvib.elements.load import Load
from mbsvib.elements.roles import axis, number, point, stated
from mbsvib.elements.shared_rows import ExpandedPart
from mbsvib.linalg import components as c
from mbsvib.plots._scene import of_model
from mbsvib_export.targets import BY_SUFFIX

MASS, STIFFNESS, GAP, FORCE, POWER = 0.5, 400.0, 0.05, 3e-6, 4.0
RADIUS, GRAVITY = 0.3, 9.81


def puck(force=FORCE, along="free"):
    """A puck on a spring above a magnet that attracts it along z."""
    model = mv.Model("puck")
    model.add_body("puck", MASS, (1e-3, 2e-3, 3e-3), position=(0, 0, GAP))
    model.add_joint("slide", None, "ground", "puck", (0, 0, GAP), free=("x", "z") if along == "free" else ("z",))
    model.add_bushing("k", "ground", "puck", (0, 0, GAP), (STIFFNESS, STIFFNESS, STIFFNESS, 0, 0, 0))
    model.add_magnet("magnet", "ground", "puck", (0, 0, 0), (0, 0, GAP), force, POWER, 0.3)
    model.add_input("F", "puck", "z")
    model.add_output("z", "puck", "z")
    model.add_distance("gap", "ground", "puck", (0.03, 0, 0), (0, 0, GAP))
    return model


def balanced_gap(force=FORCE):
    """The gap z with k (GAP - z) = strength / z^n."""
    z = GAP
    for _ in range(50):
        z -= (STIFFNESS * (GAP - z) - force / z**POWER) / (-STIFFNESS + POWER * force / z ** (POWER + 1))
    return z


def pull(z, force=FORCE):
    return force / z**POWER


def test_a_magnet_at_equilibrium_is_that_of_its_law():
    model = puck().equilibrium()
    z = balanced_gap()
    assert model.bodies["puck"].position[2] == pytest.approx(z, rel=1e-13)
    expected = np.diag((STIFFNESS + pull(z) / z, STIFFNESS - POWER * pull(z) / z))
    system = model.linearize()
    np.testing.assert_allclose(system.K, expected, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(system.C, np.diag((0.0, 0.3)), atol=1e-15)
    compliance = np.array([1.0, z / np.hypot(z, 0.03)]) / expected[1, 1]
    for method in ("dense", "sparse"):
        response = model.linearize(method=method).frequency_response([0.0], outputs=["z", "gap"])
        np.testing.assert_allclose(response[:, 0, 0], compliance, rtol=1e-12)


def test_a_magnet_as_described_is_refused_where_it_is_off_balance():
    with pytest.raises(mv.EquilibriumError, match="slide"):
        puck().linearize()


def test_variants_and_compiled_plants_of_a_magnet():
    model = puck().equilibrium()
    damping = [0.1, 0.4]
    batch, plant = model.linearize(values={"magnet.damping": damping}), model.compile(["magnet.damping"])
    for i, value in enumerate(damping):
        assert batch[i].C[1, 1] == pytest.approx(value, rel=1e-14)
        np.testing.assert_allclose(plant([value]).C, batch[i].C, rtol=1e-14)
        np.testing.assert_allclose(plant([value]).K, model.linearize().K, rtol=1e-14)
    unbalanced = [0.9 * FORCE, 1.1 * FORCE]
    with pytest.raises(mv.EquilibriumError, match="variant 0"):
        model.linearize(values={"magnet.strength": unbalanced})


def test_poses_of_a_magnet():
    """Where nothing else acts along x, its stiffness across the line is force over gap."""
    model = puck().equilibrium()
    model = model.with_parts(loads={}, springs={"magnet": model.springs["magnet"]})
    z, step = balanced_gap(), 0.004
    held = model.replace("slide", free=("x",))
    plant = held.compile([], pose=["slide.x"])
    for x in (0.0, step):
        length = np.hypot(x, z)
        stiffness = pull(length) / length * ((z / length) ** 2 - POWER * (x / length) ** 2)
        there = held.moved({"slide.x": x})
        assert there.springs["magnet"].rest_wrench[0] == pytest.approx(-pull(length) * x / length, rel=1e-13)
        if x == 0.0:
            assert there.linearize().K[0, 0] == pytest.approx(stiffness, rel=1e-12)
            assert plant([x]).K[0, 0] == pytest.approx(stiffness, rel=1e-12)


@pytest.mark.slow
def test_sensitivities_of_a_magnet_follow_its_equilibrium():
    """d lambda / d strength, in closed form, along with the pose."""
    model = puck(along="z").equilibrium()
    z = balanced_gap()
    k = STIFFNESS - POWER * pull(z) / z
    names = ["magnet.damping", "magnet.strength"]
    rates = model.linearize().eigenvalue_sensitivities(names)[:, 0]
    value = model.linearize().modes().eigenvalues[0]
    slope = 2.0 * MASS * value + 0.3
    per_strength = -POWER / z ** (POWER + 1.0)
    moved = -(1.0 / z**POWER) / k * POWER * (POWER + 1.0) * pull(z) / z**2
    np.testing.assert_allclose(rates[0], -value / slope, rtol=1e-9)
    np.testing.assert_allclose(rates[1], -(per_strength + moved) / slope, rtol=1e-7)


def test_a_magnet_runs_by_its_law():
    t = np.linspace(0.0, 0.4, 41)
    run = puck().simulate(t, initial={"slide.x": 0.01}, tolerance=1e-10)

    def rate(_, state):
        x, z, vx, vz = state
        line = np.array((x, z))
        length = np.hypot(x, z)
        force = -(pull(length) + 0.3 * (x * vx + z * vz) / length) * line / length - STIFFNESS * (line - (0.0, GAP))
        return [vx, vz, *(force / MASS)]

    states = solve_ivp(rate, (0.0, t[-1]), [0.01, GAP, 0.0, 0.0], t_eval=t, rtol=1e-11, atol=1e-13).y
    np.testing.assert_allclose(run["z"], states[1] - GAP, atol=1e-9)
    distance = np.hypot(states[0] - 0.03, states[1])
    np.testing.assert_allclose(run["gap"], distance - np.hypot(0.03, GAP), atol=1e-9)


def test_strangers_in_files_pictures_and_copies(tmp_path):
    model = puck()
    path = tmp_path / "puck.yaml"
    mv.save(model, path)
    again = mv.load(path)
    assert again.springs["magnet"] == model.springs["magnet"]
    assert again.outputs["gap"] == model.outputs["gap"]
    assert {line.name for line in of_model(model).lines} >= {"magnet"}
    both = mv.Model("both")
    both.add_model("there", model, position=(1.0, 0.0, 0.0))
    copy = next(part for part in both.springs.values() if part.family == "magnet")
    assert copy.end == (1.0, 0.0, GAP)


def test_what_a_magnet_cannot_say_is_refused_by_name():
    model = puck().equilibrium()
    with pytest.raises(mv.ModelError, match="magnet 'magnet': its force follows from its geometry"):
        model.moved({"slide.x": 0.01}, relaxed=True)
    with pytest.raises(mv.ModelError, match="power"):
        puck().replace("magnet", power=1.0)


@dataclass(frozen=True, slots=True)
class Linear(Connection):
    """A magnet by its expansion alone, which does not say what its force is elsewhere."""

    roles = stated(**ENDS, **LINE)

    start: tuple[float, ...]
    end: tuple[float, ...]


class Straight(Linear):
    """The same with a law of coefficients of its own, whose force in another pose nothing states."""

    __slots__ = ()
    stiffness, damping = -STIFFNESS, 0.0
    law = Law(lambda x, j: length(x, j), "stiffness", "damping")


@pytest.mark.parametrize(("family", "why"), [(Linear, "it states no law"), (Straight, "its force in another pose")])
def test_parts_without_a_finite_law_move_nowhere(monkeypatch, family, why):
    def expand(part, *_):
        return ExpandedPart(springs={part.name: spring.make(part.name, part.first, part.second, part.start, part.end,
                                                            -0.5 * STIFFNESS, 0.0, pull(GAP))})  # fmt: skip

    monkeypatch.setitem(EXPANSIONS, family, expand)
    model = puck(along="z")
    part = family("magnet", "ground", "puck", (0, 0, 0), (0, 0, GAP))
    model = model.with_parts(springs=dict(model.springs) | {"magnet": part})
    held, message = model.with_parts(), f"'magnet': {why}"
    held.add_load("hold", "puck", (0, 0, pull(GAP)))
    for call in (lambda: model.equilibrium(), lambda: model.moved({"slide.z": 0.01}),
                 lambda: held.compile([], pose=["slide.z"])([0.01]),
                 lambda: held.linearize().eigenvalue_sensitivities(["hold.force.z"]),
                 lambda: model.path("slide.z", [0.01])):  # fmt: skip
        with pytest.raises(mv.ModelError, match=message):
            call()
    if family is Linear:
        with pytest.raises(mv.ModelError, match=message):
            model.moved({"slide.z": 0.01}, relaxed=True)
        with pytest.raises(mv.ModelError, match="'magnet': has no law"):
            model.simulate([0.0, 0.1])


def both_legs(x, j):
    """Lengths of the lines from two points of the first body to one of the second."""
    return [c.norm(c.subtract(x.point(j.tip), side)) for side in (j.left, j.right)]


@dataclass(frozen=True, slots=True)
class Vee(Connection):
    """Two equal springs of a free length from two points of the first body to one of the second."""

    law = Law(both_legs, damping="damping", energy=lambda lengths, j: sum(
        0.5 * j.stiffness * (length - j.free_length) ** 2 for length in lengths))  # fmt: skip
    roles = stated(**ENDS, left=point("first"), right=point("first"), tip=point("second"), stiffness=number("N/m"),
                   free_length=number("m"), damping=number("N s/m"))  # fmt: skip

    left: tuple[float, ...]
    right: tuple[float, ...]
    tip: tuple[float, ...]
    stiffness: float
    free_length: float
    damping: float


@pytest.mark.slow
def test_an_energy_of_two_lengths_is_two_springs(monkeypatch):
    monkeypatch.setitem(EXPANSIONS, Vee, by_law.expand)
    left, right, tip = (-0.2, 0.1, 0.3), (0.3, 0.0, 0.4), (0.05, 0.1, 0.0)
    model = mv.Model("vee", gravity=(0, 0, -GRAVITY))
    model.add_body("b", 1.0, (0.1, 0.2, 0.3))
    model.add_joint("ball", "spherical", "ground", "b", (0, 0.2, 0.1))
    model.add_bushing("pad", "ground", "b", (0, 0.2, 0.1), (0, 0, 0, 30.0, 40.0, 50.0))
    vee = Vee("v", "ground", "b", left, right, tip, 90.0, 0.3, 2.0)
    own = model.with_parts(springs=dict(model.springs) | {"v": vee})
    for name, side in (("l", left), ("r", right)):
        model.add_spring(name, "ground", "b", side, tip, 90.0, 2.0, free_length=0.3)
    pair = [case.equilibrium() for case in (model, own)]
    np.testing.assert_allclose(*(case.bodies["b"].orientation for case in pair), atol=1e-12)
    for key in "MCK":
        np.testing.assert_allclose(*(getattr(case.linearize(), key) for case in pair), rtol=1e-11, atol=1e-11)
    t = np.linspace(0.0, 0.2, 5)
    runs = [case.simulate(t).coordinates for case in (model, own)]
    for name, values in runs[0].items():
        np.testing.assert_allclose(runs[1][name], values, atol=1e-6)


@dataclass(frozen=True, slots=True)
class Torsion(Connection):
    """A torsion spring by its energy, whose angle since the pose as described no field keeps."""

    law = Law(twist, energy=lambda deformation, fields: 0.5 * fields.stiffness * deformation[0] ** 2)
    roles = stated(**ENDS, stiffness=number("N m/rad"), axis=axis("first"))

    axis: tuple[float, ...]
    stiffness: float


def test_an_energy_of_what_no_field_keeps_moves_nowhere(monkeypatch):
    monkeypatch.setitem(EXPANSIONS, Torsion, by_law.expand)
    model = mv.Model("twist")
    model.add_body("b", 1.0, (0.1, 0.2, 0.3))
    model.add_joint("hinge", "revolute", "ground", "b", (0, 0, 0))
    model = model.with_parts(springs={"t": Torsion("t", "ground", "b", (0.0, 0.0, 1.0), 7.0)})
    assert model.linearize().K[0, 0] == pytest.approx(7.0, rel=1e-14)
    loaded = model.with_parts()
    loaded.add_load("push", "b", torque=(0, 0, 1.0))
    for call in (lambda: model.moved({"hinge.rz": 0.1}), loaded.equilibrium):
        with pytest.raises(mv.ModelError, match="torsion 't': its deformation in another pose does not follow"):
            call()


def test_families_that_say_nothing_are_refused():
    with pytest.raises(mv.ModelError, match="family 'linear': nothing says what it is in the equations"):
        Family(Linear, "linear", "springs", None)
    with pytest.raises(mv.ModelError, match="family 'puck': parts of the section 'loads' are not expanded"):
        Family(Load, "puck", "loads", None, expand=by_law.expand)
    model = puck().with_parts(springs={"own": Linear("own", "ground", "puck", (0, 0, 0), (0, 0, GAP))})
    for method in ("dense", "sparse"):
        with pytest.raises(mv.ModelError, match="linear 'own': its family is not in FAMILIES"):
            model.linearize(method=method)


def test_a_kind_of_joint_with_a_motion_of_its_own_is_refused():
    with pytest.raises(mv.ModelError, match="expected STRAIGHT, SCREW or ROD"):
        Kind(("y", "rx", "ry", "rz"), motion=Motion(displaced_on_sphere, open_by))
    assert Kind(("y",), motion=STRAIGHT).free == ("y",)


def bead():
    """A bead on a vertical circle, a distance below its centre; the axis of the circle is y."""
    model = mv.Model("bead", gravity=(0, 0, -GRAVITY))
    model.add_body("bead", MASS, (1e-4,) * 3, position=(0, 0, -RADIUS))
    model.add_point_on_circle("circle", "ground", "bead", (0, 0, 0), (0, 1, 0), (0, 0, -RADIUS))
    model.add_bushing("upright", "ground", "bead", (0, 0, -RADIUS), (0, 0, 0, 2.0, 2.0, 2.0))
    model.add_input("F", "bead", "x")
    model.add_output("x", "bead", "x")
    return model


def test_a_point_on_a_circle_swings_as_a_pendulum():
    model = bead()
    compliance = 1.0 / (MASS * GRAVITY / RADIUS)
    for method in ("dense", "sparse"):
        response = model.linearize(method=method).frequency_response([0.0])
        assert response[0, 0, 0] == pytest.approx(compliance, rel=1e-12)
    masses = [0.2, 0.9]
    batch, plant = model.linearize(values={"bead.mass": masses}), model.compile(["bead.mass"])
    for i, mass in enumerate(masses):
        expected = RADIUS / (mass * GRAVITY)
        assert batch[i].frequency_response([0.0])[0, 0, 0] == pytest.approx(expected, rel=1e-12)
        np.testing.assert_allclose(plant([mass]).K, batch[i].K, rtol=1e-12, atol=1e-12)
    angle = 0.7
    moved = model.moved({"circle.turn.rz": angle}, relaxed=True)
    at = (-RADIUS * np.sin(angle), 0.0, -RADIUS * np.cos(angle))
    np.testing.assert_allclose(moved.bodies["bead"].position, at, atol=1e-15)
    moved.add_load("push", "bead", (-MASS * GRAVITY * np.tan(angle), 0.0, 0.0))
    there = moved.equilibrium()
    np.testing.assert_allclose(there.bodies["bead"].position, at, atol=1e-12)


@pytest.mark.slow
def test_a_point_on_a_circle_runs_and_is_saved(tmp_path):
    model = bead()
    t = np.linspace(0.0, 0.5, 11)
    run = model.simulate(t, initial={"circle.turn.rz": 0.5}, tolerance=1e-10)

    def rate(_, state):
        return [state[1], -GRAVITY / RADIUS * np.sin(state[0])]

    angle = solve_ivp(rate, (0.0, 0.5), [0.5, 0.0], t_eval=t, rtol=1e-11, atol=1e-13).y[0]
    np.testing.assert_allclose(run["x"], -RADIUS * np.sin(angle), atol=1e-7)
    mv.save(model, tmp_path / "bead.yaml")
    assert mv.load(tmp_path / "bead.yaml").joints == model.joints


def test_an_export_target(tmp_path):
    system = puck().equilibrium().linearize()
    path = BY_SUFFIX[".mtx"].write(system, tmp_path / "k.mtx")
    np.testing.assert_array_equal(mmread(path), system.K)
