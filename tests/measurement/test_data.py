"""Measured data: what it says of itself, and what it refuses."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.measurement.common_errors import CommonErrors
from mbsvib.measurement.points import Node, Point


def roved(**more):
    """Three of four pairs were measured; the second input acts against the second output."""
    responses = np.ones((2, 2, 3), dtype=complex)
    responses[0, 1] = np.nan
    given = {
        "output_units": ("m", "m"), "output_points": (Point(1, 3), Point(2, -1)), "input_units": ("N", "N"),
        "input_points": (Point(1, 4), Point(2, 1)), "nodes": (Node(1, "plate", (0.0, 0.0, 0.0)),),
    }  # fmt: skip
    return mv.Measurement([1.0, 2.0, 3.0], responses, ("a", "b"), ("F", "G"), **(given | more))


def test_pairs_and_driving_points():
    data = roved()
    assert data.is_measured.tolist() == [[True, False], [True, True]]
    assert data.driving_points == (("b", "G"),)
    assert repr(data) == "Measurement(2 inputs, 2 outputs, 3 frequencies, 1 node, 0 modes)"
    assert data.quantity == ("displacement", "displacement")
    assert data.frequencies == pytest.approx(np.arange(1, 4) / (2 * np.pi))
    with pytest.raises(ValueError, match="read-only"):
        data.responses[0, 0, 0] = 1.0
    same = pickle.loads(pickle.dumps(roved(variance=np.ones((2, 2, 3)))))
    np.testing.assert_array_equal(same.responses, data.responses)
    assert same.variance.sum() == 12.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"omega": [1.0, 2.0]}, r"responses has shape \(2, 2, 3\); expected \(2, 2, 2\)"),
        ({"omega": [1.0, 3.0, 2.0]}, "omega with 2 behind 3 at index 2; expected a vector of ascending"),
        ({"omega": [-1.0, 3.0, 2.0]}, "omega with -1 at index 0"),
        ({"responses": np.full((2, 2, 3), np.inf)}, "responses are infinite"),
        ({"outputs": ("a", "a")}, "'a' is there more than once"),
        ({"input_units": ("N",)}, "1 input_units for the inputs F, G"),
        ({"output_points": (Point(1, 1),)}, "1 points for the channels a, b"),
        ({"variance": np.full((2, 2, 3), -1.0)}, "variance of 'a' to 'F' is -1 at 0.159155 Hz; expected values of 0"),
        ({"variance": np.ones((2, 2))}, r"variance has shape \(2, 2\); expected \(2, 2, 3\)"),
        ({"coherence": np.full((2, 2, 3), 1.2)}, "coherence of 'a' to 'F' is 1.2 at 0.159155 Hz; expected values"),
        ({"averages": 0}, "averages = 0; expected their number"),
        ({"line_correlation": [0.5, np.nan]}, r"line_correlation = \[0.5, nan\]; expected correlations of errors"),
        ({"line_correlation": [-0.4, -0.2]}, "with a sum above -1/2"),
        ({"line_correlation": [[0.5]]}, "expected correlations of errors of lines that are 1, 2, ... apart"),
        ({"line_correlation": 1.5}, "expected correlations of errors of lines that are 1, 2, ... apart"),
        ({"covariance": -np.ones((2, 2, 3))}, "not Hermitian and positive semidefinite"),
        ({"quantity": "acceleration"}, "quantity of 'a' = 'acceleration', yet its unit is m, of a displacement"),
        ({"quantity": "accelerance", "output_units": ()}, "expected 'displacement', 'velocity' or 'acceleration'."),
    ],
)  # fmt: skip
def test_what_does_not_fit_together(change, message):
    with pytest.raises(mv.ResponseError, match=message):
        replace(roved(), **change)


def test_a_variance_that_contradicts_what_channels_share_is_refused():
    """What fits and budgets take from the two would differ."""
    noise = np.array([[2.0, 1j], [-1j, 3.0]])[:, :, None] * np.ones(3)
    variance = np.array([2.0, 3.0])[:, None, None] * np.ones((2, 2, 3))
    both = roved(covariance=noise, variance=variance * (1.0 + 1e-8))
    errors = CommonErrors(np.array([[1.0], [2.0]])[:, :, None] * np.ones(3), np.ones((1, 1, 3)), np.ones((2, 1, 3)))
    shared = roved(common_errors=errors)
    assert shared.variance[:, 0, 0].tolist() == [1.0, 4.0]
    assert np.isnan(shared.variance[0, 1]).all()  # was not measured
    unknown = np.where(np.arange(3) == 1, np.inf, variance)
    for data, wrong, what in ((both, 5.0 * variance, "10 at 0.159155 Hz; expected the diagonal of the covariance"),
                              (both, unknown, "inf at 0.31831 Hz; expected the diagonal of the covariance"),
                              (shared, variance, "2 at 0.159155 Hz; expected that of common_errors")):  # fmt: skip
        with pytest.raises(mv.ResponseError, match=f"variance of 'a' to 'F' is {what} or no variance beside it"):
            replace(data, variance=wrong)
    for data in (both, shared):
        smooth = data.smoothed(3)
        np.testing.assert_allclose(smooth.variance, data.variance, rtol=1e-7)
        assert (smooth.covariance is None) == (data.covariance is None)


def test_variance_is_that_of_coherence_or_of_the_covariance():
    """The residual of m averages has m - 1 degrees of freedom: |G|^2 (1 - c) / (c (m - 1)); rounding above 1 is 1."""
    coherence = np.array([0.5, 0.9, 1.0 + 1e-9]).reshape(1, 1, 3)
    data = mv.Measurement([1.0, 2.0, 3.0], [[[2j, 2.0, 1.0]]], ["y"], ["u"], coherence=coherence, averages=4)
    np.testing.assert_allclose(data.variance[0, 0], [4.0 / 3.0, 4.0 * (0.1 / 0.9) / 3, 0.0], rtol=1e-12, atol=0)
    noise = np.array([[2.0, 1j], [-1j, 3.0]])[:, :, None] * np.ones(3)
    data = roved(covariance=noise)
    assert data.variance[:, 1, 0].tolist() == [2.0, 3.0]
    np.testing.assert_array_equal(roved(covariance=noise.tolist())["b", "*"].covariance, 3.0 * np.ones((1, 1, 3)))


def test_parts_of_the_data():
    data = roved(variance=np.arange(12.0).reshape(2, 2, 3), quantity=("displacement", ""))
    part = data["b", "*"].within(0.3, 0.5)
    assert (part.outputs, part.inputs, part.output_points) == (("b",), ("F", "G"), (Point(2, -1),))
    assert part.variance.ravel().tolist() == [7.0, 8.0, 10.0, 11.0]
    assert part.omega.tolist() == [2.0, 3.0]
    with pytest.raises(mv.ResponseError, match=r"no line from 1 to 2 Hz; the measurement has 3 lines from 0\.159155"):
        data.within(1.0, 2.0)


@pytest.mark.parametrize("ends", [("a", 10), ((1.0, 2.0), (3.0, 4.0)), (0.5, 0.3), (np.nan, 1.0)])
def test_limits_are_two_ascending_numbers(ends):
    with pytest.raises(mv.ResponseError, match=r"within: limits = .*; expected two numbers, the lower one first"):
        roved().within(*ends)


@pytest.mark.parametrize("stated", ["variance", "covariance"])
def test_parts_keep_all_that_belongs_to_channels_and_lines(stated):
    """Each array and each text of some channels, in their order, and of some lines, both ends among them."""
    rng = np.random.default_rng(0)
    w = np.arange(1.0, 6.0)
    factor = rng.standard_normal((3, 3, 5)) + 1j * rng.standard_normal((3, 3, 5))
    noise = {"variance": rng.random((3, 2, 5)), "covariance": np.einsum("ijn,kjn->ikn", factor, factor.conj())}
    data = mv.Measurement(
        w, rng.standard_normal((3, 2, 5)) + 0j, ["a", "b", "c"], ["F", "G"], **{stated: noise[stated]},
        coherence=rng.random((3, 2, 5)), averages=3,
        quantity=("displacement", "velocity", "acceleration"), output_units=("m", "m/s", "m/s^2"),
        input_units=("N", "N m"), output_points=[((k, 0, 0), "x") for k in range(3)],
        input_points=[((0, k, 0), "y") for k in range(2)], noise_variance=rng.random((3, 2, 5)),
        notes=["n"])  # fmt: skip
    part = data[["c", "a"], "G"]
    rows = [2, 0]
    for name in ("responses", "variance", "coherence", "noise_variance"):
        np.testing.assert_array_equal(getattr(part, name), getattr(data, name)[rows][:, [1]])
    if stated == "covariance":
        np.testing.assert_array_equal(part.covariance, data.covariance[rows][:, rows])
    assert (part.outputs, part.inputs, part.quantity) == (("c", "a"), ("G",), ("acceleration", "displacement"))
    assert (part.output_units, part.input_units) == (("m/s^2", "m"), ("N m",))
    assert part.output_points == (data.output_points[2], data.output_points[0])
    assert (part.input_points, part.notes, part.averages) == (data.input_points[1:], ("n",), 3)
    few = data.within(data.frequencies[1], data.frequencies[3])
    for name in data.by_line:
        if getattr(data, name) is None:
            assert getattr(few, name) is None
            continue
        np.testing.assert_array_equal(getattr(few, name), getattr(data, name)[..., 1:4])
        assert not getattr(few, name).flags.writeable
    np.testing.assert_allclose(few.frequencies, w[1:4] / (2 * np.pi))


@pytest.mark.parametrize("covariance", [
    [[1.0, 1.0], [0.0, 1.0]], [[1.0, 1j], [1j, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[1.0, np.nan], [np.nan, 1.0]],
    [[1.0 + 0.1j, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, -0.1]],
])  # fmt: skip
def test_covariances_that_are_none(covariance):
    with pytest.raises(mv.ResponseError, match="not Hermitian and positive semidefinite"):
        roved(covariance=np.repeat(np.array(covariance, dtype=complex)[:, :, None], 3, axis=2))


@pytest.mark.parametrize("field", ["variance", "noise_variance", "coherence"])
def test_noise_is_known_wherever_a_response_is(field):
    """Not a number is refused beside a response and stays where there is none."""
    values = np.full((2, 2, 3), 0.5)
    values[0, 1] = np.nan
    data = roved(**{field: values})
    np.testing.assert_array_equal(getattr(data, field), values)
    values[1, 1, 2] = np.nan
    with pytest.raises(mv.ResponseError, match=f"{field} of 'b' to 'G' is nan at 0.477465 Hz; expected values"):
        roved(**{field: values})


@pytest.mark.parametrize(("averages", "right"), [(1, True), (2.5, True), (0.5, False), (-1, False), ([1, 2], False)])
def test_numbers_of_averages(averages, right):
    coherence = np.full((2, 2, 3), 0.5)
    if right:
        data = roved(averages=averages, coherence=coherence)
        if averages == 1:  # one tells nothing of its noise
            assert data.variance is None
        else:
            np.testing.assert_allclose(data.variance[data.is_measured], 1.0 / (averages - 1.0))
            assert np.isnan(data.variance[0, 1]).all()
        assert roved(coherence=coherence).variance is None
        return
    with pytest.raises(mv.ResponseError, match="averages = "):
        roved(averages=averages)


@pytest.mark.parametrize(("points", "pairs"), [
    ((Point(1, 3), Point(1, 3)), [("a", "F")]), ((Point(2, -3), Point(2, 3)), [("a", "F")]),
    ((Point(2, 3), Point(1, 3)), []), ((Point(2, 3), Point(2, 2)), []),
])  # fmt: skip
def test_driving_points_are_at_one_node_along_one_line(points, pairs):
    data = mv.Measurement([1.0], np.ones((1, 1, 1)), ["a"], ["F"], output_points=points[:1], input_points=points[1:])
    assert list(data.driving_points) == pairs


@pytest.mark.parametrize("units", ["m/s²", "m/s2", "m/s^2"])
def test_units_as_other_programs_write_them(units):
    data = mv.Measurement([1.0], np.ones((1, 1, 1)), ["a"], ["F"], output_units=[units])
    assert (data.output_units, data.quantity) == (("m/s^2",), ("acceleration",))


@pytest.mark.parametrize("lines", [1, 2, 3, 4, 7, 50])
@pytest.mark.parametrize("decades", [0.0, 30.0])
def test_smoothed_noise_of_lines_of_any_size(lines, decades):
    """Means of (lines - 1) // 2 lines below and lines // 2 above, with their own digits; unknown ones do not count."""
    rng = np.random.default_rng(lines)
    size = 10.0 ** (-decades * np.arange(20) / 20)
    variance = rng.uniform(1.0, 2.0, (2, 1, 20)) * size
    factor = (rng.standard_normal((2, 2, 20)) + 1j * rng.standard_normal((2, 2, 20))) * np.sqrt(size)
    covariance = np.einsum("ijn,kjn->ikn", factor, factor.conj())
    variance[0, 0, 11] = np.inf
    responses = np.ones((2, 1, 20), dtype=complex)
    responses[1, 0, 5] = variance[1, 0, 5] = np.nan
    independent, shared = (
        mv.Measurement(np.arange(20.0), responses, ["y", "z"], ["u"], noise_variance=0.5 * variance, **stated)
        for stated in ({"variance": variance}, {"covariance": covariance}))

    def mean(row):
        windows = [row[max(0, k - (lines - 1) // 2) : k + lines // 2 + 1] for k in range(20)]
        return np.array([one if not np.isfinite(one) else window[np.isfinite(window)].mean()
                         for one, window in zip(row, windows, strict=True)])  # fmt: skip

    for data, name in ((independent, "variance"), (independent, "noise_variance"), (shared, "covariance")):
        smooth = data.smoothed(lines)
        for at in np.ndindex(getattr(data, name).shape[:2]):
            expected = mean(getattr(data, name)[at])
            np.testing.assert_allclose(getattr(smooth, name)[at], expected, rtol=1e-9 if name[0] == "c" else 1e-12)


def test_smoothed_variance_is_a_mean_over_lines():
    variance = np.array([1.0, np.nan, 4.0, 7.0, 0.0]).reshape(1, 1, 5)
    responses = np.where(np.isnan(variance), np.nan, 1.0 + 0j)
    data = mv.Measurement(np.arange(5.0), responses, ["y"], ["u"], variance=variance)
    np.testing.assert_allclose(data.smoothed(3).variance[0, 0], [1.0, np.nan, 5.5, 11 / 3, 3.5])
    np.testing.assert_array_equal(data.smoothed(1).variance, variance)
    with pytest.raises(mv.ResponseError, match="lines = 0 of variances; expected a positive"):
        data.smoothed(0)
    with pytest.raises(mv.ResponseError, match="lines = 15 of no variances"):
        roved().smoothed()


def test_measured_modes():
    modes = mv.MeasuredModes([5.0, 2.0], [0.01, 0.02], [[1.0, 2.0], [3.0, 4.0]], ["1X+", "2Z-"], sd=0.01)
    assert modes.sd.tolist() == [0.01, 0.01]
    assert modes.output_points == (Point(1, 1), Point(2, -3))
    assert "5" in str(modes)
    for given, message in (
        ({"frequencies": [0.0]}, r"frequencies = \[0.0\]; expected positive numbers"),
        ({"damping_ratios": [0.1]}, "expected ratios from 0 to 1, not per cent, one of each of 2 modes"),
        ({"outputs": ("a",)}, r"shapes has shape \(2, 2\); expected \(1, 2\)"),
        ({"shapes": None}, "given together"),
    ):
        with pytest.raises(mv.ResponseError, match=message):
            replace(modes, **given)


def test_ragged_rows_and_a_line_at_0_hz_alone_are_refused():
    with pytest.raises(mv.ResponseError, match="responses have rows of different lengths"):
        mv.Measurement([1.0, 2.0], [[[1.0, 2.0], [1.0]]], ["z"], ["F", "G"])
    with pytest.raises(mv.ResponseError, match="shapes has rows of different lengths"):
        mv.MeasuredModes([1.0, 2.0], None, [[1.0, 2.0], [1.0]], ["z", "x"])
    with pytest.raises(mv.ResponseError, match="no line above 0 Hz"):
        mv.Measurement([0.0], [[[1.0]]], ["z"], ["F"]).plot()
