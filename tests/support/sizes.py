"""Families of tests of which a few members run by default: all in slow runs, or in slow runs of random examples."""

import pytest
from hypothesis import given, settings

SUFFIX = "_of_many"


def few(values, count):
    """Values for ``parametrize``: the first ``count`` by default, the others in slow runs."""
    values = list(values)
    return values[:count] + [pytest.param(value, marks=pytest.mark.slow) for value in values[count:]]


def examples(count, slow):
    """Let a random test try ``count`` examples, and where they are random (``HYPOTHESIS_PROFILE=random``) a slow test
    of its own ``slow`` of them: above all its other decorators.
    """

    def decorate(test):
        if settings.default.derandomize:
            return settings(max_examples=count)(test)
        inner = test.hypothesis.inner_test
        many = settings(max_examples=slow)(given(**test.hypothesis._given_kwargs)(inner))
        many.__name__ = test.__name__ + SUFFIX
        many.pytestmark = [*getattr(test, "pytestmark", ()), pytest.mark.slow.mark]
        inner.__globals__[many.__name__] = many
        return settings(max_examples=count)(test)

    return decorate
