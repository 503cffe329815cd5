"""Stiffness that depends on frequency: factors, fits with their errors, and connections with it."""

import mpmath
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.dynamic import Dynamic
from mbsvib.errors import AccuracyWarning, ModelError
from tests.assembly.scenes import RIGID, apart
from tests.assembly.test_systems import holds_its_factors

OMEGA = np.geomspace(1.0, 2000.0, 80)


def test_a_factor_prints_itself():
    assert "loss factor 0.1" in str(mv.Dynamic.hysteretic(0.1))


def test_factors():
    s = 1j * OMEGA
    prony = Dynamic.prony([0.5, 2.0], [0.1, 1e-3])
    expected = 1.0 + 0.5 * 0.1 * s / (1 + 0.1 * s) + 2.0 * 1e-3 * s / (1 + 1e-3 * s)
    np.testing.assert_allclose(prony.factor(OMEGA), expected, rtol=1e-15)
    np.testing.assert_allclose(prony.factor(-OMEGA), expected.conj(), rtol=1e-15)
    assert prony.factor([0.0])[0] == 1.0
    hysteretic = Dynamic.hysteretic(0.1)
    np.testing.assert_array_equal(hysteretic.factor([-3.0, 0.0, 3.0]), [1 - 0.1j, 1.0, 1 + 0.1j])
    zener = Dynamic.transfer([1.5 * 0.1, 1.0], [0.1, 1.0])
    np.testing.assert_allclose(zener.factor(OMEGA), Dynamic.prony([0.5], [0.1]).factor(OMEGA), rtol=1e-14)
    np.testing.assert_allclose([zener.static, *zener.weights, *zener.times], [1.0, 0.5, 0.1], rtol=1e-14)
    damper = Dynamic.transfer([0.02, 1.0], [1.0])
    assert (damper.static, damper.viscous, len(damper.weights)) == (1.0, 0.02, 0)


def test_a_table_is_exact_at_its_points_and_warns_beyond():
    f = np.geomspace(1.0, 100.0, 9)
    factors = 1.0 + 0.2 * np.log10(f) + 0.1j * f**0.1
    table = Dynamic.table(f, factors)
    np.testing.assert_allclose(table.factor(2 * np.pi * f), factors, rtol=1e-12)
    with pytest.warns(AccuracyWarning, match="beyond its 1 to 100 Hz"):
        assert table.factor([2 * np.pi * 300.0])[0] == pytest.approx(factors[-1])
    assert not table.is_rational


# loss factor, decades, least error and error of relaxations [%], by a linear programme with 40 bins a decade
@pytest.mark.few(2)
@pytest.mark.parametrize(("loss", "decades", "least", "error"), [
    (0.1, 1, 0.28, 3.4), (0.1, 2, 2.1, 7.1), (0.1, 4, 5.4, 9.4), (0.02, 2, 0.40, 1.45), (0.3, 1, 1.1, 10.5),
])  # fmt: skip
def test_fits_state_their_error_and_the_least_one(loss, decades, least, error):
    fit = Dynamic.hysteretic(loss, (1.0, 10.0**decades))
    assert 100 * fit.least_error == pytest.approx(least, rel=0.04, abs=0.04)
    assert 100 * fit.error == pytest.approx(error, rel=0.15)
    w = 2 * np.pi * np.geomspace(1.0, 10.0**decades, 500)
    found = np.abs(fit.factor(w) / (1.0 + loss * 1j) - 1.0).max()
    assert found == pytest.approx(fit.error, rel=0.03)
    everywhere = np.geomspace(1e-6, 1e9, 200)
    assert (fit.factor(everywhere).imag >= 0.0).all()
    assert min(fit.static, fit.viscous, *fit.weights) >= 0.0
    assert fit.static >= 0.5 - 1e-12
    for static in (0.4, 0.9):
        held = Dynamic.hysteretic(loss).rational((1.0, 10.0**decades), static=static)
        assert held.factor([0.0])[0] == held.static == static


def test_a_passive_factor_has_no_least_error():
    prony = Dynamic.prony([0.5, 2.0], [0.02, 1e-3])
    fit = Dynamic.table(np.geomspace(1.0, 100.0, 60), prony.factor(2 * np.pi * np.geomspace(1.0, 100.0, 60)))
    fit = fit.rational((1.0, 100.0))
    assert fit.least_error < 2e-3
    assert fit.error < 2e-2


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("matrix", [False, True])
def test_two_masses_on_a_prony_mount(measured, matrix):
    """3 kg on 900 N/m, 2 kg behind a mount, along x and y that the stiffness couples or not; closed form."""
    parts = {}
    for name, mass in (("a", 3.0), ("b", 2.0)):
        model = mv.Model(name)
        model.add_body("m", mass, (1, 1, 1))
        model.add_joint("plane", "planar", "ground", "m", (0, 0, 0), axis=(0, 0, 1))
        model.add_port("p", "m")
        if name == "a":
            model.add_bushing("k", "ground", "m", (0, 0, 0), (900.0, 700.0, 0, 0, 0, 50.0))
        parts[name] = model.linearize()
    if measured:
        data = parts["a"].frequency_response(OMEGA)
        parts["a"] = mv.Measurement(OMEGA, data, parts["a"].outputs, parts["a"].inputs,
                                    output_units=parts["a"].output_units)  # fmt: skip
    k = np.array([[600.0, 100.0], [100.0, 400.0]]) if matrix else np.diag([600.0, 400.0])
    dynamic = Dynamic.prony([0.8, 0.3], [0.02, 1e-3])
    result = mv.assemble(parts, [("a.p", "b.p", (k, dynamic), ("x", "y"))])
    z = k * dynamic.factor(OMEGA)[:, None, None]
    mass = np.kron(np.diag([3.0, 2.0]), np.eye(2))
    base = np.zeros((4, 4))
    base[:2, :2] = np.diag([900.0, 700.0])
    stiffness = base - OMEGA[:, None, None] ** 2 * mass + np.block([[z, -z], [-z, z]])
    expected = np.linalg.inv(stiffness)[:, [2, 3]][:, :, [0, 1]].transpose(1, 2, 0)
    names = ["b.p.x", "b.p.y"], ["a.p.x", "a.p.y"]
    found = result[names].responses if measured else result[names].frequency_response(OMEGA)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    if not measured:
        holds_its_factors(result)
        assert result.massless == 4
        assert "Dynamic('prony', 2 relaxations)" in result.explain()


def test_responses_are_exact_at_the_points_of_a_table():
    """z of the table itself between two masses, one of which is given by its responses."""
    f = np.geomspace(1.0, 100.0, 30)
    omega = 2 * np.pi * f
    factors = Dynamic.prony([0.5, 0.4], [0.02, 2e-3]).factor(omega) * (1.0 + 0.01 * np.sin(7 * f))
    parts = {}
    for name, mass in (("a", 3.0), ("b", 2.0)):
        model = mv.Model(name)
        model.add_body("m", mass, (1, 1, 1))
        model.add_joint("rail", "prismatic", "ground", "m", (0, 0, 0), axis=(1, 0, 0))
        model.add_bushing("k", "ground", "m", (0, 0, 0), (900.0 * mass, 0, 0, 0, 0, 0))
        model.add_port("p", "m")
        parts[name] = model.linearize()
    data = parts["a"].frequency_response(omega)
    parts["a"] = mv.Measurement(omega, data, parts["a"].outputs, parts["a"].inputs,
                                output_units=parts["a"].output_units)  # fmt: skip
    table = Dynamic.table(f, factors)
    whole = mv.assemble(parts, [("a.p", "b.p", (np.array([[4e4]]), table), ("x",))])
    found = whole[["b.p.x"], ["a.p.x"]].responses[0, 0]
    z, a, b = 4e4 * factors, 3.0 * (900.0 - omega**2), 2.0 * (900.0 - omega**2)
    expected = z / ((a + z) * (b + z) - z**2)
    np.testing.assert_allclose(found / np.abs(expected).max(), expected / np.abs(expected).max(), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("order", [0.35, 0.7, 1.0])
def test_zener_elements_of_any_order(order):
    made = Dynamic.zener(2.5, 3e-3, order)
    with mpmath.workdps(30):
        powers = [(mpmath.mpc(0, w) * mpmath.mpf("3e-3")) ** mpmath.mpf(order) for w in OMEGA]
        expected = np.array([complex(1 + 2.5 * power / (1 + power)) for power in powers])
    np.testing.assert_allclose(made.factor(OMEGA), expected, rtol=1e-14)
    np.testing.assert_allclose(made.factor([0.0, -OMEGA[3]]), [1.0, expected[3].conj()], rtol=1e-14)
    assert made.is_rational == (order == 1.0)
    fit = made if made.is_rational else made.rational((0.5, 200.0))
    w = 2 * np.pi * np.geomspace(0.5, 200.0, 500)
    error = np.abs(fit.factor(w) / made.factor(w) - 1.0).max()
    assert error == pytest.approx(fit.error, rel=0.05, abs=1e-15)
    assert fit.least_error <= fit.error < 1e-6  # a sum of relaxations over all times has such a factor


def test_oscillators_of_ghm():
    """Each is a spring g in series with a damper 2 z g / w and an inertance g / w^2, side by side."""
    g, z, f = np.array([0.6, 1.5]), np.array([4.0, 0.8]), np.array([20.0, 300.0])
    made, w = Dynamic.ghm(g, z, f), 2 * np.pi * f
    s = 1j * OMEGA[:, None]
    beside = s * 2 * z * g / w + s**2 * g / w**2
    np.testing.assert_allclose(made.factor(OMEGA), 1.0 + (1.0 / (1.0 / g + 1.0 / beside)).sum(axis=1), rtol=1e-13)
    assert made.factor([0.0])[0] == 1.0
    assert not made.is_rational
    overdamped = Dynamic.ghm([0.6], [4.0], [20.0]).rational((0.1, 100.0))
    assert overdamped.least_error < overdamped.error < 0.02
    ringing = Dynamic.ghm([0.6], [0.1], [20.0]).rational((1.0, 100.0))
    assert ringing.error > 0.3  # no relaxation has a resonance; a passive model does
    assert ringing.least_error < 0.1 * ringing.error


def test_a_table_that_is_not_causal_is_named_with_its_distance():
    """Storage that does not rise, with a loss factor of 0.3 over two decades: 7 % away."""
    f = np.geomspace(1.0, 100.0, 60)
    flat = np.full(60, 1.0 + 0.3j)
    words = "table of 60 factors.* nearer to it than 7 % from 1 to 100 Hz.*noise of 5 %.*not causal"
    with pytest.warns(AccuracyWarning, match=words):
        fit = Dynamic.table(f, flat).rational((1.0, 100.0))
    assert fit.least_error == pytest.approx(0.072, rel=0.05)
    assert Dynamic.table(f, flat, noise=0.1).rational((1.0, 100.0)).least_error == fit.least_error


def test_force_outputs_feel_a_dynamic_mount():
    base, payload = apart()
    dynamic = Dynamic.prony([0.8], [0.01])
    connect = [(*RIGID[0][:2], ([1e5, 2e5, 3e5, 200, 300, 400.0], dynamic))]
    system = mv.assemble({"base": base, "payload": payload}, connect)
    omega = np.linspace(2.0, 300.0, 30)
    linear = base.linearize()
    data = mv.Measurement(omega, linear.frequency_response(omega), linear.outputs, linear.inputs,
                          output_units=linear.output_units)  # fmt: skip
    responses = mv.assemble({"base": data, "payload": payload}, connect)
    names = ["base.arm.force", "base.link.force", "payload.a"], ["base.F", "payload.root.y"]
    expected = responses[names].responses
    size = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(system[names].frequency_response(omega) / size, expected / size, rtol=0.0, atol=1e-10)


def test_a_delay_is_exact_in_responses_and_the_first_pade_approximation_with_states():
    """A force that is late, between a measured mass and one of a model: closed form at any delay."""
    late, k, w = Dynamic.delay(3e-3), 5e3, np.geomspace(10.0, 3000.0, 20)
    np.testing.assert_allclose(late.factor(w), np.exp(-3e-3j * w), rtol=1e-15)
    np.testing.assert_allclose(late.factor(-w), np.exp(3e-3j * w), rtol=1e-15)
    parts = {"a": mv.Measurement(w, -1.0 / (3.0 * w[None, None] ** 2), ["p.x"], ["p.x"], quantity="displacement"),
             "b": mv.System.from_matrices([[2.0]], None, [[400.0]], [1.0], [1.0], inputs=["p.x"], outputs=["p.x"])}
    found = mv.assemble(parts, [("a.p", "b.p", ([k], late))]).responses
    z = k * np.exp(-3e-3j * w)
    expected = np.linalg.inv(np.array([[z - 3.0 * w**2, -z], [-z, z + 400.0 - 2.0 * w**2]]).transpose(2, 0, 1))
    np.testing.assert_allclose(found, expected.transpose(1, 2, 0), rtol=1e-12)
    stated = late.rational((1.0, 40.0))
    x = 3e-3 * 2 * np.pi * 40.0  # the error is largest at the end of the band
    assert stated.error == pytest.approx(abs((1 - 0.5j * x) / (1 + 0.5j * x) - np.exp(-1j * x)), rel=1e-9)
    np.testing.assert_allclose(stated.factor(w), (1 - 1.5e-3j * w) / (1 + 1.5e-3j * w), rtol=1e-14)
    assert stated.least_error > stated.error  # no passive model is as near
    assert Dynamic.of_words(stated.words()) == stated


@pytest.mark.parametrize(("make", "words"), [
    (lambda: Dynamic.prony([0.5], [0.1, 0.2]), "expected as many times, above 0 s, as weights"),
    (lambda: Dynamic.prony([-0.5], [0.1]), "weights = .*expected finite numbers, 0 or more"),
    (lambda: Dynamic.hysteretic(0.1, (10.0, 1.0)), "band = .*two ascending frequencies above 0 Hz"),
    (lambda: Dynamic.table([1.0, 2.0], [1.0, 1.0 - 0.1j]),
     "factor at 2 Hz is .*take energy.*No passive model is nearer than [0-9.]+ %"),
    (lambda: Dynamic.zener(0.5, 0.1, 1.2), "order = 1.2; expected one above 0 and up to 1"),
    (lambda: Dynamic.zener(0.5, -0.1, 0.5), "times = .*0 or more"),
    (lambda: Dynamic.ghm([0.5], [0.1], [0.0]), "expected as many of each, the last two above 0"),
    (lambda: Dynamic.table([2.0, 1.0], [1.0, 1.0]), "ascending frequencies above 0 Hz with a factor each"),
    (lambda: Dynamic.transfer([1.0, 0.0, 0.0, 1.0], [1.0, 1.0]), "at most one degree more"),
    (lambda: Dynamic.transfer([1.0], [1.0, -1.0]), "pole at 1 rad/s; expected stable ones"),
    (lambda: Dynamic.transfer([1.0], [0.1, 1.0]), "imaginary part is negative"),
    (lambda: Dynamic.transfer([1.0, -1.0], [1.0, 1.0]), "it is -1 at rest; expected 0 or more"),
    (lambda: Dynamic.delay(0.0), r"time = 0.0; expected one above 0 s"),
    (lambda: Dynamic.delay(1e-3).rational((1.0, 9.0), static=0.9), "static = 0.9 of a delay of 0.001 s; expected 1"),
    (lambda: Dynamic.of_words({"delay": 1e-3}), "delay = 0.001 without weights and times"),
    (lambda: Dynamic.of_words({"weights": [-2.0], "times": [1e-3]}), "weights = .*0 or more"),
])  # fmt: skip
def test_factors_that_no_element_has_are_refused(make, words):
    with pytest.raises(ModelError, match=f"(?s){words}"):
        make()


def test_a_system_needs_states():
    base, payload = apart()
    with pytest.raises(ModelError, match=r"loss factor 0.1.*between base.tip to payload.root has no states"):
        mv.assemble({"base": base, "payload": payload}, [(*RIGID[0][:2], ([1e5] * 6, Dynamic.hysteretic(0.1)))])


@pytest.mark.parametrize("scale", [1e-3, 1e3, 2e5])
def test_tables_of_stiffnesses_are_told_from_factors(scale):
    with pytest.warns(AccuracyWarning, match="factor at 2 Hz is .*divide stiffnesses"):
        Dynamic.table([2.0, 3.0], [1.2 * scale, 1.3 * scale])
