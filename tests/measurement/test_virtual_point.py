"""Virtual points: any mixture of translations and rotations against the pseudo-inverse of their geometry."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ResponseError

POINT, OMEGA = np.array([0.1, -0.2, 0.3]), np.array([3.0, 5.0, 8.0])
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
UNITS = {"displacement": ("m", "rad"), "velocity": ("m/s", "rad/s"), "acceleration": ("m/s^2", "rad/s^2")}


def channels(seed, count, turning):
    """Places of channels, the last ``turning`` of which are rotations, and their geometry R (count, 6)."""
    rng = np.random.default_rng(seed)
    at, along = POINT + 0.2 * rng.standard_normal((count, 3)), rng.standard_normal((count, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    rows, points = [], []
    for k, (r, e) in enumerate(zip(at, along, strict=True)):
        turns = k >= count - turning
        rows.append([0, 0, 0, *e] if turns else [*e, *np.cross(r - POINT, e)])
        points.append((r, [0, 0, 0, *e] if turns else e))
    return points, np.array(rows, dtype=float)


def rigid(quantity="velocity", **more):
    """Nine sensors and eight impacts on a rigid part, two outputs and an input elsewhere among them."""
    rng = np.random.default_rng(3)
    (out, r_out), (into, r_in) = channels(1, 9, 3), channels(2, 8, 2)
    point = rng.standard_normal((6, 6, 3)) + 1j * rng.standard_normal((6, 6, 3))
    whole = rng.standard_normal((11, 9, 3)) + 1j * rng.standard_normal((11, 9, 3))
    rows, columns = [0, 1, *range(3, 10)], [0, *range(2, 9)]
    whole[np.ix_(rows, columns)] = np.einsum("oi,ijn,kj->okn", r_out, point, r_in)
    q_out = rng.standard_normal((6, 3)) + 1j * rng.standard_normal((6, 3))
    whole[rows, 1] = r_out @ q_out  # of the input elsewhere
    q_in = rng.standard_normal((2, 6, 3)) + 1j * rng.standard_normal((2, 6, 3))
    whole[np.ix_([2, 10], columns)] = np.einsum("oin,ki->okn", q_in, r_in)
    outputs = [f"s{k}" for k in range(11)]
    outputs[2], outputs[10] = "a", "b"
    inputs = [f"h{k}" for k in range(9)]
    inputs[1] = "F"
    places = [*out[:2], None, *out[2:], None], [into[0], None, *into[1:]]
    unit = UNITS[quantity]
    output_units = [unit[0]] * 11
    for k in (7, 8, 9):
        output_units[k] = unit[1]
    given = {"output_units": tuple(output_units), "input_units": (*["N"] * 7, *["N m"] * 2), "output_points": places[0],
             "input_points": places[1]}  # fmt: skip
    data = mv.Measurement(OMEGA, whole, outputs, inputs, **(given | more))
    return data, (rows, r_out, q_out), (columns, r_in, q_in), point


def wide(rows, geometry, count):
    """T (others and six, count) that leaves others and replaces channels by the point."""
    others = [k for k in range(count) if k not in rows]
    result = np.zeros((len(others) + 6, count))
    result[np.arange(len(others)), others] = 1.0
    result[np.ix_(range(len(others), len(others) + 6), rows)] = np.linalg.pinv(geometry)
    return result


@pytest.mark.parametrize("quantity", list(UNITS))
def test_motions_and_forces_of_a_rigid_part(quantity):
    rng = np.random.default_rng(7)
    factor = rng.standard_normal((11, 11, 3)) + 1j * rng.standard_normal((11, 11, 3))
    covariance = np.einsum("ijn,kjn->ikn", factor, factor.conj())
    noise = {"noise_variance": rng.uniform(0.1, 1.0, (11, 9, 3)), "covariance": covariance, "averages": 7,
             "coherence": np.full((11, 9, 3), 0.5)}  # fmt: skip
    data, (rows, r_out, q_out), (columns, r_in, q_in), point = rigid(quantity, **noise)
    virtual = data.virtual_point("P", POINT, "s*", "h*")
    assert virtual.outputs == ("a", "b", *(f"P.{d}" for d in DIRECTIONS))
    assert virtual.inputs == ("F", *(f"P.{d}" for d in DIRECTIONS))
    assert virtual.output_units == (*[UNITS[quantity][0]] * 5, *[UNITS[quantity][1]] * 3)
    assert virtual.input_units == ("N",) * 4 + ("N m",) * 3
    assert virtual.quantity == (quantity,) * 8
    np.testing.assert_allclose(virtual.responses[2:, 1:], point, atol=1e-12)
    np.testing.assert_allclose(virtual.responses[2:, 0], q_out, atol=1e-12)
    np.testing.assert_allclose(virtual.responses[:2, 1:], q_in, atol=1e-12)
    np.testing.assert_array_equal(virtual.responses[:2, 0], data.responses[[2, 10], 1])
    out, into = wide(rows, r_out, 11), wide(columns, r_in, 9)
    expected = np.einsum("oi,ijn,kj->okn", out**2, data.noise_variance, into**2)
    np.testing.assert_allclose(virtual.noise_variance, expected, rtol=1e-10)
    shared = np.einsum("oi,ijn,kj->okn", out, covariance, out)
    variance = np.einsum("oon,kj->okn", shared.real, into**2)
    np.testing.assert_allclose(virtual.variance, variance, rtol=1e-8)
    assert virtual.covariance is None  # that of each new input is another one
    np.testing.assert_allclose(data.virtual_point("P", POINT, "s*").covariance, shared, rtol=1e-8, atol=1e-9)
    assert (virtual.averages, virtual.coherence) == (None, None)
    assert set(virtual.consistency) == {*data.outputs, *data.inputs} - {"a", "b", "F"}
    assert min(virtual.consistency.values()) > 1.0 - 1e-12
    ports = {node.number: node for node in virtual.nodes}
    for point_of in (*virtual.output_points[2:], *virtual.input_points[1:]):
        np.testing.assert_allclose(ports[point_of.node].position, POINT)


def test_variances_of_independent_sensors_add_up():
    data, (rows, r_out, _), (columns, r_in, _), _ = rigid(
        variance=np.random.default_rng(8).uniform(1.0, 2.0, (11, 9, 3)))  # fmt: skip
    expected = np.einsum("oi,ijn,kj->okn", wide(rows, r_out, 11) ** 2, data.variance, wide(columns, r_in, 9) ** 2)
    np.testing.assert_allclose(data.virtual_point("P", POINT, "s*", "h*").variance, expected, rtol=1e-10)


@pytest.mark.parametrize("which", ["outputs", "inputs"])
def test_one_side_alone_and_a_second_point(which):
    """Consistency of an earlier point stays; the other side is as it was."""
    data, out, into, _ = rigid()
    numbers, geometry, _ = out if which == "outputs" else into
    names = getattr(data, which)
    chosen = [names[k] for k in numbers]
    virtual = data.virtual_point("P", POINT, **{which: [*chosen, chosen[0]]})
    other = "inputs" if which == "outputs" else "outputs"
    assert getattr(virtual, other) == getattr(data, other)
    axis = 0 if which == "outputs" else 1
    moved = np.moveaxis(np.tensordot(wide(numbers, geometry, len(names)), np.moveaxis(data.responses, axis, 0), 1), 0,
                        axis)  # fmt: skip
    np.testing.assert_allclose(virtual.responses, moved, atol=1e-11)
    assert set(virtual.consistency) == set(chosen)
    others = [getattr(data, other)[k] for k in (into if axis == 0 else out)[0]]
    both = virtual.virtual_point("Q", POINT, **{other: others})
    assert set(both.consistency) > set(chosen)


def test_consistency_is_the_share_that_a_rigid_motion_explains():
    data, (rows, r_out, _), _, _ = rigid()
    responses = data.responses + 0.1 * np.random.default_rng(9).standard_normal(data.responses.shape)
    responses[4, 3] = np.nan
    noisy = mv.Measurement(OMEGA, responses, data.outputs, data.inputs, output_points=data.output_points,
                           nodes=data.nodes, quantity="velocity")  # fmt: skip
    found = noisy.virtual_point("P", POINT, "s*")
    values = responses[rows].reshape(9, -1)
    values = values[:, np.isfinite(values).all(axis=0)]
    rest = values - r_out @ np.linalg.pinv(r_out) @ values
    expected = 1.0 - (np.abs(rest) ** 2).sum(axis=1) / (np.abs(values) ** 2).sum(axis=1)
    assert [found.consistency[data.outputs[k]] for k in rows] == pytest.approx(expected.tolist(), rel=1e-10)
    assert found.output_units == ("",) * 8
    assert found.consistency.keys() == {data.outputs[k] for k in rows}


@pytest.mark.parametrize(("place", "told"), [
    ((POINT, "y"), "P.y"), ((POINT + np.array([0, 0.3, 0]), "y"), "P.y"),
    ((POINT + np.array([1.0, 2, 3]), "rz"), "P.rz"),
    ((POINT, (0, -1, 0)), "P.y"),
])  # fmt: skip
@pytest.mark.parametrize("kind", ["output", "input"])
def test_a_channel_through_the_point_tells_one_direction(place, told, kind):
    given = {f"{kind}_points": [place], "quantity": "acceleration", f"{kind}_units": ["V"] if kind == "input" else None}
    given = {key: value for key, value in given.items() if value is not None}
    data = mv.Measurement(OMEGA, [[[1.0, 2j, 3.0]]], ["u"], ["F"], **given)
    virtual = data.virtual_point("P", POINT, **{f"{kind}s": "*"})
    assert getattr(virtual, f"{kind}s") == (told,)
    sign = -1.0 if place[1] == (0, -1, 0) else 1.0
    np.testing.assert_allclose(virtual.responses, sign * data.responses, rtol=1e-12)
    assert virtual.quantity == ("acceleration",)
    assert getattr(virtual, f"{kind}_units") == ("V" if kind == "input" else "",)


@pytest.mark.parametrize("units", [("mm/s^2",) * 11, ("m/s^2", *["g"] * 10), ("V", *["m/s^2"] * 10)])
def test_outputs_in_other_units_are_refused(units):
    data = replace(rigid()[0], output_units=units, quantity="acceleration")
    with pytest.raises(ResponseError, match=r"virtual_point: outputs are in .*; expected data in SI units"):
        data.virtual_point("P", POINT, "s*")


def test_outputs_of_several_quantities_are_refused():
    data, *_ = rigid(output_units=("m", *["m/s"] * 10))
    with pytest.raises(ResponseError, match="outputs of 'P' are displacement and velocity; expected one"):
        data.virtual_point("P", POINT, "s*")
    data, *_ = rigid(output_units=("V", *["m/s"] * 10))
    with pytest.raises(ResponseError, match="are of unknown quantity and velocity"):
        data.virtual_point("P", POINT, "s*")
