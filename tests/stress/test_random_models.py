"""Random mechanisms, open, closed and redundant, their parts added in any order, against an independent reference."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.support.compare import (
    assert_same_eigenvalues,
    assert_same_matrices,
    assert_same_response,
    frequencies,
    linearized,
)  # fmt: skip
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, rebuilt, seeds
from tests.support.sizes import examples

ANY = st.one_of(
    open_trees(kinds=st.just(("revolute", "universal", "spherical", "screw", "custom"))),
    open_trees(floating=st.just(True)), closed_loops(), planar_loops(),
)  # fmt: skip


def check(model, order, limit):
    """Matrices, eigenvalues and responses of the model with its parts in another order."""
    again = rebuilt(model, order=order)
    system = linearized(again)
    assume(0 < system.dof <= limit)
    reference = Exact(model)
    assert system.dof == reference.dof
    assert_same_matrices(system, reference)
    assert_same_eigenvalues(system.modes().eigenvalues, reference.eigenvalues)
    rigid = bool(reference.zeros)
    omega = frequencies(reference)
    assert_same_response(system.frequency_response(omega[omega > 0] if rigid else omega),
                         reference.frequency_response(omega), rtol=1e-8)  # fmt: skip
    return system


@pytest.mark.slow
@examples(12, slow=25)
@given(ANY, seeds())
def test_any_mechanism_in_any_order(model, order):
    check(model, order, limit=8)


@pytest.mark.slow
@settings(max_examples=250)
@given(ANY, seeds())
def test_any_mechanism_in_any_order_at_length(model, order):
    check(model, order, limit=12)


@pytest.mark.slow
@examples(30, slow=60)
@given(ANY, seeds(), seeds())
def test_order_changes_nothing_but_names(model, first, second):
    """Two orders: the same degrees of freedom, eigenvalues and responses, though coordinates may be others."""
    left, right = (linearized(rebuilt(model, order=order)) for order in (first, second))
    assert left.dof == right.dof
    assert len(left.redundant) == len(right.redundant)
    assume(left.dof)
    assert_same_eigenvalues(left.modes().eigenvalues, right.modes().eigenvalues)
    omega = np.geomspace(1.0, 1e3, 5)
    assert_same_response(left.frequency_response(omega), right.frequency_response(omega), rtol=1e-8)
