"""``mbsvib cosim``: a table, a figure, and an exit status for CI."""

import pytest

import mbsvib_export as mx
from tests.export.cosimulation.loops import controller, plant, speed_feedback


@pytest.fixture
def units(run, tmp_path):
    mx.to_fmu(plant(), tmp_path / "plant.fmu")
    mx.to_fmu(speed_feedback(), tmp_path / "law.fmu")
    return run


@pytest.mark.slow
def test_a_step_that_is_short_enough(units, tmp_path):
    result = units("cosim plant.fmu law.fmu --step 1e-3 --duration 0.02 -o error.png")
    assert result.exit_code == 0
    assert "gauss-seidel" in result.stdout
    assert "Written: error.png" in result.stdout
    assert (tmp_path / "error.png").stat().st_size > 1000


@pytest.mark.slow
def test_a_step_that_is_too_long(units):
    result = units("cosim plant.fmu law.fmu --step 0.02 --master jacobi")
    assert result.exit_code == 1
    assert "NO, unstable" in result.stdout


@pytest.mark.slow
def test_names_are_connected_by_hand(units, tmp_path):
    mx.to_fmu(controller(-40.0, outputs=("command",)), tmp_path / "other.fmu")
    assert units("cosim plant.fmu other.fmu --step 1e-3 --master jacobi --connect F=command").exit_code == 0
    result = units("cosim plant.fmu other.fmu --step 1e-3")
    assert result.exit_code == 1
    assert "no connection" in result.output
    assert units("cosim plant.fmu other.fmu --step 1e-3 --connect F").exit_code == 2


@pytest.mark.slow
def test_a_missing_file_and_a_strange_figure(units):
    assert "no such file" in units("cosim plant.fmu none.fmu --step 1e-3").output
    assert units("cosim plant.fmu law.fmu --step 1e-3 --master jacobi -o error.xyz").exit_code == 2
