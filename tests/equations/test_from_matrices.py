"""Systems of matrices that come from elsewhere."""

import mpmath
import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library, plots
from tests.support import fast_digits

W = np.geomspace(10.0, 1e5, 60)


def same(system, **words):
    arrays = {name: getattr(system, name) for name in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")}
    names = {"inputs": system.inputs, "outputs": system.outputs, "coordinates": system.coordinates}
    return mv.System.from_matrices(**arrays, **names, **words)


def masses(n=12, seed=0, free=False):
    """Masses and springs over six decades between them."""
    rng = np.random.default_rng(seed)
    m, k = 10.0 ** rng.uniform(-3, 3, n), 10.0 ** rng.uniform(0, 6, n)
    rows = np.eye(n) - np.eye(n, k=-1)
    if free:
        k[0] = 0.0
    return np.diag(m), rows.T @ (k[:, None] * rows)


@pytest.mark.parametrize("scene", ["stewart", "quarter_car", "engine_on_mounts", "trifilar_pendulum"])
def test_the_matrices_of_a_mechanism(scene):
    system = library.build(scene).linearize()
    given = same(system)
    assert_allclose(given.frequency_response(W), system.frequency_response(W), rtol=1e-9,
                    atol=1e-12 * np.abs(system.frequency_response(W)).max())  # fmt: skip
    assert_allclose(given.modes().frequencies, system.modes().frequencies, rtol=1e-9, atol=1e-6)
    t = np.linspace(0.0, 0.1, 50)
    u = np.ones((len(system.inputs), 50))
    assert_allclose(given.time_response(t, u), system.time_response(t, u), rtol=1e-8,
                    atol=1e-10 * np.abs(system.time_response(t, u)).max())  # fmt: skip


@pytest.mark.parametrize("free", [False, True])
def test_frequencies_in_40_digits(free):
    mass, stiffness = masses(free=free)
    modes = mv.System.from_matrices(mass, None, stiffness).modes()
    with mpmath.workdps(40):
        exact = fast_digits.eigenvalues(mpmath.matrix(mass.tolist()) ** -1 * mpmath.matrix(stiffness.tolist()))
        omega = np.sort(np.sqrt(np.abs([float(value.real) for value in exact])))
    assert modes.rigid == free
    assert_allclose(modes.natural[free:], omega[free:], rtol=1e-9)
    assert modes.damping_ratios.tolist() == [0.0] * 12


def test_damping_of_all_kinds():
    mass, stiffness = masses(6)
    rng = np.random.default_rng(1)
    coupled = rng.normal(size=(6, 6))
    skew = coupled - coupled.T
    for damping in (0.01 * mass + 1e-4 * stiffness, coupled @ coupled.T, coupled @ coupled.T + skew, -0.01 * mass):
        system = mv.System.from_matrices(mass, damping, stiffness, np.eye(6)[:, 0])
        a = np.block([[np.zeros((6, 6)), np.eye(6)], [-np.linalg.solve(mass, stiffness),
                                                      -np.linalg.solve(mass, damping)]])  # fmt: skip
        exact = np.linalg.eigvals(a)
        poles = system.poles()
        assert max(np.abs(poles - value).min() / np.abs(value) for value in exact) < 1e-7
        s = 1j * W[:5, None, None]
        direct = np.linalg.solve(stiffness + s * damping + s * s * mass, np.eye(6)[:, :1])
        assert_allclose(system.frequency_response(W[:5]).transpose(2, 0, 1), direct, rtol=1e-8, atol=1e-14)
        assert (system.gyroscopic is not None) == (damping is not None and not np.allclose(damping, damping.T))
    circulatory = mv.System.from_matrices(mass, None, stiffness + skew)
    assert_allclose(circulatory.circulatory, skew, rtol=1e-9)


@pytest.mark.parametrize("form", [sp.csr_array, sp.coo_matrix])
def test_sparse_ports(form):
    mass, stiffness = masses(6)
    b, c = np.eye(6)[:, :2], np.eye(6)[3:]
    system = mv.System.from_matrices(mass, 0.01 * stiffness, stiffness, form(b), form(c))
    s = 1j * W[:3, None, None]
    direct = c @ np.linalg.solve((1.0 + 0.01 * s) * stiffness + s * s * mass, b)
    assert_allclose(system.frequency_response(W[:3]).transpose(2, 0, 1), direct, rtol=1e-9)


def test_ports_that_are_too_large_as_dense_matrices_are_refused():
    with pytest.raises(mv.ModelError, match=r"Cq is a sparse matrix of shape \(70000000, 2\) and takes 1\.12 GB"):
        mv.System.from_matrices(np.eye(2), None, np.eye(2), Cq=sp.csr_array((70_000_000, 2)))


def test_names_and_default_outputs():
    system = mv.System.from_matrices(np.eye(2), None, 4.0 * np.eye(2), [1.0, 0.0])
    assert (system.inputs, system.outputs, system.coordinates) == (("u1",), ("q1", "q2"), ("q1", "q2"))
    assert system.state_space().states == ("q1", "q2", "d(q1)/dt", "d(q2)/dt")
    assert system["q1", "u1"].frequency_response([0.0])[0, 0, 0] == 0.25
    seen = mv.System.from_matrices(np.eye(2), None, np.eye(2), Cv=[[1.0, 1.0]], outputs=["speed"], name="two")
    assert (seen.name, seen.outputs, seen.inputs) == ("two", ("speed",), ())
    assert [" ".join(most) for most in system.modes().strongest()] == ["q1", "q2"]
    assert "largest motion" in str(system.modes())


@pytest.mark.slow
def test_everything_that_needs_no_mechanism(tmp_path):
    system = same(library.stewart().linearize(), name="given")
    assert plots.bode(system, "x", "Fx").axes
    assert mx.to_control(system).nstates == 12
    mx.to_npz(system, tmp_path / "given.npz")
    assert_allclose(mx.from_npz(tmp_path / "given.npz").K, system.K)
    assert system.hinf_norm("x", "Fx").value == pytest.approx(
        library.stewart().linearize().hinf_norm("x", "Fx", []).value, rel=1e-10)  # fmt: skip
    assert system.feedback([[-1e5]], "x", "Fx").stable
    assert "made of matrices; there is no mechanism" in system.explain()
    from mbsvib import report

    assert "given" in report.html(system)


MECHANISM = {
    "parameters": lambda s: s.parameters,
    "sensitivities": lambda s: s.eigenvalue_sensitivities(),
    "body_shapes": lambda s: s.modes().body_shapes,
    "reactions": lambda s: s.reactions,
    "stiffness_shares": lambda s: s.stiffness_shares(),
    "displacements": lambda s: s.displacements(np.zeros(6)),
    "animate": lambda s: s.modes().animate(1),
    "plots.mechanism": lambda s: plots.mechanism(s),
    "plots.topology": lambda s: plots.topology(s),
}


@pytest.mark.parametrize("what", MECHANISM)
def test_what_needs_a_mechanism_is_refused(what):
    with pytest.raises(mv.ModelError, match=f"{what}: 'system' was made of matrices"):
        MECHANISM[what](same(library.stewart().linearize()))


ONE = np.eye(2)
REFUSALS = [
    (([[1, 2], [2, 1]], None, ONE), {}, r"eigenvalue -1 beside 3; expected a symmetric positive definite"),
    (([[1, 0], [0, 0]], None, ONE), {}, r"M\[1, 1\] = 0; .*static condensation"),
    (([[1, 1], [1, 1]], None, ONE), {}, r"no mass or a negative one"),
    (([[1, 2e-3], [2.1e-3, 1]], None, ONE), {}, r"M\[0, 1\] = 0\.002, but M\[1, 0\] = 0\.0021.*0\.5 \* \(M \+ M\.T\)"),
    ((ONE[:1], None, ONE), {}, r"M has shape \(1, 2\); expected \(m, m\)"),
    ((ONE, None, np.eye(3)), {}, r"K has shape \(3, 3\); expected \(2, 2\)"),
    ((ONE, [[np.nan, 0], [0, 1]], ONE), {}, r"C = .*finite"),
    ((ONE, None, ONE, np.eye(3)), {}, r"B has shape \(3, 3\); expected \(2, inputs\)"),
    ((ONE, None, ONE), {"Cq": np.eye(3)}, r"Cq has shape \(3, 3\); expected \(outputs, 2\)"),
    ((ONE, None, ONE, [1, 0]), {"inputs": ["a", "b"]}, r"inputs = .*expected 1 name"),
    ((ONE, None, ONE), {"coordinates": ["a", "a"]}, r"'a' is there more than once"),
    ((ONE * 1j, None, ONE), {}, r"M = .*real numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "words", "message"), REFUSALS, ids=[message for *_, message in REFUSALS])
def test_refusals(given, words, message):
    with pytest.raises((mv.ModelError, mv.ResponseError), match=message):
        mv.System.from_matrices(*given, **words)
