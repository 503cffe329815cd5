"""Noise in closed loops, continuous and sampled."""

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm

import mbsvib as mv
from mbsvib import isolation
from tests.random.scenes import oscillator, two_masses

M, C, K = 2.0, 3.0, 800.0
W = 2.0 * np.pi
GAINS = np.array([[-300.0, -8.0]])


def controlled():
    """An oscillator under feedback of displacement and velocity, with noise."""
    return oscillator().linearize().feedback(GAINS, ["x", "v"], ["F"], noise=True)


def test_noise_of_sensors_and_actuators_are_inputs():
    loop = controlled()
    assert loop.inputs == ("F", "F2", "base", "x.noise", "v.noise", "F.noise")
    assert loop.input_units == ("N", "N", "m/s^2", "m", "m/s", "N")
    assert loop.outputs == ("x", "v", "a", "a_abs")
    w = np.array([3.0, 20.0, 30.0])
    g = loop.frequency_response(w, "x")[0]
    stiffness = K + 300.0 + 1j * w * (C + 8.0) - w * w * M
    for row, force in zip(g, (1.0, 1.0, -M, -300.0, -8.0, 1.0), strict=True):
        np.testing.assert_allclose(row, force / stiffness, rtol=1e-12)


def test_direct_sensors():
    """u = K (y + n) + d around a sensor of acceleration, which sees forces at once."""
    k = -0.5
    loop = oscillator().linearize().feedback([[k]], ["a"], ["F"], noise=True)
    w = np.array([5.0, 40.0])
    z = K + 1j * w * C - w * w * M
    plant = -(w**2) / z
    closed = 1.0 / (1.0 - k * plant)
    response = loop.frequency_response(w, "a", ["F", "a.noise", "F.noise"])[0]
    np.testing.assert_allclose(response, np.array([plant, plant * k, plant]) * closed, rtol=1e-12)


def test_noise_around_a_state_space_and_dynamic_controllers():
    """The same as around the system; names of a controller with states."""
    system = two_masses().linearize()
    law = mv.StateSpace.from_arrays([[-30.0]], [[1.0]], [[-500.0]], [[-20.0]], ["v2"], ["F2"])
    w = np.array([2.0, 15.0, 33.0])
    for loop in (system.feedback(law, noise=True), system.state_space().feedback(law, noise=True)):
        assert loop.inputs[-2:] == ("v2.noise", "F2.noise")
        g = system.frequency_response(w, ["x1", "v2"], ["F2"])[:, 0]
        k = -20.0 - 500.0 / (1j * w + 30.0)
        expected = g[0] * np.array([k, np.ones(3)]) / (1.0 - k * g[1])
        np.testing.assert_allclose(loop.frequency_response(w, "x1", ["v2.noise", "F2.noise"])[0], expected, rtol=1e-11)


def test_names_that_are_taken_are_refused():
    model = oscillator()
    model.add_input("x.noise", "b", "z")
    with pytest.raises(mv.ResponseError, match=r"'x\.noise', which there is already"):
        model.linearize().feedback(GAINS, ["x", "v"], ["F"], noise=True)


def test_budget_of_a_loop_in_closed_form():
    """Every source acts as a force: rms of x is sqrt(S / (4 c' k')) times its gain."""
    budget = controlled().budget({"F": 1.0, "x.noise": 1e-6, "v.noise": 1e-6, "F.noise": 4.0}, "x")
    unit = np.sqrt(1.0 / (4.0 * (C + 8.0) * (K + 300.0)))
    expected = {"F": unit, "x.noise": 300e-3 * unit, "v.noise": 8e-3 * unit, "F.noise": 2.0 * unit}
    assert {name: pytest.approx(value, rel=1e-12) for name, value in expected.items()} == budget.contributions["x"]


def periodic_variance(rate, delay, sensor, substeps=400):
    """Variance of x and v over a period under white force noise or sensor noise, by a covariance that is propagated.

    States: x, v, held force, and the force that waits for the delay.
    """
    a = np.array([[0.0, 1.0, 0.0], [-K / M, -C / M, 1.0 / M], [0.0, 0.0, 0.0]])
    h = 1.0 / rate

    def step(time):
        n = np.zeros((6, 6))
        q = np.zeros((3, 3))
        q[1, 1] = 0.0 if sensor else 1.0 / M**2
        n[:3, :3], n[:3, 3:], n[3:, 3:] = -a, q, a.T
        e = expm(n * time)
        turn = e[3:, 3:].T
        return turn, turn @ e[:3, 3:]

    def wide(matrix):
        result = np.eye(4)
        result[:3, :3] = matrix
        return result

    sample = np.eye(4)
    sample[3] = [GAINS[0, 0], GAINS[0, 1], 0.0, 0.0]
    act = np.eye(4)
    act[2] = [0.0, 0.0, 0.0, 1.0]
    noise = np.zeros((4, 4))
    if sensor:
        noise[3, 3] = GAINS[0, 0] ** 2 * rate  # variance S rate / 2 with S = 2
    p = np.zeros((4, 4))
    parts = [(delay, round(substeps * delay / h)), (h - delay, round(substeps * (h - delay) / h))]
    moves = [[np.asarray(part) for part in step(time / max(1, count))] for time, count in parts]
    for period in range(4000):
        p = sample @ p @ sample.T + noise
        means, before = np.zeros(2), p.copy()
        for (turn, added), (time, count), event in zip(moves, parts, (None, act), strict=True):
            if event is not None:
                p = event @ p @ event.T
            values = [np.diag(p)[:2]]
            for _ in range(count):
                p = wide(turn) @ p @ wide(turn).T
                p[:3, :3] += added
                values.append(np.diag(p)[:2])
            if count:  # Simpson's rule
                weight = np.array([1.0, *[4.0, 2.0] * (count // 2 - 1), 4.0, 1.0]) / 3.0 * time / count
                means = means + weight @ np.array(values)
        if period > 20 and np.allclose(sample @ p @ sample.T + noise, before, rtol=1e-13, atol=0.0):
            break
    return means / h


@pytest.mark.slow
@pytest.mark.parametrize("sensor", [False, True])
@pytest.mark.parametrize("delay", [0.0, 2e-3])
def test_sampled_loops_between_samples(sensor, delay):
    loop = controlled().sampled(100.0, delay)
    rms = loop.rms(["x", "v"], {"x.noise" if sensor else "F": 2.0})
    np.testing.assert_allclose(list(rms.values()), np.sqrt(periodic_variance(100.0, delay, sensor)), rtol=1e-7)


def test_sampled_budgets_tend_to_continuous_ones():
    noise = {"F": 1.0, "x.noise": isolation.shaped([W * 20.0], [1.0, W * 20.0], 1e-8),
             "F.noise": isolation.shaped([30.0], [1.0, 30.0])}  # fmt: skip
    loop = controlled()
    slow, fast, limit = (each.budget(noise, ["x", "v"]) for each in (loop.sampled(200.0), loop.sampled(2e4), loop))
    for name in ("x", "v"):
        for source, value in limit.contributions[name].items():
            np.testing.assert_allclose(fast.contributions[name][source], value, rtol=1e-3)
            assert abs(slow.contributions[name][source] / value - 1.0) > 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("source", "density"), [("F", 1.0), ("x.noise", 1.0), ("x.noise", [(0.1, 1.0), (150.0, 1.0)]),
                                                 ("x.noise", isolation.shaped([900.0], [1.0, 900.0]))])  # fmt: skip
def test_sampled_densities_add_up_to_the_mean_square(source, density):
    """Two ways with nothing in common: integrals of what sampling folds, and covariances from sample to sample."""
    loop = controlled().sampled(60.0, 3e-3)
    whole = loop.rms("x", {source: density})["x"]
    np.testing.assert_allclose(loop.rms("x", {source: density}, band=(0.0, 900.0))["x"], whole, rtol=2e-8)


def test_filtered_noise_of_sensors_is_folded():
    """Sum over k of 1 / (1 + (f + k rate)^2 / corner^2) times the density of white noise, in closed form."""
    loop, corner, rate, f = controlled().sampled(60.0), 900.0 / W, 60.0, np.array([2.0, 20.0])
    white, shaped = (loop.psd("x", {"x.noise": density}, f)[0] for density in
                     (1.0, isolation.shaped([900.0], [1.0, 900.0])))  # fmt: skip
    wide = W * corner / rate
    folds = 0.5 * wide * np.sinh(wide) / (np.cosh(wide) - np.cos(W * f / rate))
    np.testing.assert_allclose(shaped / white, folds, rtol=1e-12)


def by_folds(f, rate, density, count):
    """Density of x at frequencies (n,) [Hz]: noise of a force at f + k rate comes out at f by the samples alone."""
    z = np.exp(1j * W * f / rate)
    a = np.array([[0.0, 1.0], [-K / M, -C / M]])
    e = expm(a / rate)
    held = np.linalg.solve(a, (e - np.eye(2)) @ np.array([0.0, 1.0 / M]))
    folds, result = np.arange(-count, count + 1), []
    for at, zi in zip(f, z, strict=True):
        gain = 1.0 / (1.0 - GAINS[0] @ np.linalg.solve(zi * np.eye(2) - e, held))
        w = W * (at + folds * rate)
        compliance = 1.0 / (K + 1j * w * C - w * w * M)
        demanded = gain * (GAINS[0, 0] + 1j * w * GAINS[0, 1]) * compliance
        wi = W * at
        out = (1.0 - 1.0 / zi) / (1j * wi / rate) / (K + 1j * wi * C - wi * wi * M)
        shown = np.where(folds == 0, compliance + out * demanded, out * demanded)
        result.append((np.abs(shown) ** 2 * density(np.abs(w) / W)).sum())
    return np.array(result)


def test_sampled_density_against_a_sum_over_folds():
    f = np.array([2.0, 40.0])
    got = controlled().sampled(60.0).psd("x", {"F": 1.0}, f)[0]
    np.testing.assert_allclose(got, by_folds(f, 60.0, np.ones_like, 2000), rtol=2e-5)


@pytest.mark.parametrize("rate", [60.0, 5e3])
def test_sampled_density_of_an_output_that_sees_forces_at_once(rate):
    """That of the acceleration is (2 pi f)^4 times that of the displacement, and 1 / M^2 towards high frequencies."""
    f = np.array([2.0, 40.0, 1e3])
    loop = controlled().sampled(rate)
    x, a = loop.psd(["x", "a"], {"F": 1.0}, f)
    np.testing.assert_allclose(a, (W * f) ** 4 * x, rtol=1e-9)
    assert a[-1] == pytest.approx(1.0 / M**2, rel=0.05)


def test_densities_far_below_the_rate_keep_their_digits():
    """A mass m held by u = -k x - d v at its samples; in 40 digits, with z = exp(i w T) and h the component of a hold:

    S = |(1 + h u) / (m w^2)|^2 + |h / (m w^2)|^2 (E|u|^2 - |u|^2); at 1e-3 Hz it was wrong by a factor of 2.3.
    """
    m, k, d, rate = 2.0, 3e3, 160.0, 1e3
    plant = mv.System.from_matrices([[m]], None, [[0.0]], [[1.0]], Cq=[[1.0], [0.0]], Cv=[[0.0], [1.0]])
    loop = plant.feedback([[-k, -d]], plant.outputs, plant.inputs).sampled(rate)
    f = np.array([1e-5, 1e-3, 10.0, 400.0])
    expected = []
    with mp.workdps(40):
        t, row = mp.mpf(1) / rate, mp.matrix([[-k, -d]])
        a, noise = mp.matrix([[1, t], [0, 1]]), mp.matrix([[t**3 / 3, t**2 / 2], [t**2 / 2, t]]) / m**2
        for w in (2 * mp.pi * mp.mpf(x) for x in f.tolist()):
            z, s = mp.exp(1j * w * t), 1j * w
            reached = row * mp.inverse(z * mp.eye(2) - a - mp.matrix([[t**2 / 2], [t]]) / m * row)
            pushed = mp.matrix([[(z - 1) / s**2 - t / s], [(z - 1) / s]]) / m
            u, hold = (reached * pushed)[0], (1 - 1 / z) / (s * t)
            folded = (reached * noise * reached.H)[0].real / rate - abs(u) ** 2
            expected.append(float((abs(1 + hold * u) ** 2 + abs(hold) ** 2 * folded) / (m * w**2) ** 2))
    np.testing.assert_allclose(loop.psd("y1", {"u1": 1.0}, f)[0], expected, rtol=1e-14)


@pytest.mark.parametrize("given", [{"band": (1.0, 50.0)}, None])
def test_white_noise_that_is_sampled_at_once_has_no_density(given):
    """It was a finite number that depended on rounding; without a band the rms is infinite."""
    loop = oscillator().linearize().feedback([[-0.5]], ["a"], ["F"]).sampled(200.0)
    assert loop.rms("x", {"F": 1.0}) == {"x": np.inf}
    with pytest.raises(mv.ResponseError, match=r"samples what white noise acts on at once, .* table: F"):
        loop.psd("x", {"F": 1.0}, [1.0]) if given is None else loop.rms("x", {"F": 1.0}, **given)


LATE = 4e-3  # s


def delayed(f):
    """A source that repeats the other one later."""
    turn = np.exp(2j * np.pi * np.asarray(f) * LATE)
    return np.moveaxis(np.array([[np.ones_like(turn), turn], [turn.conj(), np.ones_like(turn)]]), -1, 0)


@pytest.mark.slow
def test_forces_that_repeat_each_other_in_sampled_loops():
    """Two forces of a table on one mass, the second late: 4 cos^2(pi f late) times the density of one."""
    f, table = np.array([2.0, 25.0, 70.0]), [(0.1, 1.0), (150.0, 1.0)]
    loop = controlled().sampled(60.0)
    got = loop.psd("x", {"F": table, "F2": table}, f, correlation=delayed)[0]

    def density(at):
        return np.where((at >= 0.1) & (at <= 150.0), 4.0 * np.cos(np.pi * at * LATE) ** 2, 0.0)

    np.testing.assert_allclose(got, by_folds(f, 60.0, density, 10), rtol=1e-10)


@pytest.mark.slow
def test_mean_squares_of_correlated_tables_in_sampled_loops():
    loop, table = controlled().sampled(60.0, 3e-3), [(0.1, 1.0), (90.0, 1.0)]
    noise = {"F": table, "F2": table}
    budget = loop.budget(noise, "x", correlation=delayed)
    by_band = loop.budget(noise, "x", correlation=delayed, band=(0.0, 250.0))
    for source, value in by_band.contributions["x"].items():
        np.testing.assert_allclose(budget.contributions["x"][source], value, rtol=1e-5)
    total = sum(np.sign(value) * value**2 for value in budget.contributions["x"].values())
    np.testing.assert_allclose(budget.rms["x"] ** 2, total, rtol=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("r", [1.0, -1.0, 0.3])
def test_correlated_white_noise_in_sampled_loops(r):
    """Forces on one mass have the density 2 + 2 r of one of them; sensors that agree are one with the sum of gains."""
    loop = controlled().sampled(60.0, 3e-3)
    alone = loop.rms("x", {"F": 1.0})["x"]
    matrix = [[1.0, r], [r, 1.0]]
    got = loop.rms("x", {"F": 1.0, "F2": 1.0}, correlation=matrix)["x"]
    np.testing.assert_allclose(got, alone * np.sqrt(2.0 + 2.0 * r), rtol=1e-10, atol=1e-8 * alone)
    f = np.array([40.0])
    by_one, by_both = loop.psd("x", {"F": 1.0}, f), loop.psd("x", {"F": 1.0, "F2": 1.0}, f, correlation=matrix)
    np.testing.assert_allclose(by_both, (2.0 + 2.0 * r) * by_one, rtol=1e-10, atol=1e-12 * by_one.max())
    parts = loop.budget({"x.noise": 1.0, "v.noise": 4.0}, "x", correlation=matrix).contributions["x"]
    one, two = (abs(gain) * np.sqrt(density) * loop.rms("x", {"x.noise": 1.0})["x"] / 300.0
                for gain, density in zip(GAINS[0], (1.0, 4.0), strict=True))  # fmt: skip
    np.testing.assert_allclose([parts["x.noise"], parts["v.noise"]], [one, two], rtol=1e-10)
    np.testing.assert_allclose(parts["correlation"] * abs(parts["correlation"]), 2.0 * r * one * two, rtol=1e-9)


@pytest.mark.slow
def test_tables_in_sampled_loops():
    """A table that ends beyond the rate: mean powers of single frequencies, and densities of what is folded."""
    loop, table = controlled().sampled(60.0, 3e-3), {"F": [(0.1, 1.0), (150.0, 1.0)]}
    whole = loop.rms("x", table)["x"]
    np.testing.assert_allclose(loop.rms("x", table, band=(0.0, 900.0))["x"], whole, rtol=2e-8)
    assert 0.9 < whole / loop.rms("x", {"F": 1.0})["x"] < 1.0


@pytest.mark.slow
def test_sampled_outputs_behind_filters():
    """A filter behind the loop, and the same one as weighting; of a table and of white noise."""
    loop, weight = controlled().sampled(60.0), isolation.shaped([12.0], [1.0, 12.0])
    for noise in ({"F": 1.0}, {"F": [(0.5, 1.0), (40.0, 1.0)]}):
        by_band = loop.rms("v", noise, band=(0.0, 400.0), weighting=weight)["v"]
        np.testing.assert_allclose(loop.rms("v", noise, weighting=weight)["v"], by_band, rtol=1e-5)


def test_what_sampling_meets_directly_is_infinite():
    """White noise that a sensor sees at once, which no filter takes before it is sampled."""
    loop = oscillator().linearize().feedback([[-0.1]], ["a"], ["F"], noise=True).sampled(100.0)
    budget = loop.budget({"F2": 1.0, "a.noise": 1.0}, "x")
    assert budget.contributions["x"]["F2"] == np.inf
    assert 0.0 < budget.contributions["x"]["a.noise"] < np.inf


@pytest.mark.parametrize(("noise", "settings", "words"), [
    ({"F": lambda f: 1.0 / (1.0 + f)}, {}, "as a table"),
    ({"F": 1.0, "F2": 1.0}, {"correlation": delayed}, "all tables, or white noise behind like filters"),
    ({"F": 1.0, "x.noise": 1.0}, {"correlation": [[1.0, 0.5], [0.5, 1.0]]}, "its sensors is a sequence"),
    ({"F": 1.0}, {"weighting": isolation.moving_average(0.1)}, "rational weighting"),
])  # fmt: skip
def test_refusals_of_sampled_loops(noise, settings, words):
    with pytest.raises(mv.ResponseError, match=words):
        controlled().sampled(100.0).rms("x", noise, **settings)
    with pytest.raises(mv.ResponseError, match=words):
        controlled().sampled(100.0).psd("x", noise, [1.0, 70.0], **settings)
    with pytest.raises(mv.ResponseError, match="expected no band"):
        controlled().sampled(100.0).budget({"F": 1.0}, "x", band=(1.0, 9.0)).sensitivities()


def test_sampled_densities_have_cumulative_values():
    """Sampled loops have no continuous equations that these could ask for."""
    budget = controlled().sampled(60.0).budget({"F": 1.0}, "x", band=(0.5, 40.0))
    np.testing.assert_allclose(budget.cumulative([40.0])[0], budget.rms["x"], rtol=1e-10)


@pytest.mark.slow
def test_sampling_folds_a_wide_table_as_white_noise():
    """A table that is constant up to ten times the rate, beyond which a mass hardly moves."""
    loop, f = controlled().sampled(60.0, 3e-3), np.array([0.7, 3.3, 29.0, 41.0])
    table, white = (loop.psd("x", {"F": density}, f) for density in ([(1e-3, 2.0), (600.0, 2.0)], 2.0))
    np.testing.assert_allclose(table, white, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e5])
def test_undamped_modes_beside_sampled_loops_in_any_unit_of_time(unit):
    """A mode that the loop does not reach has poles on the axis but for rounding, which grows with the frequency."""
    def loop(damping):
        c, k = np.diag([0.4, damping]) * unit, np.diag([9.0, 16.0]) * unit**2
        system = mv.System.from_matrices(np.eye(2), c, k, B=[[1.0, 1.0], [0.0, 1.0]], Cq=[[1.0, 0.0], [1.0, 1.0]],
                                         inputs=["F", "G"], outputs=["x", "y"])  # fmt: skip
        return system.feedback([[-2.0 * unit**2]], ["x"], ["F"], noise=True).sampled(10.0 * unit)

    first = 4.0 * unit / W
    for band, infinite in (((0.1 * first, 2.0 * first), True), ((0.1 * first, 0.9 * first), False),
                           ((1.1 * first, 2.0 * first), False)):  # fmt: skip
        budget = loop(0.0).budget({"F": 1.0, "G": 1.0}, band=band)
        assert (budget.contributions["y"]["G"] == np.inf) is infinite
        assert budget.contributions["y"]["F"] < np.inf
        assert budget.contributions["x"]["G"] < np.inf
    light = loop(1e-6).budget({"G": 1.0}, "y", band=(0.9 * first, 1.1 * first)).rms["y"]
    assert light * unit**1.5 == pytest.approx(np.sqrt(1.0 / (4.0 * 1e-6 * 16.0)), rel=1e-2)


def test_a_sampled_loop_says_which_noise_an_integrator_adds_up():
    """Proportional to q and integral of v, both measured: noise of v runs the integrator away, that of q does not; and
    a white force does, as the trapezoids of samples miss h^3 / 12 of the variance of the way in between.
    """
    mass, kq, ki, kp, rate = 2.0, 400.0, 300.0, 40.0, 50.0
    model = mv.Model("axis")
    model.add_body("mass", mass, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    model.add_input("F", "mass", "x")
    model.add_input("push", "mass", "x")
    model.add_output("q", "mass", "x")
    model.add_output("v", "mass", "x", quantity="velocity")
    controller = mv.StateSpace.from_arrays([[0.0]], [[0.0, 1.0]], [[-ki]], [[-kq, -kp]], ["q", "v"], ["F"])
    loop = model.linearize().feedback(controller, noise=True).sampled(rate)
    budget = loop.budget({"q.noise": 1e-8, "v.noise": 1e-6}, ["q"])
    assert "q is infinite: the noise of v.noise drives controller away" in str(budget)
    assert np.isfinite(budget.contributions["q"]["q.noise"])
    assert "the noise of push drives controller away" in str(loop.budget({"push": 1.0}, ["q"]))
    f = np.array([1e-4, 1e-3])
    drift = 2.0 * 0.5 / rate**2 / 12.0 / mass**2 * (ki / (ki + kq)) ** 2 / (W * f) ** 2
    np.testing.assert_allclose(loop.psd("q", {"push": 1.0}, f)[0], drift, rtol=1e-3)


@pytest.mark.slow
def test_densities_of_correlated_noise_of_sensors():
    """Two sensors whose noises are sequences act as one with a sum of gains."""
    loop, f, (k, c), r = controlled().sampled(60.0, 3e-3), np.array([0.7, 29.0, 40.0]), GAINS[0], 0.3
    one = loop.psd("x", {"x.noise": 1.0}, f)
    both = loop.psd("x", {"x.noise": 1.0, "v.noise": 4.0}, f, correlation=[[1.0, r], [r, 1.0]])
    np.testing.assert_allclose(both, one * (k**2 + 4.0 * c**2 + 2.0 * r * k * 2.0 * c) / k**2, rtol=1e-10)


def test_modes_that_the_loop_does_not_reach_do_not_hide_each_other():
    """Two undamped oscillators beside a sampled loop: each output is infinite under noise of its own oscillator."""
    system = mv.System.from_matrices(np.eye(3), np.diag([0.4, 0.0, 0.0]), np.diag([9.0, 16.0, 25.0]), B=np.eye(3),
                                     inputs=["F", "G", "H"], outputs=["x", "y", "z"])  # fmt: skip
    loop = system.feedback([[-2.0]], ["x"], ["F"], noise=True).sampled(10.0)
    parts = loop.budget({"F": 1.0, "G": 1.0, "H": 1.0}).contributions
    for output, source in (("x", "F"), ("y", "G"), ("z", "H")):
        assert [name for name in "FGH" if parts[output][name] != 0.0] == [source]
        assert (parts[output][source] == np.inf) is (source != "F")


def test_a_pole_that_rounding_hides_beside_fast_ones_is_not_called_undamped():
    """A belt drive under PD control with a lag of 0.1 ns: a damping ratio of 0.7 % beside 1e10 1/s was lost."""
    k, c, r, big, tau = 4e5, 20.0, 0.02, 0.2, 1e-10
    tie = np.array([[r * r, -r * big], [-r * big, big * big]])
    plant = mv.System.from_matrices(np.diag([5e-5, 0.8]), c * tie, k * tie, B=[[1.0], [0.0]], Cq=np.eye(2),
                                    inputs=["T"], outputs=["q", "Q"])  # fmt: skip
    law = mv.StateSpace.from_arrays([[-1 / tau]], [[1 / tau]], [[100 / tau]], [[-1e4 - 100 / tau]], ["q"], ["T"])
    with pytest.raises(mv.ResponseError, match=r"rounding leaves open whether .* decays, beside poles of up to 1e\+10"):
        plant.feedback(law).rms("Q", {"T": 1e-6})
