"""Modes and responses of batches: against 50 digits, and as those of each variant by itself."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib import library
from mbsvib.modes.batch import batch_modes
from mbsvib.responses.batch import few_frequencies
from tests.equations.test_batch import other_values, some_names
from tests.support.compare import assert_same_eigenvalues, assert_same_response, linearized
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds
from tests.support.sizes import examples

WORDS = {"negative": st.booleans(), "damped": st.booleans()}
ANY = st.one_of(open_trees(**WORDS), open_trees(floating=st.just(True)), closed_loops(**WORDS), planar_loops())


def some_batch(model, seed, fields=("mass", "stiffness", "damping"), count=3):
    """Three variants, of the undamped model for every fourth seed."""
    linearized(model)  # or reject
    rng = np.random.default_rng(seed)
    names = some_names(model, rng, fields)
    values = other_values(model, rng, names, count)
    if seed % 4 == 0 and any(".stiffness" in name for name in names):
        values = {"*.damping*": 0.0} | {name: value for name, value in values.items() if "damping" not in name}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.NearSingularWarning)
        try:
            return model.linearize(values=values), values
        except mv.ModelError:  # no stiffness and no damping
            assume(False)


def oscillator():
    """1 kg on 4 N/m."""
    model = mv.Model("oscillator")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(1, 0, 0))
    model.add_spring("s", "ground", "b", (-1, 0, 0), (0, 0, 0), 4.0)
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    return model


def value_of(value, i):
    return value if np.ndim(value) == 0 else value[i]


@pytest.mark.slow
@examples(15, slow=25)
@given(ANY, seeds())
def test_modes_are_those_of_each_variant(model, seed):
    batch, _ = some_batch(model, seed)
    modes = batch.modes()
    assert len(modes) == len(batch)
    for i, (system, item) in enumerate(zip(batch, modes, strict=True)):
        single = system.modes()
        for key in ("natural", "frequencies", "damped_frequencies", "damping_ratios", "eigenvalues", "errors"):
            assert np.array_equal(getattr(modes, key)[i], getattr(item, key), equal_nan=True), key
        assert modes.stable[i] == item.stable
        assert (modes.rigid[i], modes.classical[i]) == (item.rigid, item.classical) == (single.rigid, single.classical)
        away = np.abs(item.eigenvalues - single.eigenvalues)
        assert (away <= (item.errors + single.errors) * np.abs(single.eigenvalues)).all()
        for name in batch.bodies:
            assert np.array_equal(modes.body_shapes[name][i], item.body_shapes[name])


@pytest.mark.slow
@examples(15, slow=25)
@given(ANY, seeds())
def test_modes_solve_their_equations(model, seed):
    batch, _ = some_batch(model, seed)
    for system, modes in zip(batch, batch.modes(rtol=1e-9), strict=True):
        for value, shape in zip(modes.eigenvalues[::2], modes.shapes.T, strict=True):
            terms = [value**2 * system.M @ shape, value * system.C @ shape, system.K @ shape]
            size = max(np.abs(term).max() for term in terms)
            assert np.abs(sum(terms)).max() <= 1e-8 * size + 1e-8 * np.abs(system.K).max() * (value == 0)
        if modes.classical and len(modes):
            assert np.abs(modes.shapes.T @ system.M @ modes.shapes - np.eye(batch.dof)).max() < 1e-8


@pytest.mark.slow
@examples(6, slow=40)
@pytest.mark.parametrize("rtol", [1e-10, 1e-13])
@given(model=st.one_of(open_trees(damped=st.booleans()), planar_loops()), seed=seeds())
def test_errors_of_modes_are_honest(rtol, model, seed):
    """Against 50 digits of the variant's data; what the data's own rounding does is no error of the method."""
    batch, values = some_batch(model, seed, ("mass", "stiffness", "damping"), 2)
    modes = batch_modes(batch, rtol)
    for i in range(len(batch)):
        exact = Exact(model.with_values({name: value_of(value, i) for name, value in values.items()}))
        assert_same_eigenvalues(modes.eigenvalues[i], exact.eigenvalues, 1e-13 + 2 * modes.errors[i].max(initial=0.0))
        assert (modes.errors[i] < 1e-6).all() or not batch.row_damping.any()


@pytest.mark.slow
@examples(15, slow=40)
@given(ANY, seeds(), st.integers(1, 30))
def test_frequency_response_is_that_of_each_variant(model, seed, count):
    """By one solution for each frequency, or by the sums of each variant: whatever is less work."""
    batch, _ = some_batch(model, seed)
    omega = 10 ** np.random.default_rng(seed).uniform(-1, 4, size=count) * np.where(np.arange(count) % 5, 1, -1)
    result = batch.frequency_response(omega)
    assert result.shape == (len(batch), len(batch.outputs), len(batch.inputs), count)
    for system, item in zip(batch, result, strict=True):
        assert_same_response(item, system.frequency_response(omega), rtol=1e-8)


@pytest.mark.slow
@examples(8, slow=40)
@given(st.one_of(open_trees(damped=st.booleans()), closed_loops(), planar_loops()), seeds())
def test_frequency_response_against_the_reference(model, seed):
    batch, values = some_batch(model, seed, ("mass", "stiffness"), 2)
    for i in range(len(batch)):
        exact = Exact(model.with_values({name: value_of(value, i) for name, value in values.items()}))
        omega = np.concatenate(([1.0], 1.01 * np.abs(exact.eigenvalues[::2][:4]).astype(float), [1e5]))
        result = few_frequencies(batch, batch.basis.modal.damped, omega)[i]
        assert_same_response(result, exact.frequency_response(omega), rtol=1e-8)


def test_isolation_far_above_the_modes_loses_nothing():
    """Absolute acceleration of what rests in space: D and the mode's answer cancel, by eleven decades here."""
    model = oscillator()
    model.add_base_motion("a", "x")
    model.add_output("absolute", "b", "x", quantity="acceleration")
    stiffness, omega = np.array([[4.0], [9.0]]), np.array([1e3, 1e6])
    batch = model.linearize(values={"s.stiffness": stiffness[:, 0]})
    result = batch.frequency_response(omega)
    np.testing.assert_allclose(result[:, 1, 1], stiffness / (stiffness - omega**2), rtol=1e-14)
    np.testing.assert_allclose(result[:, 0, 1], -1.0 / (stiffness - omega**2), rtol=1e-14)


def test_poles_are_refused_by_the_index_of_the_variant():
    batch = oscillator().linearize(values={"s.stiffness": [4.0, 9.0, 16.0]})
    with pytest.raises(mv.ResponseError, match=r"variant 1: .*pole"):
        batch.frequency_response([1.0, 3.0])
    result = batch.frequency_response([1.0])[:, 0, 0, 0]
    np.testing.assert_allclose(result, 1.0 / np.array([3.0, 8.0, 15.0]), rtol=1e-14)
    with pytest.raises(mv.ResponseError, match="finite"):
        batch.frequency_response([np.nan])


@pytest.mark.slow
@examples(15, slow=40)
@given(open_trees(), seeds())
def test_time_response_and_state_space(model, seed):
    batch, _ = some_batch(model, seed)
    t = np.linspace(0.0, 0.1, 5)
    u = np.random.default_rng(seed).normal(size=(len(batch.inputs), len(t)))
    result, spaces = batch.time_response(t, u), batch.state_space()
    for system, item, space in zip(batch, result, spaces, strict=True):
        expected = system.time_response(t, u)
        assert np.abs(item - expected).max() <= 1e-9 * np.abs(expected).max()
        assert np.array_equal(space.A, system.state_space().A)


def test_displacements():
    batch = library.stewart().linearize(values={"leg1.head.position.x": [0.03, 0.05]})
    q = np.arange(12.0).reshape(2, 6)
    item = batch.displacements(q)
    assert item["platform"].shape == (2, 6)
    for i, system in enumerate(batch):
        np.testing.assert_allclose(item["platform"][i], system.displacements(q[i])["platform"], rtol=1e-14)
        np.testing.assert_allclose(batch.displacements(q[0])["platform"][i], system.displacements(q[0])["platform"])
    with pytest.raises(mv.ResponseError, match=r"\(5,\)"):
        batch.displacements(np.zeros(5))


def test_inaccurate_modes_are_warned_of_by_index():
    """Frequencies that span more than any method bears at the accuracy asked for."""
    model = library.chain(6, line=(0, 1, 0))
    batch = model.linearize(values={"*.mass": np.array([1.0, 2.0])})
    with pytest.warns(mv.AccuracyWarning, match=r"2 variants, the first of which is 0"):
        batch.modes(rtol=1e-18)


def test_pieces_have_the_modes_of_the_whole(monkeypatch):
    """Modes are computed piece by piece, whose size is no one's business."""
    import mbsvib.modes.batch

    batch = library.stewart().linearize(values={"leg1.k.stiffness": np.linspace(1e7, 3e7, 7), "platform.mass": 2.0})
    full = batch.modes()
    monkeypatch.setattr(mbsvib.modes.batch, "PIECE_BYTES", 3 * 64 * 36)
    parts = batch_modes(batch)
    np.testing.assert_allclose(parts.eigenvalues, full.eigenvalues, rtol=1e-14)
    size = np.abs(full.shapes).max()
    np.testing.assert_allclose(np.abs(parts.shapes), np.abs(full.shapes), rtol=0, atol=1e-10 * size)
    some = batch.slice(2, 5)
    assert len(some) == 3
    np.testing.assert_allclose(some.modes().eigenvalues, full.eigenvalues[2:5], rtol=1e-14)
    assert some[0].parameters["leg1.k.stiffness"] == batch[2].parameters["leg1.k.stiffness"]


def two_masses(stiffness=(4.0, 9.0), mass=(2.0, 3.0), damping=(0.0, 0.0)):
    """In line on two springs; a force on the first, the place of the second."""
    model = mv.Model("two masses")
    for i, m in enumerate(mass):
        model.add_body(f"b{i}", m, (1, 1, 1), (i, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
    model.add_spring("s0", "ground", "b0", (-1, 0, 0), (0, 0, 0), stiffness[0], damping[0])
    model.add_spring("s1", "b0", "b1", (0, 0, 0), (1, 0, 0), stiffness[1], damping[1])
    model.add_input("F", "b0", "x")
    model.add_output("x", "b1", "x")
    model.add_output("a", "b1", "x", quantity="acceleration")
    return model


def test_what_inertia_does_not_reach_stays_small_far_above_the_modes():
    """From a force to a mass behind a spring: k / (m1 m2 w^4) and no sum of modes that nearly cancels in 1 / w^2."""
    k, w = np.array([[9.0], [5.0]]), np.array([1e3, 1e5])
    result = two_masses().linearize(values={"s1.stiffness": k[:, 0]}).frequency_response(w)
    exact = k / ((4.0 + k - 2.0 * w**2) * (k - 3.0 * w**2) - k**2)
    np.testing.assert_allclose(result[:, 0, 0], exact, rtol=1e-11)
    np.testing.assert_allclose(result[:, 1, 0], -(w**2) * exact, rtol=1e-11)


@pytest.mark.slow
@examples(8, slow=40)
@pytest.mark.parametrize("factor", [1.0, 30.0, 1e3, 1e5, 1e7])
@given(model=open_trees(), seed=seeds())
def test_dampers_of_any_strength(factor, model, seed):
    """Some variants oscillate, in others modes creep, and each is as accurate as by itself."""
    rng = np.random.default_rng(seed)
    names = [name for name, value in linearized(model).parameters.items() if ".damping" in name and value]
    assume(names)
    values = {name: model.parameters[name] * factor ** rng.uniform(-0.2, 1, size=3) for name in names}
    try:
        batch = model.linearize(values=values)
    except mv.ModelError:
        assume(False)
    for system, item in zip(batch, batch.modes(), strict=True):
        single = system.modes()
        away = np.abs(item.eigenvalues - single.eigenvalues)
        assert (away <= (item.errors + single.errors) * np.abs(single.eigenvalues)).all()
        assert item.errors.max(initial=0.0) <= max(1e-10, 10.0 * single.errors.max(initial=0.0))


@pytest.mark.few(2)
@pytest.mark.parametrize("rtol", [1e-10, 1e-13])
@pytest.mark.parametrize("span", [1e2, 1e5, 1e8, 1e12])
def test_wide_ranges_of_stiffness(span, rtol):
    """Frequencies far apart: what the common pass leaves short of the accuracy asked for climbs the ladder alone."""
    model, stiffness = two_masses(), span ** np.linspace(0.0, 1.0, 6)
    modes = two_masses().linearize(values={"s1.stiffness": stiffness}).modes(rtol=rtol)
    for i, k in enumerate(stiffness):
        exact = Exact(model.with_values({"s1.stiffness": k}))
        assert_same_eigenvalues(modes.eigenvalues[i], exact.eigenvalues, 3e-15 + modes.errors[i].max())
        assert modes.errors[i].max() <= rtol
