"""Densities and weightings of standards against what these print."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation
from mbsvib.random.curves import VC, centres, edges, strictest
from tests.random.scenes import oscillator

W = 2.0 * np.pi


def test_peterson_models():
    """Density of the acceleration [dB] at periods, from table 3 and figure 14 of the report."""
    low, high = isolation.seismic_spectrum("NLNM"), isolation.seismic_spectrum("NHNM")
    for model, period, level in ((low, 0.17, -166.7), (low, 4.3, -141.1), (low, 101.0, -185.0), (low, 600.0, -184.4),
                                 (low, 0.1, -168.0), (high, 0.1, -91.5), (high, 0.32, -110.5), (high, 4.6, -96.5),
                                 (high, 6.3, -101.0), (high, 20.0, -138.5), (high, 354.8, -126.0)):  # fmt: skip
        np.testing.assert_allclose(10.0 * np.log10(model.at(np.array([1.0 / period]))), level, atol=0.05)
    f = np.array([0.3])
    for order, quantity in enumerate(("displacement", "velocity", "acceleration")):
        model = isolation.seismic_spectrum("NLNM", quantity)
        np.testing.assert_allclose(model.at(f) * (W * f) ** (2 * (2 - order)), low.at(f), rtol=1e-12)
        assert model.unit == ("m", "m/s", "m/s^2")[order]


def test_one_third_octaves():
    """Nominal centre frequencies are these rounded; three bands are an octave of base ten, edges lie between."""
    nominal = [1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8, 10, 12.5, 16, 20, 25, 31.5, 40, 50, 63, 80]
    np.testing.assert_allclose(centres(), nominal, rtol=0.012)
    np.testing.assert_allclose(centres(3.15, 12.5), nominal[5:12], rtol=0.012)
    np.testing.assert_allclose(centres()[[0, 10]], [1.0, 10.0], rtol=1e-14)
    middle = centres(4.0, 16.0)
    np.testing.assert_allclose(edges(middle)[1:-1], np.sqrt(middle[1:] * middle[:-1]), rtol=1e-14)
    np.testing.assert_allclose(edges(middle)[[0, -1]] * edges(middle)[[1, -2]], middle[[0, -1]] ** 2, rtol=1e-14)


def test_vibration_criteria_as_printed():
    """Velocities [um/s] of the standard's table; A and B are lines of 1/f below 8 Hz."""
    for name, level in zip(VC, (50, 25, 12.5, 6.25, 3.12, 1.56, 0.78), strict=True):
        relaxed = name in ("VC-A", "VC-B")
        np.testing.assert_allclose(isolation.vc_curve(name, [4.0, 8.0, 80.0]) * 1e6,
                                   np.array([2.0 if relaxed else 1.0, 1.0, 1.0]) * level)  # fmt: skip
    middle = centres()
    for velocity, name in ((0.7e-6, "VC-G"), (3e-6, "VC-E"), (20e-6, "VC-B"), (51e-6, "")):
        assert strictest(middle, np.full(len(middle), velocity)) == name
    low = isolation.vc_spectrum("VC-C")
    np.testing.assert_allclose(low.frequencies, [10.0**-0.05, 10.0**1.95], rtol=0.02)
    for quantity, order in (("acceleration", 1), ("displacement", -1)):
        there = isolation.vc_spectrum("VC-C", quantity)
        np.testing.assert_allclose(there.at(np.array([7.0])), (W * 7.0) ** (2 * order) * isolation.vc_spectrum(
            "VC-C", "velocity").at(np.array([7.0])), rtol=1e-12)  # fmt: skip


@pytest.mark.parametrize("name", VC)
def test_vibration_criteria_are_met_in_every_third_octave(name):
    """The rms velocity in each band by an integral of the density is the criterion."""
    density, middle = isolation.vc_spectrum(name, "velocity"), centres()
    limits = edges(middle)
    node, weight = np.polynomial.legendre.leggauss(20)
    for k, f in enumerate(middle):
        half = 0.5 * (limits[k + 1] - limits[k])
        square = half * weight @ density.at(0.5 * (limits[k + 1] + limits[k]) + half * node * (1.0 - 1e-12))
        if name in ("VC-A", "VC-B") and f < 8.5:  # lines of constant acceleration are curved within a band
            np.testing.assert_allclose(np.sqrt(square), isolation.vc_curve(name, [f]), rtol=0.03)
        else:
            np.testing.assert_allclose(np.sqrt(square), isolation.vc_curve(name, [f]), rtol=1e-9)


def test_roads():
    """Class C at 20 m/s: 256e-6 m^3 at 0.1 cycles/m, which is 2 Hz, falls with the square of the frequency."""
    road = isolation.road_spectrum("C", 20.0)
    np.testing.assert_allclose(road.at(np.array([2.0, 4.0])), np.array([256e-6, 64e-6]) / 20.0, rtol=1e-12)
    np.testing.assert_allclose(road.frequencies, [0.22, 56.6])
    np.testing.assert_allclose(isolation.road_spectrum("C", 20.0, "velocity").at(np.array([1.0, 7.0])),
                               256e-6 / 20.0 * (2.0 * W) ** 2, rtol=1e-12)  # fmt: skip


@pytest.mark.parametrize(("name", "factors"), [
    ("Wk", {0.5: 418, 1.0: 482, 2.0: 531, 3.15: 804, 4.0: 967, 5.0: 1039, 6.3: 1054, 8.0: 1036, 12.5: 902, 31.5: 405,
            80.0: 132}),
    ("Wd", {0.5: 853, 1.0: 1011, 1.6: 968, 2.0: 890, 4.0: 512, 8.0: 253, 16.0: 125, 31.5: 63.2, 80.0: 21.0}),
])  # fmt: skip
def test_frequency_weightings(name, factors):
    """Factors times 1000 of table 3 of ISO 2631-1, to the digits printed there."""
    weighting = isolation.iso_2631(name)
    f = np.array(list(factors))
    np.testing.assert_allclose(1000.0 * np.abs(weighting.response(1j * W * f)), list(factors.values()), rtol=0.004)
    at_reference = {"Wk": 0.7718, "Wd": 0.1261}[name]  # of ISO 8041, at 100 rad/s
    np.testing.assert_allclose(np.abs(weighting.response(np.array([100j]))), at_reference, atol=5e-5)


def test_weightings_of_accelerations_are_refused_for_other_outputs():
    """Their filters are taken for any output."""
    system, noise = oscillator().linearize(), {"base": 1e-3}
    with pytest.raises(mv.ResponseError, match=r"'Wd': the output 'x' is in m, .*isolation.iso_2631\('Wd'\)"):
        system.rms(["a_abs", "x"], noise, weighting="Wd")
    assert system.rms("a_abs", noise, weighting="Wd").keys() == {"a_abs"}  # x is not asked for
    assert system.rms("x", noise, weighting=isolation.iso_2631("Wd"))["x"] > 0.0


def test_weighted_vibration():
    """The weighting acts on the density, of outputs that it names alone."""
    system, f = oscillator().linearize(), np.array([1.0, 5.0, 20.0])
    plain, weighted = (system.psd(None, {"base": 1e-3}, f, weighting=w) for w in (None, {"a_abs": "Wk"}))
    gain = np.abs(isolation.iso_2631("Wk").response(1j * W * f)) ** 2
    for name, before, after in zip(system.outputs, plain, weighted, strict=True):
        np.testing.assert_allclose(after, before * (gain if name == "a_abs" else 1.0), rtol=1e-12)


def test_gains_of_averages_keep_their_digits_at_low_frequencies():
    """1 - sinc^2(pi f T) in 40 digits, on both sides of where a series takes over."""
    import mpmath

    turns = np.array([1e-9, 1e-3, 0.03, 0.0499, 0.0501, 0.3, 2.0])
    f = turns / (0.8 * np.pi)
    with mpmath.workdps(40):
        exact = [1 - mpmath.sinc(mpmath.pi * mpmath.mpf(x) * mpmath.mpf(0.8)) ** 2 for x in f.tolist()]
    within, mean = (average(0.8)(f) ** 2 for average in (isolation.moving_deviation, isolation.moving_average))
    np.testing.assert_allclose(within, [float(value) for value in exact], rtol=1e-12)
    np.testing.assert_allclose(mean, [float(1 - value) for value in exact], rtol=1e-14)


@pytest.mark.parametrize("time", [1e-5, 0.02, 0.7, 30.0])
def test_averages_over_a_time(time):
    """Of a first-order process with R(t) = exp(-a t) / 2 a: mean 2 (x - 1 + exp(-x)) / x^2 of the variance, x = a T."""
    import mpmath

    a = 3.0
    space, noise = mv.StateSpace.from_arrays([[-a]], [[1.0]], [[1.0]], 0), {"u1": 2.0}
    mean = space.rms("y1", noise, weighting=isolation.moving_average(time))["y1"]
    within = space.rms("y1", noise, weighting=isolation.moving_deviation(time))["y1"]
    with mpmath.workdps(40):
        x = mpmath.mpf(a) * mpmath.mpf(time)
        share = 2 * (x - 1 + mpmath.exp(-x)) / x**2
        expected = [mpmath.sqrt(part / (2 * mpmath.mpf(a))) for part in (share, 1 - share)]
    np.testing.assert_allclose([mean, within], [float(value) for value in expected], rtol=1e-12)
    table = [(0.1, 1.0), (8.0, 0.3)]
    parts = [space.rms("y1", {"u1": table}, weighting=w)["y1"] for w in (
        isolation.moving_average(time), isolation.moving_deviation(time), None)]  # fmt: skip
    np.testing.assert_allclose(np.hypot(*parts[:2]), parts[2], rtol=1e-12)


def test_averages_under_a_table_beside_white_noise():
    """Integrals end with the table, however far the noise extends that has exact moments."""
    system, weighting = oscillator().linearize(), isolation.moving_average(0.1)
    noise = {"F": 1.0, "base": [(0.5, 0.2), (40.0, 0.1)]}
    alone = [system.rms("x", {name: value}, weighting=weighting)["x"] for name, value in noise.items()]
    np.testing.assert_allclose(system.rms("x", noise, weighting=weighting)["x"], np.hypot(*alone), rtol=1e-13)


def test_displacements_in_space_from_accelerations():
    """A mass of which the base shakes: |(k + i w c) / (k + i w c - w^2 m)|^2 S / w^4."""
    m, k, c = 2.0, 800.0, 3.0
    budget = oscillator(m, k, c).linearize().budget({"base": [(1.0, 1e-4), (100.0, 1e-4)]}, "a_abs",
                                                    weighting=isolation.integrated(2))  # fmt: skip
    f = np.geomspace(1.0, 100.0, 400_001)
    force = k + 1j * W * f * c
    density = np.abs(force / (force - (W * f) ** 2 * m)) ** 2 * 1e-4 / (W * f) ** 4
    np.testing.assert_allclose(budget.rms["a_abs"], np.sqrt(np.trapezoid(density, f)), rtol=1e-8)
    assert budget.units["a_abs"] == "m"
    white = oscillator(m, k, c).linearize().rms("a_abs", {"base": 1e-4}, weighting=isolation.integrated(1))
    assert white["a_abs"] == np.inf  # of the base itself


@pytest.mark.parametrize(("call", "words"), [
    (lambda: isolation.vc_spectrum("VC-Z"), "VC-A"),
    (lambda: isolation.vc_spectrum("VC-A", "jerk"), "quantity"),
    (lambda: isolation.seismic_spectrum("NLN"), "NLNM"),
    *[(lambda bad=bad: isolation.road_spectrum("C", bad), "road_spectrum: speed = .*a speed")
      for bad in (0.0, -2.0, np.inf, np.nan, "fast")],
    *[(lambda bad=bad: isolation.moving_average(bad), "moving_average: time") for bad in (0.0, np.inf)],
    (lambda: isolation.integrated(3), "times"),
    (lambda: oscillator().linearize().rms("a", {"F": 1.0}, weighting=isolation.moving_average(0.1)), "acts directly"),
    (lambda: oscillator().linearize().rms("x", {"F": lambda f: 1.0 + 0.0 * f},
                                          weighting=isolation.moving_average(0.1)), "last frequency"),
])  # fmt: skip
def test_refusals(call, words):
    with pytest.raises(mv.MbsvibError, match=words):
        call()


def test_weightings_may_name_outputs_that_are_not_asked_for():
    system, noise = oscillator().linearize(), {"base": [(0.5, 1e-3), (80.0, 1e-3)]}
    weighting = {"a_abs": "Wk", "x": isolation.shaped([5.0], [1.0, 5.0])}
    every = system.rms(None, noise, weighting=weighting)
    for name, value in every.items():
        np.testing.assert_allclose(system.rms(name, noise, weighting=weighting)[name], value, rtol=1e-13)
    with pytest.raises(mv.ResponseError, match="'y'"):
        system.rms("x", noise, weighting={"y": "Wk"})


def test_correlation_by_a_function_of_one_frequency():
    """What reads like the formula is taken as well as one of arrays."""
    def delayed(f):
        turn = np.exp(2j * np.pi * f * 0.02)
        return np.array([[1.0, turn], [np.conj(turn), 1.0]])

    def of_arrays(f):
        return np.array([delayed(one) for one in f])

    system, noise = oscillator().linearize(), {"F": [(1.0, 1.0), (30.0, 0.1)], "base": [(1.0, 0.1), (30.0, 0.2)]}
    one, many = (system.budget(noise, "x", correlation=r).contributions["x"] for r in (delayed, of_arrays))
    assert one == many
    assert one["correlation"] != 0.0
    with pytest.raises(mv.ResponseError, match=r"function fails at .* Hz"):
        system.rms("x", noise, correlation=lambda f: [[1.0], [1.0, 2.0]])


@pytest.mark.parametrize(("first", "last"), [(0.015, 0.018), (3.0, 3.4), (40.0, 52.0)])
def test_a_table_as_weighting_is_integrated_between_its_points(first, last):
    """A gain of 1 in a narrow band, far from the resonance or at it, is that band; as a function it is nearly so."""
    system, noise = oscillator().linearize(), {"F": 0.3}
    band = system.rms(None, noise, band=(first, last))
    table = system.budget(noise, weighting=[(first, 1.0), (last, 1.0)])
    function = system.budget(noise, weighting=lambda f: 1.0 * ((f >= first) & (f <= last)))
    assert table.error == 0.0
    assert table.weighting["x"] == "table"
    for name, value in band.items():
        np.testing.assert_allclose(table.rms[name], value, rtol=1e-12)
        np.testing.assert_allclose(function.rms[name], value, rtol=1e-6)
