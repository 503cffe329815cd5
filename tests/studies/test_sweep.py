"""Sweeps: every point answered as if it were alone, whatever fails elsewhere, and nothing lost."""

import csv
import json
import os

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, studies
from mbsvib.errors import ModelError
from mbsvib.library import quarter_car, stewart
from mbsvib.studies import sweep

TYRE, SUSPENSION = np.linspace(1e5, 3e5, 7), np.linspace(1e4, 4e4, 5)
GRID = {"tyre.stiffness": TYRE, "suspension.stiffness": SUSPENSION}


def alone(model, values):
    return model.with_values(values).linearize().modes().frequencies


def lowest(system):
    return system.modes().frequencies[0]


def picky(system):
    if system.K[0, 0] > 2.5e5:
        raise ArithmeticError("too stiff")
    return {"low": system.modes().frequencies[0], "poles": system.poles()}


def pendulum():
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 1.0, (0.01, 0.01, 0.01), position=(0, 0, -0.5))
    model.add_joint("pivot", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    return model


def test_grid_of_frequencies_is_that_of_single_models():
    result = sweep(quarter_car(), GRID, "modes.frequencies")
    table = result.grid("modes.frequencies")
    assert result.shape == (7, 5)
    assert table.shape == (7, 5, 2)
    for i, j in ((0, 0), (2, 4), (6, 3)):
        expected = alone(quarter_car(), {"tyre.stiffness": TYRE[i], "suspension.stiffness": SUSPENSION[j]})
        assert np.allclose(table[i, j], expected, rtol=1e-12, atol=0)
    assert result.units == {"tyre.stiffness": "N/m", "suspension.stiffness": "N/m", "modes.frequencies": "Hz"}


def test_patterns_tie_and_numbers_hold_for_all_points():
    model = stewart()
    values = {"leg*.k.stiffness": [1e7, 2e7, 3e7], "platform.mass": 2.0}
    result = sweep(model, values, "modes.frequencies", how="paired")
    expected = alone(model, {"leg*.k.stiffness": 2e7, "platform.mass": 2.0})
    assert np.allclose(result["modes.frequencies"][1], expected, rtol=1e-12, atol=0)


def test_patterns_of_any_shape_have_the_unit_of_what_they_pick():
    result = sweep(quarter_car(), {"*.stiffnes[s]": [1e4, 2e4], "*.inertia.z[z]": 1.0, "wheel.[mp]*": 0.3}, lowest,
                  how="paired")  # fmt: skip
    assert result.units == {"*.stiffnes[s]": "N/m", "*.inertia.z[z]": "kg m^2"}
    assert np.isfinite(result["lowest"]).all()


def test_linear_maps_add_to_what_the_model_has():
    result = sweep(quarter_car(), {"softer": [0.0, 1.0]}, lowest, ties={"softer": {
        "tyre.stiffness": -1e4, "suspension.stiffness": -2e3}})  # fmt: skip
    expected = alone(quarter_car(), {"tyre.stiffness": 192000.0 - 1e4, "suspension.stiffness": 20000.0})
    assert result["lowest"][1] == pytest.approx(expected[0], rel=1e-12)


def test_functions_that_take_batches_are_asked_once():
    asked = []

    def both(batch):
        asked.append(len(batch))
        return batch.frequency_response([3.0])[:, 0, 0, 0]

    result = sweep(quarter_car(), GRID, both, batched=True)
    assert len(asked) <= 3  # once to see whether it can, then all in two pieces
    single = quarter_car().with_values({"tyre.stiffness": TYRE[3], "suspension.stiffness": SUSPENSION[1]}).linearize()
    assert result.grid("both")[3, 1] == pytest.approx(single.frequency_response([3.0])[0, 0, 0], rel=1e-11)


def test_models_that_batches_refuse_go_one_by_one():
    result = sweep(pendulum(), {"bob.position.z": [-0.25, -0.5, -1.0]}, "modes.natural")
    length = np.array([0.25, 0.5, 1.0])
    assert np.allclose(result["modes.natural"][:, 0], np.sqrt(9.81 * length / (0.01 + length**2)), rtol=1e-12)


def test_a_point_that_fails_is_recorded_and_the_others_kept():
    result = sweep(quarter_car(), {"tyre.stiffness": [1e5, 3e5, 2e5]}, picky)
    assert result.errors == {1: "ArithmeticError: too stiff"}
    assert result.failed.tolist() == [False, True, False]
    assert np.isnan(result["low"][1])
    assert np.isnan(result["poles"][1]).all()
    assert result["poles"].dtype == complex
    assert result["low"][2] == pytest.approx(alone(quarter_car(), {"tyre.stiffness": 2e5})[0], rel=1e-12)
    assert "Point 1 failed: ArithmeticError: too stiff" in str(result)


def test_a_value_that_no_part_can_have_fails_alone():
    mass = np.full(300, 2.0)
    mass[[17, 230]] = -1.0
    result = sweep(stewart(), {"platform.mass": mass}, "modes.frequencies")
    assert sorted(result.errors) == [17, 230]
    assert "mass" in result.errors[17]
    assert np.isfinite(result["modes.frequencies"][~result.failed]).all()


@pytest.mark.parametrize("of", ["modes.frequencies", "modes.natural", studies.frequency(1)])
def test_frequencies_of_modes_that_grow_come_with_a_word(of, recwarn):
    """Those of real eigenvalues are magnitudes, so that -k has the frequency of k, and nothing said so."""
    model = mv.Model("cart")
    model.add_body("mass", 2.0, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_spring("k", "ground", "mass", start=(-1, 0, 0), end=(0, 0, 0), stiffness=8.0)
    sweep(model, {"k.stiffness": [8.0, 18.0]}, of)
    sweep(model, {"k.stiffness": [8.0, -8.0]}, "modes.damping_ratios")
    assert not recwarn.list
    with pytest.warns(mv.errors.UnstableWarning, match="modes of 'cart' grow at some of the points"):
        (values,) = sweep(model, {"k.stiffness": [8.0, -8.0]}, of).results.values()
    assert np.ptp(values) < 1e-14 * values.max()


def test_if_every_point_fails_the_sweep_says_so():
    with pytest.warns(UserWarning, match="all 2 points failed, the first by ZeroDivisionError"):
        result = sweep(quarter_car(), {"tyre.stiffness": [1e5, 2e5]}, lambda system: 1 / 0)
    assert not result.results


def test_results_of_different_shapes_are_kept_as_they_are():
    result = sweep(quarter_car(), {"tyre.stiffness": [1e5, 2e5]}, lambda s: np.arange(int(s.K.max() // 1e5)))
    assert [len(value) for value in result["value"]] == [1, 2]


def test_record_is_resumed_after_an_interruption(tmp_path):
    file, asked = tmp_path / "sweep.jsonl", []

    def interrupted(system):
        asked.append(1)
        if len(asked) == 4:
            raise KeyboardInterrupt
        return {"poles": system.poles(), "stable": True}

    with pytest.raises(KeyboardInterrupt):
        sweep(quarter_car(), {"tyre.stiffness": TYRE}, {"value": interrupted}, file=file, workers=1)
    retained = len(file.read_bytes().splitlines()) - 1
    assert 1 <= retained <= 3
    with open(file, "ab") as stream:
        stream.write(b'{"point": 6, "resu')  # cut short
    counts = []
    result = sweep(quarter_car(), {"tyre.stiffness": TYRE}, {"value": interrupted}, file=file, workers=1,
                  progress=lambda done, total: counts.append((done, total)))  # fmt: skip
    assert len(asked) == 4 + 7 - retained
    assert counts[-1] == (7, 7)
    full = sweep(quarter_car(), {"tyre.stiffness": TYRE}, "poles")
    assert (result["poles" if "poles" in result.results else "value.poles"] == full["poles"]).all()
    assert not result.errors
    again = sweep(quarter_car(), {"tyre.stiffness": TYRE}, {"value": interrupted}, file=file)
    assert len(asked) == 4 + 7 - retained
    assert all((again[label] == result[label]).all() for label in result)


def test_failed_points_are_asked_again_only_if_wanted(tmp_path):
    file, works = tmp_path / "sweep.jsonl", []

    def sometimes(system):
        if not works:
            raise OSError("disk full")
        return 1.0

    values = {"tyre.stiffness": [1e5, 2e5]}
    with pytest.warns(UserWarning, match="disk full"):
        sweep(quarter_car(), values, sometimes, file=file)
    works.append(True)
    with pytest.warns(UserWarning, match="disk full"):
        sweep(quarter_car(), values, sometimes, file=file)
    assert sweep(quarter_car(), values, sometimes, file=file, retry=True)["sometimes"].tolist() == [1.0, 1.0]
    assert sweep(quarter_car(), values, sometimes, file=file)["sometimes"].tolist() == [1.0, 1.0]


def test_quantities_are_named_by_their_label(tmp_path):
    file = tmp_path / "sweep.jsonl"
    floor = {"load": isolation.white(1.0)}
    car, values = quarter_car(suspension_damping=300.0), {"tyre.stiffness": [1.8e5, 2e5]}
    table = sweep(car, values, studies.rms("body.z", floor), file=file)
    assert "rms of body.z" in str(table)
    with pytest.raises(ModelError, match="record of another study"):
        sweep(car, values, studies.rms("wheel.z", floor), file=file)


@pytest.mark.slow
def test_records_tell_quantities_of_one_label_apart(tmp_path):
    """Root mean squares of one output under other noise, gains at other frequencies; the same again is resumed."""
    car, values = quarter_car(suspension_damping=300.0), {"tyre.stiffness": [1.8e5, 2e5]}
    of = [studies.rms("body.z", {"load": isolation.shaped([gain], [1.0, 2.0])}) for gain in (1.0, 5.0)]
    again = studies.rms("body.z", {"load": isolation.shaped([1.0], [1.0, 2.0])})
    for k, study in enumerate((lambda quantity, file: sweep(car, values, quantity, file=file),
                               lambda quantity, file: studies.tolerances(car, {"tyre.stiffness": "1 %"}, quantity,
                                                                         samples=3, file=file).sweep)):  # fmt: skip
        file = tmp_path / f"{k}.jsonl"
        first = study(of[0], file)
        size = file.stat().st_size
        for quantity in (of[0], again):
            np.testing.assert_array_equal(study(quantity, file)["rms of body.z"], first["rms of body.z"])
        assert file.stat().st_size == size
        with pytest.raises(ModelError, match=r"another study \(quantities is not the same\)"):
            study(of[1], file)


def test_records_of_other_studies_are_refused(tmp_path):
    file = tmp_path / "sweep.jsonl"
    sweep(quarter_car(), {"tyre.stiffness": TYRE}, "poles", file=file)
    before = file.read_bytes()
    other = quarter_car().with_values({"body.mass": 300.0})
    for model, values, of in ((other, {"tyre.stiffness": TYRE}, "poles"), (quarter_car(), GRID, "poles"),
                              (quarter_car(), {"tyre.stiffness": TYRE}, "K")):  # fmt: skip
        with pytest.raises(ModelError, match="record of another study"):
            sweep(model, values, of, file=file)
    (tmp_path / "no.jsonl").write_text("hello\n")
    with pytest.raises(ModelError, match="not a record of a study"):
        sweep(quarter_car(), GRID, "poles", file=tmp_path / "no.jsonl")
    (tmp_path / "bad.jsonl").write_bytes(before.replace(b'"result"', b'"rest"', 1))
    with pytest.raises(ModelError, match="line 2"):
        sweep(quarter_car(), {"tyre.stiffness": TYRE}, "poles", file=tmp_path / "bad.jsonl")
    assert file.read_bytes() == before


def damaged(lines):
    """Lines of a record of seven points, each damaged in another way, and what is told of them."""
    line, other = lines[3], lines[4]
    moved = line.replace(b'"point": 2', b'"point": 3')
    yield moved, "the result of point 3 is there twice"
    for point in (b"-1", b"7", b"1.0", b"true", b'"2"', b"null"):
        yield line.replace(b'"point": 2', b'"point": ' + point), "expected one from 0 to 6"
    yield b"[1, 2]", "expected a point"
    yield b"3", "expected a point"
    yield b'"point"', "expected a point"
    yield line[:-1] + b', "error": "x"}', "expected a point"
    yield b'{"point": 2, "error": 3}', "an error that is not a text"
    yield line + other, "Extra data"
    yield b"[" * 100_000, "nested too deep"
    yield b"\xff" + line, "utf-8"
    for value in (b"1", b"[1]", b'{"poles": "abc"}', b'{"poles": [1, [2]]}', b'{"poles": {"real": [1, 2]}}',
                  b'{"poles": {"real": [1, 2], "imag": [1]}}', b'{"poles": {"real": ["1"], "imag": [1]}}',
                  b'{"poles": null}', b'{"poles": {}}'):  # fmt: skip
        yield b'{"point": 2, "result": ' + value + b"}", "a result that is not an array of numbers"


@pytest.mark.slow
def test_damaged_lines_of_a_record_are_refused(tmp_path):
    """Each by its number and reason; a point with a wrong number took the place of another one."""
    file = tmp_path / "sweep.jsonl"
    values = {"tyre.stiffness": TYRE}
    sweep(quarter_car(), values, "poles", file=file, workers=1)
    lines = file.read_bytes().splitlines()
    for line, reason in damaged(lines):
        file.write_bytes(b"\n".join([*lines[:3], line, *lines[4:], b""]))
        before = file.read_bytes()
        with pytest.raises(ModelError, match=rf"sweep\.jsonl, line [45]: this is not a line of a record.*{reason}"):
            sweep(quarter_car(), values, "poles", file=file)
        assert file.read_bytes() == before


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such devices here")
def test_a_device_is_no_record(tmp_path):
    (tmp_path / "link").symlink_to("/dev/zero")
    for path in ("/dev/zero", tmp_path / "link", tmp_path):
        with pytest.raises(ModelError, match=r"cannot be read: it is (no regular file|a folder)"):
            sweep(quarter_car(), {"tyre.stiffness": TYRE}, "poles", file=path)


def test_results_that_are_no_number_come_back(tmp_path):
    file = tmp_path / "sweep.jsonl"
    for _ in range(2):
        result = sweep(quarter_car(), {"tyre.stiffness": [1e5, 2e5]}, {"f": lambda s: np.array([np.nan, np.inf])},
                       file=file)  # fmt: skip
        assert str(result["f"].tolist()) == "[[nan, inf], [nan, inf]]"


def test_csv_keeps_every_digit(tmp_path):
    result = sweep(quarter_car(), {"tyre.stiffness": [1e5, 3e5, 2e5]}, picky)
    path = result.to_csv(tmp_path / "sweep.csv")
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [float(row["tyre.stiffness"]) for row in rows] == [1e5, 3e5, 2e5]
    assert float(rows[2]["low"]) == result["low"][2]
    assert float(rows[0]["poles(2).im"]) == result["poles"][0, 1].imag
    assert rows[1]["error"] == "ArithmeticError: too stiff"
    assert set(result.to_numpy()) == {"tyre.stiffness", "low", "poles"}


@pytest.mark.few(1)
@pytest.mark.parametrize(("values", "of", "kind"), [
    (GRID, "modes.frequencies", "map"), ({"tyre.stiffness": TYRE}, "modes.frequencies", "lines"),
    ({"tyre.stiffness": TYRE, "body.mass": TYRE / 1e3, "wheel.mass": 40.0}, lowest, "histogram"),
])  # fmt: skip
def test_figures_have_units(values, of, kind):
    result = sweep(quarter_car(), values, of, how="paired" if kind == "histogram" else "grid")
    figure = result.plot()
    labels = [axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes]
    assert all(label.endswith(("]", "number of points")) for label in labels)
    assert len(figure.axes) == (2 if kind == "map" else 1)
    assert not any("[1]" in label for label in labels)  # what a function returns has a unit that nobody knows
    with pytest.raises(ModelError, match="Did you mean"):
        result.plot("modes.frequences" if kind != "histogram" else "lowes")


@pytest.mark.few(2)
@pytest.mark.parametrize(("values", "scale"), [
    (np.geomspace(1e4, 2e5, 5), "log"), (np.geomspace(2e5, 1e4, 5), "log"), (np.linspace(1e4, 2e5, 5), "linear"),
    ([-1e4, 1e4, 2e4], "linear"), ([1e4, 2e4], "linear")])  # fmt: skip
def test_values_in_equal_ratios_are_drawn_over_their_logarithm(values, scale):
    lines = sweep(quarter_car(), {"tyre.stiffness": values}, lowest).plot().axes[0]
    assert lines.get_xscale() == scale
    grid = sweep(quarter_car(), {"body.mass": [300.0, 350.0, 400.0], "tyre.stiffness": values}, lowest).plot().axes[0]
    assert (grid.get_xscale(), grid.get_yscale()) == (scale, "linear")


BAD = [
    ({"tyre.stifness": [1.0]}, "poles", {}, "Did you mean 'tyre.stiffness'"),
    ({"leg*.k.stiffness": [1.0]}, "poles", {}, "no parameter 'leg\\*.k.stiffness'"),
    ({"axle.mass": [1.0]}, "poles", {}, "no parameter 'axle.mass'"),
    ({"soft": [1.0]}, "poles", {"ties": {"soft": {"axle*.mass": 1.0}}}, "no parameter 'axle"),
    ({"soft": [1.0]}, "poles", {"ties": {"sort": {"body.mass": 1.0}}}, "Did you mean 'soft'"),
    ({"soft": [1.0], "body.mass": [1.0]}, "poles", {"ties": {"soft": {"body.mass": 1.0}}}, "values of its own"),
    ({"body.mass": [1.0]}, "modes.frequences", {}, "Did you mean 'frequencies'"),
    ({"body.mass": [1.0]}, "frequency_response", {}, "needs arguments"),
    ({"body.mass": [1.0]}, 3.0, {}, "a function of a system"),
    ({"body.mass": [np.nan]}, "poles", {}, "finite numbers"),
    ({"body.mass": []}, "poles", {}, "finite numbers"),
    ({"body.mass": "heavy"}, "poles", {}, "finite numbers"),
    ({}, "poles", {}, "a mapping from parameters"),
    ({"body.mass": [1.0, 2.0], "wheel.mass": [1.0, 2.0, 3.0]}, "poles", {"how": "paired"}, "2 entries, values"),
    ({"body.mass": [1.0]}, "poles", {"how": "random"}, "'grid' or 'paired'"),
    ({"body.mass": [1.0]}, "poles", {"workers": 0}, "at least 1"),
    ({"body.mass": [1.0]}, lambda batch: 1.0, {"batched": True}, "along the first axis"),
]


@pytest.mark.parametrize(("values", "of", "words", "message"), BAD)
def test_bad_input_is_told(values, of, words, message):
    with pytest.raises(ModelError, match=message):
        sweep(quarter_car(), values, of, **words)


def test_progress_bar_is_drawn_if_asked_for(capsys):
    sweep(quarter_car(), GRID, "modes.frequencies", progress=True)
    assert "35/35" in capsys.readouterr().err
    sweep(quarter_car(), GRID, "modes.frequencies")
    assert not capsys.readouterr().err


def test_record_is_readable_by_others(tmp_path):
    file = tmp_path / "sweep.jsonl"
    result = sweep(quarter_car(), {"tyre.stiffness": TYRE}, "modes.frequencies", file=file)
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert lines[0]["of"] == {"modes.frequencies": "modes.frequencies"}
    assert lines[3]["result"]["modes.frequencies"] == result["modes.frequencies"][lines[3]["point"]].tolist()


def test_many_points_that_fail_do_not_hold_up_the_others(monkeypatch):
    from mbsvib.studies.running import Task

    asked = []
    plain = Task.run
    monkeypatch.setattr(Task, "run", lambda task, numbers, columns: asked.append(len(numbers)) or plain(
        task, numbers, columns))  # fmt: skip
    mass = np.linspace(-1.0, 3.0, 200)
    result = sweep(stewart(), {"platform.mass": mass}, "modes.frequencies", workers=1)
    assert sorted(result.errors) == np.flatnonzero(mass <= 0.0).tolist()
    assert len(asked) < 20, "what may fail is told beforehand, and taken by itself"
    assert np.isfinite(result["modes.frequencies"][mass > 0.0]).all()


def sprung(system):
    """An actuator that acts as a spring of 3 kN/m beside the suspension."""
    return system.feedback([[-3e3]], ["travel"], ["actuator"])


def test_results_of_loops_around_each_point(tmp_path):
    """The loop is the mechanism with that spring; its record is that of no sweep without it."""
    values, asked = {"suspension.stiffness": np.array([1e4, 2e4])}, {"poles": "poles", "rms": lambda plant: plant.rms(
        "body.z", {"load": [(2.0, 1.0), (8.0, 0.5)]})}  # fmt: skip
    model, file = quarter_car(suspension_damping=800.0), tmp_path / "loops.jsonl"
    loops = sweep(model, values, asked, plant=sprung, file=file)
    springs = sweep(model, {"suspension.stiffness": np.array([1.3e4, 2.3e4])}, asked)
    for name in ("poles", "rms.body.z"):
        np.testing.assert_allclose(np.sort_complex(loops.results[name]), np.sort_complex(springs.results[name]),
                                   rtol=1e-9)  # fmt: skip
    with pytest.raises(ModelError, match="another"):
        sweep(model, values, asked, file=file)
    with pytest.raises(ModelError, match="function of a system"):
        sweep(model, values, asked, plant=[[1.0]])
    with pytest.raises(ModelError, match="False beside plant"):
        sweep(model, values, asked, plant=sprung, batched=True)
