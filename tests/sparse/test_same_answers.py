"""Small mechanisms of all kinds: the sparse equations give what the dense ones give."""


import numpy as np
import pytest
from hypothesis import assume, given, reject
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.common.arguments import DIRECTIONS
from tests.support import overconstrained
from tests.support.compare import assert_same_eigenvalues, assert_same_response, both_ways
from tests.support.random_models import closed_loops, open_trees, planar_loops
from tests.support.sizes import examples

ANY = st.one_of(
    open_trees(), open_trees(negative=st.just(True)), open_trees(floating=st.just(True)), closed_loops(),
    planar_loops(), open_trees(damped=st.just(False)), closed_loops(damped=st.just(False)),
)  # fmt: skip
OMEGA = np.array([0.7, 13.0, 170.0, 3e3])


def both(model):
    """Dense and sparse equations of a pose that neither path doubts; where one doubts, so does the other."""
    dense, sparse = both_ways(model)
    if isinstance(dense, type) or isinstance(sparse, type):
        assert dense is sparse
        reject()
    assert (dense.dof, dense.tree, dense.cut_joints) == (sparse.dof, sparse.tree, sparse.cut_joints)
    assert dense.redundant == sparse.redundant
    return dense, sparse


def motion_of(shape):
    """Displacements of all bodies, one vector a mode, of unit length."""
    whole = np.concatenate([shape[name] for name in sorted(shape)])
    return whole / np.linalg.norm(whole, axis=0)


@pytest.mark.slow
@examples(16, slow=24)
@given(ANY)
def test_modes(model):
    dense, sparse = both(model)
    assume(dense.dof)
    one, other = dense.modes(rtol=None), sparse.modes(sparse.dof)
    assert one.rigid == other.rigid
    assert_same_eigenvalues(other.eigenvalues, one.eigenvalues, rtol=2e-11)
    assert other.missed == 0


@pytest.mark.slow
@examples(14, slow=26)
@given(ANY)
def test_shapes(model):
    """Modes that stand apart move the bodies in the same way, but for a (complex) factor."""
    dense, sparse = both(model)
    assume(dense.dof)
    one, other = dense.modes(), sparse.modes(sparse.dof)
    a, b = motion_of(one.body_shapes), motion_of(other.body_shapes)
    gap = np.abs(one.natural[:, None] - one.natural) + np.diag(np.full(dense.dof, np.inf))
    for i in np.flatnonzero((gap.min(axis=1) > 1e-4 * one.natural.max()) & (one.natural > 1e-4 * one.natural.max())):
        if one.eigenvalues[2 * i].imag:  # of a pair that creeps either vector is shown
            assert abs(abs(np.vdot(a[:, i], b[:, i])) - 1) < 1e-8


@pytest.mark.slow
@given(ANY)
def test_frequency_response(model):
    """Displacement, velocity, acceleration and force outputs of forces and base motion."""
    dense, sparse = both(model)
    assert sparse.inputs == dense.inputs
    assert sparse.outputs == dense.outputs
    assert (sparse.input_units, sparse.output_units) == (dense.input_units, dense.output_units)
    assume(dense.dof)
    pivot = min((group.retained for group in sparse.constraints.groups), default=1.0)
    expected = dense.frequency_response(OMEGA)
    found = sparse.frequency_response(OMEGA)
    size = np.abs(expected).max(axis=1, keepdims=True)
    noise = 1e-13 * size.max(axis=0, keepdims=True)  # what cannot respond is zero on one path and rounding on the other
    assert (np.abs(found - expected) <= (1e-10 * size + noise) / pivot).all()


@pytest.mark.slow
@examples(14, slow=26)
@given(ANY)
def test_static_compliance(model):
    dense, sparse = both(model)
    assume(dense.dof)
    assume(dense.modes().rigid == 0)
    assume(dense.modes().natural[0] > 1e-3 * dense.modes().natural[-1])
    expected = dense.Cq @ np.linalg.solve(dense.K, dense.B) + dense.D
    assert_allclose(sparse.static_compliance(), expected, rtol=0, atol=1e-8 * np.abs(expected).max(initial=1e-30))


@pytest.mark.slow
@examples(20, slow=20)
@given(ANY, st.data())
def test_some_modes(model, data):
    """The lowest ones and those around a frequency are the dense path's."""
    dense, sparse = both(model)
    assume(dense.dof)
    every = dense.modes()
    k = data.draw(st.integers(1, dense.dof))
    near = data.draw(st.sampled_from([0.0, *(1.003 * every.frequencies[every.frequencies > 0]).tolist(), 0.3, 1e3]))
    found, expected = sparse.modes(k, near=near), every.nearest(k, near)
    assert len(found) == k
    distance = np.sort(np.abs(every.frequencies - near))
    if k < dense.dof and distance[k] - distance[k - 1] < 1e-9 * (near + distance[k]):
        reject()  # equally near: either is right
    assert found.rigid == expected.rigid
    assert not found.frequencies[: found.rigid].any()
    assert_allclose(found.frequencies, expected.frequencies, rtol=2e-11 + every.errors.max())
    assert_same_eigenvalues(found.eigenvalues, expected.eigenvalues, rtol=2e-10 + every.errors.max())


@pytest.mark.parametrize("name", overconstrained.ALL)
def test_overconstrained_mechanisms(name):
    """What counting constraints gets wrong, redundant rows and dead centres included."""
    model, redundant = overconstrained.ALL[name]()
    found = []
    for method in ("dense", "sparse"):
        try:
            found.append(model.linearize(method=method))
        except mv.SingularPoseError as error:
            found.append(str(error).split(":")[0])
    dense, sparse = found
    if isinstance(dense, str) or isinstance(sparse, str):
        assert dense == sparse
        return
    assert sparse.dof == dense.dof
    assert len(sparse.redundant) == redundant == len(dense.redundant)
    assert_same_eigenvalues(sparse.modes(sparse.dof).eigenvalues, dense.modes().eigenvalues, rtol=1e-12)


@pytest.mark.slow
@examples(14, slow=26)
@given(ANY)
def test_reduced_by_all_modes_is_the_whole(model):
    """Modal coordinates of every mode: the same responses in time and frequency, from small dense matrices."""
    dense, sparse = both(model)
    assume(dense.dof)
    small = sparse.reduced(sparse.dof)
    assert_same_response(small.frequency_response(OMEGA), dense.frequency_response(OMEGA), rtol=1e-9)
    assume(dense.modes().stable)
    t = np.linspace(0, 0.05, 20)
    u = np.sin(40 * t + np.arange(len(dense.inputs))[:, None])
    expected = dense.time_response(t, u)
    size = np.abs(expected).max(axis=1, keepdims=True)
    size = np.maximum(size, 1e-6 * size.max(initial=0.0))
    assert (np.abs(sparse.time_response(t, u, modes=sparse.dof) - expected) <= 1e-8 * size + 1e-30).all()


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (2, -1, 2)])
@pytest.mark.parametrize("seat", ["fixed", "revolute", "prismatic"])
def test_a_body_on_the_arm_of_another(seat, axis):
    """It moves where the other turns, also along directions in which its own joint does not move it."""
    unit, at = np.array(axis) / np.linalg.norm(axis), np.array((1.0, 0.4, 0.5))
    model = mv.Model("rider")
    model.add_body("lever", 1.0, (0.1, 0.2, 0.3), (1, 0, 0))
    model.add_body("rider", 2.0, (0.3, 0.2, 0.1), at)
    model.add_joint("hinge", "revolute", "ground", "lever", (0, 0, 0), axis=axis)
    model.add_joint("seat", seat, "lever", "rider", at, **{} if seat == "fixed" else {"axis": (0, 0, 1)})
    model.add_bushing("k", "ground", "lever", (0, 0, 0), (1, 2, 3, 40, 40, 40))
    model.add_bushing("k2", "lever", "rider", at, (7, 8, 9, 10, 11, 12))
    wrench = np.arange(1.0, 7.0)
    model.add_input("F", "rider", wrench)
    for direction in DIRECTIONS:
        model.add_output(direction, "rider", direction)
    dense, sparse = (model.linearize(method=method).frequency_response(OMEGA) for method in ("dense", "sparse"))
    assert_allclose(sparse, dense, rtol=1e-11, atol=1e-14 * np.abs(dense).max())
    if seat == "fixed":  # one degree of freedom: w (w . F) / (k - J omega^2)
        motion = np.concatenate((np.cross(unit, at), unit))
        inertia = unit @ np.diag((0.4, 0.4, 0.4)) @ unit + np.sum(np.cross(unit, (1, 0, 0)) ** 2) \
            + 2.0 * np.sum(motion[:3] ** 2)
        expected = np.outer(motion * (motion @ wrench), 1.0 / (40.0 - inertia * OMEGA**2))
        assert_allclose(sparse[:, 0], expected, rtol=1e-11, atol=1e-14 * np.abs(expected).max())


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_mode_that_diverges_is_among_those_near_its_rate(unit):
    """Masses by themselves, of which a negative spring lets one diverge with 31 1/s, in any unit of time."""
    model = mv.Model("row")
    for k in range(1, 81):
        model.add_body(f"b{k}", 1.0, (1, 1, 1), (0, 0, k))
        model.add_joint(f"j{k}", "prismatic", "ground", f"b{k}", axis=(0, 0, 1))
        model.add_bushing(f"k{k}", "ground", f"b{k}", (0, 0, k),
                          (0, 0, (k * unit) ** 2 * (-1 if k == 31 else 1), 0, 0, 0))  # fmt: skip
    result = model.linearize(method="sparse").modes(3, near=30.6 * unit / (2 * np.pi))
    assert not result.stable
    assert_allclose(result.eigenvalues / unit, [31, -31, 30j, -30j, 32j, -32j], rtol=1e-10, atol=1e-10)
