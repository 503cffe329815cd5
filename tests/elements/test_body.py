"""Bodies: the ways of giving an inertia, and which inertias a body can have."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.elements.body import TRIANGLE_SLACK, principal
from tests.support.random_models import rotation

TENSOR = np.array([[3.0, 0.2, -0.1], [0.2, 2.5, 0.3], [-0.1, 0.3, 2.0]])
SIX = (3.0, 2.5, 2.0, 0.2, -0.1, 0.3)


def make(**words):
    return mv.Model().add_body("b", **({"mass": 1.0, "inertia": (1, 1, 1)} | words))


def test_three_ways_of_one_inertia():
    assert make(inertia=TENSOR).inertia == make(inertia=SIX).inertia == SIX
    assert make(inertia=(3.0, 2.5, 2.0)).inertia == make(inertia=np.diag([3.0, 2.5, 2.0])).inertia
    assert make(inertia=(3.0, 2.5, 2.0)).inertia == (3.0, 2.5, 2.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("form", [tuple, list, np.array, lambda v: np.array(v, dtype=np.float32)])
def test_lists_tuples_and_arrays(form):
    body = make(mass=np.float64(2), inertia=form([1.0, 1.25, 1.5]), position=form([1, 2, 3]),
                orientation=form([0.0, 0.0, 0.5]))  # fmt: skip
    assert body.inertia == (1.0, 1.25, 1.5, 0.0, 0.0, 0.0)
    assert body.position == (1.0, 2.0, 3.0)
    assert {type(v) for v in (body.mass, *body.inertia, *body.position, *body.orientation[0])} == {float}


@pytest.mark.parametrize("number", [2, np.int32(2), np.float32(2), np.array(2.0), np.float64(2)])
def test_scalars_of_numpy(number):
    body = make(mass=number)
    assert body.mass == 2.0
    assert type(body.mass) is float


def test_what_was_given_can_be_changed_afterwards():
    position = np.zeros(3)
    body = make(position=position)
    position[0] = 9.0
    assert body.position == (0.0, 0.0, 0.0)


def test_bodies_are_immutable():
    with pytest.raises(FrozenInstanceError):
        make().mass = 3.0
    with pytest.raises((AttributeError, TypeError)):
        make().colour = "red"


def test_words_give_the_call_back():
    words = {"name": "b", "mass": 2.0, "inertia": SIX, "position": (1.0, 2.0, 3.0),
             "orientation": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))}  # fmt: skip
    body = mv.Model().add_body(**words)
    assert body.constructor_kwargs() == words
    assert mv.Model().add_body(**body.constructor_kwargs()) == body


def test_words_leave_defaults_out():
    assert set(make().constructor_kwargs()) == {"name", "mass", "inertia"}


def test_a_rotation_vector_is_a_matrix():
    assert_allclose(make(orientation=(0, 0, np.pi / 2)).orientation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=2e-16)


@pytest.mark.parametrize("inertia", [
    (0.0, 0.0, 0.0),  # a point mass
    (0.0, 1.0, 1.0),  # a rod without thickness
    (1.0, 1.0, 2.0),  # a plate without thickness
    (1.0, 1.0, 2.0 * (1 + 0.9 * TRIANGLE_SLACK)),  # a plate in seven digits
])  # fmt: skip
def test_bodies_without_thickness_exist(inertia):
    assert make(inertia=inertia).inertia[:3] == inertia[:3]


def test_an_oblique_rod_exists():
    along = np.array([1.0, 2.0, -2.0]) / 3
    tensor = np.eye(3) - np.outer(along, along)
    assert_allclose(principal(*make(inertia=(tensor + tensor.T) / 2).inertia), [0, 1, 1], atol=1e-15)


def test_an_oblique_plate_exists():
    normal = np.array([2.0, -1.0, 2.0]) / 3
    tensor = np.eye(3) + np.outer(normal, normal)
    assert_allclose(principal(*make(inertia=(tensor + tensor.T) / 2).inertia), [1, 1, 2], rtol=1e-15)


@pytest.mark.parametrize("excess", [1.5 * TRIANGLE_SLACK, 1e-3, 1.0])
def test_the_triangle_rule_holds_beyond_print_out_digits(excess):
    with pytest.raises(mv.ModelError, match="exceeds the sum of the other two"):
        make(inertia=(1.0, 1.0, 2.0 * (1 + excess)))
    turn = rotation(np.random.default_rng(1))
    tensor = turn @ np.diag([1.0, 1.0, 2.0 * (1 + excess)]) @ turn.T
    with pytest.raises(mv.ModelError, match="exceeds the sum of the other two"):
        make(inertia=(tensor + tensor.T) / 2)


@pytest.mark.parametrize("turn", [np.eye(3), rotation(np.random.default_rng(2))], ids=["along", "turned"])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
@pytest.mark.parametrize(("principal_moments", "message"), [
    ((-1.0, 2.5, 2.5), "smallest principal moment is -1"), ((1.0, 1.5, 4.0), "exceeds the sum of the other two"),
])  # fmt: skip
def test_moments_that_no_body_has_are_refused_about_any_axis(principal_moments, message, order, turn):
    tensor = turn @ np.diag(np.array(principal_moments)[list(order)]) @ turn.T
    with pytest.raises(mv.ModelError, match=message):
        make(inertia=(tensor + tensor.T) / 2)


@given(st.integers(0, 2**31), st.floats(-12, 6), st.floats(-12, 0), st.floats(-12, 0))
def test_principal_moments_against_numpy(seed, size, middle, low):
    turn = rotation(np.random.default_rng(seed))
    tensor = turn @ np.diag(10.0**size * np.array([10**low, 10**middle, 1.0])) @ turn.T
    tensor = (tensor + tensor.T) / 2
    entries = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    expected = np.linalg.eigvalsh(tensor)
    # the closed form loses half of the digits where two moments agree, far less than the triangle rule's slack
    assert_allclose(principal(*entries), expected, rtol=0, atol=4e-8 * expected[-1])
    assert sum(principal(*entries)) == pytest.approx(np.trace(tensor), rel=1e-14)


@given(st.integers(0, 2**31), st.floats(1e-6, 1e6))
def test_every_box_is_accepted_in_every_orientation(seed, mass):
    rng = np.random.default_rng(seed)
    a, b, c = 10 ** rng.uniform(-3, 1, size=3)
    turn = rotation(rng)
    tensor = mass / 12 * turn @ np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) @ turn.T
    assert make(mass=mass, inertia=(tensor + tensor.T) / 2).mass == mass
