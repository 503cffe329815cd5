"""Units in co-simulation and model exchange through fmpy, against exact solutions."""

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import mbsvib_export as mx
from mbsvib import library
from tests.export.fmu.drive import held, names_of, unit, worst
from tests.export.plants import stewart

VERSIONS = ("2.0", "3.0")


@pytest.fixture(scope="module")
def chain():
    """24 states."""
    return library.chain(12, line=(0, 1, 0)).linearize()


def steps_of(system, seed=0, count=200):
    return np.random.default_rng(seed).standard_normal((count, len(system.inputs)))


def run(file, folder, u, h):
    inputs, outputs, result = names_of(file, "input"), names_of(file, "output"), []
    with unit(file, folder) as plant:
        for k, row in enumerate(u):
            plant.set(dict(zip(inputs, row, strict=True)))
            plant.step(k * h, h)
            result.append(plant.get(outputs))
    return np.array(result)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("realization", ["physical", "modal"])
def test_the_stewart_platform_steps_exactly(version, realization, tmp_path):
    system = stewart()
    file = mx.to_fmu(system, tmp_path / "plant.fmu", version, realization=realization)
    assert validate_fmu(str(file)) == []
    u, h = steps_of(system), 1e-3
    truth = held(system.state_space("modal"), h, u)
    assert worst(run(file, tmp_path / "plant", u, h), truth) < 1e-11


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_of_any_size_is_exact(chain, version, tmp_path):
    file = mx.to_fmu(chain, tmp_path / "chain.fmu", version)
    u = steps_of(chain, count=20)
    for h in (1e-6, 1e-3, 0.7):
        truth = held(chain.state_space(), h, u)
        assert worst(run(file, tmp_path / "chain", u, h), truth) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("realization", ["physical", "modal"])
def test_400_states_step_exactly(realization, tmp_path):
    system = library.chain(200, line=(0, 1, 0)).linearize()
    file = mx.to_fmu(system, tmp_path / "chain.fmu", realization=realization)
    u = steps_of(system, count=20)
    truth = held(system.state_space(realization), 1e-3, u)
    assert worst(run(file, tmp_path / "chain", u, 1e-3), truth) < 5e-12


@pytest.mark.few(1)
@pytest.mark.parametrize("version", VERSIONS)
def test_slopes_of_inputs_make_steps_of_second_order_exact(chain, version, tmp_path):
    file = mx.to_fmu(chain, tmp_path / "chain.fmu", version)
    inputs, outputs = names_of(file, "input"), names_of(file, "output")
    h, u = 2e-3, steps_of(chain, count=40)
    space = chain.state_space()
    truth = chain.time_response(h * np.arange(40), u.T, hold="first").T
    now = 0

    def at(time):
        return dict(zip(inputs, u[now + 1], strict=True))

    with unit(file, tmp_path / "chain", **({"inputs_at": at} if version == "3.0" else {})) as plant:
        for now in range(39):
            plant.set(dict(zip(inputs, u[now], strict=True)))
            slope = (u[now + 1] - u[now]) / h
            if version == "2.0":
                references = [plant.references[name] for name in inputs]
                plant.fmu.setRealInputDerivatives(references, [1] * len(inputs), list(slope))
            plant.step(now * h, h)
            size = np.abs(truth).max(axis=0)
            assert np.abs((plant.get(outputs) - truth[now + 1]) / size).max() < 1e-11
            assert plant.get(inputs) == pytest.approx(u[now + 1], rel=1e-12, abs=1e-12)
            x = plant.get(names_of(file, "state"))
            rates = space.C @ (space.A @ x + space.B @ u[now + 1]) + space.D @ slope
            call = plant.fmu.getOutputDerivatives if plant.new else plant.fmu.getRealOutputDerivatives
            references = [plant.references[name] for name in outputs]
            size = 1e-9 * np.abs(rates).max()
            assert call(references, [1] * len(outputs)) == pytest.approx(rates, rel=1e-8, abs=size)


@pytest.mark.parametrize("version", VERSIONS)
def test_model_exchange_gives_the_equations(version, tmp_path):
    system = stewart()
    file = mx.to_fmu(system, tmp_path / "plant.fmu", version)
    space = system.state_space()
    rng = np.random.default_rng(1)
    x, u = rng.standard_normal(len(space.states)), rng.standard_normal(len(space.inputs))
    with unit(file, tmp_path / "plant", "me") as plant:
        if version == "2.0":
            plant.fmu.newDiscreteStates()
        plant.fmu.enterContinuousTimeMode()
        inputs = dict(zip(names_of(file, "input"), u, strict=True))
        truth = space.A @ x + space.B @ u
        assert plant.derivatives(0.5, x, inputs) == pytest.approx(truth, rel=1e-13, abs=1e-13 * np.abs(truth).max())
        y = space.C @ x + space.D @ u
        assert plant.get(names_of(file, "output")) == pytest.approx(y, rel=1e-13, abs=1e-13 * np.abs(y).max())


@pytest.mark.slow
def test_model_exchange_integrates(tmp_path):
    system = library.quarter_car().linearize()
    file = mx.to_fmu(system, tmp_path / "car.fmu", realization="modal")
    space = system.state_space("modal")
    inputs = names_of(file, "input")
    frequency = 5.0
    with unit(file, tmp_path / "car", "me") as plant:
        plant.fmu.enterContinuousTimeMode()

        def rate(t, x):
            return plant.derivatives(t, x, dict.fromkeys(inputs, np.sin(frequency * t)))

        nominal = np.array([item.nominal for item in plant.description.modelVariables if item.derivative is None
                            and item.causality == "local"], dtype=float)  # fmt: skip
        result = solve_ivp(rate, (0, 2), np.zeros(len(space.states)), method="DOP853", rtol=1e-10, atol=1e-10 * nominal)
    n = len(space.states)
    wave = np.array([[0, frequency], [-frequency, 0]])
    big = np.block([[space.A, space.B.sum(axis=1)[:, None], np.zeros((n, 1))], [np.zeros((2, n)), wave]])
    truth = (expm(big * 2) @ np.r_[np.zeros(n), 0, 1])[:n]
    assert result.y[:, -1] == pytest.approx(truth, rel=1e-7, abs=1e-8 * np.abs(truth).max())
