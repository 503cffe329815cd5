"""The seeds of the hunt: ``--hunt-seed`` is the first one, or ``random``, and ``--hunt-count`` how many there are."""

from dataclasses import dataclass

import pytest

FIRST, COUNT = 0, 240


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


def _seeds(config):
    return Seeds(int(config.getoption("hunt_seed") or FIRST), config.getoption("hunt_count") or COUNT)


@pytest.fixture(scope="session")
def seeds(pytestconfig):
    """The seeds of this run: those of every run, or what ``--hunt-seed`` asks for, which the summary names."""
    return _seeds(pytestconfig)


def pytest_terminal_summary(terminalreporter, config):
    """Tell the seeds of a run that others do not repeat."""
    run = _seeds(config)
    if not run.same:
        terminalreporter.write_line(f"hunt: pytest tests/hunt -m slow --hunt-seed={run.first} --hunt-count={run.count}")
