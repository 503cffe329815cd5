"""Errors that checks of files state, against errors by hand of files that are a little off."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib.equations.matrices import MATRICES
from mbsvib_export.checking import pole_error
from mbsvib_export.responses import check_points

OFF = 1e-5  # of each entry: found, and within what readers take for one system in two forms
SLIGHT = 1e-7  # of entries of a state space, in which forces cancel above all resonances


def model(first=800.0):
    """A mass on another one: coupled coordinates, outputs of all three rates, ports of several units and sizes."""
    result = mv.Model("two")
    result.add_body("a", 2.0, (1, 1, 1), (0, 0, 1))
    result.add_body("b", 3.0, (1, 1, 1), (0, 0, 2))
    result.add_joint("ja", "prismatic", "ground", "a", axis=(0, 0, 1))
    result.add_joint("jb", "prismatic", "a", "b", axis=(0, 0, 1))
    result.add_spring("ka", "ground", "a", start=(0, 0, 0), end=(0, 0, 1), stiffness=first, damping=6.0)
    result.add_spring("kb", "a", "b", start=(0, 0, 1), end=(0, 0, 2), stiffness=500.0, damping=4.0)
    result.add_input("F", "a", (0, 0, 1.0))
    result.add_input("G", "b", "z")
    result.add_output("z", "a", "z")
    result.add_output("v", "b", "z", quantity="velocity")
    result.add_output("u", "a", "z", quantity="velocity")
    result.add_output("w", "b", "z", quantity="acceleration")
    result.add_force_output("force", "kb")
    return result


SYSTEM = model().linearize()
OMEGA = check_points(SYSTEM.poles())


def response(data, omega=OMEGA):
    return np.stack([(data.Cq + 1j * w * data.Cv - w**2 * data.Ca)
                     @ np.linalg.solve(data.K + 1j * w * data.C - w**2 * data.M, data.B) + data.D for w in omega],
                    axis=2)  # fmt: skip


def of_states(space, omega=OMEGA):
    return np.stack([space.C @ np.linalg.solve(1j * w * np.eye(len(space.A)) - space.A, space.B) + space.D
                     for w in omega], axis=2)  # fmt: skip


def error(actual, truth):
    """The largest difference by the largest entry between ports of these units, at each frequency."""
    worst = 0.0
    for output in set(SYSTEM.output_units):
        for given in set(SYSTEM.input_units):
            block = np.ix_(*([k for k, unit in enumerate(units) if unit == own] for units, own in
                             ((SYSTEM.output_units, output), (SYSTEM.input_units, given))))  # fmt: skip
            size = np.abs(truth[block]).max(axis=(0, 1))
            worst = max(worst, (np.abs((actual - truth)[block]) / size).max())
    return worst


def off(array, seed, share=OFF):
    return array * (1.0 + share * np.random.default_rng(seed).uniform(-1.0, 1.0, array.shape))


def test_frequencies_are_below_at_and_above_all_poles():
    """Each rate once, 0.2 % beside it; a pole at 0 and a pair that is nearly double are none of their own."""
    values = np.array([0.0, -2.0, 3j, -3j, -3.0 * (1.0 + 1e-4), 50.0])
    np.testing.assert_allclose(check_points(values), [0.2, 2.004, 3.006, 50.1, 150.0], rtol=1e-3)
    np.testing.assert_allclose(check_points(values[:2]), [0.2, 2.004, 6.0], rtol=1e-14)
    assert check_points(values[:1]).tolist() == check_points(values[:0]).tolist() == [1.0, 10.0]
    many = check_points(np.geomspace(1.0, 1e6, 201) * 1j)
    np.testing.assert_allclose(many[[0, 1, -2, -1]], [0.1, 1.002, 1.002e6, 3e6], rtol=1e-14)
    assert len(many) == 12
    assert (np.diff(np.log10(many[1:-1])) < 0.7).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("key", MATRICES[:-1])  # D is 0
def test_second_order_matrices_that_are_off(key, tmp_path):
    data = mx.from_json(mx.to_json(SYSTEM))
    data = replace(data, **{key: off(getattr(data, key), MATRICES.index(key))})
    path = mx.to_npz(data, tmp_path / "x.npz")
    first, second, poles, bodies = mx.check_export(path, SYSTEM).comparisons
    expected = error(response(data), response(SYSTEM))
    assert 1e-7 < expected < 1e-3
    assert second.error == pytest.approx(expected, rel=1e-6)
    assert max(first.error, poles.error, bodies.error) < 1e-12
    alone, own_bodies = mx.check_export(path).comparisons  # the state space against the second-order equations
    assert alone.against == own_bodies.against == "its second-order equations"
    if key not in "MCK":
        assert alone.error == pytest.approx(error(response(SYSTEM), response(data)), rel=1e-6)
    assert mx.check_export(path, SYSTEM, limit=2.0 * expected).passed
    assert not mx.check_export(path, SYSTEM, limit=0.5 * expected).passed


@pytest.mark.parametrize("key", ["A", "B", "C", "D"])
def test_state_spaces_that_are_off(key, tmp_path):
    """In a file of both forms, and in one of first-order equations alone."""
    data, space = mx.from_json(mx.to_json(SYSTEM)), SYSTEM.state_space()
    changed = replace(space, **{key: off(getattr(space, key), 7, SLIGHT)})
    expected = error(of_states(changed), response(SYSTEM))
    assert 1e-8 < expected < 1e-4
    whole = mx.to_npz(replace(data, state_space=changed), tmp_path / "x.npz")
    found = mx.check_export(whole, SYSTEM).comparisons
    assert found[0].error == pytest.approx(expected, rel=1e-6)
    assert found[1].error < 1e-12
    values = np.sort_complex(np.linalg.eigvals(space.A))
    moved = np.abs(np.sort_complex(np.linalg.eigvals(changed.A)) / values - 1.0).max()
    assert found[2].error == pytest.approx(moved, rel=1e-6, abs=1e-12)
    m, omega = SYSTEM.dof, OMEGA[:, None, None]
    rows = SYSTEM.body_motion.reshape(-1, m)
    states = np.linalg.solve(1j * omega * np.eye(2 * m) - changed.A, changed.B)
    exact = rows @ np.linalg.solve(SYSTEM.K + 1j * omega * SYSTEM.C - omega**2 * SYSTEM.M, SYSTEM.B)
    size = np.abs(exact).max(axis=(0, 1))
    displaced = (np.abs(rows @ space.transform[:m] @ states - exact) / size).max()
    assert found[3].error == pytest.approx(displaced, rel=1e-6, abs=1e-12)
    alone = mx.to_npz(changed, tmp_path / "y.npz")
    first, poles = mx.check_export(alone, SYSTEM).comparisons
    assert (first.error, poles.error) == pytest.approx((expected, moved), rel=1e-6, abs=1e-12)


def test_displacements_of_bodies_that_are_off(tmp_path):
    """Of each input by the largest displacement that it causes."""
    data = mx.from_json(mx.to_json(SYSTEM))
    factor = np.array([1.0, 1.0 + OFF])[:, None, None]
    path = mx.to_npz(replace(data, body_motion=factor * data.body_motion), tmp_path / "x.npz")
    *others, bodies = mx.check_export(path, SYSTEM).comparisons
    assert max(item.error for item in others) < 1e-12
    motion = np.stack([SYSTEM.body_motion @ np.linalg.solve(SYSTEM.K + 1j * w * SYSTEM.C - w**2 * SYSTEM.M, SYSTEM.B)
                       for w in OMEGA])  # fmt: skip
    size = np.abs(motion).max(axis=(0, 1, 2))
    assert bodies.error == pytest.approx((OFF * np.abs(motion[:, 1]).max(axis=(0, 1)) / size).max(), rel=1e-6)


@pytest.mark.parametrize("suffix", ["op4", "pch", "uff", "fmu"])
def test_files_of_another_stiffness(suffix, tmp_path):
    other, path = model(first=800.0 * (1.0 + 1e-4)).linearize(), tmp_path / f"x.{suffix}"
    write = {"op4": mx.to_op4, "pch": mx.to_dmig, "uff": mx.to_uff, "fmu": mx.to_fmu}[suffix]
    write(other, path, **({"omega": OMEGA[:3]} if suffix == "uff" else {}))
    result = {item.quantity: item.error for item in mx.check_export(path, SYSTEM).comparisons}
    if suffix in ("op4", "pch"):
        for key, value in result.items():
            truth = getattr(SYSTEM, key)
            expected = np.abs(getattr(other, key) - truth).max() / (np.abs(truth).max() or 1.0)
            assert value == pytest.approx(expected, rel=1e-4, abs=1e-9), key
        assert result["K"] > 5e-5
        return
    omega = mx.from_uff(path).omega if suffix == "uff" else OMEGA
    expected = error(response(other, omega), response(SYSTEM, omega))
    assert next(iter(result.values())) == pytest.approx(expected, rel=1e-6)
    if suffix == "fmu":
        poles, moved = (np.sort_complex(np.linalg.eigvals(system.state_space().A)) for system in (SYSTEM, other))
        assert result["poles"] == pytest.approx(np.abs(moved / poles - 1.0).max(), rel=1e-6)


@pytest.mark.parametrize(("found", "truth", "expected"), [
    ([2.0], [1.0], 1.0), ([1.0], [2.0], 0.5), ([3j, 1.0], [1.0, 3.3j], 1.0 / 11.0), ([1e-3], [0.0], 1e-3),
    ([1e-4, 2.0], [0.0, 2.0], 5e-5), ([1e-4, 2.0], [1e-7, 2.0], (1e-4 - 1e-7) / 2.0), ([], [], 0.0),
    ([1.0], [], np.inf), ([5.0, 1.0, 2.0], [1.0, 2.0, 4.0], 0.25),
])  # fmt: skip
def test_errors_of_poles(found, truth, expected):
    """By the size of the true pole; of rigid-body motions by the largest one."""
    assert pole_error(np.array(found, complex), np.array(truth, complex)) == pytest.approx(expected, rel=1e-12)
