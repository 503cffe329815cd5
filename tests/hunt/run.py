"""A run of the hunt: each scene through all comparisons, what failed, and what was refused on principle.

``python -m tests.hunt.run --seed 123 --count 100 --shrink`` hunts outside of pytest.
"""

import argparse
import re
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import mbsvib as mv
from tests.hunt.answers import Mismatch
from tests.hunt.checks import CHECKS, Subject
from tests.hunt.features import ALL, PAIRS
from tests.hunt.generate import example
from tests.hunt.skip import Skip

# What an engine refuses by name, on principle.
ON_PRINCIPLE = re.compile(
    r"does not support|do not support|not supported|would need the derivative of input|"
    r"without mass in a mechanism that spins|modal states of .* depend on each other|"
    r"grows, although no output shows|not computed sparse yet|in another pose, which a Maxwell element cannot say|"
    r"do not change smoothly with .* \((rotor '|joint '.* no joint with free = )|"
    # far from the origin, rounding of points leaves differences six digits
    r"\(differences agree to [1-9]\.\de-07 only\)"
)
# A response that is the derivative of an input grows by this share of the frequency at least.
IMPROPER = 0.5


@dataclass(frozen=True)
class Failure:
    """One comparison of one scene that failed."""

    seed: int
    check: str
    kind: str
    message: str
    where: str
    features: frozenset[str]

    def __str__(self):
        return (f"seed {self.seed}, comparison '{self.check}': {self.kind}: {self.message}\n  at {self.where}\n"
                f"  features: {', '.join(sorted(self.features))}\n"
                f"  again: pytest tests/hunt -m slow --hunt-seed={self.seed} --hunt-count=1 -s")  # fmt: skip


@dataclass
class Record:
    """What a run has seen."""

    scenes: int = 0
    none: list[Any] = field(default_factory=list)
    failures: list[Any] = field(default_factory=list)
    outcomes: Counter[Any] = field(default_factory=Counter)
    refused: Counter[Any] = field(default_factory=Counter)
    features: Counter[Any] = field(default_factory=Counter)
    pairs: Counter[Any] = field(default_factory=Counter)
    seconds: Counter[Any] = field(default_factory=Counter)

    def table(self):
        """Features against engines: how often each was refused on principle."""
        engines = sorted({engine for engine, _ in self.refused})
        width = max(map(len, ALL))
        lines = [f"{'feature':{width}} scenes " + " ".join(f"{engine:>12}" for engine in engines)]
        for feature in ALL:
            counts = [self.refused[engine, feature] for engine in engines]
            lines.append(f"{feature:{width}} {self.features[feature]:6} " + " ".join(f"{n:12}" for n in counts))
        return "\n".join(lines)

    def summary(self):
        lines = [f"{self.scenes} scenes, {len(self.none)} seeds without a scene: {self.none[:10]}"]
        for check in ("equilibrium", "linearize", "answers", *CHECKS):
            counts = {kind: self.outcomes[check, kind] for kind in ("held", "skipped", "refused", "failed")}
            lines.append(f"{check:14} " + ", ".join(f"{n} {kind}" for kind, n in counts.items() if n) +
                         f"; {self.seconds[check]:.0f} s")  # fmt: skip
        return "\n".join(lines)


def outcome_of(check, subject):
    """ "held", "skipped", "refused" or "failed", with the exception."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", mv.UndeterminedForceWarning)
        warnings.filterwarnings("ignore", ".*(out of line|nearly redundant)", mv.NearSingularWarning)
        try:
            check(subject)
        except Skip:
            return "skipped", None
        except mv.MbsvibError as error:
            return ("refused" if ON_PRINCIPLE.search(str(error)) else "failed"), error
        except Exception as error:  # whatever it is, it is no answer
            return "failed", error
    return "held", None


def hunt(seeds, record=None):
    """Run all comparisons on the scenes of some seeds."""
    record = Record() if record is None else record
    for seed in seeds:
        start = time.process_time()
        scene = example(seed)
        record.seconds["generate"] += time.process_time() - start
        if scene is None:
            record.none.append(seed)
            continue
        examine(Subject(scene), record)
    return record


def examine(subject, record):
    """Run all comparisons on one scene."""
    scene = subject.scene
    if subject.example.error is not None:
        note(record, "equilibrium", subject, "failed", subject.example.error)
    kind, error = outcome_of(lambda s: s.system, subject)
    if kind == "refused" and not improper(subject, str(error)):
        kind = "failed"
    note(record, "linearize", subject, kind, error)
    if kind != "held":
        return
    record.scenes += 1
    record.features.update(scene.features)
    record.pairs.update(pair for pair in PAIRS if pair[0] in scene.features and pair[1] in scene.features)
    kind, error = outcome_of(lambda s: s.answers, subject)
    if kind != "held":
        note(record, "answers", subject, kind, error)
        return
    for name, check in CHECKS.items():
        start = time.process_time()
        kind, error = outcome_of(check, subject)
        record.seconds[name] += time.process_time() - start
        note(record, name, subject, kind, error)


def improper(subject, message):
    """Whether a refusal of an output that would need the derivative of an input is right; others are."""
    names = re.match(r"output '([^']+)' would need the derivative of input '([^']+)'", message)
    if names is None:
        return True
    reference = subject.example.reference
    i, j = subject.scene.outputs.index(names[1]), subject.scene.inputs.index(names[2])
    high = 1e3 * np.abs(reference.eigenvalues).max(initial=1.0)
    low, far = np.abs(reference.matrices.response(np.array([high, 10 * high]))[0][i, j])
    return bool(far > 10 * IMPROPER * low > 0.0)


def note(record, name, subject, kind, error):
    record.outcomes[name, kind] += 1
    if kind == "refused":
        record.refused.update((name, feature) for feature in subject.scene.features)
    if kind == "failed":
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = "" if isinstance(error, Mismatch) else f"{frame.filename}:{frame.lineno} in {frame.name}"
        record.failures.append(Failure(subject.scene.seed, name, type(error).__name__, str(error), where,
                                       subject.scene.features))  # fmt: skip


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--shrink", action="store_true")
    arguments = parser.parse_args()
    record = hunt(range(arguments.seed, arguments.seed + arguments.count))
    for failure in record.failures:
        print(failure)
        if arguments.shrink:
            from tests.hunt.shrink import shrunk

            print(shrunk(failure))
    print(record.table())
    print(record.summary())


if __name__ == "__main__":
    main()
