"""Parameters of tests of which only some run by default."""

import pytest


def some(cases, *quick):
    """All cases as parameters; those that are not ``quick`` are slow."""
    return [case if case in quick else pytest.param(case, marks=pytest.mark.slow) for case in cases]
