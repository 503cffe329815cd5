"""Fixtures for tests of batches."""

import pytest

from mbsvib.equations.batch_assembly import BatchPlan


@pytest.fixture
def at_once(monkeypatch):
    """Variants that are linearized one after the other fail the test."""
    def refuse(*_):
        raise AssertionError("one after the other")

    monkeypatch.setattr(BatchPlan, "_one_by_one", refuse)
