"""Outputs that see next to nothing of what moves, against 80 digits."""

import warnings
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.double_double import DoubleDouble, Sliced, two_sum
from mbsvib.responses import frequency_response as module
from mbsvib.responses import refined as corrections
from tests.stress import reference
from tests.stress.families import wide
from tests.support.exact import Exact
from tests.support.random_models import add_random_ports

EPS = float(np.finfo(float).eps)


def scene(seed, damping, stiffness_span=12.0, mass_span=8.0):
    model = wide(seed, bodies=5, damping=damping, stiffness_span=stiffness_span, mass_span=mass_span)
    centres = {"ground": np.zeros(3)} | {body.name: np.array(body.position) for body in model.bodies.values()}
    add_random_ports(model, np.random.default_rng(seed), centres, base=False)
    return model


def compared(model):
    """The system, frequencies, responses found and expected."""
    system = model.linearize()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.AccuracyWarning)
        natural = system.modes().natural
    omega = np.array([0.1, 0.3, 2.1]).repeat(2) * natural[[0, -1] * 3]
    with reference.precision():
        expected = Exact(model).frequency_response(omega)
    return system, omega, system.frequency_response(omega), expected


def wrong(system, omega, result, expected):
    """Largest relative error of what is no sum that cancels to less than 1e-7 of its terms, and no zero."""
    modal = system.basis.modal
    forward = corrections._forward(
        system, modal, omega, lambda w: module._solver(system.basis, modal, w, modal.vectors is None)
    )
    clear = np.abs(expected) > np.maximum(1e-7 * forward.size, 1e4 * forward.floor + 1e-60)
    return float((np.abs(result - expected)[clear] / np.abs(expected)[clear]).max())


@pytest.mark.few(2)
@pytest.mark.parametrize("damping", [None, (1e-3, 1e-1), (1e-1, 1e3), (1e-3, 1e6)])
@pytest.mark.parametrize("seed", [4, 7, 15])
def test_any_damping_over_twelve_decades(seed, damping):
    assert wrong(*compared(scene(seed, damping))) <= 1e-7


def test_strong_dampers_need_it(monkeypatch):
    model = scene(409, (1e-3, 1e6), 6.0, 3.0)
    system, omega, result, expected = compared(model)
    assert wrong(system, omega, result, expected) <= 1e-10
    monkeypatch.setattr(module, "recomputed", lambda system, modal, w, result, solver: result[0])
    assert wrong(system, omega, system.frequency_response(omega), expected) > 0.1


@pytest.mark.parametrize("name", ["stewart", "cubic_hexapod", "quadruped", "chain", "ladder", "stewart_isolator"])
def test_scenes_without_such_outputs_are_left_alone(name, monkeypatch):
    """Zeros by symmetry among them, which are rounding."""
    model = mv.library.chain(line=(0, 1, 0)) if name == "chain" else mv.library.build(name)
    system = model.linearize()
    natural = system.modes().natural
    omega = np.geomspace(natural[0] / 10, 3 * natural[-1], 50)
    monkeypatch.setattr(corrections, "refined", None)
    result = system.frequency_response(omega)
    monkeypatch.setattr(module, "recomputed", lambda system, modal, w, result, solver: result[0])
    np.testing.assert_array_equal(result, system.frequency_response(omega))


def test_corrections_that_do_not_settle_are_warned_of(monkeypatch):
    system = scene(409, (1e-3, 1e6), 6.0, 3.0).linearize()
    refined = corrections.refined

    def restless(factors, shapes, load, outputs, solve):
        result = refined(factors, shapes, load, outputs, solve)
        if load.shape[1] < len(system.inputs) or load.shape[2] == 1:
            object.__setattr__(result, "change", np.full(result.change.shape, np.inf))
        return result

    omega = 0.3 * system.modes().natural[:1]
    entries = np.ones((len(system.outputs), len(system.inputs)), dtype=bool)
    monkeypatch.setattr(corrections, "_entries", lambda *_: entries)
    monkeypatch.setattr(corrections, "refined", restless)
    with pytest.warns(mv.AccuracyWarning, match=r"wide409: '.*' is so small compared with the motions due to 'in0' at"):
        system.frequency_response(omega)


def test_static_responses_are_real():
    system = scene(7, (1e-1, 1e3)).linearize()
    assert not system.frequency_response([0.0]).imag.any()


@pytest.mark.parametrize("stiffness", [0.0, 5.0])
def test_many_rows_of_inertia_for_one_coordinate(stiffness):
    """As many bodies without a spring, or with one, have them: (k - 14 w^2) q = 1."""
    given, unit = np.array([stiffness]), np.ones((1, 1))
    inertia = np.array([[1.0], [2.0], [3.0]])
    system = SimpleNamespace(row_stiffness=given, row_damping=0.0 * given, elastic_rows=unit, inertia_factor=inertia)
    w, load, outputs = np.array([0.5, 2.0]), np.ones((1, 1, 2), dtype=complex), ([(0, unit)], 0.0 * unit)
    exact = stiffness - 14.0 * w * w
    # six digits of a solution are enough to start with
    rough = 14.0 * (1.0 + 1e-6) / exact
    shapes = np.array([[1.0 / np.sqrt(14.0)]])
    factors = corrections.Factors.of(system, w)
    result = corrections.refined(factors, shapes, load, outputs, lambda right: right * rough)
    np.testing.assert_allclose(result.value[0, 0], 1.0 / exact, rtol=4 * EPS)
    assert result.relative_motion.shape == (4 if stiffness else 3, 1, 2)


def test_products_to_twice_the_digits():
    rng = np.random.default_rng(3)
    a = rng.normal(size=(4, 9)) * 10.0 ** rng.uniform(-9, 9, (4, 1))
    high = rng.normal(size=(9, 3)) * 10.0 ** rng.uniform(-6, 6, (9, 3))
    high, low = two_sum(high, EPS * high * rng.uniform(-0.3, 0.3, high.shape))
    result = Sliced.of(a).product(DoubleDouble(high, low))
    for i in range(4):
        for j in range(3):
            terms = [Fraction(a[i, k]) * (Fraction(high[k, j]) + Fraction(low[k, j])) for k in range(9)]
            error = Fraction(result.high[i, j]) + Fraction(result.low[i, j]) - sum(terms)
            largest = Fraction(np.abs(a[i]).max()) * Fraction(np.abs(high[:, j]).max())
            assert abs(error) <= largest * Fraction(2) ** -94
