"""Families of tests of which a few members run by default, and all in slow runs."""

import pytest
from hypothesis import given, settings

SUFFIX = "_of_many"


def few(values, count):
    """Values for ``parametrize``: the first ``count`` by default, the others in slow runs."""
    values = list(values)
    return values[:count] + [pytest.param(value, marks=pytest.mark.slow) for value in values[count:]]


def examples(count, slow):
    """Let a random test try ``count`` examples, and a slow one of its own so many: above all its other decorators."""

    def decorate(test):
        inner = test.hypothesis.inner_test
        many = settings(max_examples=slow)(given(**test.hypothesis._given_kwargs)(inner))
        many.__name__ = test.__name__ + SUFFIX
        many.pytestmark = [*getattr(test, "pytestmark", ()), pytest.mark.slow.mark]
        inner.__globals__[many.__name__] = many
        return settings(max_examples=count)(test)

    return decorate
