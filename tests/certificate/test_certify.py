"""Certificates: each check with its value against one from elsewhere, passed, failed and skipped."""

import importlib.util
import json
import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.certificate import certifying, restated
from mbsvib.certificate.radius import half_last_digit
from mbsvib.certificate.restated import difference, factor
from tests.equations.test_alignment import four_bar

KEYS = {"verdict", "equilibrium.residual", "rank.margin", "accuracy.radius", "units.invariance", "engine", "skipped",
        "versions"}  # fmt: skip


def slider(mass=2.0, stiffness=4.7e3):
    model = mv.Model("slider")
    model.add_body("m", mass, (0.1, 0.1, 0.1))
    model.add_joint("rail", "prismatic", "ground", "m", axis=(1, 0, 0))
    model.add_spring("k", "ground", "m", (-1, 0, 0), (0, 0, 0), stiffness)
    model.add_output("x", "m", "x")
    return model


def value(certificate, name):
    return next(check for check in certificate.checks if check.name == name)


@pytest.mark.parametrize(("number", "half"), [
    (2.0, 0.5), (200.0, 0.5), (0.35, 0.005), (-0.35, 0.005), (4.7e3, 0.5), (1e-3, 5e-4), (1.25e-7, 5e-10), (0.0, 0.0),
    (1 / 3, 0.5 * np.spacing(1 / 3)), (np.pi, 0.5 * np.spacing(np.pi))])  # fmt: skip
def test_half_a_unit_in_the_last_printed_digit(number, half):
    assert half_last_digit(number) == pytest.approx(half, rel=1e-15)


def test_the_radius_of_an_oscillator_is_that_of_the_closed_form():
    """omega^2 = k / m: half of dk / k + dm / m, with k = 4700 +- 0.5 and m = 2.25 +- 0.005."""
    certificate = mv.certify(slider(2.25))
    radius = value(certificate, "accuracy.radius").value
    assert radius == pytest.approx(0.5 * (0.5 / 4700 + 0.005 / 2.25), rel=1e-9)
    details = certificate.content()["accuracy"]
    assert details["parameter"] == "m.mass"
    assert details["rounding"] == pytest.approx(0.5 * np.finfo(float).eps, rel=1e-9)


def test_the_radius_covers_what_the_last_digits_do():
    """Eigenvalues of models with random last digits stay within it, but for second order."""
    rng, model = np.random.default_rng(0), slider(2.25, 4712.3)
    radius = value(mv.certify(model), "accuracy.radius").value
    nominal = model.linearize().modes().eigenvalues
    for _ in range(20):
        moved = {name: number + half_last_digit(number) * rng.uniform(-1, 1)
                 for name, number in model.parameters.items() if number and "inertia" not in name}  # fmt: skip
        off = np.abs(model.with_values(moved).linearize().modes().eigenvalues - nominal).max() / np.abs(nominal[0])
        assert off <= radius * (1.0 + 2.0 * radius)


@pytest.mark.parametrize("name", ["stewart_isolator", "quarter_car", "inclined_chain", "four_bar", "engine_on_mounts"])
def test_models_of_the_library_pass(name, tmp_path):
    certificate = mv.certify(getattr(mv.library, name)())
    content = json.loads(certificate.to_json(tmp_path / "certificate.json").read_text())
    assert certificate.passed
    assert content["verdict"] == "passed"
    assert set(content) >= KEYS
    assert content["units.invariance"] < 1e-12
    assert content["equilibrium"]["residual"] == content["equilibrium.residual"] <= 1e-9
    assert f"Certificate of {certificate.name}: passed" in str(certificate)


@pytest.mark.skipif(importlib.util.find_spec("exudyn") is None, reason="needs exudyn")
def test_another_engine_finds_the_same_eigenvalues():
    certificate = mv.certify(mv.library.stewart_isolator())
    assert certificate.engine == "exudyn"
    assert value(certificate, "engine.difference").value < 1e-9
    assert "exudyn" in certificate.versions


def test_an_engine_that_finds_others_fails_it(monkeypatch):
    def wrong(model):
        return (1.0 + 1e-4) * np.asarray(model.linearize().modes().eigenvalues), "0"

    monkeypatch.setattr(certifying, "by_exudyn", wrong)
    certificate = mv.certify(slider())
    assert not certificate.passed
    assert value(certificate, "engine.difference").value == pytest.approx(1e-4, rel=1e-6)


def test_what_depends_on_units_fails_it(monkeypatch):
    monkeypatch.setitem(restated.SCALES, "N", 1.001)
    certificate = mv.certify(slider())
    assert certificate.content()["failed"] == ["units.invariance"]


def test_a_pose_off_balance_fails_with_the_words_of_the_refusal():
    certificate = mv.certify(mv.library.four_bar().with_values({"coupler.mass": 3.0}))
    assert certificate.verdict == "failed"
    assert "unbalanced moment on body 'coupler'" in value(certificate, "equilibrium.residual").words
    assert set(certificate.skipped) >= {"rank.margin", "accuracy.radius", "units.invariance"}


def test_a_loop_that_an_angle_locks_fails_and_passes_aligned():
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the certificate has them
        certificate = mv.certify(four_bar(1e-4))
        aligned = mv.certify(four_bar(1e-4), align=1e-3)
    assert certificate.content()["failed"] == ["rank.margin"]
    assert "align=" in value(certificate, "rank.margin").words
    assert aligned.passed


def test_units_are_products_of_powers():
    assert factor("kg m^2") == pytest.approx(1e9)
    assert factor("N m s/rad") == pytest.approx(1e6)
    assert factor("m/s^2") == pytest.approx(1e-3)
    assert factor("-") == 1.0
    with pytest.raises(KeyError):
        factor("bar")


def test_differences_of_eigenvalues_do_not_depend_on_their_order():
    one = np.array([1j, -1j, 2j, -2j, 0, 0])
    assert difference(one[::-1], one) == 0.0
    assert difference(one * (1 + 1e-6), one) == pytest.approx(1e-6)
    assert difference(one[:4], one) == np.inf


def test_what_is_no_model_is_refused():
    with pytest.raises(mv.ModelError, match="certify"):
        mv.certify("stewart")
