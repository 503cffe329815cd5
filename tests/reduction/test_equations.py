"""Reduced equations of motion: the error bound against the responses of both models, by all methods that project."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.reduction.modal import ModalTruncation, projected
from mbsvib.reduction.reduced import reduced_equations
from tests.support.random_models import spatial
from tests.support.sliding_chain import sliding_chain
from tests.support.slow_cases import some

METHODS = ("modal", "static-corrected", "craig-bampton")


def largest_error(full, small):
    """The largest singular value of the difference, on a grid and at all resonances."""
    values = np.concatenate([part.modes().eigenvalues for part in (full, small)])
    size = np.abs(values[values != 0.0])
    omega = np.sort(np.concatenate((np.geomspace(0.01 * size.min(), 30.0 * size.max(), 1000), np.abs(values.imag),
                                    np.sqrt(np.abs(np.abs(values) ** 2 - 2.0 * values.real**2)))))  # fmt: skip
    omega = omega[omega > 0.0]
    off = full.frequency_response(omega) - small.frequency_response(omega)
    return np.linalg.norm(off.transpose(2, 0, 1), ord=2, axis=(1, 2)).max()


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", [0, 1, 2, *range(4, 70, 3)])
def test_the_bound_holds_and_is_tight(method, seed):
    system = spatial(seed, bodies=4, loops=seed % 2).linearize()
    least = np.linalg.matrix_rank(np.vstack((system.Cq, system.B.T))) if method == "craig-bampton" else 1
    orders = sorted({least, (least + system.dof) // 2, system.dof})
    for order in orders:
        small = reduced_equations(system, method, order)
        assert small.dof == order
        assert (small.inputs, small.outputs) == (system.inputs, system.outputs)
        if (np.abs(system.modes().damping_ratios) < 1e-12).any():
            assert small.error_bound == np.inf
            continue
        off, noise = largest_error(system, small), 1e-12 * system.hinf_norm(parameters=[]).value
        assert off <= small.error_bound + noise
        assert small.error_bound <= 1.3 * off + noise


@pytest.mark.slow
@pytest.mark.parametrize("method", some(METHODS, "modal"))
def test_an_error_gives_a_small_model(method):
    system = mv.library.wafer_stage().linearize()
    peak = system.hinf_norm().value
    small = reduced_equations(system, method, error=1e-3 * peak)
    assert small.dof < system.dof
    assert small.error_bound <= 1e-3 * peak
    assert largest_error(system, small) <= 1e-3 * peak


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_an_error_gives_the_smallest_model(method):
    """The first of all orders whose bound is within the error, wherever that lies."""
    m, k = [1.0, 2.0, 0.5, 3.0], [900.0, 300.0, 500.0, 200.0]
    system = sliding_chain(m, k, [1e-2 * v for v in k], (0,), [("displacement", 0)]).linearize()
    least = 1 if method == "craig-bampton" else 0
    bounds = [system.reduced(order, method=method).error_bound for order in range(least, 5)]
    for order, bound in enumerate(bounds[1:-1], least + 1):
        small = system.reduced(error=1.001 * bound, method=method)
        assert small.dof == least + next(i for i, b in enumerate(bounds) if b <= 1.001 * bound)
        assert small.dof <= order
        assert small.error_bound <= 1.001 * bound
    assert system.reduced(error=1e-6 * bounds[-2], method=method).dof == 4


def test_interfaces_of_forces_and_torques_have_their_units():
    model = mv.library.chain(4, line=(0, 1, 0))
    model.add_input("torque", "body2", "rz")
    model.add_input("force", "body2", "x")
    small = model.linearize()[:, ["torque", "force"]].reduced(4, method="craig-bampton")
    units = dict(zip(small.coordinates, small.coordinate_units, strict=True))
    assert (units["at torque"], units["at force"]) == ("rad", "m")


def test_all_coordinates_are_the_same_system():
    system = mv.library.chain(6).linearize()
    small = reduced_equations(system, "modal", system.dof)
    assert small.error_bound < 1e-11 * system.hinf_norm().value
    assert_allclose(small.modes().eigenvalues, system.modes().eigenvalues, rtol=1e-12)
    bodies, same = system.modes().body_shapes, small.modes().body_shapes
    for name, shape in bodies.items():
        assert_allclose(np.abs(same[name]), np.abs(shape), atol=1e-9 * np.abs(shape).max())


def test_every_matrix_is_projected():
    """Also gyroscopic and circulatory parts, and outputs of velocities and accelerations."""
    rng = np.random.default_rng(8)
    mass, damping, stiffness = (r @ r.T + np.eye(5) for r in rng.normal(size=(3, 5, 5)))
    turns = rng.normal(size=(2, 5, 5))
    damping, stiffness = damping + turns[0] - turns[0].T, stiffness + turns[1] - turns[1].T
    ports = rng.normal(size=(5, 2)), *rng.normal(size=(3, 4, 5)), rng.normal(size=(4, 2))
    system, shapes = mv.System.from_matrices(mass, damping, stiffness, *ports), rng.normal(size=(5, 3))
    small = projected(system, shapes, ["a", "b", "c"], ["m"] * 3)
    for name, matrix in (("M", mass), ("C", damping), ("K", stiffness)):
        assert_allclose(getattr(small, name), shapes.T @ matrix @ shapes, rtol=1e-12, atol=1e-13, err_msg=name)
    whole = shapes.T @ ports[0], *(rows @ shapes for rows in ports[1:4]), ports[4]
    for name, matrix in zip(("B", "Cq", "Cv", "Ca", "D"), whole, strict=True):
        assert_allclose(getattr(small, name), matrix, rtol=1e-13, atol=1e-14, err_msg=name)
    np.testing.assert_array_equal(small.provenance.reduction.independent, range(3))
    assert_allclose(small.inertia_factor.T @ small.inertia_factor, small.M, rtol=1e-13, atol=1e-13)
    s = 2.0j
    exact = (ports[1] + s * ports[2] + s**2 * ports[3]) @ shapes @ np.linalg.solve(
        shapes.T @ (s**2 * mass + s * damping + stiffness) @ shapes, shapes.T @ ports[0]) + ports[4]  # fmt: skip
    assert_allclose(small.frequency_response([2.0])[..., 0], exact, rtol=1e-11)


def test_modes_are_ranked_by_the_peaks_of_their_responses():
    """On a fine grid; two modes that creep have theirs at rest, and free motions come first, seen or not."""
    rng, n = np.random.default_rng(4), 9
    natural, ratio = np.concatenate(([0.0, 0.0], np.geomspace(3.0, 40.0, n))), rng.uniform(0.002, 0.01, n + 2)
    b = rng.normal(size=(n + 2, 2)) * 10 ** rng.uniform(-1, 1, (n + 2, 1))
    cq, cv = rng.normal(size=(2, 3, n + 2)) * np.array([10.0, 0.1])[:, None, None]
    ca = cq / np.maximum(natural, 1.0) ** 2 * rng.uniform(0.3, 1.5, n + 2)
    b[1], cq[:, 1], cv[:, 1], ca[:, 1] = 0.0, 0.0, 0.0, 0.0
    creep = [4, 7]
    ratio[creep], cq[:, creep], cv[:, creep], ca[:, creep] = [2.0, 5.0], 500.0 * cq[:, creep], 0.0, 0.0
    turn = rng.normal(size=(n + 2, n + 2))  # coordinates of other shapes than the modes
    turn[:2, 2:] = turn[2:, :2] = 0.0
    matrices = [turn.T @ (diagonal[:, None] * turn) for diagonal in (np.ones(n + 2), 2.0 * ratio * natural, natural**2)]
    system = mv.System.from_matrices(*matrices, turn.T @ b, cq @ turn, cv @ turn, ca @ turn)
    w = np.union1d(np.geomspace(1e-3, 60.0, 3000), natural[2:, None] * np.linspace(0.98, 1.02, 81))
    s = 1j * w[:, None, None]
    rows = np.linalg.norm(cq + s * cv + s**2 * ca, axis=1) / np.abs(
        natural**2 + 2.0 * ratio * natural * s[:, 0] + s[:, 0] ** 2)  # fmt: skip
    heights = (rows.max(axis=0) * np.linalg.norm(b, axis=1))[2:]
    order = np.concatenate(([0, 1], 2 + np.argsort(-heights)))
    assert order.tolist() != sorted(order.tolist())
    at_resonance = np.linalg.norm(cq + 1j * natural * cv - natural**2 * ca, axis=0)[2:] / (
        2.0 * ratio * natural**2)[2:] * np.linalg.norm(b, axis=1)[2:]  # fmt: skip
    corrected = np.concatenate(([0, 1], 2 + np.argsort(-at_resonance)))
    assert corrected.tolist() != order.tolist()
    for ranked, static in ((order, False), (corrected, True)):  # the static part of a correction does not count
        family = ModalTruncation(system, corrected=static)
        for count in range(2, n + 2):
            small = family.model(count)
            assert small.coordinates == tuple([f"mode{k + 1}" for k in sorted(ranked[:count].tolist())])
            assert_allclose(np.diag(small.K), natural[np.sort(ranked[:count])] ** 2, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [3, 4])
def test_the_interface_alone_is_static_condensation(seed):
    """K = (R K^-1 R^T)^-1 of the interface displacements u = R q, and the response at rest is exact."""
    rng = np.random.default_rng(seed)
    mass, damping, stiffness = (r @ r.T + np.eye(6) for r in rng.normal(size=(3, 6, 6)))
    rows = rng.normal(size=(3, 6))
    system = mv.System.from_matrices(mass, damping, stiffness, rows.T, rows)
    small = system.reduced(3, method="craig-bampton")
    u, r = small.B.T, system.B.T  # the interface in both coordinates
    static = r @ np.linalg.solve(stiffness, r.T)
    assert_allclose(u @ np.linalg.solve(small.K, u.T), static, rtol=1e-11)
    shapes = np.linalg.solve(stiffness, r.T) @ np.linalg.inv(static)
    assert_allclose(np.linalg.inv(u).T @ small.M @ np.linalg.inv(u), shapes.T @ mass @ shapes, rtol=1e-10)


def test_an_error_that_no_order_reaches_is_refused():
    with pytest.raises(mv.ResponseError, match=r"error = 1; all 3 coordinates of 'sliding chain' leave inf\. Give"):
        sliding_chain([1.0] * 3, [2.0] * 3, [0.0] * 3, (0,), [("displacement", 2)]).linearize().reduced(
            error=1.0, method="modal")  # fmt: skip


@pytest.mark.slow
def test_free_motions_stay():
    """A free chain of masses: two rigid motions of the two directions, infinite responses at rest, a finite error."""
    model = mv.Model("free chain")
    for k in range(5):
        model.add_body(f"m{k}", 1.0 + 0.1 * k, (1, 1, 1), (k, 0, 0))
        model.add_joint(f"slide{k}", "prismatic", "ground", f"m{k}", axis=(1, 0, 0))
        if k:
            model.add_spring(f"k{k}", f"m{k - 1}", f"m{k}", (k - 0.9, 0, 0), (k - 0.1, 0, 0), 1e4 * k, 2.0)
    model.add_input("F", "m0", "x")
    model.add_output("x", "m4", "x")
    system = model.linearize()
    for method, order in (("modal", 2), ("static-corrected", 2), ("craig-bampton", 3)):
        small = reduced_equations(system, method, order)
        assert small.modes().frequencies[0] == pytest.approx(0.0, abs=1e-6)
        off = largest_error(system, small)
        assert off == pytest.approx(small.error_bound, rel=1e-2)
    with pytest.raises(mv.ResponseError, match="has 1 free motions, which every reduced model keeps"):
        reduced_equations(system, "modal", 0)


def test_the_static_correction_is_exact_at_rest():
    system = sliding_chain([1.0, 2.0, 0.5, 3.0], [900.0, 300.0, 500.0, 200.0], [1.0, 0.1, 3.0, 0.2], (0, 3),
                           [("displacement", 1), ("displacement", 3)]).linearize()  # fmt: skip
    for order in (0, 2):
        small = system.reduced(order, method="static-corrected")
        assert_allclose(small.frequency_response([0.0]), system.frequency_response([0.0]), rtol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_of_coordinates_and_ports_do_not_change_the_interface(unit):
    """Of two rows that differ by 1e9 in size none is rounding, and of motions held none is free."""
    rng = np.random.default_rng(2)
    mass, damping, stiffness = (r @ r.T + np.eye(5) for r in rng.normal(size=(3, 5, 5)))
    ports, scale = rng.normal(size=(5, 2)) * [1.0, unit], np.array([1.0, 1.0, 1.0, unit, unit])
    matrices = [scale[:, None] * matrix * scale for matrix in (mass, damping, stiffness)]
    system = mv.System.from_matrices(*matrices, scale[:, None] * ports, ports.T * scale)
    small = system.reduced(3, method="craig-bampton")
    plain = mv.System.from_matrices(mass, damping, stiffness, ports, ports.T).reduced(2, method="craig-bampton")
    assert small.dof == 3
    assert_allclose(small.frequency_response([0.0]), plain.frequency_response([0.0]), rtol=1e-9)


def test_the_interface_has_the_names_of_the_outputs():
    system = mv.library.quarter_car().linearize()
    small = reduced_equations(system, "craig-bampton", 2)
    assert small.coordinates == ("body.z", "wheel.z")
    assert_allclose(small.Cq[:2], np.eye(2), atol=1e-12)


def test_a_mode_without_damping_has_no_bound():
    system = mv.library.cantilever().linearize()
    assert reduced_equations(system, "modal", 10).error_bound == np.inf


@pytest.mark.parametrize(("method", "words", "message"), [
    ("modl", {"order": 2}, "Did you mean 'modal'"), ("modal", {"order": 13}, "whole number up to 12"),
    ("modal", {}, "expected one of both"), ("craig-bampton", {"order": 1}, "coordinates of the interface"),
])  # fmt: skip
def test_refusals(method, words, message):
    with pytest.raises(mv.ResponseError, match=message):
        reduced_equations(mv.library.stewart_isolator().linearize(), method, **words)


def test_an_interface_that_holds_nothing_is_refused():
    model = mv.Model("loose")
    for k in range(2):
        model.add_body(f"m{k}", 1.0, (1, 1, 1), (k, 0, 0))
        model.add_joint(f"slide{k}", "prismatic", "ground", f"m{k}", axis=(1, 0, 0))
    model.add_input("F", "m0", "x")
    model.add_output("x", "m0", "x")
    with pytest.raises(mv.ResponseError, match="can still move when its outputs and the points of its inputs are held"):
        reduced_equations(model.linearize(), "craig-bampton", 1)
