"""State space in physical and in modal states."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.responses.modal_blocks import pair_block
from tests.modes.test_modes import oscillator
from tests.support.arm import arm
from tests.support.compare import assert_same_eigenvalues, assert_same_response, frequencies, linearized
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops
from tests.support.sizes import examples

ANY = st.one_of(
    open_trees(damped=st.booleans()), open_trees(floating=st.just(True), damped=st.booleans()),
    open_trees(negative=st.just(True)), closed_loops(damped=st.booleans()), planar_loops(),
)  # fmt: skip
BOTH = pytest.mark.parametrize("realization", ["physical", "modal"])


def response(ss, omega):
    n = len(ss.A)
    return np.stack([ss.C @ np.linalg.solve(1j * w * np.eye(n) - ss.A, ss.B) + ss.D for w in omega], axis=2)


@pytest.mark.slow
@examples(10, slow=40)
@BOTH
@given(model=ANY)
def test_frequency_response(realization, model):
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)
    result = response(system.state_space(realization), omega)
    assert_same_response(result, reference.frequency_response(omega), rtol=1e-7)


@pytest.mark.few(1)
@examples(15, slow=25)
@BOTH
@given(model=ANY)
def test_poles(realization, model):
    system = linearized(model)
    modes = system.modes()
    assume(system.dof > 0)
    # a double zero splits into roots of the rounding
    values = np.linalg.eigvals(system.state_space(realization).A)
    size = np.abs(modes.eigenvalues).max()
    flexible = np.abs(modes.eigenvalues) > 1e-6 * size
    assume(flexible.any())
    retained = values[np.argsort(-np.abs(values))][: np.count_nonzero(flexible)]
    assert_same_eigenvalues(retained, modes.eigenvalues[flexible], rtol=1e-5)


@pytest.mark.slow
@examples(15, slow=25)
@given(ANY)
def test_physical_states_are_coordinates_and_rates(model):
    system = linearized(model)
    ss = system.state_space()
    m = system.dof
    assert ss.states == (*system.coordinates, *(f"d({name})/dt" for name in system.coordinates))
    assert ss.state_units == (*system.coordinate_units, *(f"{unit}/s" for unit in system.coordinate_units))
    assert (ss.A[:m, :m] == 0).all()
    assert (ss.A[:m, m:] == np.eye(m)).all()
    assert (ss.B[:m] == 0).all()
    size = np.abs(system.K).max(initial=1.0)
    assert_allclose(system.M @ ss.A[m:, :m], -system.K, rtol=0, atol=1e-11 * size)
    assert_allclose(system.M @ ss.B[m:], system.B, rtol=0, atol=1e-12 * np.abs(system.B).max(initial=1.0))


@pytest.mark.slow
@examples(15, slow=25)
@given(ANY)
def test_modal_states_are_blocks_of_one_mode_each(model):
    system = linearized(model)
    ss, modes = system.state_space("modal"), system.modes()
    blocks = np.kron(np.eye(system.dof), np.ones((2, 2)))
    assert (ss.A[blocks == 0] == 0).all()
    assert len(ss.states) == 2 * system.dof == len(set(ss.states))
    for k in range(system.dof):
        first, second = modes.eigenvalues[2 * k : 2 * k + 2]
        block = ss.A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
        assert block[0, 0] == 0
        assert block[0, 1] == 1
        assert block[1, 0] == pytest.approx(-(first * second).real, rel=1e-9, abs=0)
        assert block[1, 1] == pytest.approx((first + second).real, rel=1e-9, abs=1e-12 * abs(second))


@pytest.mark.slow
@examples(15, slow=25)
@given(ANY)
def test_modal_states_lead_back_to_coordinates(model):
    """transform A_modal = A_physical transform, and likewise for B and C."""
    system = linearized(model)
    physical, modal = system.state_space(), system.state_space("modal")
    t = modal.transform
    for result, expected, size in (
        (t @ modal.A, physical.A @ t, abs(physical.A).max(initial=0) * abs(t).max(initial=0)),
        (t @ modal.B, physical.B, abs(physical.B).max(initial=0)),
        (modal.C, physical.C @ t, abs(physical.C).max(initial=0) * abs(t).max(initial=0)),
        (modal.D, physical.D, abs(physical.D).max(initial=0)),
    ):
        assert_allclose(result, expected, rtol=0, atol=1e-9 * size)


@BOTH
@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 3.0])
def test_one_degree_of_freedom(realization, ratio):
    """Critical damping included, where no second eigenvector exists."""
    system = oscillator(2.0, 2 * ratio * 2.0 * 10.0, 200.0).linearize()
    ss = system.state_space(realization)
    w = np.array([0.5, 9.0, 40.0])
    s = 1j * w
    exact = 1 / (2 * s**2 + 40 * ratio * s + 200)
    assert_allclose(response(ss, w)[:, 0], [exact, s * exact, s**2 * exact], rtol=1e-12)
    assert_allclose(ss.A[1], [-100, -20 * ratio], rtol=1e-12)


@BOTH
@pytest.mark.parametrize("c", [0.0, 3.0])
def test_rigid_modes(realization, c):
    ss = oscillator(2.0, c=c).linearize().state_space(realization)
    w = np.array([0.5, 9.0])
    s = 1j * w
    exact = 1 / (2 * s**2 + c * s)
    assert_allclose(response(ss, w)[:, 0], [exact, s * exact, s**2 * exact], rtol=1e-13)
    assert_allclose(ss.A[1, 0], 0, atol=0)


@BOTH
def test_names_and_units_go_along(realization):
    system = arm().linearize()
    ss = system.state_space(realization)
    assert (ss.name, ss.realization) == ("robot", realization)
    assert (ss.inputs, ss.outputs) == (system.inputs, system.outputs)
    assert (ss.input_units, ss.output_units) == (system.input_units, system.output_units)
    assert len(ss.states) == len(ss.state_units) == len(ss.A) == 8
    assert ss.B.shape == (8, 2)
    assert ss.C.shape == (2, 8)
    assert ss.D.shape == (2, 2)
    assert "8 states" in repr(ss)


@BOTH
def test_arrays_are_read_only(realization):
    ss = arm().linearize().state_space(realization)
    for array in (ss.A, ss.B, ss.C, ss.D):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(FrozenInstanceError):
        ss.A = np.eye(8)


@pytest.mark.parametrize("realization", ["modl", None, "Physical", 3])
def test_unknown_realizations_are_refused(realization):
    with pytest.raises(mv.ResponseError, match=r"realization = .*'physical', 'modal' or"):
        arm().linearize().state_space(realization)


def test_an_acceleration_has_a_direct_term():
    system = oscillator(2.0, k=200.0).linearize()
    assert_allclose(system.state_space().D, [[0], [0], [0.5]], rtol=1e-15)
    assert_allclose(system.D, 0, atol=0)


def line(springs):
    """Sliders of 1 kg along x and what acts between them: (first, second, k, c)."""
    model = mv.Model("line")
    positions = {"ground": 0.0, "a": 1.0, "b": 2.0}
    for name in sorted({part for pair in springs for part in pair[:2]} - {"ground"}):
        model.add_body(name, 1.0, (1.0, 1.0, 1.0), (positions[name], 0, 0))
        model.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(1, 0, 0))
    for i, (first, second, k, c) in enumerate(springs):
        ends = [(positions[name], 0, 0) for name in (first, second)]
        model.add_spring(f"s{i}", first, second, *ends, stiffness=k, damping=c)
    model.add_input("F", "a", "x")
    model.add_output("x", "a", "x")
    return model


@pytest.mark.parametrize("away", [0.0, 1e-14, -1e-10, 1e-6])
def test_two_modes_that_meet_have_no_modal_states_of_their_own(away):
    """(s^2 + 2 h s + w^2)^2: no blocks of two states; close by, blocks lose digits with the square of the distance."""
    k = 1.4556068465068155 * (1.0 + away)
    system = line([("ground", "a", 1.0, 0.2973123055132099), ("a", "b", 0.0, 0.2), ("ground", "b", k, 0.4)]).linearize()
    omega = np.array([0.5, 1.0, 2.0])
    expected = response(system.state_space("physical"), omega)
    assert_allclose(system.frequency_response(omega), expected, rtol=1e-11)
    if abs(away) < 1e-7:
        with pytest.raises(mv.ResponseError, match=r"'line' .*mode1, mode2 all but.*realization='physical'"):
            system.state_space("modal")
    else:
        assert_allclose(response(system.state_space("modal"), omega), expected, rtol=1e-8)


def test_a_pair_that_rounding_mixes_with_others_is_refused(monkeypatch):
    """LAPACK says so where its ordered Schur form took another eigenvalue than was asked for."""
    def unsorted(*_, **__):
        raise np.linalg.LinAlgError("Leading eigenvalues do not satisfy sort condition.")

    a, value, vector = np.array([[-1.0, 1.0], [0.0, -1.0]]), -1.0 + 0j, np.array([1.0, 0.0], dtype=complex)
    block, columns = pair_block(a, (value, value), (vector, vector), "mode1", "line")
    assert_allclose(a @ columns, columns @ block, atol=1e-15)
    monkeypatch.setattr("scipy.linalg.schur", unsorted)
    with pytest.raises(mv.ResponseError, match=r"'line' .*mode1 all but coincide.*realization='physical'"):
        pair_block(a, (value, value), (vector, vector), "mode1", "line")


@pytest.mark.parametrize("away", [0.0, 1e-14, -1e-10, 1e-9, 1e-7, 1e-6, 1e-5])
def test_a_pair_of_a_relaxation_that_meets(away):
    """s^3 + t s^2 + (k + k2) s + k t = (s + 10)^2 (s + 1), t = k2 / c: those that meet are one mode."""
    k = 100 / 21
    model = line([("ground", "a", k * (1.0 + away), 0.0)])
    model.add_maxwell("mx", "ground", "a", (0, 0, 0), (1, 0, 0), 120 - k, (120 - k) / 21)
    system = model.linearize()
    omega = np.array([0.5, 9.0, 30.0])
    s = 1j * omega
    expected = (s + 21) / ((s * s + k * (1.0 + away)) * (s + 21) + (120 - k) * s)
    assert_allclose(system.frequency_response(omega)[0, 0], expected, rtol=1e-11)
    assert_allclose(system.modes().natural, [1.0, 10.0], rtol=2.0 * abs(away) + 1e-7)
    assert_allclose(response(system.state_space("modal"), omega)[0, 0], expected, rtol=1e-11)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_modes_with_one_shape_have_no_modal_states(size):
    """One Jordan block: of three equal modes the solver gave a bare error of numpy."""
    chain = np.eye(size) + 0.5 * np.eye(size, k=1)
    system = mv.System.from_matrices(np.eye(size), 2.0 * np.eye(size), chain, np.ones((size, 1)), np.ones((1, size)))
    with pytest.raises(mv.ResponseError, match=r"modal states .* all but coincide.*realization='physical'"):
        system.state_space("modal")
    omega = np.array([0.3, 1.7])
    exact = [np.linalg.solve(chain + (2j * w - w * w) * np.eye(size), np.ones(size)).sum() for w in omega]
    for realization in ("physical", "balanced"):
        response = system.state_space(realization).frequency_response(omega)[0, 0]
        np.testing.assert_allclose(response, exact, rtol=1e-13)
