"""Couplers in sparse equations: the dense path's answers, in trees, loops and under loads, and closed forms of many."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.couplers.test_couplers import four_bar, shafts
from tests.sparse.test_forces import OMEGA, differ, smallest_pivot, with_forces
from tests.support.compare import assert_same_eigenvalues, both_ways
from tests.support.loaded_models import loaded
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds
from tests.support.sizes import examples, few

# redundant constraints are welcome here: what they leave open is compared as well
pytestmark = pytest.mark.filterwarnings("ignore::mbsvib.UndeterminedForceWarning")

def coupled(model, seed, most):
    """Random relations between coordinates of the model's joints, in the tree or cut."""
    rng = np.random.default_rng(seed)
    free = [f"{joint.name}.{way}" for joint in model.joints.values() if joint.kind != "distance"
            for way, _ in joint.freedom]  # fmt: skip
    for k in range(min(most, len(free) // 2)):
        names = rng.choice(free, int(rng.integers(2, min(4, len(free)) + 1)), replace=False)
        model.add_coupler(f"coupler{k}", dict(zip(names, rng.normal(size=len(names)), strict=True)))
    return model


def systems(model):
    """Both systems of a pose that neither path doubts; where one doubts, so does the other."""
    dense, sparse = both_ways(model)
    assume(not isinstance(dense, type))
    assert (dense.dof, set(dense.redundant)) == (sparse.dof, set(sparse.redundant))
    assume(dense.dof)
    return dense, sparse


ANY = st.one_of(
    st.builds(coupled, st.one_of(open_trees(), open_trees(floating=st.just(True)), closed_loops()), seeds(),
              most=st.just(2)),
    st.builds(coupled, planar_loops(), seeds(), most=st.just(1)),
)  # fmt: skip


@pytest.mark.slow
@examples(8, slow=40)
@given(ANY)
def test_random_mechanisms(model):
    """Modes, responses and forces in joints, of which those that couplers transmit are a part."""
    dense, sparse = systems(with_forces(model, bodies=()))
    retained = smallest_pivot(sparse)
    first, second = dense.modes(), sparse.modes(sparse.dof)
    assert first.rigid == second.rigid
    assert_same_eigenvalues(second.eigenvalues, first.eigenvalues, rtol=1e-10 / retained)
    expected = dense.frequency_response(OMEGA)
    assert differ(sparse.frequency_response(OMEGA), expected, retained) < 1e-9
    assert differ(sparse.reduced(sparse.dof).frequency_response(OMEGA), expected, retained) < 1e-9


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.NearSingularWarning")
@pytest.mark.parametrize("seed", few(range(5), 2))
@pytest.mark.parametrize("words", [
    {}, {"loops": 1, "kinds": ("universal", "spherical", "cylindrical")},
    {"loops": 2, "kinds": ("cylindrical", "universal", "spherical", "planar", "free", "screw", "point_on_plane")},
])  # fmt: skip
def test_random_mechanisms_under_load(seed, words):
    model = loaded(seed, bodies=4, couplers=2, **words)
    for body in model.bodies:
        model.add_input(f"push {body}", body, (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
    try:
        dense = with_forces(model).linearize(method="dense")
    except mv.SingularPoseError:
        pytest.skip("the random bodies are locked")
    sparse = model.linearize(method="sparse")
    assert sparse.dof == dense.dof
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), smallest_pivot(sparse)) < 1e-9


@pytest.mark.few(1)
@pytest.mark.filterwarnings("ignore::mbsvib.NearSingularWarning")
@pytest.mark.parametrize(("seed", "words"), [
    (4, {"loops": 1, "kinds": ("universal", "spherical", "cylindrical")}), (3, {"loops": 1}), (4, {"loops": 1}),
    (3, {"loops": 2, "kinds": ("cylindrical", "universal", "spherical", "planar", "free", "screw", "point_on_plane")}),
])  # fmt: skip
def test_forces_of_couplers_at_cut_joints_make_stiffness(seed, words):
    model = loaded(seed, bodies=4, couplers=2, **words)
    for body in model.bodies:
        model.add_input(f"push {body}", body, (1.0, 0.5, 0.3, 0.2, 0.1, 0.7))
        model.add_output(f"see {body}", body, (0.3, 0.5, -1.0, 0.2, 0.7, 0.1))
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    assert sparse.dof == dense.dof > 0
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA), smallest_pivot(sparse)) < 1e-9


@pytest.mark.few(2)
@pytest.mark.parametrize("cut", ["j0", "j1", "j2", "j3"])
@pytest.mark.parametrize("coefficients", [{"j0.rz": 1.0, "j1.rz": -0.7}, {"j0.rz": 1.0, "j3.rz": 2.0, "shaft.rz": 3.0}])
def test_joints_of_a_loop_in_the_tree_or_cut(cut, coefficients):
    model = four_bar([(0, 0, 0), (0.1, 0.8, 0), (1.2, 1.1, 0), (1.4, 0, 0)])
    model.add_body("motor", 1.0, (0.1, 0.1, 0.2), (-0.5, 0, 0))
    model.add_joint("shaft", "revolute", "crank", "motor", (-0.5, 0, 0))
    model.add_bushing("clutch", "crank", "motor", (-0.5, 0, 0), (0, 0, 0, 0, 0, 70.0), (0, 0, 0, 0, 0, 0.3))
    model.add_input("torque", "motor", "rz")
    model.add_coupler("relation", coefficients)
    with_forces(model, bodies=())
    dense, sparse = (model.linearize(method=method, cut=[cut]) for method in ("dense", "sparse"))
    assert sparse.dof == dense.dof
    assert set(sparse.redundant) == set(dense.redundant)
    assert differ(sparse.frequency_response(OMEGA), dense.frequency_response(OMEGA)) < 1e-9


@pytest.mark.parametrize("ratio", [-0.4, 1.0, 25.0, -1e-4, 1e4])
def test_gears_reflect_inertia_by_the_square_of_their_ratio(ratio):
    model = shafts(2)
    model.add_gear("mesh", "s0.j", "s1.j", ratio)
    omega = 2 * np.pi * model.linearize(method="sparse").modes(1).frequencies[0]
    assert_allclose(omega**2, (3.0 + ratio**2 * 4.0) / (0.03 + ratio**2 * 0.04), rtol=1e-12)


def test_a_rack_moves_by_its_pitch_radius():
    model = shafts(2, slide=True)
    model.add_rack("rack", "s0.j", "s1.j", -0.05)
    system = model.linearize(method="sparse")
    omega = 2 * np.pi * system.modes(1).frequencies[0]
    assert_allclose(omega**2, (3.0 + 50.0 * 0.05**2) / (0.03 + 3.0 * 0.05**2), rtol=1e-13)
    assert "none but those of couplers" in system.explain()


def train(n, ratio=-0.8):
    """Shafts side by side on equal springs, each geared to the next and the last to nothing."""
    model = mv.Model(f"train{n}")
    for i in range(n):
        model.add_body(f"s{i}", 1.0, (0.1, 0.1, 0.03), (0.3 * i, 0, 0))
        model.add_joint(f"j{i}", "revolute", "ground", f"s{i}", (0.3 * i, 0, 0))
        model.add_bushing(f"k{i}", "ground", f"s{i}", (0.3 * i, 0, 0), (0, 0, 0, 0, 0, 1.0 + i % 3))
        if i:
            model.add_gear(f"mesh{i}", f"j{i - 1}", f"j{i}", ratio if i % 2 else 1 / ratio)
    model.add_input("torque", f"s{n - 1}", "rz")
    model.add_force_output("holds", "j0", "rz")
    return model


@pytest.mark.slow
def test_trains_of_very_many_gears():
    """One freedom of thousands of shafts, in equations that grow with them."""
    n, ratio = 3000, -0.8
    system = train(n, ratio).linearize()
    assert type(system).__name__ == "SparseSystem"
    assert system.dof == 1
    turn = np.where(np.arange(n) % 2, ratio, 1.0)
    inertia, stiffness = 0.03 * (turn**2).sum(), ((1.0 + np.arange(n) % 3) * turn**2).sum()
    assert_allclose((2 * np.pi * system.modes(1).frequencies[0]) ** 2, stiffness / inertia, rtol=1e-12)
    # held still, the first gear carries to its shaft's spring what that one takes of the torque
    slow = system.frequency_response([0.0])[0, 0, 0]
    assert_allclose(slow, -turn[-1] / stiffness, rtol=1e-10)
    small, large = (train(count).linearize(method="sparse") for count in (50, 500))
    assert len(large.tableau.indices) <= 10.5 * len(small.tableau.indices)
    assert large.tableau.factor().lu.nnz <= 10.5 * small.tableau.factor().lu.nnz


@pytest.mark.parametrize("last", [6.0, 5.0])
def test_a_train_that_closes_is_redundant_where_its_ratios_agree(last):
    model = shafts(3)
    for name, first, second, ratio in (("ab", 0, 1, -2.0), ("bc", 1, 2, -3.0), ("ac", 0, 2, last)):
        model.add_gear(name, f"s{first}.j", f"s{second}.j", ratio)
    system = model.linearize(method="sparse")
    assert system.dof == (1 if last == 6.0 else 0)
    assert system.redundant == model.linearize(method="dense").redundant


def test_parts_that_gears_join_are_within_reach_of_each_other():
    model = shafts(4)
    model.add_gear("ab", "s0.j", "s1.j", -2.0)
    model.add_gear("cd", "s2.j", "s3.j", 1.5)
    model.add_input("M", "s0", "rz")
    model.add_output("turn", "s1", "rz")
    model.add_output("other", "s3", "rz")
    system = model.linearize(method="sparse")
    part = system.reachable(["turn"], "M")
    assert part.bodies == ("s0", "s1")
    assert part.dof == 1
    assert_allclose(part.frequency_response(OMEGA), system.frequency_response(OMEGA)[:1], rtol=1e-12)


def test_a_coupler_with_the_name_of_a_redundant_constraint():
    """Five bars with two degrees of freedom, of which a coupler takes one, whatever its name."""
    points = np.array([(0.0, 0.0), (0.0, 1.0), (0.6, 1.5), (1.1, 1.0), (1.0, 0.0)])

    def five_bar(name):
        model = mv.Model("five bars")
        chain = ["ground", *(model.add_body(f"b{i}", 1.0, (1, 1, 1), (*points[i : i + 2].mean(axis=0), 0.0)).name
                             for i in range(4)), "ground"]  # fmt: skip
        for i, (first, second) in enumerate(pairwise(chain)):
            at = (*points[i], 0.0)
            model.add_joint(f"p{i}", "revolute", first, second, at)
            model.add_bushing(f"k{i}", first, second, at, (0, 0, 0, 0, 0, 100.0 + i))
        model.add_coupler(name, {"p0.rz": 1.0, "p1.rz": -2.0})
        return model.linearize(method="sparse")

    system = five_bar("gear")
    for name in system.redundant:
        other = five_bar(name)
        assert (other.dof, other.redundant) == (system.dof, system.redundant) == (1, system.redundant)
        assert_allclose(other.modes(1).frequencies, system.modes(1).frequencies, rtol=1e-12)
