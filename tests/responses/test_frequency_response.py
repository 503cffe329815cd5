"""Frequency response, against one solution in 50 digits for each frequency and against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib import library
from mbsvib.responses import frequency_response
from mbsvib.responses.basis import Basis
from tests.modes.test_modes import oscillator
from tests.support.chains import stiff_chain
from tests.support.compare import assert_same_response, frequencies, linearized
from tests.support.digits import mp
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds, spatial
from tests.support.sizes import examples

ANY = st.one_of(
    open_trees(damped=st.booleans()), open_trees(floating=st.just(True)), closed_loops(damped=st.booleans()),
    planar_loops(), planar_loops(damped=st.just(False)),
)  # fmt: skip


@pytest.mark.slow
@examples(15, slow=40)
@given(ANY)
def test_against_the_reference(model):
    """Base motion, relative and absolute outputs, forces; below, near, between and above the natural frequencies."""
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)
    assert_same_response(system.frequency_response(omega), reference.frequency_response(omega))


@pytest.mark.slow
@examples(15, slow=40)
@given(open_trees(negative=st.just(True), damped=st.booleans()))
def test_negative_stiffness(model):
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)
    assert_same_response(system.frequency_response(omega), reference.frequency_response(omega), rtol=1e-8)


@pytest.mark.slow
@examples(15, slow=40)
@given(st.one_of(open_trees(offset=st.just(1e4)), closed_loops(offset=st.just(1e4)), planar_loops(offset=st.just(1e4))))
def test_ten_kilometres_away(model):
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)
    assert_same_response(system.frequency_response(omega), reference.frequency_response(omega))


@pytest.mark.slow
@examples(15, slow=40)
@given(st.one_of(open_trees(), closed_loops(), planar_loops()))
def test_static_compliance(model):
    system, reference = linearized(model), Exact(model)
    if system.dof:
        result = system.frequency_response([0.0])[:, :, 0]
        assert not result.imag.any()
        assert_same_response(result[:, :, None].real, reference.static()[:, :, None], rtol=1e-10)


def test_static_compliance_alone_where_modes_coincide():
    system = library.stewart_isolator().linearize()
    exact = system.Cq @ np.linalg.solve(system.K, system.B) + system.D
    assert np.allclose(system.frequency_response([0.0])[:, :, 0], exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())


@pytest.mark.slow
@given(seeds(), st.integers(5, 8), st.integers(0, 3), st.booleans())
def test_bigger_mechanisms(seed, bodies, loops, damped):
    """Random ones of up to eight bodies."""
    model = spatial(seed, bodies, loops, damped=damped)
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)
    assert_same_response(system.frequency_response(omega), reference.frequency_response(omega))


@pytest.mark.parametrize("ratio", [1e-9, 1e-6, 1e-3, 0.05, 1.0])
@pytest.mark.parametrize("detune", [0.0, 1e-12, 1e-6, -0.3, 3.0])
def test_resonances_keep_ten_digits(ratio, detune):
    """At the peak of a mode with a damping ratio of 1e-9 an error of the frequency would count a billion times."""
    m, omega0 = 2.0, 10.0
    model = oscillator(m, 2 * ratio * m * omega0, m * omega0**2)
    w = omega0 * (1 + detune)
    c, s = model.springs["s"].damping, mp.mpc(0, w)
    exact = 1 / (m * s * s + mp.mpf(c) * s + mp.mpf(model.springs["s"].stiffness))
    result = model.linearize().frequency_response([w])[:, 0, 0]
    for value, factor in zip(result, (1, s, s * s), strict=True):
        expected = complex(exact * factor)
        # the data of the spring are rounded, and so is w: what this makes of a peak is no error of the method
        assert abs(value - expected) <= 1e-10 * abs(expected) + 4e-16 / ratio * abs(expected) * (detune == 0)


@pytest.mark.slow
@examples(15, slow=40)
@given(ANY)
def test_many_frequencies_at_once(model):
    """What serves hundreds of frequencies is another road than what serves one, and leads to the same place."""
    system, reference = linearized(model), Exact(model)
    few = frequencies(reference)
    omega = np.sort(np.concatenate((few, np.geomspace(few[0] / 7, few[-1] * 9, 700))))
    result = system.frequency_response(omega)[:, :, np.searchsorted(omega, few)]
    assert_same_response(result, reference.frequency_response(few))


@pytest.mark.slow
@examples(15, slow=40)
@given(st.one_of(open_trees(), planar_loops(), open_trees(damped=st.just(False))), st.floats(2, 5))
def test_far_above_the_modes(model, decades):
    """Isolation is what remains high above the modes: it must not drown in terms that cancel."""
    system, reference = linearized(model), Exact(model)
    omega = frequencies(reference)[-1:] * 10.0**decades
    result, expected = system.frequency_response(omega), reference.frequency_response(omega)
    assert_same_response(result, expected)


@pytest.mark.parametrize("damping", [0.0, 6.0])
def test_isolation_to_fourteen_orders(damping):
    """Of the absolute acceleration behind an isolator at 1e7 times its frequency ten digits are left."""
    model = mv.Model("isolator")
    model.add_body("b", 3.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b")
    model.add_spring("s", "ground", "b", (0, 0, -1), (0, 0, 0), stiffness=300.0, damping=damping)
    model.add_base_motion("base", "z")
    model.add_output("felt", "b", "z", quantity="acceleration")
    w = 10 * np.logspace(-7, 7, 29) * 1.01
    z = 300.0 + 1j * w * damping
    result = model.linearize().frequency_response(w)[0, 0]
    assert_allclose(result, z / (z - 3 * w**2), rtol=1e-10)


def test_transmissibility_crosses_one_at_root_two():
    zeta, omega0 = 0.1, 10.0
    model = mv.Model("isolator")
    model.add_body("b", 3.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b")
    model.add_spring("s", "ground", "b", (0, 0, -1), (0, 0, 0), stiffness=3 * omega0**2, damping=6 * zeta * omega0)
    model.add_base_motion("base", "z")
    model.add_output("felt", "b", "z", quantity="acceleration")
    r = np.array([1e-9, 0.5, 1.0, np.sqrt(2), 5.0, 1e3])
    result = model.linearize().frequency_response(omega0 * r)[0, 0]
    expected = (1 + 2j * zeta * r) / (1 - r**2 + 2j * zeta * r)
    assert_allclose(result, expected, rtol=1e-11)
    assert abs(result[3]) == pytest.approx(1, rel=1e-13)


def test_two_mass_base_transmissibility():
    """Acceleration to acceleration through two stages, without ever integrating the input."""
    m1, m2, k1, k2, c1, c2 = 2.0, 1.0, 800.0, 300.0, 4.0, 1.5
    model = mv.Model("two stages")
    model.add_body("low", m1, (1, 1, 1), position=(0, 0, 1))
    model.add_body("high", m2, (1, 1, 1), position=(0, 0, 2))
    model.add_joint("jl", "prismatic", "ground", "low")
    model.add_joint("jh", "prismatic", "low", "high")
    model.add_spring("sl", "ground", "low", (0, 0, 0), (0, 0, 1), stiffness=k1, damping=c1)
    model.add_spring("sh", "low", "high", (0, 0, 1), (0, 0, 2), stiffness=k2, damping=c2)
    model.add_base_motion("base", "z")
    model.add_output("felt", "high", "z", quantity="acceleration")
    model.add_output("between", "high", "z", relative_to="low", quantity="acceleration")
    w = np.geomspace(0.1, 500, 40)
    s = 1j * w
    z1, z2 = k1 + c1 * s, k2 + c2 * s
    down = (m1 * s**2 + z1 + z2) * (m2 * s**2 + z2) - z2**2
    high, low = z1 * z2 / down, z1 * (m2 * s**2 + z2) / down
    result = model.linearize().frequency_response(w)
    assert_allclose(result[0, 0], high, rtol=1e-12)
    assert_allclose(result[1, 0], high - low, rtol=1e-11)


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", range(3))
def test_stiffness_over_many_decades(seed):
    """Where a body is pushed, in resonance and beside it (far from there answers cancel to nothing)."""
    model = stiff_chain(8, 10, 6, seed, damped=True)
    for body in model.bodies:
        model.add_input(body, body, "z")
        model.add_output(body, body, "z")
    system, reference = model.linearize(), Exact(model)
    omega = np.sqrt(reference.squares)
    omega = np.concatenate((0.9 * omega, omega))
    result, expected = (np.diagonal(g) for g in (system.frequency_response(omega), reference.frequency_response(omega)))
    assert_allclose(result, expected, rtol=1e-9)


def test_a_free_body_answers_above_zero():
    result = oscillator(m=2.0).linearize().frequency_response([1.0, 10.0])[:, 0]
    assert_allclose(result, [[-0.5, -0.005], [-0.5j, -0.05j], [0.5, 0.5]], rtol=1e-15)


@pytest.mark.parametrize(("model", "omega", "what"), [
    (oscillator(m=2.0), 0.0, "rigid-body mode"), (oscillator(m=2.0, k=200.0), 10.0, "undamped mode 1"),
])  # fmt: skip
def test_poles_are_refused_by_name(model, omega, what):
    with pytest.raises(mv.ResponseError, match=rf"omega\[1\] = {omega:g} rad/s is a pole.*{what}"):
        model.linearize().frequency_response([1.0, omega])


def test_a_rigid_mode_beside_modes_that_damping_couples_has_a_pole_at_zero():
    """A floating pair whose two springs are damped unevenly."""
    model = spatial(3, bodies=3, floating=True, kinds=("spherical", "universal"))
    system = model.linearize()
    assert not system.modes().classical
    assert np.isfinite(system.frequency_response([1e-3])).all()
    with pytest.raises(mv.ResponseError, match=r"omega\[1\] = 0 rad/s is a pole.*rigid-body mode"):
        system.frequency_response([1e-3, 0.0])


def test_a_braked_rigid_mode_has_a_pole_at_zero():
    with pytest.raises(mv.ResponseError, match="pole"):
        oscillator(c=3.0).linearize().frequency_response([0.0])


@pytest.mark.parametrize("omega", [[1.0, np.nan], [np.inf], [[1.0, 2.0]], "fast", [1j], None])
def test_bad_frequencies_are_refused(omega):
    with pytest.raises(mv.ResponseError, match="frequency_response: omega"):
        oscillator(k=1.0).linearize().frequency_response(omega)


@pytest.mark.parametrize("omega", [[3.0, 4.0], (3.0, 4.0), np.array([3.0, 4.0]), np.array([3, 4]), range(3, 5)])
def test_lists_tuples_and_arrays(omega):
    result = oscillator(k=2.0).linearize().frequency_response(omega)
    assert (result.shape, result.dtype) == ((3, 1, 2), complex)
    assert_allclose(result[0, 0], [1 / (2 - 2 * 9), 1 / (2 - 2 * 16)], rtol=1e-14)


def test_no_frequency_and_no_port():
    assert oscillator(k=2.0).linearize().frequency_response([]).shape == (3, 1, 0)
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1))
    assert model.linearize().frequency_response([1.0]).shape == (0, 0, 1)


@pytest.mark.slow
@examples(20, slow=20)
@given(open_trees(damped=st.booleans()))
def test_negative_frequencies_are_conjugate(model):
    system = linearized(model)
    if system.dof:
        w = np.array([0.5, 7.0])
        assert_allclose(system.frequency_response(-w), system.frequency_response(w).conj(), rtol=1e-12)


@pytest.mark.slow
@examples(15, slow=40)
@given(open_trees())
def test_one_frequency_at_a_time_is_the_same(model):
    system = linearized(model)
    w = np.geomspace(0.1, 1000, 300)
    full = system.frequency_response(w)
    for k in (0, 150, 299):
        single = system.frequency_response(w[k : k + 1])
        assert_allclose(single[:, :, 0], full[:, :, k], rtol=1e-10, atol=1e-13 * np.abs(full[:, :, k]).max(initial=0))


@pytest.mark.slow
@examples(20, slow=20)
@given(open_trees(kinds=st.just(("revolute", "spherical", "universal"))))
def test_reciprocity(model):
    """The displacement at A under a force at B is the one at B under the force at A."""
    for i, body in enumerate(model.bodies):
        model.add_input(f"r{i}", body, (1.0, 2.0, -1.0))
        model.add_output(f"r{i}", body, (1.0, 2.0, -1.0))
    system = linearized(model)
    n = len(model.bodies)
    result = system.frequency_response([5.0])[-n:, -n:, 0]
    assert_allclose(result, result.T, rtol=0, atol=1e-11 * np.abs(result).max())


def test_pieces_of_frequencies_and_those_that_refinement_gives_up(monkeypatch):
    """In pieces of three frequencies, of which each other one is solved directly: the response by matrices."""
    rng = np.random.default_rng(6)
    mass, damping, stiffness = (r @ r.T + np.eye(4) for r in rng.normal(size=(3, 4, 4)))
    b, (cq, cv, ca) = rng.normal(size=(4, 2)), rng.normal(size=(3, 3, 4))
    basis = Basis(mv.System.from_matrices(mass, damping, stiffness, b, cq, cv, ca))
    given_up, whole = [], frequency_response.refined_solutions

    def refined(basis, modal, b, s):
        eta = whole(basis, modal, b, s)
        eta[:, :, 1::2] = np.nan
        given_up.append(len(s))
        return eta

    monkeypatch.setattr(frequency_response, "refined_solutions", refined)
    monkeypatch.setattr(frequency_response, "BATCH_BYTES", 3 * 64 * b.size)
    w = np.linspace(0.1, 5.0, 11)
    result = frequency_response._solved(basis, basis.modal, w)
    assert given_up == [3, 3, 3, 2]
    for k, s in enumerate(1j * w):
        exact = (cq + s * cv + s**2 * ca) @ np.linalg.solve(s**2 * mass + s * damping + stiffness, b)
        np.testing.assert_allclose(result[:, :, k], exact, rtol=1e-11)
