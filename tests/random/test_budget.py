"""Error budgets: what they print, draw and write."""

import csv
import pickle

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.errors import ResponseError
from tests.random.scenes import two_masses

TABLE = [(0.5, 1.0), (30.0, 0.1)]


def made(**settings):
    return two_masses().linearize().budget({"F1": TABLE, "F2": 1e-6}, ["x1", "v2"], **settings)


def test_densities_and_cumulative_values():
    budget, system = made(), two_masses().linearize()
    f = np.array([0.2, 0.5, 3.0, 7.0, 29.0])
    g = np.abs(system.frequency_response(2.0 * np.pi * f, ["x1", "v2"], ["F1", "F2"])) ** 2
    table = np.where(f < 0.5, 0.0, np.exp(np.interp(np.log(f), np.log([0.5, 30.0]), np.log([1.0, 0.1]))))
    parts = g * np.stack((table, np.full(5, 1e-6)))
    for k, source in enumerate(("F1", "F2")):
        np.testing.assert_allclose(budget.psd(f, source), parts[:, k], rtol=1e-11)
    np.testing.assert_allclose(budget.psd(f), parts.sum(axis=1), rtol=1e-11)
    bands = [system.rms(["x1", "v2"], {"F1": TABLE, "F2": 1e-6}, band=(0.0, end)) for end in (3.0, 7.0)]
    np.testing.assert_allclose(budget.cumulative([3.0, 7.0]), np.array([list(b.values()) for b in bands]).T, rtol=1e-12)
    np.testing.assert_allclose(budget.cumulative([1e5])[:, 0], list(budget.rms.values()), rtol=1e-4)
    np.testing.assert_array_equal(budget.cumulative([0.2, 0.5], "F1"), 0.0)
    shown, dense = budget.frequencies(), np.geomspace(0.5, 30.0, 4000)
    assert {0.5, 30.0} <= set(shown.tolist())
    np.testing.assert_allclose(budget.psd(shown).max(axis=1), budget.psd(dense).max(axis=1), rtol=1e-3)


def test_it_prints_sources_in_the_order_of_their_size():
    text = str(made())
    assert "Error budget of two" in text
    assert text.index("F1") < text.index("F2") < text.index("< 0.01 %")
    assert "All frequencies." in text
    assert "From 1 to 20 Hz." in str(made(band=(1.0, 20.0)))
    assert repr(made()) == "Budget('two': 2 outputs, 2 sources)"


def test_it_says_why_a_value_is_infinite():
    """The first mode of the two masses in Hz by hand, a free mass, and noise that comes through directly."""
    squares = np.roots([2.0, -(2.0 * 300.0 + 1200.0), 900.0 * 300.0])
    first = f"{np.sqrt(squares.min()) / (2.0 * np.pi):.4g}"
    text = str(two_masses(0.0, 0.0).linearize().budget({"F1": 1.0}, "x1"))
    assert f"x1 is infinite: the noise of F1 drives mode 1 ({first} Hz, m2 z) and 1 more without damping;" in text
    free = mv.StateSpace.from_arrays([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2)[:1], 0.0)
    assert "y1 is infinite: the noise of u1 drives a motion at 0 Hz" in str(free.budget({"u1": 1.0}))
    loop = two_masses(0.0, 0.0).linearize().feedback([[0.0]], "x1", "F1")
    text = str(loop.budget({"F1": 1.0}, "x1"))
    assert f"x1 is infinite: the noise of F1 drives mode 1 ({first} Hz, m2 z) and 1 more without damping;" in text
    drag = mv.System.from_matrices([[1.0]], [[2.0]], [[0.0]], [[1.0]], [[1.0]], inputs=["F"], outputs=["x"])
    assert "the noise of F drives mode 1 (0 Hz, q1) away" in str(drag.budget({"F": 1.0}))
    direct = mv.StateSpace.from_arrays([[-1.0]], [[1.0, 1.0]], [[1.0], [2.0]], [[0.0, 0.0], [0.0, 1.0]])
    text = str(direct.budget({"u?": 1.0}))
    assert "y2 is infinite: the noise of u2 comes through directly at all frequencies; give a band." in text
    assert "y1 is infinite" not in text


def test_it_warns_of_tables_that_end_within_the_frequencies():
    system = two_masses().linearize()
    noise = {"F1": TABLE, "F2": 1e-6}
    for f in ([0.2, 3.0], [3.0, 31.0]):
        with pytest.warns(mv.OutsideTableWarning, match=r"from 0.2 to 3 Hz|from 3 to 31 Hz") as told:
            system.psd("x1", noise, f)
        assert "F1 from 0.5 to 30 Hz" in str(told[0].message)
        assert "F2" not in str(told[0].message)
    with pytest.warns(mv.OutsideTableWarning, match="F1 from 0.5 to 30 Hz"):
        outside = system.rms("x1", noise, band=(0.1, 40.0))
    system.psd("x1", noise, [0.5, 30.0])
    within = system.rms("x1", noise, band=(0.5, 30.0))  # neither warns: warnings are errors here
    assert outside["x1"] == pytest.approx(within["x1"], rel=1e-2)


def test_rows_of_the_table():
    """Each output with all noise first, then sources that count, then the others together; shares of the variance."""
    a, b, c = np.diag([-1.0, -1.0]), np.array([[4.0, 0.1, 0.05, 3.0], [0.0, 0.0, 0.0, 1.0]]), np.eye(2)
    noise = {f"u{k + 1}": 4.0 for k in range(4)}  # rms = b
    rows = mv.StateSpace.from_arrays(a, b, c, 0).budget(noise).table()["rows"]
    total = 16.0 + 9.0 + 0.01 + 0.0025
    assert rows[:4] == [("y1", "all", f"{np.sqrt(total):.4g}", "", ""),
                        ("", "u1", "4", "", f"{1600 / total:.2f} %"), ("", "u4", "3", "", f"{900 / total:.2f} %"),
                        ("", "2 more", "0.11", "", "0.05 %")]  # fmt: skip
    assert rows[4:] == [("y2", "all", "1", "", ""), ("", "u4", "1", "", "100.00 %")]
    b[0, 1:] = 1e-12  # rounding of the first row: no row of the table
    rows = mv.StateSpace.from_arrays(a, b, c, 0).budget(noise, "y1").table()["rows"]
    assert rows == [("y1", "all", "4", "", ""), ("", "u1", "4", "", "100.00 %")]


def test_rows_of_the_table_with_correlated_sources():
    a, b, c = np.diag([-1.0, -1.0]), np.array([[4.0, 0.1, 0.05, 3.0], [0.0, 0.0, 0.0, 1.0]]), np.eye(2)
    noise, total = {f"u{k + 1}": 4.0 for k in range(4)}, 25.0125
    r = np.eye(4)
    r[0, 3] = r[3, 0] = -0.5
    rows = mv.StateSpace.from_arrays(a, b, c, 0).budget(noise, "y1", correlation=r).table()["rows"]
    assert ("", "correlation", "-3.464", "", f"-{1200 / (total - 12.0):.2f} %") in rows


@pytest.mark.slow
def test_it_is_drawn_and_written(tmp_path):
    budget = made()
    figure = budget.plot("v2")
    density, cumulative = figure.axes
    assert density.get_title(loc="left") == "v2 of two"
    line = density.get_lines()[0]
    np.testing.assert_allclose(line.get_ydata(), np.sqrt(budget.psd()[1]))
    np.testing.assert_allclose(cumulative.get_lines()[0].get_ydata()[-1], budget.cumulative()[1][-1])
    with open(budget.to_csv(tmp_path / "budget.csv"), encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))
    assert rows[0][:2] == ["frequency_hz", "psd x1 [(m)^2/Hz]"]
    np.testing.assert_array_equal(np.array(rows[1:], dtype=float)[:, 2], budget.psd()[1])


def test_equal_sources_keep_their_order():
    """Six legs that contribute the same but for rounding."""
    system = mv.library.cubic_hexapod(ports=("platform", "legs")).linearize()
    legs = [f"leg{k}.f" for k in range(1, 7)]
    budget = system.budget(dict.fromkeys(legs, 1.0) | {"Fz": 0.01}, "z")
    assert list(budget.contributions["z"]) == [*legs, "Fz"]
    labels = [text.get_text().partition(":")[0] for text in budget.plot().legends[0].get_texts()]
    assert labels == ["all", "leg1.f and 5 alike", "Fz"]


def test_it_pickles():
    budget = pickle.loads(pickle.dumps(made()))
    assert budget.rms == made().rms
    np.testing.assert_array_equal(budget.psd([3.0]), made().psd([3.0]))


def test_unknown_names():
    with pytest.raises(mv.ResponseError, match="no source 'F3'"):
        made().psd([1.0], "F3")
    with pytest.raises(mv.ResponseError, match="no output 'y'"):
        made().plot("y")


@pytest.mark.slow
def test_filters_of_outputs_are_named():
    system = two_masses().linearize()
    weighting = {"x1": isolation.moving_average(0.05), "v2": isolation.shaped([1.0], [0.1, 1.0])}
    budget = system.budget({"F1": TABLE}, ["x1", "x2", "v2"], weighting=weighting)
    assert "Weighted: x1 by mean over 0.05 s, v2 by filter." in str(budget)
    assert budget.plot("x1").axes[0].get_title(loc="left") == "x1 of two, mean over 0.05 s"
    car = mv.library.quarter_car().linearize()
    assert "Weighted: body.az by Wk, wheel.az by Wk." in str(car.budget({"road": TABLE}, "*.az", weighting="Wk"))
    assert "Weighted" not in str(made())


def test_sources_are_counted_together_in_groups():
    """Three sources of a first-order lag each, of rms 4, 3 and 1 alone; two of them are correlated."""
    system = mv.StateSpace.from_arrays([[-1.0]], [[4.0, 3.0, 1.0]], [[1.0]], 0)
    r = np.eye(3)
    r[0, 1] = r[1, 0] = 0.5
    budget = system.budget({"u*": 4.0}, correlation=r)
    both = budget.grouped({"actuators": ["u2", "u3"]})
    assert both.contributions["y1"] == pytest.approx({"u1": 4.0, "actuators": np.sqrt(10.0), "correlation": 12.0**0.5})
    assert list(both.contributions["y1"]) == ["u1", "actuators", "correlation"]
    assert both.sources == ("actuators", "u1")
    assert both.rms == budget.rms
    f = np.array([0.01, 0.2])
    np.testing.assert_allclose(both.psd(f, "actuators"), budget.psd(f, "u2") + budget.psd(f, "u3"))
    np.testing.assert_allclose(both.psd(f, "correlation"), budget.psd(f, "correlation"))
    np.testing.assert_allclose(both.cumulative(f), budget.cumulative(f))
    everything = both.grouped({"all of them": ["actuators", "u1"]})
    assert everything.contributions["y1"]["all of them"] == pytest.approx(np.sqrt(26.0))
    assert [text.get_text() for text in both.plot().legends[0].get_texts()][:2] == ["all: 6.16", "u1: 4"]
    with pytest.raises(ResponseError, match="'u2' is in the groups 'a' and 'b'"):
        budget.grouped({"a": "u*", "b": "u2"})
    with pytest.raises(ResponseError, match="picks no source"):
        budget.grouped({"a": "v*"})
    with pytest.raises(ResponseError, match="called 'u1'"):
        budget.grouped({"u1": ["u2", "u3"]})


def test_infinite_values_under_a_weighting_that_is_a_function():
    """Every panel of the integral is infinite, and none is left for quadrature."""
    value = mv.library.quarter_car().linearize().rms("body.az", {"road": [(1.0, 1e-4), (50.0, 1e-6)]},
                                                     weighting=lambda f: 1.0 / (1.0 + f))  # fmt: skip
    assert value == {"body.az": np.inf}
