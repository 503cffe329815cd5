"""Checks of co-simulations against closed forms: errors, orders, largest stable steps."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib_export as mx
from mbsvib.library import stewart
from tests.export.cosimulation.loops import (
    DAMPING,
    GAIN,
    MASS,
    ROLL_OFF,
    STIFFNESS,
    closed_poles,
    controller,
    plant,
    speed_feedback,
)
from tests.support.sizes import few

H = 5e-4


@pytest.fixture(scope="module", params=few([("2.0", "3.0"), ("3.0", "2.0")], 1), ids=" with ".join)
def files(request, tmp_path_factory):
    """Units of either version, which run with each other."""
    folder = tmp_path_factory.mktemp("units")
    return (mx.to_fmu(plant(), folder / "plant.fmu", request.param[0]),
            mx.to_fmu(speed_feedback(), folder / "law.fmu", request.param[1]))  # fmt: skip


@pytest.fixture(scope="module")
def check(files):
    return mx.check_cosimulation(*files, H, bonds={"F": "z"})


@pytest.mark.slow
def test_units_do_what_numpy_says(check):
    assert check.passed
    assert len(check.masters) == 4
    for item in check.masters:
        assert item.difference < 1e-12
        assert item.steps == (H, H / 2, H / 4)


@pytest.mark.slow
def test_orders_are_those_of_theory(check):
    for method, order in (("jacobi", 1), ("gauss-seidel", 2), ("slopes", 2), ("iteration", 2)):
        assert check[method].order == pytest.approx(order, abs=0.15)
    assert check["jacobi"].errors[0] > check["gauss-seidel"].errors[0] > check["gauss-seidel"].errors[2] > 0


@pytest.mark.slow
def test_the_closed_loop_is_that_of_python_control(check):
    assert check.growth == pytest.approx(closed_poles(speed_feedback()).real.max(), rel=1e-10)


@pytest.mark.slow
def test_coupling_makes_less_energy_with_smaller_steps(files, check):
    finer = mx.check_cosimulation(*files, H / 4, masters="jacobi", bonds={"F": "z"}, duration=256 * H)
    assert abs(finer["jacobi"].energy) < 0.4 * abs(check["jacobi"].energy)
    assert abs(check["iteration"].energy) < 1e-12
    assert np.isnan(mx.check_cosimulation(*files, H, masters="jacobi", duration=H)["jacobi"].energy)


@pytest.mark.slow
def test_error_of_jacobi_is_that_of_a_program_without_this_package(files):
    """The whole master again in ten lines: held inputs, both at once; and the loop by one exponential."""
    result = mx.check_cosimulation(*files, H, masters="jacobi")["jacobi"].errors[0]
    a = np.array([[0, 1], [-STIFFNESS / MASS, -DAMPING / MASS]])
    b = np.array([[0], [1 / MASS]])
    ak, bk, ck = (np.asarray(getattr(speed_feedback(), label)) for label in "ABC")

    def held(a, b):
        n = len(a)
        big = expm(np.block([[a, b], [np.zeros((1, n + 1))]]) * H)
        return big[:n, :n], big[:n, n]

    (phi, g), (phik, gk) = held(a, b), held(ak, bk)
    full = np.block([[a, b @ ck, b], [bk @ [[0, 1]], ak, np.zeros((1, 1))], [np.zeros((1, 4))]])
    step, z = expm(full * H), np.array([0, 0, 0, 1.0])
    x, xk, y, f, rows, truth = np.zeros(2), np.zeros(1), 0.0, 0.0, [], []
    for _ in range(256):
        x, xk = phi @ x + g * (f + 1.0), phik @ xk + gk * y
        y, f = x[1], ck[0] @ xk
        z = step @ z
        rows.append(y)
        truth.append(z[1])
    assert result == pytest.approx(np.abs(np.subtract(rows, truth)).max() / np.abs(truth).max(), rel=1e-9)


@pytest.mark.slow
def test_the_largest_stable_step_is_where_the_units_begin_to_grow(files):
    largest = mx.check_cosimulation(*files, H, masters="jacobi")["jacobi"].largest_stable_step
    assert 2 * H < largest < 100 * H
    below = mx.check_cosimulation(*files, 0.998 * largest, masters="jacobi")["jacobi"]
    above = mx.check_cosimulation(*files, 1.004 * largest, masters="jacobi")["jacobi"]
    assert below.stable
    assert below.radius < 1 < above.radius
    assert not above.passed
    assert above.difference < 1e-9  # the units are not to blame
    assert above.largest_stable_step == pytest.approx(largest, rel=2e-3)


def test_a_step_that_is_stable_again_beyond_unstable_ones_does_not_pass(files):
    """Steps much longer than all time constants see a plant at rest, whatever happens in between."""
    largest = mx.check_cosimulation(*files, H, masters="jacobi", duration=H)["jacobi"].largest_stable_step
    far = mx.check_cosimulation(*files, 300 * largest, masters="jacobi", duration=2400 * largest)["jacobi"]
    assert far.radius < 1
    assert not far.stable
    assert not far.passed
    assert far.largest_stable_step == pytest.approx(largest, rel=2e-3)


@pytest.mark.slow
def test_feedthrough_lags_a_step(tmp_path):
    """Velocity feedback with a direct part: Gauss-Seidel is of first order then."""
    masters = ("gauss-seidel", "iteration")
    result = mx.check_cosimulation(plant("velocity"), controller(-40.0, through=-40.0), H, masters=masters,
                                  duration=128 * H)  # fmt: skip
    assert result["gauss-seidel"].order == pytest.approx(1, abs=0.15)
    assert result["iteration"].order == pytest.approx(2, abs=0.15)
    assert result.passed


@pytest.mark.slow
def test_acceleration_is_measured_by_a_controller_without_feedthrough():
    result = mx.check_cosimulation(plant("acceleration"), controller(-1.0), H, masters=("jacobi", "slopes"))
    assert result.passed
    assert result["jacobi"].order == pytest.approx(1, abs=0.15)


@pytest.mark.slow
def test_without_free_inputs_states_start_at_nominal_values():
    masters = ("jacobi", "iteration")
    result = mx.check_cosimulation(plant(disturbance=False), speed_feedback(), H, masters=masters, duration=128 * H)
    assert result.excitation == {}
    assert "nominal" in str(result)
    assert result.passed
    assert result["jacobi"].order == pytest.approx(1, abs=0.15)


@pytest.mark.slow
def test_an_iteration_that_diverges_has_no_error_for_any_step():
    """H = 0.02 s is far beyond the time constants of so high a gain: the master grows 122-fold each step."""
    item = mx.check_cosimulation(plant(), controller(-3e4), 2e-2, masters="iteration", duration=0.16)["iteration"]
    assert item.steps == (2e-2, 1e-2, 5e-3)
    assert item.errors == (np.inf, np.inf, np.inf)
    assert np.isnan(item.order)
    assert not item.passed


@pytest.mark.slow
def test_a_loop_that_is_unstable_itself_is_said_so():
    result = mx.check_cosimulation(plant(), controller(400.0), H, masters="jacobi")
    assert result.growth > 0
    assert "unstable: a pole at" in str(result)


@pytest.mark.slow
def test_connections_and_excitation_by_name():
    law = controller(-40.0, inputs=("speed", "reference"), outputs=("command",))
    law.B[0, 1] = -1.0
    result = mx.check_cosimulation(
        plant("velocity"), law, H, masters="jacobi", connections={"F": "command", "controller:speed": "y"},
        excitation={"reference": 2.0},
    )  # fmt: skip
    assert result.connections == ("plant <- command as F", "controller <- y as speed")
    assert result.excitation == {"d": 0.0, "reference": 2.0}
    assert result.passed


@pytest.mark.slow
def test_the_table_and_the_figure_tell_all(check):
    text = str(check)
    assert "Co-simulation of slider and law, H = 0.0005 s, over 0.128 s" in text
    for word in ("jacobi", "gauss-seidel", "slopes", "iteration", "error at H/4", "largest stable H"):
        assert word in text
    figure = check.plot()
    figure.canvas.draw()
    assert figure.axes[0].get_xlabel() == "step [s]"
    with pytest.raises(KeyError):
        check["euler"]


@pytest.mark.slow
def test_the_stewart_platform_with_six_loops():
    """IFF: force of the spring through g / (s + a + g)."""

    legs = [f"leg{i}" for i in range(1, 7)]
    gain = GAIN + ROLL_OFF
    law = control.ss(-(gain + 120) * np.eye(6), np.eye(6), gain * np.eye(6), np.zeros((6, 6)), name="iff",
                     inputs=[f"{leg}:force" for leg in legs], outputs=[f"{leg}:f" for leg in legs])  # fmt: skip
    result = mx.check_cosimulation(stewart(ports="all").linearize(), law, 1e-5)
    assert result.growth < 0
    assert all(item.difference < 1e-9 for item in result.masters)


def test_an_output_that_cancels_to_rounding_is_no_difference():
    """The second output of the controller is 0.3 x1 - 0.1 x2 = 0 for x1' = -w x1 + 0.1 y and x2' = -w x2 + 0.3 y."""
    law = control.ss(-900.0 * np.eye(2), [[0.1], [0.3]], [[-3.6e6, 0.0], [0.3, -0.1]], np.zeros((2, 1)), inputs=["y"],
                     outputs=["F", "G"], name="law")  # fmt: skip
    result = mx.check_cosimulation(plant(), law, H, masters="jacobi", duration=20 * H)
    assert result.passed
    assert result["jacobi"].difference < 1e-9
