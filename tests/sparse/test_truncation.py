"""A few modes of many, what the others would add, and its static part in D."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.sparse import scenes
from tests.sparse.test_long_chains import torsional


def ported(model, bodies):
    """A force and a displacement, a velocity and an acceleration at each of two bodies."""
    for i, body in enumerate(bodies):
        model.add_input(f"F{i}", body, "y")
        for quantity in ("displacement", "velocity", "acceleration"):
            model.add_output(f"{quantity}{i}", body, "y", quantity=quantity)
    return model


def test_the_correction_makes_statics_exact():
    model = ported(mv.library.chain(300, line=(0, 1, 0)), ("body20", "body300"))
    system = model.linearize(method="sparse")
    exact = system.static_compliance()
    plain, better = system.reduced(4), system.reduced(4, correction=True)
    static = [s.Cq @ np.linalg.solve(s.K, s.B) + s.D for s in (plain, better)]
    rows = [i for i, name in enumerate(system.outputs) if "velocity" not in name and "acceleration" not in name]
    assert_allclose(static[1][rows], exact[rows], rtol=0, atol=1e-10 * np.abs(exact).max())
    assert np.abs(static[0] - exact)[rows].max() > 1e-4 * np.abs(exact).max()
    assert not (better.D - plain.D)[[i for i in range(len(system.outputs)) if i not in rows]].any()


def test_it_is_the_sum_over_the_modes_left_out():
    """Against the dense path's own sum, phi phi^T / omega^2 of all modes from the fifth on."""
    model = ported(mv.library.chain(60, line=(0, 1, 0)), ("body20", "body60"))
    dense = model.linearize(method="dense")
    modes = dense.modes()
    phi = modes.shapes[:, 4:]
    expected = (dense.Cq @ phi / modes.natural[4:] ** 2) @ (phi.T @ dense.B)
    sparse = model.linearize(method="sparse")
    result = sparse.reduced(4, correction=True).D - sparse.reduced(4).D
    assert_allclose(result, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_free_motions_are_left_aside():
    """A floating chain: the compliance about the free motion."""
    model = ported(scenes.floating(40), ("b5", "b39")).with_values({"s*.damping.r*": 0.0})
    dense = model.linearize(method="dense")
    modes = dense.modes()
    assert modes.rigid == 6
    phi = modes.shapes[:, 9:]
    expected = (dense.Cq @ phi / modes.natural[9:] ** 2) @ (phi.T @ dense.B)
    sparse = model.linearize(method="sparse")
    small = sparse.reduced(9, correction=True)
    assert_allclose(small.D, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    omega = modes.natural[8] * np.array([0.05, 0.2, 0.5])
    with_, without = (sparse.truncation_error(s, omega)[0].max() for s in (small, sparse.reduced(9)))
    assert with_ < without
    with pytest.raises(mv.ResponseError, match=r"ask for more modes \(at least 6\)"):
        sparse.reduced(4, correction=True)


@pytest.mark.slow
def test_error_against_the_whole_response():
    """The largest error of displacements falls with the number of modes, and by the correction."""
    system = torsional(800, damping=20.0).linearize()
    omega = np.linspace(0.1, 2.0, 15) * 2 * np.pi * system.modes(1).frequencies[0]
    plain = [system.truncation_error(system.reduced(k), omega).max() for k in (2, 4, 8)]
    better = [system.truncation_error(system.reduced(k, correction=True), omega).max() for k in (2, 4, 8)]
    assert plain[0] > plain[1] > plain[2]
    assert all(b < 0.2 * p for p, b in zip(plain, better, strict=True))
    assert better[2] < 1e-4
    space = system.state_space(modes=8, correction=True)
    assert len(space.states) == 16
    assert space.state_units[:2] == ("modal", "modal/s")
    physical = system.state_space("physical", modes=3)
    assert physical.states == ("mode1", "mode2", "mode3", "d(mode1)/dt", "d(mode2)/dt", "d(mode3)/dt")
    assert physical.state_units == ("modal",) * 3 + ("modal/s",) * 3
    assert space.D[0, 0] == pytest.approx(system.reduced(8, correction=True).D[0, 0], rel=1e-12)


def test_what_cannot_be_corrected_or_compared_is_refused():
    system = torsional(700).linearize()
    with pytest.raises(mv.ResponseError, match="around near = 3 Hz; modes below that have no static part"):
        system.reduced(5, near=3.0, correction=True)
    with pytest.raises(mv.ResponseError, match="expected those of 'shaft700', M and rz"):
        system.truncation_error(mv.library.chain(3).linearize(), [1.0])


@pytest.mark.parametrize(("words", "asked"), [
    ({}, "no order"), ({"error": 1e-6}, "error = 1e-06"), ({"order": 4, "method": "balanced"}, "method = 'balanced'"),
])  # fmt: skip
def test_reductions_that_only_dense_systems_have_are_refused(words, asked):
    system = mv.library.chain(20).linearize(method="sparse")
    with pytest.raises(mv.ResponseError, match=rf"reduced: {asked}; 'C20RF1' is held sparse .* truncation_error"):
        system.reduced(**words)


def test_static_correction_by_the_name_of_the_method():
    system = mv.library.chain(20).linearize(method="sparse")
    one, other = system.reduced(order=4, correction=True), system.reduced(4, method="static-corrected")
    assert np.array_equal(one.D, other.D)
    assert one.D.any()
