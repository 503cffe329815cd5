"""Line springs."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv


def make(**words):
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1))
    arguments = {"name": "k", "first": "ground", "second": "a", "start": (1, 0, 0), "end": (1, 3, 4), "stiffness": 2.0}
    return model.add_spring(**(arguments | words))


def test_the_line_goes_from_start_to_end():
    assert make().line == (0.0, 0.6, 0.8)


@pytest.mark.parametrize("length", [1e-200, 1e-9, 1e6, 1e200])
def test_any_length_has_a_line(length):
    assert_allclose(make(start=(0, 0, 0), end=(0, 0.6 * length, 0.8 * length)).line, (0, 0.6, 0.8), rtol=1e-15)


@pytest.mark.parametrize("form", [tuple, list, np.array])
def test_lists_tuples_and_arrays(form):
    spring = make(start=form([0, 0, 0]), end=form([0, 0, 2]), stiffness=np.float32(2), damping=np.int64(3))
    assert (spring.end, spring.stiffness, spring.damping) == ((0.0, 0.0, 2.0), 2.0, 3.0)
    assert type(spring.damping) is float


def test_a_damper_alone_and_a_negative_stiffness_are_legal():
    assert make(stiffness=0, damping=1).damping == 1.0
    assert make(stiffness=-5).stiffness == -5.0


def test_words_give_the_call_back():
    words = {"name": "k", "first": "ground", "second": "a", "start": (1.0, 0.0, 0.0), "end": (1.0, 3.0, 4.0),
             "stiffness": 2.0, "damping": 0.5}  # fmt: skip
    assert make(damping=0.5).constructor_kwargs() == words


def test_springs_are_immutable():
    with pytest.raises(FrozenInstanceError):
        make().stiffness = 3.0
