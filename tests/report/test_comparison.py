"""Modes of two designs in pairs, where frequencies coincide too."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.report.comparison import compared_modes
from mbsvib.report.data import collect


def plate(angle, more=0.0):
    """A mass on three springs; two are turned by an angle in their plane, and equally stiff but for ``more``."""
    model = mv.Model("plate")
    model.add_body("mass", 1.0, (0.1, 0.1, 0.1), (0, 0, 0))
    model.add_joint("free", "custom", "ground", "mass", (0, 0, 0), free=("x", "y", "z"))
    c, s = np.cos(angle), np.sin(angle)
    model.add_bushing("k", "ground", "mass", (0, 0, 0), (100.0, 100.0 + more, 900.0, 0, 0, 0),
                      orientation=((c, -s, 0), (s, c, 0), (0, 0, 1)))  # fmt: skip
    for axis in "xyz":
        model.add_input(f"F{axis}", "mass", axis)
        model.add_output(axis, "mass", axis)
    return model.linearize()


@pytest.mark.slow
def test_equal_frequencies_are_paired_by_their_plane():
    """A small change of one of two equal springs picks shapes anywhere in the plane: they are all alike."""
    rows = compared_modes(plate(0.0), plate(0.6, more=1.0))["rows"]
    assert [row[2] for row in rows] == [1.0, 1.0, 1.0]
    assert rows[2][:2] == [2, 2]
    assert [row[:2] for row in compared_modes(plate(0.0), plate(0.0))["rows"]] == [[0, 0], [1, 1], [2, 2]]


def test_frequencies_apart_are_paired_by_their_shapes():
    rows = compared_modes(plate(0.0, more=50.0), plate(0.6, more=50.0))["rows"]
    np.testing.assert_allclose([row[2] for row in rows], [np.cos(0.6) ** 2, np.cos(0.6) ** 2, 1.0], atol=1e-6)


def measured_plate():
    """What a plate that is 4 % stiffer along y shows at its own mass, with one line not known."""
    made = plate(0.0, more=4.0)
    omega = 2 * np.pi * np.array([1.0, 1.2, 1.4])
    responses = made.frequency_response(omega)
    responses[0, 0, 1] = np.nan
    f = made.modes().frequencies
    return made, mv.Measurement(omega, responses, made.outputs, made.inputs, output_units=made.output_units,
                                input_units=made.input_units), mv.MeasuredModes(f, shapes=made.Cq @ made.modes().shapes,
                                                                                outputs=made.outputs)  # fmt: skip


@pytest.mark.slow
def test_a_measurement_stands_beside_the_model():
    made, data, modes = measured_plate()
    system = plate(0.0)
    page = collect(system, other=data, labels=("model", "rig"))["compared"]
    assert (page["labels"], page["responses"]) == (["model", "rig"], None)
    assert (page["pairs"]["rows"], page["modes"]) == ([], [])
    measured = page["measured"]
    assert measured["frequencies"] == [1.0, 1.2, 1.4]
    pair = measured["pairs"][0]
    assert (pair["name"], pair["unit"]) == ("Fx → x", "m/N")
    assert pair["curves"][1]["size"][1] is None
    assert pair["curves"][1]["size"][::2] == pytest.approx(np.abs(data.responses[0, 0, ::2]).tolist(), rel=1e-6)
    own = np.abs(system.frequency_response(data.omega)[0, 0])
    assert pair["curves"][0]["size"] == pytest.approx(own.tolist(), rel=1e-6)
    page = collect(system, other=modes)["compared"]
    assert [row[:2] for row in page["pairs"]["rows"]] == [[0, 0], [1, 1], [2, 2]]
    assert [mode["natural"] for mode in page["modes"]] == made.modes().frequencies.tolist()
    assert page["modes"][0]["ratio"] is None
    assert page["measured"]["pairs"] == []
    other = mv.Measurement(data.omega, data.responses[:1], ("tilt",), data.inputs)
    with pytest.raises(mv.ResponseError, match="no common output"):
        collect(system, other=other)


def test_differences_of_two_designs_are_told():
    notes = collect(plate(0.0), other=plate(0.0, more=4.0))["compared"]["notes"]
    assert any(note == "k: stiffness.y 100 → 104 N/m (+4 %)" for note in notes)
    assert any(note.startswith("y / Fy: FRAC") for note in notes)
