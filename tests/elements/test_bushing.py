"""Bushings: six values or a matrix, in any axes."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.equilibrium.motion import posed_model

SIX = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


def make(**words):
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1))
    arguments = {"name": "k", "first": "ground", "second": "a", "position": (0, 0, 0), "stiffness": SIX} | words
    return model.add_bushing(**arguments)


@pytest.mark.parametrize("form", [tuple, list, np.array])
def test_lists_tuples_and_arrays(form):
    bushing = make(stiffness=form(SIX), damping=form(np.diag(SIX).tolist()), position=form([1, 2, 3]))
    assert bushing.stiffness == SIX
    assert bushing.damping == tuple(map(tuple, np.diag(SIX).tolist()))
    assert bushing.position == (1.0, 2.0, 3.0)


def test_a_matrix_turned_into_other_axes_is_symmetric_enough():
    matrix = np.diag(SIX).copy()
    matrix[0, 1], matrix[1, 0] = 0.5 + 1e-10, 0.5
    stored = np.array(make(stiffness=matrix).stiffness)
    assert (stored == stored.T).all()
    assert stored[0, 1] == pytest.approx(0.5 + 0.5e-10, rel=1e-15)


@pytest.mark.parametrize("values", [{"stiffness": (0, 0, -5.0, 0, 0, 0)}, {"damping": (0, 0, 0, 0, 0, -1.0)},
                                    {"stiffness": (0,) * 6, "damping": SIX}])  # fmt: skip
def test_negative_values_and_dampers_alone_are_legal(values):
    bushing = make(**values)
    for key, value in values.items():
        assert getattr(bushing, key) == tuple(map(float, value))


def test_words_give_the_call_back():
    words = {"name": "k", "first": "ground", "second": "a", "position": (1.0, 2.0, 3.0), "stiffness": SIX,
             "damping": tuple(map(tuple, np.diag(SIX).tolist())),
             "orientation": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))}  # fmt: skip
    assert make(**words).constructor_kwargs() == words


def test_words_leave_defaults_out():
    assert set(make().constructor_kwargs()) == {"name", "first", "second", "position", "stiffness"}


def test_bushings_are_immutable():
    with pytest.raises(FrozenInstanceError):
        make().stiffness = SIX
    with pytest.raises(TypeError):
        make().stiffness[0] = 7.0


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("field", "words"), [
    ("stiffness", {"stiffness": (1e308,) * 6}), ("damping", {"damping": (0.0, 0.0, 0.0, 1.7e308, 1.7e308, 1.7e308)}),
    ("preload", {"preload": (0.0, 0.0, 0.0, 1.7e308, 1.7e308, 1.7e308)}),
])  # fmt: skip
def test_values_that_overflow_in_another_pose_are_refused(field, words):
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1))
    model.add_joint("ball", "spherical", "ground", "a", (0, 0, 0))
    model.add_bushing("k", "ground", "a", (0, 0, 0), **{"stiffness": SIX} | words)
    with pytest.raises(mv.ModelError, match=f"bushing 'k': {field} = .*finite in this pose"):
        model.moved({"ball.rx": 0.3})


def test_several_go_to_another_pose_as_each_of_them_does():
    model, matrix = mv.Model(), np.diag(SIX) + 0.1
    kinds = ({}, {"stiffness": matrix}, {"damping": matrix}, {"preload": SIX},
             {"stiffness": (1.0, 2.0, 3.0, 0.0, 0.0, 0.0), "orientation": (0.1, 0.2, 0.3)})  # fmt: skip
    for i, words in enumerate(kinds):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), (0.1 * i, 0.2, 0.3))
        model.add_joint(f"ball{i}", "spherical", "ground", f"b{i}", (0, 0, 0))
        model.add_bushing(f"k{i}", "ground", f"b{i}", (0.3, 0.1 * i, 0.2), **{"stiffness": SIX} | words)
    model.add_body("still", 1.0, (1, 1, 1))
    model.add_bushing("rests", "ground", "still", (0, 0, 0), SIX)
    here = posed_model(model)
    pose = here.moved(np.where(np.arange(len(here.scale)) < 15, 0.2, 0.0)).pose
    for there in model.moved(dict.fromkeys(here.coordinates.names[:15], 0.2)).springs.values():
        single = model.springs[there.name].in_pose(pose, False)
        assert np.allclose(there.stiffness, single.stiffness, rtol=1e-14, atol=1e-14)
        assert np.allclose(there.damping, single.damping, rtol=1e-14, atol=1e-14)
        assert (there.preload is None) == (single.preload is None)
        assert there.preload is None or there.preload == pytest.approx(single.preload, rel=1e-14, abs=1e-14)
        assert (there is model.springs[there.name]) == (there.name == "rests")


@pytest.mark.parametrize("angle", [0.5, 1.5])
def test_damping_of_a_ball_that_has_turned(angle):
    """It acts on the rate of the rotation vector: (a/2 / sin(a/2))^2 times as much across the axis of a turn by a."""
    model = mv.Model("ball")
    model.add_body("ball", 1.0, (0.2, 0.2, 0.2))
    model.add_joint("socket", "spherical", "ground", "ball", (0, 0, 0))
    model.add_bushing("oil", "ground", "ball", (0, 0, 0), damping=(0, 0, 0, 0.1, 0.1, 0.1))
    across = -0.5 * (angle / 2 / np.sin(angle / 2)) ** 2
    rates = np.sort(model.moved({"socket.rx": angle}).linearize().modes().eigenvalues.real)
    np.testing.assert_allclose(rates, [across, across, -0.5, 0, 0, 0], rtol=1e-13)
    mounted = model.moved({"socket.rx": angle}, relaxed=True).linearize().modes().eigenvalues.real
    np.testing.assert_allclose(np.sort(mounted), [-0.5, -0.5, -0.5, 0, 0, 0], rtol=1e-13)
