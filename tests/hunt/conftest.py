"""The seeds of the hunt: ``--hunt-seed`` is the first one, or ``random``, and ``--hunt-count`` how many there are."""

import random
from dataclasses import dataclass

import pytest

FIRST, COUNT = 0, 500


@dataclass(frozen=True)
class Seeds:
    """The seeds of a run, and whether they are those of every run."""

    first: int
    count: int

    @property
    def same(self):
        return (self.first, self.count) == (FIRST, COUNT)

    def __iter__(self):
        return iter(range(self.first, self.first + self.count))


@pytest.fixture(scope="session")
def seeds(pytestconfig):
    """The seeds of this run: those of every run, or what ``--hunt-seed`` asks for, which the summary names."""
    asked = pytestconfig.getoption("hunt_seed")
    first = random.SystemRandom().getrandbits(30) if asked == "random" else int(asked or FIRST)
    pytestconfig.hunt = Seeds(first, pytestconfig.getoption("hunt_count") or COUNT)
    return pytestconfig.hunt


def pytest_terminal_summary(terminalreporter, config):
    """Tell the seeds of a run that others do not repeat."""
    run = getattr(config, "hunt", None)
    if run is not None and not run.same:
        terminalreporter.write_line(f"hunt: pytest tests/hunt -m slow --hunt-seed={run.first} --hunt-count={run.count}")
