"""Derivatives of the matrices by complex steps: against the adjoint statement at rest, and differences under loads."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equations import batch_assembly, loaded
from mbsvib.equations.batch_equations import BatchEquations
from mbsvib.equations.batch_values import checked
from mbsvib.equations.plan_tangents import along_parameters
from tests.equations.test_batch_golden import everything
from tests.golden.store import scenes

KEYS = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
COUNT = 24
# Central differences of fourth order: steps against the value of a parameter, and weights.
# Entries below this cancel to rounding, in metres and radians; which are exactly 0 depends on the processor.
ROUNDING = 1e-15
STEP, POINTS, WEIGHTS = 2.0**-13, np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / 12.0


@pytest.fixture
def unbalanced(monkeypatch):
    """Let poses off balance pass: what is compared is the statement of their forces."""
    monkeypatch.setattr(loaded, "check_balance", lambda *_: None)


def prepared(name, wanted=COUNT):
    """A plan of a golden scene, its nominal batch, the parameters, and their derivatives; None if not at once."""
    model = mv.load(scenes()[name])
    rng = np.random.default_rng(5)
    own = [item for item in model.parameters if item.partition(".")[0] not in model.composed]
    names = rng.permutation(own)[:wanted].tolist()
    names = [item for item in names if model.parameters[item] or not any(word in item for word in ("damping", "mass"))]
    values = checked(model.parameters, {item: np.array([model.parameters[item]]) for item in names})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plan = batch_assembly.batch_plan(model, values.slots)
    if not plan.at_once(values):
        return None
    base = plan.equations(values, BatchEquations)
    return model, plan, names, along_parameters(plan, base, dict(zip(names, np.eye(len(names)), strict=True)))


@pytest.mark.few(3)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.UndeterminedForceWarning")
@pytest.mark.parametrize("name", scenes())
@pytest.mark.usefixtures("unbalanced")
def test_derivatives_are_limits_of_differences(name):
    case = prepared(name)
    if case is None:
        pytest.skip("variants of this scene are computed one after the other")
    model, _, names, slopes = case
    for j, item in enumerate(names):
        size = abs(model.parameters[item]) or 0.1
        if np.isnan(slopes["K"][0, j]).any():
            continue
        step = STEP * size
        try:
            near = model.linearize(values={item: model.parameters[item] + step * POINTS})
        except mv.MbsvibError:  # redundant constraints contradict each other beside this value
            continue
        for key in KEYS:
            matrix, slope = getattr(near, key), slopes[key][0, j] if slopes[key] is not None else 0.0
            expected = np.tensordot(WEIGHTS / step, matrix, 1)
            largest, change = np.abs(matrix).max(initial=0.0), np.abs(expected).max(initial=0.0)
            if largest > ROUNDING:
                assert np.abs(slope - expected).max(initial=0.0) <= 2e-7 * (largest / size + change), (item, key)


def single_fields():
    """A parameter of each field of the scene with one element of each kind."""
    parameters = everything().parameters
    return list({(entry.part, entry.field): entry.name for entry in parameters.entries}.values())


@pytest.mark.few(4)
@pytest.mark.parametrize("name", single_fields())
@pytest.mark.usefixtures("unbalanced")
def test_one_parameter_alone(name):
    """Arrays that nothing else varies keep no axis of variants: each output and matrix takes what there is."""
    model = everything()
    value = model.parameters[name]
    step = STEP * (abs(value) or 0.1)
    tangent = model.compile(name).tangent([value], [1.0])
    near = model.linearize(values={name: value + step * POINTS})
    for key in KEYS:
        matrix = getattr(near, key)
        expected = np.tensordot(WEIGHTS / step, matrix, 1)
        scale = np.abs(matrix).max(initial=0.0) / (abs(value) or 1.0) + np.abs(expected).max(initial=0.0)
        assert np.abs(getattr(tangent, key) - expected).max(initial=0.0) <= 2e-7 * scale, key


@pytest.mark.few(3)
@pytest.mark.parametrize("name", [name for name in scenes() if not name.startswith(("loaded", "massless", "hunt"))])
def test_derivatives_at_rest_are_those_of_the_adjoint(name):
    case = prepared(name)
    if case is None or case[1].scene.loads is not None or case[1].nominal.provenance.separation is not None:
        pytest.skip("loads, or variants that are computed one after the other")
    model, _, names, slopes = case
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        known = model.linearize(method="dense").matrix_derivatives(names)
    for key in KEYS:
        expected, result = getattr(known, key), slopes[key]
        lost = np.isnan(expected).any(axis=(1, 2))
        assert np.array_equal(lost, np.isnan(result[0]).any(axis=(1, 2))), key
        for j in np.flatnonzero(~lost):
            size = np.abs(getattr(known, key)[j]).max(initial=0.0)
            size += np.abs(getattr(case[1].nominal, key)).max(initial=0.0) / (abs(model.parameters[names[j]]) or 1.0)
            assert np.abs(result[0, j] - expected[j]).max(initial=0.0) <= 1e-12 * size, (names[j], key)
