"""The checks at the door."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from mbsvib import ModelError
from mbsvib.common import arguments as check
from mbsvib.errors import nearest
from tests.support.random_models import rotation

finite = st.floats(allow_nan=False, allow_infinity=False)
seeds = st.integers(0, 2**31)


def skew(w):
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@pytest.mark.slow
@given(seeds, st.floats(-12, 1.5))
def test_exponential_is_the_matrix_exponential(seed, size):
    w = 10.0**size * np.random.default_rng(seed).normal(size=3)
    matrix = np.array(check.exponential(tuple(w)))
    assert_allclose(matrix, expm(skew(w)), atol=1e-14 * max(1, np.linalg.norm(w)))
    assert_allclose(matrix.T @ matrix, np.eye(3), atol=2e-15)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-9, 0.999e-5, 1.001e-5, 1e-4, np.pi, 2 * np.pi, -np.pi / 2])
def test_exponential_about_an_axis(angle):
    c, s = np.cos(angle), np.sin(angle)
    assert_allclose(check.exponential((0.0, 0.0, angle)), [[c, -s, 0], [s, c, 0], [0, 0, 1]], rtol=0, atol=5e-16)


@given(seeds, st.floats(-17, 0), st.sampled_from([1.0, -1.0]))
def test_frame_along_is_a_rotation_with_the_axis_as_z(seed, size, sign):
    """Everywhere, and most of all near the poles, where the formula must not cancel."""
    z = np.array([0, 0, sign]) + 10.0**size * np.random.default_rng(seed).normal(size=3)
    z /= np.linalg.norm(z)
    frame = np.array(check.frame_along(tuple(z)))
    assert_allclose(frame[:, 2], z, rtol=0, atol=0)
    assert_allclose(frame.T @ frame, np.eye(3), atol=2e-15)
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-14)


def test_frame_along_z_is_the_identity():
    assert check.frame_along((0.0, 0.0, 1.0)) == check.IDENTITY
    assert_allclose(check.frame_along((0.0, 0.0, -1.0)), np.diag([1.0, -1.0, -1.0]), atol=0)


@given(seeds)
def test_every_rotation_matrix_is_an_orientation(seed):
    turn = rotation(np.random.default_rng(seed))
    assert check.orientation(turn, "body 'b'") == tuple(map(tuple, turn.tolist()))
    assert check.orientation(turn.tolist(), "body 'b'") == check.orientation(turn, "body 'b'")


@given(seeds, st.floats(-3.5, 0), st.integers(0, 8))
def test_what_is_not_orthonormal_is_refused(seed, size, entry):
    """An entry that is off by more than the tolerance makes a column too long, or two of them not square."""
    matrix = rotation(np.random.default_rng(seed))
    off = matrix.copy()
    off.flat[entry] += np.copysign(10.0**size, off.flat[entry])
    if np.abs(off.T @ off - np.eye(3)).max() <= 2 * check.ROTATION_TOLERANCE:
        return
    with pytest.raises(ModelError, match="orthonormal"):
        check.orientation(off, "body 'b'")


@pytest.mark.parametrize("digits", [4, 6, 9, 12])
def test_matrices_rounded_as_cad_writes_them_become_rotations(digits):
    """They are within their rounding of what was rounded, and orthonormal to double precision."""
    for seed in range(5):
        turn = rotation(np.random.default_rng(seed))
        rounded = np.round(turn, digits)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            axes = np.array(check.orientation(rounded, "body 'b'"))
        assert_allclose(axes.T @ axes, np.eye(3), rtol=0, atol=1e-15)
        assert_allclose(axes, turn, rtol=0, atol=3.0 * 10.0**-digits)
        assert_allclose(np.cross(axes[:, 2], rounded[:, 2]), 0.0, atol=1e-15)
        few = np.abs(rounded.T @ rounded - np.eye(3)).max() > 1e-6
        assert len(caught) == few
        assert all("body 'b': orientation is off by" in str(warning.message) for warning in caught)
        assert few == (digits == 4) or digits == 6


@given(seeds, st.permutations([0, 1, 2]), st.tuples(*[st.sampled_from([1, -1])] * 3))
def test_left_handed_axes_are_refused(seed, order, signs):
    matrix = rotation(np.random.default_rng(seed))[:, order] * signs
    if np.linalg.det(matrix) > 0:
        assert_allclose(check.orientation(matrix, "body 'b'"), matrix, atol=0)
    else:
        with pytest.raises(ModelError, match="left-handed"):
            check.orientation(matrix, "body 'b'")


@given(st.tuples(finite, finite, finite))
def test_axis_is_of_unit_length(vector):
    length = np.sqrt((np.array(vector, dtype=np.longdouble) ** 2).sum())
    if not any(vector) or length > np.finfo(float).max:
        with pytest.raises(ModelError, match="not zero"):
            check.axis(vector, "joint 'j'", "axis")
        return
    unit = check.axis(vector, "joint 'j'", "axis")
    assert_allclose(unit, np.array(np.array(vector, dtype=np.longdouble) / length, dtype=float), rtol=0, atol=4e-16)


@given(st.lists(finite, min_size=3, max_size=3))
def test_vectors_come_back_bit_by_bit(values):
    for form in (values, tuple(values), np.array(values)):
        assert check.vector(form, "body 'b'", "position") == tuple(values)


@given(st.integers(0, 2), st.sampled_from([float("nan"), float("inf"), float("-inf"), 10**400]))
def test_no_value_that_is_not_finite_passes(place, value):
    values = [1.0, -1.0, 1.0]
    values[place] = value
    with pytest.raises(ModelError, match="position"):
        check.vector(values, "body 'b'", "position")
    with pytest.raises(ModelError, match="mass"):
        check.number(value, "body 'b'", "mass")


def test_large_finite_values_pass():
    assert check.vector((1.7e308, 1.7e308, 1.7e308), "body 'b'", "position") == (1.7e308,) * 3


@pytest.mark.parametrize("value", ["12", True, None, [1.0], (), {}, object(), "nan"])
def test_what_is_no_number(value):
    with pytest.raises(ModelError, match="body 'b': mass = "):
        check.number(value, "body 'b'", "mass")


@pytest.mark.parametrize("value", ["abc", None, 3.0, {1, 2, 3}, {"x": 1, "y": 2, "z": 3}, [[1], [2], [3]], np.eye(3),
                                   [1, 2, "3 m"], np.array(1.0)])  # fmt: skip
def test_what_is_no_vector(value):
    with pytest.raises(ModelError, match="body 'b': position = "):
        check.vector(value, "body 'b'", "position")


def test_shown_values_fit_a_line():
    assert check.shown(np.arange(3.0)) == "[0.0, 1.0, 2.0]"
    assert len(check.shown(np.zeros((50, 50)))) <= 90
    assert "\n" not in check.shown(np.zeros((3, 3)))


@pytest.mark.parametrize(("word", "known", "hint"), [
    ("hpi1", ["hip1", "knee"], " Did you mean 'hip1'?"), ("zzz", ["hip1", "knee"], ""), ("hip", [], ""),
    ("Revolute", ["revolute"], " Did you mean 'revolute'?"),
])  # fmt: skip
def test_nearest_word(word, known, hint):
    assert nearest(word, known) == hint
