"""FMUs without model exchange: those that list their states, and those that hide them."""

import re
import zipfile

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib_export.cosimulation.unit import state_space_of_unit
from tests.export.cosimulation.loops import controller, plant, speed_feedback

H = 5e-4
LISTS = {"2.0": r"<Derivatives>.*?</Derivatives>", "3.0": r"<ContinuousStateDerivative\b[^>]*/>"}


def without(source, path, *patterns):
    """An FMU whose description lacks some elements."""
    with zipfile.ZipFile(source) as full, zipfile.ZipFile(path, "w") as less:
        for item in full.infolist():
            data = full.read(item)
            if item.filename == "modelDescription.xml":
                for pattern in patterns:
                    text = data.decode()
                    assert re.search(pattern, text, re.DOTALL)
                    data = re.sub(pattern, "", text, flags=re.DOTALL).encode()
            less.writestr(item, data)
    return path


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def units(request, tmp_path_factory):
    """A plant that lists its states, one that hides them, and a controller, all for co-simulation only."""
    folder, version = tmp_path_factory.mktemp("units"), request.param
    exchange = r"<ModelExchange\b[^>]*?(/>|>.*?</ModelExchange>)"
    whole = mx.to_fmu(plant(), folder / "plant.fmu", version).path
    law = mx.to_fmu(speed_feedback(), folder / "law.fmu", version).path
    return (without(whole, folder / "listed.fmu", exchange),
            without(whole, folder / "hidden.fmu", exchange, LISTS[version]),
            without(law, folder / "law_only.fmu", exchange))  # fmt: skip


@pytest.mark.slow
@pytest.mark.few(1)
def test_states_that_are_listed_give_the_equations(units):
    listed, _, law = units
    expected = mx.check_cosimulation(plant(), speed_feedback(), H, masters="gauss-seidel")["gauss-seidel"]
    result = mx.check_cosimulation(listed, law, H, masters="gauss-seidel")["gauss-seidel"]
    np.testing.assert_allclose(result.errors, expected.errors, rtol=1e-9)
    assert result.difference < 1e-12
    np.testing.assert_allclose(state_space_of_unit(listed).A, plant().state_space("physical").A, rtol=1e-12)


@pytest.mark.slow
def test_hidden_states_need_a_system(units):
    _, hidden, law = units
    with pytest.raises(mv.ExportError, match=r"lists no states, .*systems={'plant': system}"):
        mx.check_cosimulation(hidden, law, H)
    with pytest.raises(mv.ExportError, match="for co-simulation only and lists no states"):
        state_space_of_unit(hidden)
    result = mx.check_cosimulation(hidden, law, H, masters="jacobi", systems={"plant": plant()})
    assert result.passed
    assert result["jacobi"].difference < 1e-12


def test_a_system_that_is_not_that_of_the_unit_shows(units):
    _, hidden, law = units
    other = plant("acceleration")
    assert not mx.check_cosimulation(hidden, law, H, masters="jacobi", systems={"plant": other}).passed


@pytest.mark.parametrize(("words", "more"), [
    (r"systems\['plant'\] has no 'd' among its inputs", {"systems": {"plant": plant(disturbance=False)}}),
    ("systems = 'plan'; expected 'plant' or 'controller'", {"systems": {"plan": plant()}}),
    ("no free input is excited, and an FMU lists no states", {"systems": {"plant": plant()}, "excitation": {}}),
])  # fmt: skip
def test_refusals(units, words, more):
    _, hidden, _ = units
    with pytest.raises(mv.ExportError, match=words):
        mx.check_cosimulation(hidden, controller(-1.0), H, masters="jacobi", **more)
