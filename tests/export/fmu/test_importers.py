"""Units in tools that others wrote: CasADi's DaeBuilder, Ecos, and fmpy's own simulation."""

import ctypes
import sys
from pathlib import Path

import casadi as ca
import control
import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.affine import affine
from mbsvib_export.cosimulation.masters import loop_of
from tests.export.fmu.drive import held, names_of, unit, worst

MODELS = tuple(library.models())
VERSIONS = ("2.0", "3.0")
# all models in version 3.0, and by default these in 2.0 too
BOTH = {"stewart", "quarter_car", "four_bar", "rotor_stator", "engine_on_mounts"}
EITHER = [pytest.param(name, version, marks=pytest.mark.slow if version == "2.0" and name not in BOTH else ())
          for version in VERSIONS for name in MODELS]  # fmt: skip


def close(result, truth, rtol=1e-12):
    result = np.asarray(result.full() if isinstance(result, ca.DM) else result)
    return np.abs(result - truth).max(initial=0.0) <= rtol * np.abs(truth).max(initial=0.0)


def imported(file, folder):
    """DaeBuilder and its function (x, u, p) -> (x', y)."""
    builder = ca.DaeBuilder("unit", str(extract(str(file), str(folder))))
    return builder, builder.create("f", ["x", "u", "p"], ["ode", "y"])


@pytest.mark.few(4)
@pytest.mark.parametrize(("name", "version"), EITHER)
def test_casadi_takes_values_and_jacobians(name, version, tmp_path):
    system = library.models()[name][0]().linearize()
    space = system.state_space()
    file = mx.to_fmu(system, tmp_path / "unit.fmu", version)
    builder, f = imported(file, tmp_path / "unit")
    assert list(builder.x()) == names_of(file, "state")
    assert (list(builder.u()), list(builder.y())) == (names_of(file, "input"), names_of(file, "output"))
    rng = np.random.default_rng(0)
    x, u = rng.standard_normal(len(space.states)), rng.standard_normal(len(space.inputs))
    rate, y = f(x, u, [])
    assert close(rate, (space.A @ x + space.B @ u)[:, None])
    assert close(y, (space.C @ x + space.D @ u)[:, None])
    jacobian = f.jacobian()
    result = dict(zip(jacobian.name_out(), jacobian(x, u, [], rate, y), strict=True))
    for word, truth in (("ode_x", space.A), ("ode_u", space.B), ("y_x", space.C), ("y_u", space.D)):
        assert close(result[f"jac_{word}"], truth)
        # dependencies are those of the matrices, entry by entry
        pattern = np.array(ca.DM(result[f"jac_{word}"].sparsity(), 1).full())
        np.testing.assert_array_equal(pattern != 0, truth != 0)


@pytest.mark.parametrize("version", VERSIONS)
def test_casadi_takes_jacobians_to_parameters(version, tmp_path):
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "unit.fmu", version, tunable=("*.stiffness", "*.damping", "*.mass"))
    _, f = imported(file, tmp_path / "unit")
    slopes = affine(system, ["*.stiffness", "*.damping", "*.mass"], "test")
    rng = np.random.default_rng(1)
    x, u = rng.standard_normal(2 * system.dof), rng.standard_normal(len(system.inputs))
    rate, y = f(x, u, slopes.values)
    jacobian = f.jacobian()
    result = dict(zip(jacobian.name_out(), jacobian(x, u, slopes.values, rate, y), strict=True))
    m = system.dof
    acceleration = rate.full().ravel()[m:]
    parameters = range(len(slopes.names))
    d = {label: slopes.slopes[label] for label in slopes.slopes}
    bent = [np.linalg.solve(system.M, d["B"][i] @ u - d["K"][i] @ x[:m] - d["C"][i] @ x[m:] - d["M"][i] @ acceleration)
            for i in parameters]  # fmt: skip
    assert close(result["jac_ode_p"], np.array([np.append(np.zeros(m), item) for item in bent]).T)
    outputs = [d["Cq"][i] @ x[:m] + d["Cv"][i] @ x[m:] + d["Ca"][i] @ acceleration + d["D"][i] @ u + system.Ca @ bent[i]
               for i in parameters]  # fmt: skip
    assert close(result["jac_y_p"], np.array(outputs).T)


@pytest.mark.few(2)
@pytest.mark.parametrize(("name", "version"), EITHER)
def test_fmpy_runs_every_library_model(name, version, tmp_path):
    """Co-simulation against scipy; model exchange against the equations; the validator finds nothing."""
    system = library.models()[name][0]().linearize()
    space = system.state_space("modal")
    file = mx.to_fmu(system, tmp_path / "unit.fmu", version, realization="modal")
    assert validate_fmu(str(file)) == []
    inputs, outputs = names_of(file, "input"), names_of(file, "output")
    rng = np.random.default_rng(2)
    h, u, result = 0.05, rng.standard_normal((20, len(inputs))), []
    with unit(file, tmp_path / "unit") as slave:
        for k, row in enumerate(u):
            slave.set(dict(zip(inputs, row, strict=True)))
            slave.step(k * h, h)
            result.append(slave.get(outputs))
    truth, units = held(space, h, u), np.array(system.output_units)
    error = np.abs(result - truth).max(axis=0, initial=0.0)
    # some outputs hardly move in that time, or not at all: each is measured by all of its unit
    for item in set(system.output_units):
        assert error[units == item].max() <= 1e-12 * np.abs(truth[:, units == item]).max()
    x = rng.standard_normal(len(space.states))
    with unit(file, tmp_path / "unit", "me") as master:
        if version == "2.0":
            master.fmu.newDiscreteStates()
        master.fmu.enterContinuousTimeMode()
        rate = master.derivatives(0.0, x, dict(zip(inputs, u[0], strict=True)))
        truth = space.A @ x + space.B @ u[0]
        assert np.abs(rate - truth).max() <= 1e-14 * np.abs(truth).max()


@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_simulates_both_kinds(version, tmp_path):
    """From files to answers without a line of our own: a force that steps, and an oscillation from model exchange."""
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "car.fmu", version)
    time = 0.01 * np.arange(101)
    truth = system.time_response(time, np.array([[0.0], [1.0], [0.0]]) * np.ones(101), hold="zero")
    row = system.outputs.index("travel")
    size = np.abs(truth[row]).max()
    for kind, limit in (("CoSimulation", 1e-12), ("ModelExchange", 1e-3)):
        result = simulate_fmu(str(file), fmi_type=kind, stop_time=1.0, step_size=0.01, output_interval=0.01,
                              start_values={"actuator": 1.0}, output=["travel"], relative_tolerance=1e-8)  # fmt: skip
        assert np.abs(result["travel"] - np.interp(result["time"], time, truth[row])).max() < limit * size


# Every library model in every way; half of the models go one way in the default run, by turns.
WAYS = [("2.0", "physical"), ("3.0", "modal"), ("2.0", "modal"), ("3.0", "physical")]
EXCHANGES = [
    pytest.param(name, *way, marks=() if i % 8 == k and name != "cantilever" else pytest.mark.slow)
    for i, name in enumerate(library.models()) for k, way in enumerate(WAYS)
]  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize(("name", "version", "realization"), EXCHANGES)
def test_model_exchange_is_as_accurate_as_asked_for(name, version, realization, tmp_path):
    """Nominal values of states: all inputs at once, each such that some output follows it, against the exact response.

    The relative tolerance holds for each step of the integrator; errors add up over 20 periods of thousands of steps.
    """
    system = library.build(name).linearize()
    units = np.array(system.output_units)
    file = mx.to_fmu(system, tmp_path / "model.fmu", version, realization=realization)
    stop = float(read_model_description(str(file)).defaultExperiment.stopTime)
    # some of their states make thousands of oscillations until then
    elastic = name in ("cantilever", "parallel_guide", "cross_hinge")
    time, count = np.linspace(0.0, stop, 1001)[: 101 if elastic else None], len(system.inputs)
    item = np.array([np.abs(system.time_response(time, np.eye(count)[:, [j]] * np.ones(len(time)))).max(axis=1)
                     for j in range(count)]).T  # fmt: skip
    largest = item.max(axis=1, keepdims=True)
    size = 1.0 / (item / np.where(largest > 0.0, largest, 1.0)).max(axis=0)
    truth = system.time_response(time, size[:, None] * np.ones(len(time)))
    # a rigid motion beside an oscillation grows without bound, and the integrator's step with it
    factor = 1e5 if system.modes().rigid else 1e4
    for rtol in (1e-6, 1e-8):
        result = simulate_fmu(str(file), fmi_type="ModelExchange", stop_time=time[-1], output_interval=time[1],
                              relative_tolerance=rtol, output=list(system.outputs),
                              start_values=dict(zip(system.inputs, size.tolist(), strict=True)))  # fmt: skip
        response = np.array([result[output] for output in system.outputs])
        error, limit = np.abs(response - truth).max(axis=1), factor * rtol * np.abs(truth).max(axis=1)
        # what stands still by symmetry is measured by all of its unit
        still = limit <= 1e-12 * max(limit)
        allowed = np.where(still, [max(limit[units == unit]) for unit in units], limit)
        assert (error <= allowed).all(), (rtol, [system.outputs[i] for i in np.flatnonzero(error > allowed)])


@pytest.mark.parametrize(
    ("rate", "stop", "step"), [(2 * np.pi, 20.0, 0.02), (2 * np.pi * 2e4, 1e-3, 1e-6), (0.0, 1.0, 1e-3)])
def test_default_experiment_fits_the_model(rate, stop, step, tmp_path):
    """A lamp of 1 Hz and a beam of 20 kHz: twenty periods."""
    mass = control.ss([[0.0, 1.0], [-rate**2, -0.1 * rate]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    file = mx.to_fmu(mass, tmp_path / "x.fmu")
    known = read_model_description(str(file)).defaultExperiment
    assert (float(known.stopTime), float(known.stepSize), float(known.tolerance)) == (stop, step, 1e-6)


def ecos():
    """The package of an independent co-simulation master, which needs a library that another package brings."""
    for name in ("libtbb.so.12", "libtbb.12.dylib"):
        for path in Path(sys.prefix).glob(f"lib*/{name}"):
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    try:
        import ecospy
    except (ImportError, OSError) as error:
        pytest.skip(f"Ecos does not run here: {error}; pip install ecospy tbb")
    return ecospy


@pytest.mark.parametrize("version", VERSIONS)
def test_ecos_closes_the_loop_as_our_own_master_does(version, tmp_path):
    """Both units at once, inputs held (Jacobi): an active suspension by a skyhook law that rolls off."""
    package = ecos()
    gain, roll_off, leak, h, count = 4e3, 300.0, 1.0, 1e-3, 200
    car = library.quarter_car().linearize()
    law = control.ss([[-leak, 0], [roll_off, -roll_off]], [[1], [0]], [[0, -gain]], [[0]],
                     inputs=["body:az"], outputs=["actuator"], name="law")  # fmt: skip
    files = mx.to_fmu(car, tmp_path / "car.fmu", version), mx.to_fmu(law, tmp_path / "law.fmu", version)
    result = []
    with package.EcosSimulationStructure() as structure:
        structure.add_model("car", str(files[0]))
        structure.add_model("law", str(files[1]))
        structure.make_real_connection("car::body.az", "law::body.az")
        structure.make_real_connection("law::actuator", "car::actuator")
        structure.add_parameter_set("start", {"car::load": 1.0})
        with package.EcosSimulation(structure=structure, step_size=h) as simulation:
            simulation.init(parameter_set="start")
            for _ in range(count):
                simulation.step()
                result.append([simulation.get_real("car::body.z"), simulation.get_real("law::actuator")])
    space = car.state_space()
    coupling, free = np.zeros((4, len(car.outputs) + 1)), np.zeros((4, 1))  # inputs and outputs of the car, of the law
    coupling[car.inputs.index("actuator"), -1] = coupling[-1, car.outputs.index("body.az")] = 1.0
    free[car.inputs.index("load")] = 1.0
    units = [tuple(np.asarray(getattr(item, label)) for label in "ABCD") for item in (space, law)]
    loop = loop_of(units, coupling, free, h)
    z, truth = loop.start(np.zeros(6), np.ones(1), False), []
    for _ in range(count):
        z = loop.step("jacobi", z, np.ones(1))
        truth.append([z[6 + car.outputs.index("body.z")], z[-1]])
    assert worst(np.array(result), np.array(truth)) < 1e-11
