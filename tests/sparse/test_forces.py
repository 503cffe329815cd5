"""Forces in joints, and sums of forces on bodies and the ground, of many bodies: the dense path's answers."""


import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.beams import Material, Rectangle
from tests.sparse import scenes
from tests.superelements.craig_bampton import NODES, reduced
from tests.support import overconstrained
from tests.support.compare import linearized
from tests.support.loaded_models import held, loaded
from tests.support.random_models import closed_loops, open_trees, planar_loops, rotation
from tests.support.sizes import examples, few

# redundant constraints are welcome here: what they leave open is compared as well
pytestmark = pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")
SIX = ("x", "y", "z", "rx", "ry", "rz")
OMEGA = np.array([0.7, 13.0, 170.0, 3e3])
ANY = st.one_of(open_trees(), open_trees(floating=st.just(True)), closed_loops(), planar_loops(),
                closed_loops(damped=st.just(False)))  # fmt: skip


def with_forces(model, joints=None, bodies=None):
    """All components in joints, and of the sums on bodies and the ground."""
    joints, bodies = (model.joints if joints is None else joints, model.bodies if bodies is None else bodies)
    for name in (*joints, *bodies, "ground"):
        for direction in SIX:
            model.add_force_output(f"{name}!{direction}", name, direction)
    return model


def both(model):
    result = [linearized(model, method=method) for method in ("dense", "sparse")]
    assert result[0].outputs == result[1].outputs
    assert result[0].output_units == result[1].output_units
    return result


def differ(result, expected, retained=1.0):
    """The largest difference: as a share of what the same joint or body has, whichever way it acts."""
    size = np.abs(expected).max(axis=1, keepdims=True)
    noise = size.max(axis=0, keepdims=True)  # forces along free directions are zero but for rounding
    return float((np.abs(result - expected) / (size + 1e-2 * noise + 1e-30)).max()) * retained


def smallest_pivot(system):
    return min((group.retained for group in system.constraints.groups), default=1.0)


@pytest.mark.slow
@examples(10, slow=40)
@given(ANY)
def test_random_mechanisms(model):
    """Frequency responses, and those in time and of states with all modes."""
    dense, sparse = both(with_forces(model))
    assume(dense.dof)
    retained = smallest_pivot(sparse)
    expected = dense.frequency_response(OMEGA)
    assert differ(sparse.frequency_response(OMEGA), expected, retained) < 1e-9
    small = sparse.reduced(sparse.dof)
    assert differ(small.frequency_response(OMEGA), expected, retained) < 1e-9
    assume(dense.modes().stable)
    ss = sparse.state_space(modes=sparse.dof)
    result = ss.C @ np.linalg.solve(1j * OMEGA[1] * np.eye(len(ss.A)) - ss.A, ss.B) + ss.D
    assert differ(result[:, :, None], expected[:, :, 1:2], retained) < 1e-9
    t = np.linspace(0, 0.05, 10)
    u = np.sin(40 * t + np.arange(len(dense.inputs))[:, None])
    expected = dense.time_response(t, u)
    result = sparse.time_response(t, u, modes=sparse.dof)
    assert np.abs(result - expected).max() < 1e-8 / retained * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", few(sorted(overconstrained.ALL, key=lambda name: name.startswith("slider ")), 8))
def test_redundant_constraints_share_forces_as_on_the_dense_path(name, monkeypatch):
    """Of least norm, at rest and as the pose changes; by dense factors and by the sparse ones of large groups."""
    for load in (False, True):
        model, _ = overconstrained.ALL[name]()
        model = with_forces(held(model) if load else model, bodies=())
        model.add_input("push", list(model.bodies)[-1], (1.0, 2.0, 3.0, 0.3, 0.2, 0.1))
        expected = model.linearize(method="dense").frequency_response(OMEGA)
        for most in (250_000, 0):
            monkeypatch.setattr("mbsvib.sparse.self_stress.MOST_DENSE_ENTRIES", most)
            assert differ(model.linearize(method="sparse").frequency_response(OMEGA), expected) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("make", [
    lambda: scenes.grid(4, 3), lambda: scenes.grid(3, 3, "spherical", flat=False), lambda: scenes.ring(12),
    lambda: scenes.braced(13), lambda: mv.library.ladder(6), lambda: mv.library.stewart(),
])  # fmt: skip
def test_machines_with_many_loops(make):
    model = with_forces(make(), bodies=())
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    retained = smallest_pivot(sparse)
    assert sparse.redundant == dense.redundant
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), retained) < 1e-9


@pytest.mark.slow
def test_large_groups_of_loops_are_solved_sparse(monkeypatch):
    """The same forces as by the dense factors of small groups, redundant constraints included."""
    model = with_forces(mv.library.ladder(12), joints=list(mv.library.ladder(12).joints)[::7], bodies=())
    small = model.linearize(method="sparse").frequency_response(OMEGA)
    monkeypatch.setattr("mbsvib.sparse.self_stress.MOST_DENSE_ENTRIES", 0)
    assert differ(model.linearize(method="sparse").frequency_response(OMEGA), small) < 1e-9


def test_static_parts_of_modes_that_are_left_out():
    """Of a push at the tip of a chain few modes and their statics hold the root's force at low frequency."""
    model = mv.library.chain(60, line=(0, 1, 0))
    root = next(iter(model.joints))
    model.add_input("push", list(model.bodies)[-1], "y")
    for direction in SIX:
        model.add_force_output(f"root!{direction}", root, direction)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    low = 1e-2 * dense.modes().natural[:1]
    expected = dense.frequency_response(low)
    result = sparse.reduced(10, correction=True).frequency_response(low)
    assert differ(result, expected) < 1e-7
    np.testing.assert_allclose(sparse.static_compliance(), dense.Cq @ np.linalg.solve(dense.K, dense.B) + dense.D,
                               rtol=1e-9, atol=1e-9 * np.abs(expected).max())  # fmt: skip


@pytest.mark.slow
def test_static_parts_where_the_mechanism_floats():
    model = scenes.floating(40)
    model.add_input("F", "b39", (0.3, 1.0, 0.2, 0.1, 0.2, 0.3))
    with_forces(model, joints=["j0", "j20"], bodies=["b3"])
    for direction in ("rx", "ry", "rz"):
        model.add_force_output(f"s38!{direction}", "s38", direction)
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    low = 1e-2 * dense.modes().natural[6:7]
    expected = dense.frequency_response(low)
    off, close = (differ(sparse.reduced(20, correction=yes).frequency_response(low), expected) for yes in (False, True))
    assert close < 1e-8
    assert off > 1e-2


@pytest.mark.slow
def test_shaking_force_of_very_many_bodies_in_closed_form():
    """Carried along slowly, a chain leans on its foundation with all of its mass, and with its root on the joint."""
    n = 3000
    model = mv.library.chain(n, line=(0, 1, 0))
    root = next(iter(model.joints))
    model.add_base_motion("floor", "x")
    for direction in SIX:
        model.add_force_output(f"shake!{direction}", "ground", direction)
        model.add_force_output(f"root!{direction}", root, direction)
    system = model.linearize()
    assert type(system).__name__ == "SparseSystem"
    assert all(matrix.nnz <= 14 * 6 * n for matrix in system.output_rows), "a dense row each, and no more"
    response = system.frequency_response([1e-4 * system.modes(1).natural[0]])[:, system.inputs.index("floor"), 0]
    result = dict(zip(system.outputs, response, strict=True))
    mass = np.array([body.mass for body in model.bodies.values()])
    centre = np.array([body.position for body in model.bodies.values()])
    moment = np.cross(mass @ centre, (1.0, 0.0, 0.0))
    expected = -np.array((mass.sum(), 0.0, 0.0, *moment))
    shake = np.array([result[f"shake!{direction}"] for direction in SIX])
    np.testing.assert_allclose(shake, expected, rtol=1e-6, atol=1e-6 * np.abs(moment).max())
    assert model.joints[root].first == "ground"
    assert not np.any(model.joints[root].position)
    carried = np.array([result[f"root!{direction}"] for direction in SIX[:3]])
    axes = np.array(model.joints[root].axes)
    np.testing.assert_allclose(axes @ carried, expected[:3], rtol=1e-6, atol=1e-6 * mass.sum())


def test_machines_out_of_reach_take_their_outputs_along():
    """What is left out shows nothing; a shaking force sees all."""
    def chains(*names):
        model = mv.Model("two")
        for k, name in enumerate(names):
            for i in range(4):
                body, before = f"{name}{i}", f"{name}{i - 1}" if i else "ground"
                model.add_body(body, 1.0 + 0.2 * i, scenes.INERTIA, (0.5 + i, 3.0 * k, 0.0))
                model.add_joint(f"pin.{body}", "revolute", before, body, (i, 3.0 * k, 0.0))
                model.add_bushing(f"s.{body}", before, body, (i, 3.0 * k, 0.0), (0, 0, 0, 0, 0, 90.0))
            model.add_input(f"push.{name}", f"{name}3", "y")
            model.add_force_output(f"root.{name}", f"pin.{name}0", "y")
            model.add_force_output(f"sum.{name}", f"{name}2", "y")
        model.add_force_output("shake", "ground", "y")
        return model

    both_of = chains("a", "b").linearize(method="sparse")
    part = both_of.reachable(inputs="push.a")
    assert part.bodies == ("a0", "a1", "a2", "a3")
    single = chains("a").linearize(method="sparse").frequency_response(OMEGA)
    result = dict(zip(part.outputs, part.frequency_response(OMEGA), strict=True))
    for name, expected in zip(("root.a", "sum.a", "shake"), single, strict=True):
        np.testing.assert_allclose(result[name], expected, rtol=1e-11)
    assert not result["root.b"].any()
    assert not result["sum.b"].any()
    assert both_of.reachable("root.b", "push.b").bodies == ("b0", "b1", "b2", "b3")


def test_beams_share_mass_and_stiffness():
    model = mv.Model("mast")
    model.add_body("base", 3.0, (0.1, 0.2, 0.3), (0, 0, 0))
    model.add_joint("hinge", "universal", "ground", "base", (0, 0, -0.1))
    model.add_bushing("mount", "ground", "base", (0, 0, 0), (1e5, 1e5, 1e5, 1e3, 1e3, 1e3), (10.0,) * 6)
    model.add_body("head", 1.0, (0.01, 0.02, 0.03), (0.1, 0.0, 1.2))
    section, material = Rectangle(0.02, 0.03), Material(E=7e10, nu=0.3, rho=2700.0)
    model.add_beam("mast", "base", "head", section, material, start=(0, 0, 0.1), end=(0, 0, 1.0), elements=3)
    model.add_base_motion("floor", (1.0, 2.0, 0.5, 0.1, -0.2, 0.4), position=(0.3, 0.2, 0.1))
    model.add_input("F", "head", "y")
    with_forces(model, bodies=("base", "head"))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


def test_superelements_share_mass_and_stiffness():
    m, k = reduced(6)
    model = mv.Model("pipe")
    model.add_superelement("pipe", m, None, k, {"left": NODES[0], "right": NODES[-1]})
    model.add_joint("clamp", "fixed", "ground", "pipe.left", position=NODES[0])
    model.add_body("valve", 0.3, (0.01, 0.02, 0.02), NODES[-1])
    model.add_joint("flange", "spherical", "pipe.right", "valve", NODES[-1])
    model.add_bushing("seal", "pipe.right", "valve", NODES[-1], (0, 0, 0, 1e3, 1e3, 1e3), (1.0,) * 6)
    model.add_base_motion("floor", (1.0, 2.0, 0.5, 0.1, -0.2, 0.4), position=(0.3, 0.2, 0.1))
    model.add_input("F", "valve", (1, 2, 3, 0.1, 0.2, 0.3))
    with_forces(model, bodies=("valve",))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.NearSingularWarning")
@pytest.mark.parametrize("seed", few(range(6), 1))
@pytest.mark.parametrize("words", [
    {"bodies": 4}, {"bodies": 5, "loops": 2}, {"bodies": 3, "floating": True},
])  # fmt: skip
def test_random_mechanisms_under_load(seed, words):
    """Forces of the pose turn with the bodies, and their arms change."""
    model = loaded(seed, **words)
    for k, body in enumerate(model.bodies):
        model.add_input(f"in{k}", body, (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
    dense, sparse = (with_forces(model).linearize(method="dense"), model.linearize(method="sparse"))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), smallest_pivot(sparse)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("kind", [
    "universal", "homokinetic", "screw", "cylindrical", "planar", "distance", "point_on_line",
])  # fmt: skip
def test_every_kind_of_joint_under_load(kind):
    model = loaded(2, bodies=3, kinds=(kind,))
    model.add_input("push", list(model.bodies)[-1], (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
    dense, sparse = (with_forces(model).linearize(method="dense"), model.linearize(method="sparse"))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


def weighed_stewart():
    model = mv.library.stewart(ports="none")
    model.gravity = (0, 0, -9.81)
    return model.equilibrium(preload="leg*.k")


@pytest.mark.slow
@pytest.mark.parametrize("make", [mv.library.four_bar, mv.library.trifilar_pendulum, weighed_stewart,
                                  lambda: mv.library.pendulum_chain(20)])  # fmt: skip
def test_loaded_machines(make):
    """Loops and redundant constraints, of which the forces of the pose are those of least norm too."""
    model = with_forces(make())
    model.add_input("push", list(model.bodies)[-1], (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


@pytest.mark.slow
def test_large_loaded_groups_of_loops_are_solved_sparse(monkeypatch):
    """Forces of the pose of least norm, with redundant constraints, as the dense factors find them."""
    monkeypatch.setattr("mbsvib.sparse.self_stress.MOST_DENSE_ENTRIES", 0)
    for make in (mv.library.four_bar, mv.library.trifilar_pendulum):
        test_loaded_machines(make)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [("spherical", "revolute"), ("cylindrical", "revolute"), ("revolute", "fixed")])
def test_forces_in_coaxial_shafts(kinds):
    """Each in two bearings and joined to the next: columns that are rounding hold nothing.

    Their centres of mass are far off, so that turning the shafts rounds their points.
    """
    rng = np.random.default_rng(5)
    turn, origin, model = rotation(rng), rng.uniform(-3, 3, size=3), mv.Model("shafts")
    along = lambda z: origin + z * turn[:, 2]  # noqa: E731
    for k in range(5):
        model.add_body(f"b{k}", 1.0, (0.5, 0.5, 0.4), along(k + 0.5) + 1e3 * turn[:, 0])
        for name, z in (("near", k + 0.1), ("far", k + 0.9)):
            model.add_joint(f"{name} {k}", kinds[0], "ground", f"b{k}", along(z), axis=turn[:, 2])
        model.add_joint(f"j{k}", kinds[1], f"b{k - 1}" if k else "ground", f"b{k}", along(k), orientation=turn)
        model.add_bushing(f"k{k}", "ground", f"b{k}", along(k), (0, 0, 300.0, 0, 0, 50.0), orientation=turn)
    model.add_input("push", "b3", (1.0, 0.5, 0.3, 0.2, 0.1, 0.7), position=along(3.3))
    turned = model.moved(dict.fromkeys(model.linearize(method="dense").coordinates, 0.3), relaxed=True)
    dense, sparse = both(with_forces(turned))
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


def test_explain_says_how_forces_come_about():
    model = mv.library.ladder(3)
    model.add_force_output("grip", next(iter(model.joints)), "x")
    model.add_force_output("twist", next(iter(model.joints)), "rx")
    text = model.linearize(method="sparse").explain()
    assert "2 outputs by virtual work, rows as long as what they sum: grip, twist" in text
    assert "does not determine all forces in left1.foot, " in text
    assert "outputs that depend on it: twist" in text
    assert "virtual work" not in mv.library.ladder(3).linearize(method="sparse").explain()
