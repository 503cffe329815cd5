"""Modes keep their names over sweeps: through crossings, past points that fail, over grids."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from mbsvib.errors import ModelError
from mbsvib.library import quarter_car
from tests.studies.test_optimize import two

NAMES = {"across": 1, "along": 2}


def frequency(stiffness):
    return np.sqrt(np.asarray(stiffness)) / (2 * np.pi)


@pytest.mark.parametrize("count", [2, 3, 7, 12])
def test_names_are_kept_through_a_crossing(count):
    k = np.linspace(100.0, 900.0, count)  # crosses the other's 400 at a point or between two
    result = mv.track(two(), {"slow.spring.stiffness": k}, NAMES)
    assert result.modes == ("across", "along")
    assert np.allclose(result.mode("across"), frequency(k), rtol=1e-12)
    assert np.allclose(result.mode("along"), frequency(400.0), rtol=1e-12)
    assert np.allclose(result.mode("along", "damping_ratios"), 1.0 / 40.0, rtol=1e-12)


def test_modes_that_veer_change_their_shapes_and_are_followed_along_their_branches():
    model = two()
    model.add_spring("link", "slow", "fast", start=(0, 0, 0), end=(1, 1, 0), stiffness=4.0)
    k = np.linspace(100.0, 900.0, 9)
    result = mv.track(model, {"slow.spring.stiffness": k}, NAMES)
    assert (np.diff(np.argsort(result["frequencies"], axis=1), axis=0) == 0).all(), "branches that veer never cross"


def test_modes_are_named_by_what_moves_most():
    model = quarter_car()
    result = mv.track(model, {"suspension.stiffness": [1e4, 2e4]})
    assert result.modes == tuple(" ".join(most) for most in model.linearize().modes().strongest())
    assert result.units["frequencies"] == "Hz"


def test_names_are_kept_over_grids_and_points_that_fail():
    k = np.linspace(100.0, 900.0, 5)
    mass = np.array([0.5, -1.0, 1.5, 2.0])
    result = mv.track(two(), {"slow.spring.stiffness": k, "fast.mass": mass}, NAMES)
    assert len(result.errors) == 5
    good = mass > 0
    table = result.grid("frequencies")[:, good]
    assert np.allclose(table[..., 0], frequency(k)[:, None], rtol=1e-12)
    assert np.allclose(table[..., 1], frequency(400.0 / mass[good]), rtol=1e-12)
    assert np.isnan(result.grid("frequencies")[:, 1]).all()
    assert ["mass" in words for words in result.columns()["error"]] == np.isin(result["fast.mass"], -1.0).tolist()


def test_tracks_are_sweeps(tmp_path):
    file = tmp_path / "tracks.jsonl"
    k = np.linspace(100.0, 900.0, 5)
    result = mv.track(two(), {"slow.spring.stiffness": k}, NAMES, file=file)
    again = mv.track(two(), {"slow.spring.stiffness": k}, NAMES, file=file)
    assert (result["eigenvalues"] == again["eigenvalues"]).all()
    head = result.to_csv(tmp_path / "tracks.csv").read_text().splitlines()[0]
    assert "frequencies[across]" in head
    assert "eigenvalues[along].im" in head
    assert "frequencies[across]" in str(result)
    for figure in (result.plot(), result.plot("damping_ratios"), result.root_locus()):
        labels = [text.get_text() for text in (figure.axes[0].get_legend() or figure.legends[0]).get_texts()]
        assert labels == ["across", "along"]
        assert figure.axes[0].get_xlabel().endswith("]")


def test_a_root_locus_tells_which_modes_it_leaves_out():
    result = mv.track(mv.library.chain(14), {"spring1.stiffness.z": np.linspace(1e5, 3e5, 3)})
    figure = result.root_locus()
    assert figure.get_suptitle() == "12 of 14 modes; choose by modes="
    drawn = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 3]
    assert len(drawn) == 12
    assert all(line.get_marker() == "." for line in drawn)  # the points of the sweep: lines between them are chords
    last = result.root_locus([result.modes[-1]])
    assert last.get_suptitle() == ""
    line = last.axes[0].lines[0]
    assert (np.asarray(line.get_xdata()) + 1j * np.asarray(line.get_ydata()) == result["eigenvalues"][:, -1]).all()
    with pytest.raises(mv.ModelError, match="no mode 'nobody'"):
        result.root_locus("nobody")


BAD = [
    ({"slow.spring.stifness": [1.0]}, {}, "Did you mean 'slow.spring.stiffness'"),
    ({"leg*.k.stiffness": [1.0]}, {}, "no parameter 'leg"),
    ({"fast.mass": [1.0]}, {"up": 3}, "lists modes from 1 to 2"),
    ({"fast.mass": [1.0]}, {"up": 1, "down": 1}, "two names"),
]


@pytest.mark.parametrize(("values", "names", "message"), BAD)
def test_bad_input_is_told(values, names, message):
    with pytest.raises(ModelError, match=message):
        mv.track(two(), values, names)


def test_unknown_modes_are_told():
    result = st.track(two(), {"fast.mass": [1.0]}, NAMES)
    with pytest.raises(ModelError, match="Did you mean 'across'"):
        result.mode("acros")
    with pytest.raises(ModelError, match="root_locus: modes = 3; expected a name, or a list of names"):
        result.root_locus(3)
    with pytest.warns(UserWarning, match="failed"), pytest.raises(ModelError, match="points failed"):
        mv.track(two(), {"fast.mass": [-1.0]})
