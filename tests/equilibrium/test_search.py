"""The pose of equilibrium: closed forms, and the exact equations of the mechanism solved by another road."""

from itertools import pairwise

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium import path, preloads, search
from mbsvib.equilibrium.balance import balance
from mbsvib.equilibrium.motion import posed_model
from mbsvib.equilibrium.search import at_equilibrium, equilibrium
from tests.equilibrium.test_moved import four_bar, pose_of
from tests.support.lagrangian import Lagrangian, projected
from tests.support.random_models import planar, spatial
from tests.support.sizes import few

G = (0.0, 0.0, -9.81)


def reloaded(model, gravity=G):
    """The same model with gravity."""
    result = mv.Model(model.name, gravity)
    for group in (model.bodies, model.joints, model.springs, model.inputs, model.outputs):
        for part in group.values():
            getattr(result, mv.api.model.ADDERS[type(part)])(**part.constructor_kwargs())
    return result


def check(model, result):
    """The exact equations of the model as described balance in the pose found, and have the tangent of the model there.

    A Newton step of theirs, on all coordinates and multipliers at once, goes nowhere from it.
    """
    there = result.model
    exact = Lagrangian(model)
    pose = pose_of(there, model)
    local = exact.at(pose)
    start = exact.at()
    force = max(np.abs(local.gradient).max(), np.abs(start.gradient).max())
    assert np.abs(local.phi).max(initial=0.0) < 1e-11
    assert np.abs(local.residual).max() < 1e-9 * force
    (centre, turn), _ = exact.equilibrium(pose, iterations=3)
    assert np.abs(centre - pose[0]).max() < 1e-10
    assert np.abs(turn - pose[1]).max() < 1e-10
    system = there.linearize()
    basis = np.asarray(system.body_motion).reshape(-1, system.dof)
    tangent = basis.T @ local.tangent @ basis
    assert np.allclose(system.K, tangent, rtol=0, atol=1e-9 * np.abs(tangent).max(initial=1e-3))
    assert np.allclose(projected(there, system)[0], system.K, rtol=0, atol=1e-9 * np.abs(tangent).max(initial=1e-3))
    assert result.residuals[-1] < 1e-12
    assert equilibrium(there).iterations == 0


def pendulum(tilt, **words):
    model = mv.Model("pendulum", gravity=G)
    centre = 0.4 * np.array([np.sin(tilt), 0, -np.cos(tilt)])
    model.add_body("rod", 3.0, (0.3, 0.2, 0.1), centre, orientation=(0, -tilt, 0))
    model.add_joint("hinge", "revolute", "ground", "rod", (0, 0, 0), axis=(0, 1, 0), **words)
    return model


@pytest.mark.parametrize("tilt", [0.0, 0.2, 1.4, np.pi / 2, 2.5, -3.1])
def test_a_pendulum_falls_to_where_it_hangs(tilt):
    model = pendulum(tilt)
    result = equilibrium(model)
    rod = result.model.bodies["rod"]
    assert rod.position == pytest.approx((0.0, 0.0, -0.4), abs=1e-14)
    assert np.allclose(rod.orientation, np.eye(3), rtol=0, atol=1e-14)
    assert result.displacements["rod"][4] == pytest.approx(tilt, abs=1e-13)
    frequency = result.model.linearize().modes().frequencies[0]
    assert frequency == pytest.approx(np.sqrt(3 * 9.81 * 0.4 / (0.2 + 3 * 0.4**2)) / 2 / np.pi, rel=1e-12)
    check(model, result)


def test_sparse_equations_where_the_pendulum_hangs():
    model = pendulum(0.7)
    there, sparse = at_equilibrium(model, method="sparse")
    assert sparse.kind == "sparse system"
    assert sparse.model.bodies == there.bodies
    assert there.bodies == at_equilibrium(model, method="dense")[0].bodies


def test_a_pendulum_in_balance_upside_down_is_left_alone():
    result = equilibrium(pendulum(np.pi))
    assert result.iterations == 0
    assert result.model.bodies["rod"].position == pendulum(np.pi).bodies["rod"].position


def test_a_pendulum_pushed_aside_leans():
    model = pendulum(0.0)
    model.add_load("wind", "rod", force=(3 * 9.81 * np.tan(0.6), 0, 0))
    result = equilibrium(model)
    assert result.model.bodies["rod"].position == pytest.approx((0.4 * np.sin(0.6), 0, -0.4 * np.cos(0.6)), abs=1e-14)
    check(model, result)


def test_convergence_is_quadratic():
    result = equilibrium(pendulum(1.4))
    errors = [r for r in result.residuals if 1e-16 < r < 0.2]
    assert len(errors) >= 2
    model = reloaded(mv.library.stewart(), tuple(np.multiply(3e4, (1.0, 0.5, -1.0))))
    result = equilibrium(model)
    rates = [r for r in result.residuals if r > 1e-16]
    assert len(rates) >= 4
    for before, after in pairwise(rates[1:]):
        assert after < max(30.0 * before**2, 1e-14)


def test_a_weight_stretches_its_spring():
    model = mv.Model("scale", gravity=G)
    model.add_body("pan", 2.0, (0.1, 0.1, 0.1), (0, 0, -0.5))
    model.add_joint("rail", "prismatic", "ground", "pan", axis=(0, 0, 1))
    model.add_spring("k", "ground", "pan", (0, 0, 0), (0, 0, -0.5), 400.0, free_length=0.45)
    result = equilibrium(model)
    length = 0.45 + 2 * 9.81 / 400
    assert result.model.bodies["pan"].position == pytest.approx((0, 0, -length), abs=1e-15)
    assert result.model.springs["k"].tension == pytest.approx(2 * 9.81)
    assert result.model.springs["k"].free_length == 0.45
    check(model, result)


@pytest.mark.few(1)
@pytest.mark.parametrize("spring", [False, True])
def test_four_bar_under_gravity(spring):
    model = reloaded(four_bar()[0], (0.0, -9.81, 0.0))
    if spring:
        model.add_spring("k", "ground", "coupler", (0.2, 1.0, 0.0), model.joints["C"].position, 60.0, free_length=0.2)
    result = equilibrium(model)
    check(model, result)
    height = lambda m: sum(body.mass * body.position[1] for body in m.bodies.values())  # noqa: E731
    if not spring:
        assert height(result.model) < height(model)
        for by in (-1e-3, 1e-3):
            assert height(result.model) < height(result.model.moved({"A.rz": by}))


@pytest.mark.slow
def test_stewart_platform_sags_under_its_payload():
    model = reloaded(mv.library.stewart(), (300.0, -200.0, -900.0))  # of a launch
    result = equilibrium(model)
    check(model, result)
    (centre, _), step = Lagrangian(model).equilibrium()
    assert step < 1e-9
    for name, location in zip(model.bodies, centre, strict=True):
        assert result.model.bodies[name].position == pytest.approx(location, abs=1e-10)
    assert max(np.abs(six).max() for six in result.displacements.values()) > 1e-5


def test_follower_loads_and_bushings_turned_far():
    model = mv.Model("arm", gravity=G)
    for i in range(3):
        model.add_body(f"b{i}", 1.0, (0.01, 0.02, 0.02), (0.25 + 0.5 * i, 0, 0))
        first = f"b{i - 1}" if i else "ground"
        model.add_joint(f"j{i}", "spherical", first, f"b{i}", (0.5 * i, 0, 0))
        model.add_bushing(f"k{i}", first, f"b{i}", (0.5 * i, 0, 0), (0, 0, 0, 20, 30, 25))
    model.add_load("thrust", "b2", force=(0.0, 6.0, 3.0), position=(1.5, 0, 0), follower=True)
    result = equilibrium(model)
    assert np.linalg.norm(result.displacements["b2"][3:]) > 0.5
    check(model, result)


@pytest.mark.slow
@pytest.mark.parametrize("seed", few(range(8), 2))
def test_random_trees_on_their_springs(seed):
    kinds = ("revolute", "prismatic", "cylindrical", "screw", "universal", "spherical", "planar", "free")
    model = reloaded(spatial(seed, bodies=3, kinds=kinds, ports=False), (20.0, -50.0, -90.0))
    check(model, equilibrium(model, snap=seed == 4))


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", few(range(6), 2))
def test_planar_loops_in_space(seed):
    model = reloaded(planar(seed, bodies=4, loops=1, ports=False), (20.0, -50.0, -90.0))
    check(model, equilibrium(model, snap=seed == 3))


def truss(load):
    """Two bars on sliders that push a mass up: a shallow arch that snaps through."""
    model = mv.Model("arch")
    model.add_body("crown", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 0.2))
    model.add_joint("rail", "prismatic", "ground", "crown", axis=(0, 0, 1))
    for name, x in (("left", -1.0), ("right", 1.0)):
        model.add_spring(name, "ground", "crown", (x, 0, 0), (0, 0, 0.2), 1000.0)
    model.add_load("weight", "crown", force=(0, 0, -load))
    return model


def limit_of_truss():
    z = np.linspace(0.0, 0.2, 200001)
    length = np.hypot(1.0, z)
    return float((2 * 1000.0 * (np.hypot(1.0, 0.2) - length) * z / length).max())


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
def test_an_arch_below_its_limit_load_is_found(share):
    model = truss(share * limit_of_truss())
    result = equilibrium(model)
    assert result.model.bodies["crown"].position[2] > 0.1
    check(model, result)


@pytest.mark.few(1)
@pytest.mark.parametrize("share", [1.01, 3.0])
def test_an_arch_that_snaps_through_is_refused_with_the_last_residual(share):
    message = r"its stiffness is down to \d+\.\d%, mostly along 'rail\.z': it would snap through"
    with pytest.raises(mv.EquilibriumError, match=message) as caught:
        equilibrium(truss(share * limit_of_truss()))
    assert caught.value.body == "crown"
    assert caught.value.missing > 0.0
    reached = float(str(caught.value).split("under ")[1].split("%")[0]) / 100
    assert reached == pytest.approx(1 / share, abs=0.003)


def test_an_arch_may_snap_through_when_it_is_told_so():
    model = truss(3.0 * limit_of_truss())
    result = equilibrium(model, snap=True)
    assert result.model.bodies["crown"].position[2] < -0.2
    check(model, result)


@pytest.mark.slow
def test_a_body_that_nothing_holds_is_named():
    model = mv.Model("falling", gravity=G)
    model.add_body("stone", 1.0, (0.1, 0.1, 0.1))
    with pytest.raises(mv.EquilibriumError, match=r"without limit.*force on body 'stone', 9\.81 N missing along"):
        equilibrium(model)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e12])
def test_rigid_motions_in_balance_are_left_alone(unit):
    """In any unit of force; across the boom as well, where its load and that of a spring leave rounding."""
    along = np.array((0.6, 0.48, 0.64))
    model = mv.Model("satellite")
    for name, x in (("a", 0.0), ("b", 1.0)):
        model.add_body(name, 2.0, (0.1, 0.1, 0.1), x * along)
    model.add_joint("boom", "prismatic", "a", "b", axis=along)
    model.add_spring("k", "a", "b", (0, 0, 0), along, 100.0 * unit, preload=5.0 * unit)
    for name, sign in (("a", -1.0), ("b", 1.0)):
        model.add_load(name + " pull", name, sign * unit * 3.0 * along)
    result = equilibrium(model)
    ends = [np.array(result.model.bodies[name].position) for name in "ab"]
    np.testing.assert_allclose(ends[1] - ends[0], 0.98 * along, rtol=0, atol=1e-13)
    np.testing.assert_allclose(ends[0], 0.0, rtol=0, atol=1e-12)
    assert result.model.springs["k"].preload == pytest.approx(3.0 * unit, rel=1e-12)
    # loads that pull outwards turn the boom back about two axes
    assert np.count_nonzero(result.model.linearize().modes().frequencies) == 3


@pytest.mark.slow
def test_a_pose_out_of_reach_keeps_its_last_residual():
    model = mv.Model("pull")
    model.add_body("hook", 1.0, (0.1, 0.1, 0.1), (1.0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "hook", axis=(1, 0, 0))
    model.add_load("pull", "hook", force=(50.0, 0, 0))
    with pytest.raises(mv.EquilibriumError, match="no equilibrium that can be reached") as caught:
        equilibrium(model)
    assert (caught.value.body, caught.value.coordinate, caught.value.unit) == ("hook", "rail.x", "N") or \
        caught.value.coordinate == "rail.z"  # fmt: skip
    assert caught.value.missing == pytest.approx(-50.0)


def test_the_report_prints():
    result = equilibrium(pendulum(0.5))
    text = str(result)
    assert text.startswith("Equilibrium of pendulum after ")
    assert "residuals: " in text
    head, row = (next(line for line in text.splitlines() if line.split()[:1] == [word]) for word in ("body", "rod"))
    assert head.split() == ["body", "x", "[m]", "y", "[m]", "z", "[m]", "rx", "[rad]", "ry", "[rad]", "rz", "[rad]"]
    told = np.array(row.split()[1:], dtype=float)
    np.testing.assert_allclose(told, result.displacements["rod"], rtol=1e-5, atol=1e-11)
    assert abs(told[4]) == pytest.approx(0.5, rel=1e-5)
    assert (told < 0.0).any()  # with their signs
    assert sorted(set(row.split()[1:]) & {"0", "-0"}) == ["0"]


@pytest.mark.parametrize("far", ["overshoot", "loop"])
def test_a_last_step_that_does_not_help_is_not_taken(far):
    """It moves a string whose tension rises steeply far beyond, and a rocker to where its loop cannot be closed."""
    if far == "overshoot":
        model = mv.Model("string")
        model.add_body("bead", 1.0, (1, 1, 1), (0, 0, 0))
        model.add_joint("rail", "prismatic", "ground", "bead", axis=(0, 0, 1))
        for x in (-1, 1):
            model.add_spring(f"s{x}", "ground", "bead", (x, 0, 0), (0, 0, 0), 1000.0, preload=1.0)
        model.add_load("P", "bead", (0, 0, 20.0))
    else:
        model = four_bar(crank=0.7, rocker=0.3)[0]
        for name in ("crank", "rocker"):
            model.add_torsion_spring(f"{name} spring", "ground", name, (0, 0, 1), 0.1)
        model.add_load("M", "rocker", torque=(0, 0, 1.0))
    at = posed_model(model)
    forces = balance(at)
    assert path.is_stable(path.stiffness(forces)[0])
    assert path.refined(at, forces) == (at, forces, [])


def hanging_chain(count=6):
    """Bars from the horizontal, held by springs that are soft against their weight."""
    model = mv.Model("chain", gravity=(0.0, 0.0, -9.81))
    for k in range(count):
        first = f"bar{k - 1}" if k else "ground"
        model.add_body(f"bar{k}", 0.2, (1e-4, 1e-4, 1e-4), (0.1 * k + 0.05, 0, 0))
        model.add_joint(f"pin{k}", "revolute", first, f"bar{k}", (0.1 * k, 0, 0), axis=(0, 1, 0))
        model.add_torsion_spring(f"spring{k}", first, f"bar{k}", (0, 1, 0), 0.3)
    return model


@pytest.mark.slow
def test_the_forces_in_a_pose_are_computed_once(monkeypatch):
    """Along load steps and shortened ones, no pose of a model is asked for its forces again."""
    asked, real = [], path.balance

    def recorded(at, *arguments):
        numbers = np.concatenate((at.pose.centre.ravel(), at.pose.rotations.ravel()))
        asked.append((numbers.tobytes(), at.reference.gravity))
        return real(at, *arguments)

    for module in (path, search, preloads):
        monkeypatch.setattr(module, "balance", recorded)
    found = hanging_chain().equilibrium()
    assert len(asked) > 10
    assert len(set(asked)) == len(asked)
    # the moment at the pin of the base is that of all weights about it
    arms = [body.position[0] for body in found.bodies.values()]
    assert found.springs["spring0"].preload == pytest.approx(-0.2 * 9.81 * sum(arms), rel=1e-9)


def test_displacements_are_columns():
    model = mv.Model("hung", gravity=(0, 0, -10.0))
    model.add_body("mass", 2.0, (0.1, 0.1, 0.1))
    model.add_bushing("k", "ground", "mass", (0, 0, 0), (1e3, 1e3, 1e3, 10, 10, 10))
    columns = model.equilibrium(report=True).columns()
    assert columns["body"].tolist() == ["mass"]
    assert columns["z"] == pytest.approx([-0.02])
    assert list(columns) == ["body", "x", "y", "z", "rx", "ry", "rz"]


@pytest.mark.slow
@pytest.mark.parametrize("snap", [False, True])
def test_the_search_is_the_same_in_any_unit_of_length(snap):
    """A slider with a rod hinged to it: as many steps of the same shares, whatever a metre is."""
    results = []
    for unit in (1.0, 1024.0, 2.0**-10):
        model = mv.Model("crane", gravity=tuple(np.multiply(unit, G)))
        model.add_body("trolley", 2.0 / unit, tuple(np.multiply(unit, (0.1, 0.1, 0.1))))
        model.add_body("rod", 1.0 / unit, tuple(np.multiply(unit, (0.1, 0.1, 0.02))), (0.3 * unit, 0.0, -0.4 * unit))
        model.add_joint("rail", "prismatic", "ground", "trolley", axis=(1, 0, 0))
        model.add_joint("hinge", "revolute", "trolley", "rod", (0, 0, 0), axis=(0, 1, 0))
        model.add_spring("k", "ground", "trolley", (-unit, 0, 0), (0, 0, 0), 8.0 / unit)
        model.add_torsion_spring("t", "trolley", "rod", (0, 1, 0), 3.0 * unit)
        model.add_load("wind", "trolley", force=(6.0, 0, 0))
        result = equilibrium(model, snap=snap)
        results.append((result.iterations, result.load_steps, np.divide(result.model.bodies["rod"].position, unit)))
    assert results[0][0] > 3
    for steps, shares, place in results[1:]:
        assert (steps, shares) == results[0][:2]
        np.testing.assert_allclose(place, results[0][2], rtol=0, atol=1e-12)
