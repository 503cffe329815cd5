"""Random scenes in answers that come by states, against state equations in 300 bits."""

import warnings
from collections import Counter

import flint
import pytest

import mbsvib as mv
from tests.hunt.answers import Mismatch
from tests.hunt.checks import Subject
from tests.hunt.exact_states import BITS
from tests.hunt.generate import example
from tests.hunt.run import ON_PRINCIPLE
from tests.hunt.skip import Skip
from tests.hunt.states import CHECKS, States

SCENES = range(20022, 20080)
# Each comparison holds in so many of them at least.
COMPARED = 7


def compared(seeds):
    """Compare scenes; return how many there were of each comparison, and what failed."""
    held, failed = Counter(), []
    for seed in seeds:
        scene = example(seed)
        if scene is None:
            continue
        with warnings.catch_warnings(), flint.ctx.workprec(BITS):
            warnings.simplefilter("ignore", mv.UndeterminedForceWarning)
            subject = Subject(scene)
            for check in CHECKS:
                try:
                    check(States(subject))
                except Skip:
                    continue
                except (Mismatch, mv.MbsvibError) as error:
                    if not ON_PRINCIPLE.search(str(error)):
                        failed.append(f"seed {seed}, {check.__name__}: {type(error).__name__}: {error}")
                else:
                    held[check.__name__] += 1
    return held, failed


@pytest.mark.slow
def test_many_scenes():
    held, failed = compared(SCENES)
    assert not failed, "\n".join(failed)
    assert min(held[check.__name__] for check in CHECKS) >= COMPARED, held
