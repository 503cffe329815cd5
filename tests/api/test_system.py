"""The system: every matrix against the reference, names and units, and what must not change an answer."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.arm import arm
from tests.support.compare import assert_same_matrices, linearized
from tests.support.exact import Exact
from tests.support.random_models import (
    closed_loops,
    moved,
    open_trees,
    planar_loops,
    rebuilt,
    rotation,
    seeds,
    spatial,
    swapped,
    turned,
)
from tests.support.sizes import examples

WORDS = {"negative": st.booleans(), "damped": st.booleans()}
ANY = st.one_of(open_trees(**WORDS), open_trees(floating=st.just(True)), closed_loops(**WORDS), planar_loops())
GROUNDED = st.one_of(open_trees(), closed_loops(), planar_loops())


@pytest.mark.slow
@examples(12, slow=40)
@given(ANY)
def test_all_matrices(model):
    """M, C, K, B, Cq, Cv, Ca and D: base motion, relative ports and force outputs included."""
    assert_same_matrices(linearized(model), Exact(model))


@pytest.mark.slow
@examples(6, slow=40)
@given(st.one_of(open_trees(offset=st.just(1e4)), closed_loops(offset=st.just(1e4)), planar_loops(offset=st.just(1e4))))
def test_all_matrices_ten_kilometres_away(model):
    """The data are doubles, exact where they are: distances between them lose nothing."""
    assert_same_matrices(linearized(model), Exact(model))


@pytest.mark.slow
@given(st.one_of(open_trees(**WORDS), closed_loops(**WORDS)), st.data())
def test_all_matrices_at_length(model, data):
    """More of the same with more bodies."""
    seed = data.draw(seeds())
    bigger = spatial(seed, bodies=data.draw(st.integers(4, 8)), loops=data.draw(st.integers(0, 3)))
    for item in (model, bigger):
        assert_same_matrices(linearized(item), Exact(item))


@pytest.mark.slow
@given(ANY)
def test_matrices_are_symmetric_and_mass_is_positive(model):
    system = linearized(model)
    for matrix in (system.M, system.C, system.K):
        assert (matrix == matrix.T).all()
    assert (np.linalg.eigvalsh(system.M) > 0).all()


@pytest.mark.slow
@given(ANY)
def test_the_factors_give_the_matrices(model):
    system = linearized(model)
    d = system.elastic_rows
    for matrix, product in ((system.M, system.inertia_factor.T @ system.inertia_factor),
                            (system.K, d.T @ (system.row_stiffness[:, None] * d)),
                            (system.C, d.T @ (system.row_damping[:, None] * d))):  # fmt: skip
        assert_allclose(product, matrix, rtol=0, atol=1e-14 * np.abs(matrix).max(initial=1))


def response(system):
    """What does not depend on the choice of coordinates."""
    return system.frequency_response([3.0, 40.0])


def assert_same_answers(first, second, rtol):
    assert first.dof == second.dof
    a, b = response(first), response(second)
    size = np.maximum(np.abs(a).max(axis=1, keepdims=True), 1e-4 * np.abs(a).max())
    assert np.abs(a - b).max(initial=0) <= rtol * size.max()
    assert (np.abs(a - b) <= rtol * size).all()


def well_behaved(system):
    """Whether 3 and 40 rad/s lie far enough from the poles for rounding not to be multiplied."""
    values = system.modes().eigenvalues
    distance = np.abs(1j * np.array([[3.0], [40.0]]) - values) / np.maximum(np.abs(values), 3.0)
    return distance.min(initial=1.0) > 1e-3


@pytest.mark.slow
@examples(15, slow=25)
@given(GROUNDED, st.integers(0, 100))
def test_insertion_order(model, order):
    first, second = linearized(model), linearized(rebuilt(model, order=order))
    assume(well_behaved(first))
    assert_same_answers(first, second, rtol=1e-9)


@pytest.mark.slow
@examples(15, slow=25)
@given(GROUNDED)
def test_first_and_second_swapped(model):
    first, second = linearized(model), linearized(swapped(model))
    assume(well_behaved(first))
    assert_same_answers(first, second, rtol=1e-9)


@pytest.mark.slow
@examples(15, slow=25)
@given(GROUNDED, seeds())
def test_moved_ten_kilometres(model, seed):
    """Moving rounds the positions to 1e-12 m, and the answers change by as much."""
    shift = 1e4 * np.random.default_rng(seed).uniform(-1, 1, size=3)
    first, second = linearized(model), linearized(moved(model, shift))
    assume(well_behaved(first))
    assert_same_answers(first, second, rtol=1e-7)


@pytest.mark.slow
@examples(15, slow=25)
@given(GROUNDED, seeds())
def test_world_turned(model, seed):
    first, second = linearized(model), linearized(turned(model, rotation(np.random.default_rng(seed))))
    assume(well_behaved(first))
    assert_same_answers(first, second, rtol=1e-8)


def test_arrays_are_read_only():
    system = arm().linearize()
    for name in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D", "inertia_factor", "elastic_rows", "body_motion"):
        array = getattr(system, name)
        assert array.dtype == float
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(FrozenInstanceError):
        system.M = np.eye(4)


def test_names_and_units():
    model = arm()
    model.add_input("twist", "hand", "rx")
    model.add_input("both", "hand", (1, 0, 0, 0, 0, 1))
    model.add_base_motion("roll", "rx")
    model.add_output("rate", "hand", "rz", quantity="velocity")
    model.add_output("felt", "hand", (1, 2, 3), quantity="acceleration")
    model.add_output("spin", "hand", "rz", quantity="acceleration")
    model.add_force_output("moment", "mount", "ry")
    system = model.linearize()
    assert (system.name, system.bodies) == ("robot", ("arm", "hand"))
    assert system.coordinates == ("hinge.rz", "wrist.rx", "wrist.ry", "wrist.rz")
    assert system.coordinate_units == ("rad",) * 4
    assert system.inputs == ("push", "shake", "twist", "both", "roll")
    assert system.input_units[:3] == ("N", "m/s^2", "N m")
    assert system.input_units[4] == "rad/s^2"
    assert system.outputs == ("sway", "tension", "rate", "felt", "spin", "moment")
    assert system.output_units == ("m", "N", "rad/s", "m/s^2", "rad/s^2", "N m")


def test_a_slider_counts_metres():
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "cylindrical", "ground", "b", position=(0, 0, 0))
    assert model.linearize().coordinate_units == ("m", "rad")


@pytest.mark.parametrize("kind", ["screw"])
def test_a_screw_counts_radians(kind):
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", kind, "ground", "b", position=(0, 0, 0), pitch=0.01)
    system = model.linearize()
    assert system.coordinate_units == ("rad",)
    assert_allclose(system.M, [[1 + 1e-4]], rtol=1e-15)


def test_forces_on_ground_alone_do_nothing_and_reactions_act():
    model = arm()
    model.add_input("inner", "hand", "x", position=(0, 0, 1), relative_to="arm")
    model.add_input("outer", "arm", "x", position=(0, 0, 1), relative_to="hand")
    model.add_input("back", "ground", "x", position=(0, 0, 1.2), relative_to="hand")
    system = model.linearize()
    column = dict(zip(system.inputs, system.B.T, strict=True))
    assert_allclose(column["inner"], -column["outer"], atol=0)
    assert_allclose(column["back"], -column["push"], atol=1e-16)


def test_tension_is_positive():
    """A force that pulls the hand away from its spring stretches it: the spring pulls the bodies together."""
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 0, 2))
    model.add_joint("j", "prismatic", "ground", "b")
    model.add_spring("k", "ground", "b", (0, 0, 0), (0, 0, 2), stiffness=50.0, damping=3.0)
    model.add_bushing("pad", "b", "ground", (0, 0, 2), (0, 0, 50.0, 0, 0, 0))
    model.add_input("up", "b", "z")
    model.add_force_output("line", "k")
    model.add_force_output("pad.z", "pad", "z")
    system = model.linearize()
    static = system.frequency_response([0.0])[:, 0, 0]
    assert_allclose(static, [0.5, -0.5], rtol=1e-15)  # the pad counts ground against body
    assert_allclose((system.Cq, system.Cv), ([[50], [-50]], [[3], [0]]), rtol=1e-15)


def test_base_motion_and_accelerometers():
    """A free body is not carried along: its absolute acceleration is zero, and against the base it is -1."""
    model = mv.Model()
    model.add_body("b", 2.0, (1, 1, 1), position=(0, 3, 0))
    model.add_base_motion("up", "z")
    model.add_base_motion("roll", "rx", position=(0, 1, 0))
    for absolute in (True, False, None):
        model.add_output(f"a{absolute}", "b", "z", quantity="acceleration", absolute=absolute)
    system = model.linearize()
    result = (system.Ca @ np.linalg.solve(system.M, system.B) + system.D).tolist()
    assert_allclose(result, [[0, 0], [-1, -2], [0, 0]], atol=1e-15)
    assert_allclose(system.D, [[1, 2], [0, 0], [1, 2]], atol=0)


def test_massless_motion_is_refused_by_name():
    model = mv.Model()
    model.add_body("needle", 1.0, (1, 1, 0))
    model.add_joint("ball", "spherical", "ground", "needle", position=(0, 0, 0))
    with pytest.raises(mv.ModelError, match=r"coordinate 'ball\.rz'.*mass matrix is singular"):
        model.linearize()


@pytest.mark.parametrize("small", [1e-9, 1e-6])
def test_a_small_inertia_is_no_zero(small):
    model = mv.Model()
    model.add_body("needle", 1.0, (1, 1, small))
    model.add_joint("ball", "spherical", "ground", "needle", position=(0, 0, 0))
    assert model.linearize().M[2, 2] == pytest.approx(small, rel=1e-14)


@pytest.mark.slow
@examples(12, slow=40)
@given(ANY)
def test_explain_tells_the_story(model):
    system = linearized(model)
    text = system.explain()
    assert f"{system.dof} DOF" in text
    locking = [name for name in system.cut_joints if model.joints[name].locked]
    for name in (*locking, *system.redundant):
        assert name in text or "..." in text
    assert all(len(line) < 2000 for line in text.splitlines())


def test_repr_counts():
    assert repr(arm().linearize()) == "System('robot': 4 DOF, 2 inputs, 2 outputs)"


def test_a_model_without_ports_and_springs():
    model = mv.Model()
    model.add_body("b", 1.0, (1, 2, 2.5))
    system = model.linearize()
    assert (system.B.shape, system.Cq.shape, system.D.shape) == ((6, 0), (0, 6), (0, 0))
    assert not system.K.any()
    assert not system.C.any()
    assert_allclose(system.M, np.diag([1, 1, 1, 1, 2, 2.5]), rtol=1e-15)
