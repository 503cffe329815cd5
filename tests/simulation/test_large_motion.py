"""Large motion against exudyn, an independent engine; tests/support/exudyn_reference.py makes the file."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.large_motion import SCENES, TIMES

DATA = json.loads((Path(__file__).parents[1] / "data" / "large_motion.json").read_text())


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["double_pendulum", "four_bar", pytest.param("platform", marks=pytest.mark.slow)])
def test_positions_are_those_of_exudyn(name):
    reference = DATA[name]
    assert reference["error"] < 1e-9
    run = SCENES[name]().simulate(TIMES)
    ours, theirs = np.array([run[output] for output in reference["outputs"]]), np.array(reference["values"])
    assert np.abs(theirs).max() > 0.03
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-7)
    size = max(float(run.energy.kinetic.max()), 1e-3)
    assert np.abs(run.energy.balance).max() < 1e-7 * size


@pytest.mark.slow
def test_a_tighter_tolerance_is_nearer():
    """The error follows the tolerance, down to that of the reference."""
    reference = np.array(DATA["double_pendulum"]["values"])
    model = SCENES["double_pendulum"]()
    errors = []
    for tolerance in (1e-4, 1e-7, 1e-10):
        run = model.simulate(TIMES, tolerance=tolerance)
        ours = np.array([run[name] for name in DATA["double_pendulum"]["outputs"]])
        errors.append(float(np.abs(ours - reference).max()))
    assert errors[0] > 20 * errors[1] > 400 * errors[2]
    assert errors[0] < 1e-4
    assert errors[2] < 1e-10
