"""Random scenes in nonlinear runs; the seeds here once failed."""

import warnings

import pytest

import mbsvib as mv
from tests.hunt.checks import Subject
from tests.hunt.generate import example
from tests.hunt.runs import features, runs
from tests.hunt.skip import Skip

# 30018: locked translations beside two successive rotations; 30044: a loop that is redundant as a whole
ONCE = (30018, 30044)
FIRST, COUNT = 31000, 8
DRIVEN = (34015, 34020, 34023, 34029)  # with beams, superelements or Maxwell elements, or in a ground that moves


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "driven"), [*((seed, False) for seed in (*ONCE, *range(FIRST, FIRST + COUNT))),
                                              *((seed, True) for seed in DRIVEN)])  # fmt: skip
def test_runs_of_small_motion_are_linear(seed, driven):
    scene = example(seed, features(seed, driven))
    if scene is None:
        pytest.skip("no scene")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.UndeterminedForceWarning)
        try:
            runs(Subject(scene))
        except Skip as reason:
            pytest.skip(str(reason))
