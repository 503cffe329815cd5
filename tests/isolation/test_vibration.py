"""Root mean squares under base noise: closed forms, moments against integrals, octaves and criteria."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib.random import curves
from tests.isolation.scenes import FREQUENCY, MASS, OMEGA, RATIO, active_strut, one_axis, two_masses

EVER = (0.0, 1e14)


def test_white_base_acceleration_in_closed_form():
    level = 2.5e-4
    result = isolation.study(one_axis(), "payload", directions="z").under({"z": level})
    exact = math.pi / 2 * FREQUENCY * level * (1 + 4 * RATIO**2) / (2 * RATIO)
    assert result.exact
    assert result.acceleration[2] ** 2 == pytest.approx(exact, rel=1e-12)
    # relative motion: S0 / (4 (2 pi)^3 ... ), one-sided over Hz
    stroke = level / (8 * RATIO * OMEGA**3)
    assert result.stroke["mount"] ** 2 == pytest.approx(stroke, rel=1e-12)
    assert result.force["mount"] == pytest.approx(MASS * result.acceleration[2], rel=1e-12)


@pytest.mark.few(1)
@pytest.mark.parametrize("ratio", [1e-5, 0.03, 0.7, 3.0])
def test_moments_and_integrals_agree(ratio):
    study = isolation.study(one_axis(ratio), "payload", directions="z")
    for spectrum in (1e-3, isolation.shaped([1.0, 0.0], [1.0, 20.0, 900.0], 3e-4), isolation.shaped([5], [1, 5])):
        exact, total = study.under({"z": spectrum}), study.under({"z": spectrum}, band=EVER)
        assert exact.exact
        assert not total.exact
        assert total.acceleration[2] == pytest.approx(exact.acceleration[2], rel=1e-10)
        assert total.stroke["mount"] == pytest.approx(exact.stroke["mount"], rel=1e-10)


def test_correlated_directions_of_a_platform():
    study = isolation.study(library.cubic_hexapod(), "platform")
    c = np.array([[1, 0.4, 0], [0.4, 1, -0.3], [0, -0.3, 1]])
    spectra = {"x y": 1e-5, "rx": 2e-6}
    first, second = study.under(spectra, c), study.under(spectra, c, band=EVER)
    assert np.allclose(first.acceleration[[0, 1, 3]], second.acceleration[[0, 1, 3]], rtol=1e-10, atol=0)
    assert np.allclose(list(first.stroke.values()), list(second.stroke.values()), rtol=1e-10, atol=0)
    assert not np.allclose(list(first.stroke.values()), list(study.under(spectra).stroke.values()), rtol=1e-3)


def test_correlated_directions_of_different_shapes():
    """The cross spectrum is 0.5 sqrt(Sx Sy), which no filter has: an integral over the logarithm of frequency."""
    study = isolation.study(library.cubic_hexapod(damping=300.0), "platform", frequencies=[1.0, 10.0])
    result = study.under({"x": 1e-5, "y": isolation.shaped([5], [1, 5])}, [[1, 0.5], [0.5, 1]])
    assert not result.exact
    ends = np.linspace(np.log(1e-9), np.log(1e7), 300)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    half = 0.5 * np.diff(ends)[:, None]
    omega = np.exp(ends[:-1, None] + half * (1.0 + nodes)).ravel()
    x, y = study.linear["leg1.k.stroke", ["base.x", "base.y"]].frequency_response(omega)[0]
    sx, sy = 1e-5, 25.0 / (25.0 + omega**2)
    density = np.abs(x) ** 2 * sx + np.abs(y) ** 2 * sy + (x.conj() * y).real * np.sqrt(sx * sy)
    expected = density * omega / (2 * np.pi) @ (half * weights).ravel()
    assert result.stroke["leg1.k"] ** 2 == pytest.approx(expected, rel=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("phase", [np.exp(0.7j), -1.0, 1.0])
def test_directions_of_one_source_add_as_amplitudes(phase):
    """x is the source times a phase, y the source times 2, whose density is 1e-4 f / 5 from 5 to 500 Hz."""
    model = library.cubic_hexapod()
    model = model.with_values({f"leg{i}.k.damping": 300.0 * (i + 1) for i in range(1, 7)})
    study = isolation.study(model, "platform", frequencies=[1.0, 10.0])
    spectra = {"x": [(5.0, 1e-4), (500.0, 1e-2)], "y": [(5.0, 4e-4), (500.0, 4e-2)]}
    result = study.under(spectra, [[1, phase], [np.conj(phase), 1]])
    x, y = (study.linear.inputs.index(f"base.{d}") for d in "xy")
    f, weights = np.polynomial.legendre.leggauss(400)
    f, weights = 252.5 + 247.5 * f, 247.5 * weights
    g = study.linear.frequency_response(2 * np.pi * f)
    density = np.abs(g[:, x] * phase + 2 * g[:, y]) ** 2 * 1e-4 * f / 5
    for leg, stroke in result.stroke.items():
        expected = density[study.linear.outputs.index(f"{leg}.stroke")] @ weights
        assert stroke**2 == pytest.approx(expected, rel=1e-8, abs=0)
    rows = [study.linear.outputs.index(f"acceleration.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    np.testing.assert_allclose(result.density(f), density[rows], rtol=1e-9, atol=1e-12 * density[rows].max())


@pytest.mark.slow
def test_moments_of_correlated_white_noise_in_closed_form():
    """The mean square of a sum: a S_x + b S_y + 2 c R sqrt(S_x S_y), with a, b and c from three other cases."""
    study = isolation.study(library.cubic_hexapod(), "platform")
    own = [study.under({d: 1e-5}).stroke["leg1.k"] ** 2 for d in "xy"]
    both = study.under({"x": 1e-5, "y": 1e-5}, [[1, 1], [1, 1]]).stroke["leg1.k"] ** 2
    cross = (both - own[0] - own[1]) / 2
    assert abs(cross) > 0.05 * both
    for r, sx, sy in ((0.5, 1e-5, 1e-5), (-0.3, 4e-5, 1e-5), (-1.0, 1e-5, 9e-5)):
        result = study.under({"x": sx, "y": sy}, [[1, r], [r, 1]])
        expected = (own[0] * sx + own[1] * sy + 2 * r * cross * np.sqrt(sx * sy)) / 1e-5
        assert result.exact
        assert result.stroke["leg1.k"] ** 2 == pytest.approx(expected, rel=1e-9)


def test_tables_are_straight_on_log_axes():
    table = isolation.table([(1.0, 1e-6), (10.0, 1e-4), (1000.0, 1e-4)])
    assert np.allclose(table.at(np.array([1.0, 2.0, 10.0, 55.0, 1000.0])), [1e-6, 4e-6, 1e-4, 1e-4, 1e-4], rtol=1e-12)
    assert not table.at(np.array([0.99, 1001.0])).any()
    # far below the resonance the payload moves as the base: integral of f^2 1e-6 from 1 to 10
    study = isolation.study(one_axis(frequency=1e7), "payload", directions="z", frequencies=[1.0])
    result = study.under({"z": [(1.0, 1e-6), (10.0, 1e-4)]})
    assert result.acceleration[2] ** 2 == pytest.approx(1e-6 * 999 / 3, rel=1e-10)
    half = result.cumulative([0.5, 5.0, 10.0, 20.0])[2]
    assert np.allclose(half**2, [0, 1e-6 * 124 / 3, 1e-6 * 999 / 3, 1e-6 * 999 / 3], rtol=1e-10)


@pytest.mark.parametrize("spectrum", [2.5e-4, [(0.01, 2.5e-4), (1e4, 2.5e-4)]])
def test_cumulative_and_density_in_closed_form(spectrum):
    """|T|^2 = (1 + (2 z r)^2) / ((1 - r^2)^2 + (2 z r)^2) of a mass on a spring, r = f / f0, summed by quadrature."""
    result = isolation.study(one_axis(), "payload", directions="z").under({"z": spectrum})

    def density(f):
        r = f / FREQUENCY
        return 2.5e-4 * (1 + (2 * RATIO * r) ** 2) / ((1 - r * r) ** 2 + (2 * RATIO * r) ** 2)

    f = np.array([0.3, 0.9, 1.1, 30.0]) * FREQUENCY
    np.testing.assert_allclose(result.density(f)[2], density(f), rtol=1e-12)
    np.testing.assert_allclose(result.density()[2], density(result.study.frequencies), rtol=1e-12)
    np.testing.assert_array_equal(result.cumulative(), result.cumulative(result.study.frequencies))
    start = 0.0 if isinstance(spectrum, float) else 0.01
    expected = [quad(density, start, top, points=[FREQUENCY] if top > FREQUENCY else None, epsabs=0, limit=200)[0]
                for top in f]  # fmt: skip
    np.testing.assert_allclose(result.cumulative(f)[2] ** 2, expected, rtol=1e-8)


def test_cumulative_ends_at_the_whole():
    study = isolation.study(library.stewart(), "platform")
    result = study.under({"x y z": [(1, 1e-6), (100, 1e-4), (2000, 1e-5)], "rz": [(10, 1e-5), (3000, 1e-5)]})
    total = result.cumulative(np.geomspace(1.0, 1e4, 300))
    assert (np.diff(total, axis=1) >= 0).all()
    assert np.allclose(total[:, -1], result.acceleration, rtol=1e-12, atol=0)


def test_tables_and_white_noise_together():
    study = isolation.study(library.cubic_hexapod(), "platform", frequencies=[1.0])
    table = [(5.0, 1e-4), (50.0, 1e-3)]
    both, first, second = (study.under(s) for s in ({"x": table, "z": 1e-5}, {"x": table}, {"z": 1e-5}))
    assert np.allclose(both.acceleration**2, first.acceleration**2 + second.acceleration**2, rtol=1e-12)
    rows = {row[0]: row[-2:] for row in both.table()["rows"]}
    for leg, stroke in both.stroke.items():
        assert rows[leg] == (f"{1e6 * stroke:.4g}", f"{both.force[leg]:.4g}")


def test_noise_through_masses_has_no_mean_square():
    result = isolation.study(library.stewart(), "platform", frequencies=[1.0]).under({"z": 1e-6})
    assert result.acceleration[2] == math.inf
    assert all(0 < value < math.inf for value in result.stroke.values())
    assert "give a band" in str(result)


def test_white_noise_across_what_symmetry_parts_is_rounding():
    """Three legs in a ring: x shakes no y, and what rounding leaves of it came through at once, without mean square."""
    model = mv.Model("table")
    model.add_body("top", 25.0, (0.8, 0.9, 1.5), position=(0, 0, 0.4))
    for i, angle in enumerate(np.deg2rad([0.0, 120.0, 240.0])):
        end = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.3])
        for name, along in (("v", np.array([0, 0, 1.0])), ("h", np.array([-np.sin(angle), np.cos(angle), 0]))):
            model.add_spring(f"{name}{i}", "ground", "top", start=end - 0.2 * along, end=end, stiffness=2e4, damping=20)
    for direction in ("x", "y", "z"):
        result = isolation.study(model, "top").under({direction: 1e-6}).acceleration
        assert result.max() < 0.1
        assert sorted(result)[-3] < 1e-12 * result.max()


def test_octaves_of_a_stiff_mount():
    # density f^2: velocity density is constant, (2 pi)^-2 1e-10
    study = isolation.study(one_axis(frequency=1e7), "payload", directions="z", frequencies=[1.0])
    result = study.under({"z": [(0.5, 0.25e-10), (200.0, 4e-6)]})
    middle = curves.centres()
    width = middle * (10**0.05 - 10**-0.05)
    assert len(middle) == 20
    assert np.allclose(result.velocity()[2], np.sqrt(width * 1e-10) / (2 * np.pi), rtol=1e-9)
    full = np.sqrt((result.velocity()[2] ** 2).sum())
    assert full == pytest.approx(math.sqrt(1e-10 * (10**1.95 - 10**-0.05)) / (2 * np.pi), rel=1e-9)
    assert result.criterion == "VC-C"  # 6.83 um/s at 80 Hz
    assert "VC-C" in str(result)


@pytest.mark.parametrize("band", [(5.3, 9.1), (1.0, 80.0), (2.0, 2.1), (0.2, 3.0), (75.0, 300.0)])
def test_octaves_that_a_band_cuts(band):
    """The velocity's density is constant: what is left of each third counts by its width."""
    study = isolation.study(one_axis(frequency=1e7), "payload", directions="z", frequencies=[1.0])
    result = study.under({"z": [(0.1, 1e-12), (400.0, 1.6e-5)]}, band=band)
    ends = np.clip(curves.edges(curves.centres()), *band)
    assert np.allclose(result.velocity()[2] ** 2, np.diff(ends) * 1e-10 / (2 * np.pi) ** 2, rtol=1e-9, atol=1e-30)
    low, high = max(band[0], 1.0), min(band[1], 80.0)
    assert f"from {low:g} to {high:g} Hz" in str(result)


@pytest.mark.parametrize("spectrum", [1e-4, isolation.shaped([1.0, 0.0], [1.0, 20.0, 900.0], 3e-4)])
@pytest.mark.parametrize("scene", [lambda: one_axis(0.0), lambda: two_masses(c1=0.0, c2=0.0)])
def test_noise_on_modes_without_damping_has_no_mean_square(scene, spectrum):
    """A mode is two states, of which noise drives one and outputs show the other."""
    result = isolation.study(scene(), "payload", directions="z").under({"z": spectrum})
    assert result.acceleration[2] == math.inf
    assert set(result.stroke.values()) == {math.inf}


def test_criteria_of_a_band_that_they_are_not_for():
    study = isolation.study(one_axis(), "payload", directions="z", frequencies=[1.0])
    result = study.under({"z": 1e-12}, band=(100.0, 200.0))
    assert not result.velocity().any()
    assert result.criterion == ""
    assert "not in the band" in str(result)


def test_noise_through_small_masses_is_no_rounding():
    """Legs of some micrograms carry 1e-8 of the floor's acceleration through at once."""
    result = isolation.study(library.stewart(part_mass=1e-8), "platform", frequencies=[1.0])
    assert result.under({"z": 1e-6}).acceleration[2] == math.inf
    assert 1e-8 < result.plateau < 1e-7


@pytest.mark.slow
def test_rms_of_a_sampled_loop_far_above_its_rate():
    """Poles repeat at multiples of the rate, and what is late goes round: against a fine even grid."""
    plant = isolation.actuated(active_strut(damping=60.0), "payload", "leg", directions="z")
    loop = plant.with_gains(isolation.velocity_feedback(plant, 900.0)).sampled(120.0, delay=0.004)
    assert loop.stable
    result = loop.isolation([1.0]).under({"z": 1e-4}, band=(1.0, 500.0))
    f = np.linspace(1.0, 500.0, 20_001)
    density = result.density(f)[2]
    assert result.acceleration[2] ** 2 == pytest.approx(np.trapezoid(density, f), rel=1e-6)
    own = 1e-4 * np.abs(loop.isolation(f).transmissibility[2, 0]) ** 2  # without what sampling folds
    assert (density > own).all()
    assert 1.05 < np.trapezoid(density, f) / np.trapezoid(own, f) < 1.1


def test_criteria():
    assert isolation.vc_curve("VC-A", [1, 4, 8, 80]).tolist() == pytest.approx([400e-6, 100e-6, 50e-6, 50e-6])
    assert isolation.vc_curve("VC-B", [4, 8]).tolist() == pytest.approx([50e-6, 25e-6])
    values = [isolation.vc_curve(f"VC-{letter}", 2.0).item() for letter in "CDEFG"]
    assert values == [12.5e-6, 6.25e-6, 3.12e-6, 1.56e-6, 0.78e-6]
    with pytest.raises(mv.ModelError, match=r"vc_curve: name = 'VC-Z'; expected 'VC-A', .*'VC-G'\. Did you mean"):
        isolation.vc_curve("VC-Z", 1.0)
    with pytest.raises(mv.ResponseError, match="expected frequencies"):
        isolation.vc_curve("VC-A", "low")


def test_undamped_mode_in_the_band_is_refused():
    study = isolation.study(one_axis(0.0), "payload", directions="z", frequencies=[1.0])
    with pytest.raises(mv.ResponseError, match=r"the mode of 'one axis' at 5 Hz is not damped"):
        study.under({"z": [(1, 1e-6), (10, 1e-6)]})
    assert study.under({"z": [(6, 1e-6), (10, 1e-6)]}).acceleration[2] > 0


@pytest.mark.parametrize(
    ("spectra", "message"),
    [
        ({"z": [(1, 1e-6), (10, -1e-6)]}, "density at 10 Hz is -1e-06"),
        ({"z": [(10, 1e-6), (1, 1e-6)]}, "point 2 is at 1 Hz"),
        ({"z": [(0, 1e-6), (1, 1e-6)]}, "point 1 is at 0 Hz"),
        ({"z": [(1, 1e-6)]}, "at least two pairs"),
        ({"z": "loud"}, "a number .white noise."),
        ({"z": -1.0}, "no less than 0"),
        ({"up": 1.0}, "no direction 'up'"),
        ({"z": 1.0, "x z": 2.0}, "two spectra"),
        ({}, "a density for each direction"),
    ],
)
def test_spectra_are_checked(spectra, message):
    study = isolation.study(library.cubic_hexapod(), "platform", frequencies=[1.0])
    with pytest.raises(mv.ResponseError, match=message):
        study.under(spectra)


def test_other_mistakes():
    study = isolation.study(library.cubic_hexapod(), "platform", frequencies=[1.0])
    with pytest.raises(mv.ResponseError, match="not that of any noise"):
        study.under({"x y": 1.0}, [[1, 2], [2, 1]])
    with pytest.raises(mv.ResponseError, match=r"expected \(2, 2\)"):
        study.under({"x y": 1.0}, np.eye(3))
    with pytest.raises(mv.ResponseError, match="two finite frequencies"):
        study.under({"x": 1.0}, band=(10.0, 1.0))
    with pytest.raises(mv.ResponseError, match="not stable"):
        isolation.shaped([1], [1, -1])
    for poles in ((-1, 2j, -2j), (-0.5, -1, -2, -3, 7j, -7j)):  # on the imaginary axis but for rounding
        with pytest.raises(mv.ResponseError, match="not stable"):
            isolation.shaped([1], np.poly(poles).real)
    for numerator in ("abc", [1j], [[1.0, 2.0], [3.0, 4.0]]):
        with pytest.raises(mv.ResponseError, match=r"numerator .*; expected"):
            isolation.shaped(numerator, [1, 2, 3])
    with pytest.raises(mv.ResponseError, match="correlation = 'no'; expected a matrix"):
        study.under({"x": 1.0}, "no")
    with pytest.raises(mv.ResponseError, match="must be proper"):
        isolation.shaped([1, 0, 0], [1, 1])


def test_csv(tmp_path):
    study = isolation.study(library.stewart(), "platform")
    result = study.under({"x": [(1, 1e-6), (1e4, 1e-6)]})
    lines = result.to_csv(tmp_path / "rms.csv").read_text().splitlines()
    assert len(lines) == 1 + len(study.frequencies)
    assert float(lines[-1].split(",")[7]) == pytest.approx(result.acceleration[0], rel=1e-12)


def test_what_stands_still_by_symmetry_is_0_in_the_table():
    shaken = isolation.study(mv.library.cubic_hexapod(damping=2.0), "platform").under({"x": 1e-6})
    cells = {row[0]: row[1] for row in shaken.table()["rows"][:6]}
    assert float(cells.pop("platform x")) == pytest.approx(shaken.acceleration[0], rel=1e-3)
    assert set(cells.values()) == {"0"}
