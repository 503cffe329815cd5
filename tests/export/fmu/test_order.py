"""The order of calls that the standards ask for, and states that are saved, written as bytes, and restored."""

import ctypes

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

import mbsvib_export as mx
from mbsvib import library
from tests.export.fmu.drive import Unit, unit

VERSIONS = ("2.0", "3.0")


@pytest.fixture(scope="module", params=VERSIONS)
def file(request, tmp_path_factory):
    return mx.to_fmu(library.quarter_car().linearize(), tmp_path_factory.mktemp("unit") / "car.fmu", request.param)


@pytest.fixture
def raw(file, tmp_path):
    """An instance on which nothing has been called yet."""
    made = []

    def make(kind="cs", **more):
        made.append(Unit(file, tmp_path / str(len(made)), kind, **more))
        return made[-1]

    yield make
    for item in made:
        item.fmu.freeInstance()


def refused(capfd, mode, call, *given, **more):
    """The call fails, and the log says in which state the instance is."""
    capfd.readouterr()
    with pytest.raises(FMICallException):
        call(*given, **more)
    assert f"the instance is in the state '{mode}'" in capfd.readouterr().out


def test_calls_before_initialization(raw, capfd):
    made = raw()
    refused(capfd, "instantiated", made.step, 0.0, 1e-3)
    refused(capfd, "instantiated", made.get, ["body.z"])
    refused(capfd, "instantiated", made.fmu.exitInitializationMode)
    refused(capfd, "instantiated", made.fmu.terminate)
    made.set({"load": 2.0})  # start values are set before


def test_calls_in_initialization(raw, capfd):
    made = raw()
    made.fmu.enterInitializationMode()
    refused(capfd, "initialization mode", made.step, 0.0, 1e-3)
    refused(capfd, "initialization mode", made.fmu.enterInitializationMode)
    assert made.get(["body.az"])[0] == 0.0


def test_calls_after_the_end(raw, capfd):
    made = raw().initialize()
    made.fmu.terminate()
    refused(capfd, "terminated", made.step, 0.0, 1e-3)
    refused(capfd, "terminated", made.set, {"load": 1.0})
    assert made.get(["body.z"])[0] == 0.0  # results may still be read
    made.fmu.reset()
    made.initialize().step(0.0, 1e-3)


def test_model_exchange_is_no_co_simulation(raw, capfd):
    made = raw("me").initialize()
    refused(capfd, "event mode", made.fmu.completedIntegratorStep)
    made.fmu.enterContinuousTimeMode()
    refused(capfd, "continuous-time mode", made.fmu.enterContinuousTimeMode)
    made.fmu.completedIntegratorStep()
    made.fmu.enterEventMode()


@pytest.mark.parametrize("step", [0.0, -1e-3, np.nan, np.inf])
def test_steps_that_are_none(raw, step):
    made = raw().initialize()
    if step == 0 and not made.new:
        made.step(0.0, step)  # FMI 2 allows it, for events
        return
    with pytest.raises(FMICallException):
        made.step(0.0, step)


def test_values_are_checked_all_or_none(raw):
    made = raw().initialize()
    call = made.fmu.setFloat64 if made.new else made.fmu.setReal
    load = made.references["load"]
    for references, values in (
        ([load, 10_000], [1.0, 1.0]), ([load, made.references["body.z"]], [1.0, 1.0]), ([load, load], [1.0, np.nan]),
    ):  # fmt: skip
        with pytest.raises(FMICallException):
            call(references, values)
        assert made.get(["load"])[0] == 0.0


def test_saved_states_give_the_same_bits_again(file, tmp_path):
    outputs = list(file.names["output"].values())
    with unit(file, tmp_path / "a") as car, unit(file, tmp_path / "b") as other:
        car.set({"load": 100.0, "road": 0.3})
        for k in range(5):
            car.step(k * 1e-2, 1e-2)
        saved = car.fmu.getFMUState()
        content = car.fmu.serializeFMUState(saved)

        def onward(plant):
            plant.step(0.05, 1e-2)
            return plant.get(outputs)

        first = onward(car)
        car.set({"load": -7.0})
        car.step(0.06, 0.5)
        car.fmu.setFMUState(saved)
        np.testing.assert_array_equal(onward(car), first)
        car.fmu.freeFMUState(saved)
        # the bytes go to another instance
        moved = other.fmu.deserializeFMUState(content)
        other.fmu.setFMUState(moved)
        np.testing.assert_array_equal(onward(other), first)
        other.fmu.freeFMUState(moved)


def test_bytes_that_are_no_state_are_refused(file, tmp_path):
    with unit(file, tmp_path / "unit") as car:
        saved = car.fmu.getFMUState()
        content = bytearray(car.fmu.serializeFMUState(saved))
        car.fmu.freeFMUState(saved)
        for spoilt in (content[:-8], content[:50] + bytes([content[50] ^ 1]) + content[51:], b"", bytes(len(content))):
            with pytest.raises(FMICallException):
                car.fmu.deserializeFMUState(bytes(spoilt))


def test_a_token_of_another_model_is_refused(file, tmp_path, capfd):
    made = Unit(file, tmp_path / "unit")
    made.fmu.freeInstance()
    again = Unit(file, tmp_path / "again")
    again.fmu.guid = "{another}"
    before = again.fmu.component
    with pytest.raises(Exception, match="instantiate"):
        again.fmu.instantiate()
    assert "belongs to another modelDescription.xml" in capfd.readouterr().out
    again.fmu.component = before
    again.fmu.freeInstance()


def test_fmi_3_returns_early_where_it_is_asked_to(tmp_path):
    """The importer asks for a shorter step in the intermediate update: the state is that of the shorter step."""
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "car.fmu")

    def early(environment, time, wanted, readable, finished, possible, requested, when):
        if wanted:
            assert possible
            ctypes.cast(requested, ctypes.POINTER(ctypes.c_bool))[0] = True
            ctypes.cast(when, ctypes.POINTER(ctypes.c_double))[0] = 0.004

    description = read_model_description(str(file))
    references = {item.name: item.valueReference for item in description.modelVariables}
    slave = FMU3Slave(guid=description.guid, unzipDirectory=extract(str(file), str(tmp_path / "unit")),
                      modelIdentifier=description.coSimulation.modelIdentifier)  # fmt: skip
    slave.instantiate(earlyReturnAllowed=True, intermediateUpdate=early)
    slave.enterInitializationMode()
    slave.setFloat64([references["load"]], [1.0])
    slave.exitInitializationMode()
    _, _, returned, last = slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.01)
    assert (returned, last) == (True, 0.004)
    truth = system.time_response([0.0, 0.004], np.array([[0.0], [0.0], [1.0]]) * np.ones(2), hold="zero")
    result = slave.getFloat64([references["travel"]])[0]
    assert result == pytest.approx(truth[system.outputs.index("travel"), 1], rel=1e-10)
    slave.freeInstance()
