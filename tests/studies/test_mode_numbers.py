"""A mode that is named by a number counts from 1, as the printed tables list them; 0 is refused with that sentence."""

import json

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib import studies as st
from mbsvib.studies.campbell import campbell
from tests.studies.test_optimize import two
from tests.support.cli import invoke

COUNT_FROM_1 = r"modes count from 1, as print\(system\.modes\(\)\) lists them; {} was given"


def locus():
    plant = isolation.actuated(library.cubic_hexapod(damping=0.0), "platform")
    return isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), [0.0, 200.0])


def test_quantities_and_tracks_are_those_of_the_mode_that_is_printed_under_the_number():
    system = two().linearize()
    rows = [row.split() for row in str(system.modes()).splitlines() if row.split()[:1] in (["1"], ["2"])]
    for number in (1, 2):
        assert float(rows[number - 1][1]) == pytest.approx(st.frequency(number)(system), rel=1e-6)
        assert float(rows[number - 1][3]) == pytest.approx(100.0 * st.damping_ratio(number)(system), rel=1e-6)
        assert f"of mode {number} [" in st.frequency(number).label
        wanted = st.frequency(number)(system)
        assert st.placement({number: wanted})(system) == pytest.approx(0.0, abs=1e-24)
        tracks = mv.track(two(), {"slow.mass": [1.0, 1.01]}, {"this": number})
        assert tracks.modes[number - 1] == "this"
        assert tracks.mode("this")[0] == pytest.approx(wanted, rel=1e-12)


def test_the_mode_that_is_named_is_the_one_that_is_optimised():
    result = st.optimize(two(), {"slow.spring.stiffness": (50.0, 300.0)}, (st.frequency(1) - 2.0) ** 2)
    assert result.model.linearize().modes().frequencies[0] == pytest.approx(2.0, rel=1e-6)


def test_labels_of_tolerances_and_columns_of_files_count_from_1(tmp_path):
    model, f = two(), two().linearize().modes().frequencies
    result = st.tolerances(model, {"slow.mass": 0.01}, st.frequency(), samples=10)
    assert result.labels == ("frequency 1 [Hz]", "frequency 2 [Hz]")
    assert result.nominal[result.index("frequency 2 [Hz]")] == pytest.approx(f[1], rel=1e-12)
    swept = mv.sweep(model, {"slow.mass": [1.0]}, {"f": "modes.frequencies"})
    assert swept.columns()["f(2)"][0] == pytest.approx(f[1], rel=1e-12)
    assert swept.to_csv(tmp_path / "sweep.csv").read_text().splitlines()[0] == "slow.mass,f(1),f(2)"


@pytest.mark.slow
def test_critical_speeds_have_the_number_that_is_printed():
    data = campbell(library.rotor_stator(), np.linspace(0.0, 12.0, 25))
    assert data.critical
    for point in data.critical:
        assert f"rad/s, mode {point.mode} at" in str(data)
        assert np.interp(point.speed, data.speeds, data.frequencies[:, point.mode - 1]) == \
            pytest.approx(point.frequency, rel=0.01)


@pytest.mark.slow
def test_root_loci_count_as_they_print():
    result = locus()
    number, *_, printed, _ = result.table()["rows"][5]
    _, ratio = result.best(6)
    assert (number, 100.0 * ratio) == (6, pytest.approx(float(printed), rel=1e-3))
    assert ratio == pytest.approx(result.damping_ratios[:, 5].max(), rel=1e-12)
    with pytest.raises(mv.ResponseError, match=r"modes count from 1, as print\(locus\) lists them; 0 was given"):
        result.best(0)
    with pytest.raises(mv.ResponseError, match="lists modes from 1 to 6"):
        result.best(7)


@pytest.mark.parametrize("number", [0, -1])
@pytest.mark.parametrize("ask", [
    lambda n: st.frequency(n), lambda n: st.damping_ratio([1, n]), lambda n: st.placement({n: 3.0}),
    lambda n: mv.track(two(), {"slow.mass": [1.0]}, {"x": n}), lambda n: two().linearize().modes().animate(n),
], ids=["frequency", "damping_ratio", "placement", "track", "animate"])  # fmt: skip
def test_modes_below_1_are_refused_with_that_sentence(ask, number):
    with pytest.raises(mv.MbsvibError, match=COUNT_FROM_1.format(number)):
        ask(number)


@pytest.mark.parametrize("number", [True, 1.0, "1", None])
def test_numbers_of_modes_are_whole_numbers(number):
    with pytest.raises(mv.MbsvibError, match="the number of a mode is expected, 1, 2, "):
        st.placement({number: 3.0})


def test_the_command_line_counts_from_1(tmp_path):
    path = str(mv.save(two(), tmp_path / "two.yaml"))
    refused = invoke(["animate", path, "--mode", "0"])
    assert refused.exit_code != 0
    assert "modes count from 1" in refused.output


def creeping():
    """Before the modes of two masses without dampers one of first order, with one eigenvalue: -20 / 10 1/s."""
    model = two(damping=0.0)
    model.add_body("node", mass=0.0, inertia=(0, 0, 0))
    model.add_joint("guide", "prismatic", "ground", "node", axis=(0, 1, 0))
    model.add_spring("creep", "ground", "node", start=(0, -1, 0), end=(0, 0, 0), stiffness=20.0, damping=10.0)
    return model


def test_modes_of_first_order_have_a_line_in_files(tmp_path):
    path = str(mv.save(creeping(), tmp_path / "creeping.yaml"))
    rows = json.loads(invoke(["modes", path, "--json"]).output)["modes"]
    assert [row["mode"] for row in rows] == [1, 2, 3]
    assert (rows[0]["real_1"], abs(rows[1]["imag_1"])) == pytest.approx((-2.0, 10.0), rel=1e-12)


@pytest.mark.parametrize("norm", ["h2_norm", "hinf_norm"])
def test_norms_name_the_mode_that_does_not_decay(norm):
    model = creeping()
    model.add_input("F", "slow", "x")
    model.add_output("x", "slow", "x")
    with pytest.raises(mv.ResponseError, match="mode 2 does not decay"):
        getattr(model.linearize(), norm)()
