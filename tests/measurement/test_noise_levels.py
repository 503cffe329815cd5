"""What neighbouring lines tell of sample variances: noise that is drawn, so that its variance is known."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.measurement.noise_levels import shrunk

F = np.linspace(5.0, 50.0, 600)
# two sharp resonances
H = 1.0 / (1.0 - (F / 16.0) ** 2 + 0.01j) + 0.3 / (1.0 - (F / 37.0) ** 2 + 0.005j)
HUM = np.where(np.arange(len(F)) % 10 == 3, 400.0, 1.0)


def drawn(power, averages, seed=0):
    """Sample variances (1, 1, n) of the mean of some averages, whose noise has a power."""
    freedom = averages - 1
    return np.random.default_rng(seed).gamma(freedom, power / freedom).reshape(1, 1, -1)


@pytest.mark.parametrize(("power", "off"), [
    (np.ones(len(F)), 0.1), (np.abs(H) ** 2, 0.1), (0.1 + np.abs(H) ** 2, 0.1), (np.where(F > 27.0, 100.0, 1.0), 0.25),
])  # fmt: skip
@pytest.mark.parametrize("averages", [3, 6])
def test_noise_that_changes_slowly_or_with_the_response(power, off, averages):
    """The variances that count are near the true ones, where the drawn ones are ten times too small at some lines."""
    variance = drawn(power, averages)
    found = shrunk(variance, H.reshape(1, 1, -1), averages - 1.0)[0, 0] / power
    assert (variance[0, 0] / power).min() < 0.2
    assert np.median(found) == pytest.approx(1.0, abs=0.2)
    assert np.std(np.log(found)) < off + 0.2


def test_lines_of_much_noise_stay_so_and_do_not_count_for_others():
    found = shrunk(drawn(HUM, 8), H.reshape(1, 1, -1), 7.0)[0, 0]
    assert found[HUM > 1.0].min() > 50.0
    assert np.median(found[HUM == 1.0]) == pytest.approx(1.3, abs=0.3)


def test_another_unit_changes_nothing():
    variance = drawn(np.abs(H) ** 2, 4)
    ours = shrunk(variance, H.reshape(1, 1, -1), 3.0)
    theirs = shrunk(2.0**-60 * variance, 2.0**-30 * H.reshape(1, 1, -1), 3.0)
    np.testing.assert_allclose(theirs, 2.0**-60 * ours, rtol=1e-12)


def test_smoothed_variances_follow_sharp_resonances():
    """Means over lines alone were 30 times too small at the peaks."""
    power = np.abs(H) ** 2
    data = mv.Measurement(2 * np.pi * F, H.reshape(1, 1, -1), ["y"], ["u"], variance=drawn(power, 4), averages=4)
    ratio = data.smoothed().variance[0, 0] / power
    assert 0.4 < ratio.min() < ratio.max() < 2.5


def test_coherence_tells_the_variance_without_bias():
    """Of three averages of an impact, against the noise that was drawn; it was a third too small."""
    rng = np.random.default_rng(1)

    def normal(*shape):
        return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2.0)

    lines, m, sd = 4000, 3, 0.1
    x = np.exp(2j * np.pi * rng.random((m, lines)))
    y = 2.0 * x + sd * normal(m, lines)
    cross, powers = (y * x.conj()).sum(axis=0), (np.abs(x) ** 2).sum(axis=0) * (np.abs(y) ** 2).sum(axis=0)
    data = mv.Measurement(np.arange(1.0, lines + 1.0), (cross / m)[None, None], ["y"], ["u"], averages=m,
                          coherence=(np.abs(cross) ** 2 / powers)[None, None])  # fmt: skip
    assert data.variance.mean() == pytest.approx(sd**2 / m, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("averages", [3, 5])
@pytest.mark.parametrize("noise", ["even", "with the response"])
@pytest.mark.parametrize("smooth", [False, True])
def test_intervals_of_fits_hold_the_values(averages, noise, smooth):
    """Of 40 measurements, some 95 % of the intervals do, and no structure is called wrong.

    With variances as they were, 4 of 5 measurements of five averages were called wrong, and means over lines gave
    intervals of which 60 % held the value.
    """
    def machine(k1=2e4, k2=1e4, c1=4.0, c2=2.0):
        model = mv.Model("two")
        for name, mass, z in (("a", 1.0, 0.0), ("b", 0.5, 1.0)):
            model.add_body(name, mass, (1, 1, 1), (0, 0, z))
            model.add_joint(f"{name}.slide", "prismatic", "ground", name, (0, 0, z), axis=(0, 0, 1))
            model.add_output(f"{name}.z", name, "z")
        model.add_spring("s1", "ground", "a", (0, 0, -1), (0, 0, 0), k1, c1)
        model.add_spring("s2", "a", "b", (0, 0, 0), (0, 0, 1), k2, c2)
        model.add_input("F", "a", "z")
        return model

    names, w = ["s1.stiffness", "s2.stiffness", "s1.damping", "s2.damping"], 2 * np.pi * np.linspace(5.0, 50.0, 120)
    truth = machine()
    g, right = truth.linearize().frequency_response(w), [truth.parameters[name] for name in names]
    sd = 0.05 * np.abs(g) if noise != "even" else 0.02 * np.median(np.abs(g)) * np.ones(g.shape)
    held = passed = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        each = g + sd * (rng.standard_normal((averages, *g.shape)) + 1j * rng.standard_normal((averages, *g.shape)))
        data = mv.Measurement(w, each.mean(axis=0), ["a.z", "b.z"], ["F"], averages=averages,
                              variance=each.var(axis=0, ddof=1) / averages)  # fmt: skip
        fit = machine(2.2e4, 0.95e4, 5.0, 1.5).fit(data.smoothed() if smooth else data, names)
        held += sum(low <= value <= high for value, (low, high) in zip(right, fit.intervals.values(), strict=True))
        passed += fit.residual_test.passed
    assert held >= 160 * 0.95 - 3 * np.sqrt(160 * 0.95 * 0.05) * 1.5
    assert passed >= 38
