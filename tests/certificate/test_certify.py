"""Certificates: each check with its value against one from elsewhere, passed, failed and skipped."""

import importlib.util
import json
import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.certificate import certifying, engines
from mbsvib.certificate.certifying import SCALES, difference, factor, half_last_digit
from mbsvib.equations import assembly
from mbsvib.library import bicycle
from mbsvib.sparse import choice
from tests.equations.tilted import four_bar

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
    assert half_last_digit(number) == pytest.approx(half, rel=1e-15, abs=0.0)


def test_the_radius_of_an_oscillator_is_that_of_the_closed_form():
    """omega^2 = k / m: half of dk / k + dm / m, with k = 4700 +- 0.5 and m = 2.25 +- 0.005."""
    certificate = mv.certify(slider(2.25))
    radius = value(certificate, "accuracy.radius").value
    assert radius == pytest.approx(0.5 * (0.5 / 4700 + 0.005 / 2.25), rel=1e-9)
    details = certificate.content()["accuracy"]
    assert details["parameter"] == "m.mass"
    assert value(certificate, "accuracy.radius").words.endswith("most by m.mass")
    assert value(certificate, "equilibrium.residual").words == "no gravity, load or preload"
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


@pytest.mark.few(1)
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


@pytest.mark.slow
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
    monkeypatch.setitem(SCALES, "N", 1.001)
    certificate = mv.certify(slider())
    assert certificate.content()["failed"] == ["units.invariance"]


def test_another_number_of_eigenvalues_fails_it_and_is_written(monkeypatch, tmp_path):
    """The difference is infinite, which JSON cannot say."""
    monkeypatch.setattr(certifying, "difference", lambda found, expected: np.inf)
    monkeypatch.setattr(certifying, "by_exudyn", lambda model: (np.zeros(4, dtype=complex), "0"))
    certificate = mv.certify(slider())
    content = json.loads(certificate.to_json(tmp_path / "certificate.json").read_text())
    assert content["failed"] == ["units.invariance", "engine.difference"]
    assert content["units.invariance"] is content["engine.difference"] is None


def test_the_linear_range_is_the_smallest_of_all_modes_and_outputs():
    """L (sin(t) cos(b) + (1 - cos(t)) sin(b)): the second-order part is a tenth at t = 0.2 / tan(b)."""
    model = mv.Model("pendulums")
    for name, x in (("low", 0.0), ("high", 1.0)):
        model.add_body(name, 2.0, (0.1, 0.1, 0.1), (x, 0, -0.5))
        model.add_joint(f"{name}.pin", "revolute", "ground", name, (x, 0, 0), axis=(0, 1, 0))
        model.add_torsion_spring(f"{name}.k", "ground", name, (0, 1, 0), 30.0 if name == "low" else 80.0)
    for name, body, angle in (("a", "low", 0.3), ("b", "high", 1.2), ("c", "high", 0.7)):
        model.add_output(name, body, (np.cos(angle), 0, np.sin(angle)))
    certificate = mv.certify(model)
    details = certificate.content()["linear"]
    assert value(certificate, "linear.range").value == pytest.approx(0.2 / np.tan(1.2), rel=1e-6)
    assert "in mode 2 at which the linear 'b' is 10 % off" in value(certificate, "linear.range").words
    assert (details["output"], details["unit"]) == ("b", "m")
    assert details["amplitude"] == pytest.approx(0.5 * np.cos(1.2) * 0.2 / np.tan(1.2), rel=1e-6)
    none = mv.certify(model.with_parts(outputs={}))
    assert none.skipped["linear.range"] == "no outputs"
    assert mv.certify(slider()).skipped["linear.range"] == "no output has a second-order part"


def test_models_that_are_refused_fail_by_what_is_wrong():
    """A motion without mass is none of balance or rank; a dead centre is one of rank."""
    heavy = slider()
    heavy.add_body("b", 0.0, (0, 0, 0))
    heavy.add_joint("free", "prismatic", "ground", "b", axis=(1, 0, 0))
    certificate = mv.certify(heavy)
    assert certificate.content()["failed"] == ["model"]
    assert certificate.skipped["rank.margin"] == "the model could not be linearized"
    flat = mv.Model("flat")
    for name, x in (("crank", 0.5), ("coupler", 2.0), ("rocker", 3.5)):
        flat.add_body(name, 1.0, (0.1, 0.1, 0.1), (x, 0, 0))
    for name, first, second, x in (("a", "ground", "crank", 0), ("b", "crank", "coupler", 1),
                                   ("c", "coupler", "rocker", 3), ("d", "rocker", "ground", 4)):  # fmt: skip
        flat.add_joint(name, "revolute", first, second, (x, 0, 0), axis=(0, 0, 1))
    assert mv.certify(flat).content()["failed"] == ["rank.margin"]


def test_sparse_equations_have_balance_and_ranks(monkeypatch):
    monkeypatch.setattr(choice, "MANY", 3)
    monkeypatch.setattr(assembly, "FEW", 0)
    certificate = mv.certify(mv.library.stewart_isolator())
    assert certificate.passed
    assert value(certificate, "equilibrium.residual").passed
    assert value(certificate, "rank.margin").value > 1e3
    assert set(certificate.skipped) == {"accuracy.radius", "units.invariance", "linear.range", "engine.difference",
                                        "mass.difference"}
    assert all("sparse equations" in why for why in certificate.skipped.values())


@pytest.mark.slow
def test_rolling_wheels_have_balance_ranks_digits_and_units():
    """Random changes of the last digits stay within the radius, and are of its size."""
    model = bicycle()
    certificate = mv.certify(model)
    assert certificate.passed
    assert value(certificate, "equilibrium.residual").value < 1e-14
    assert value(certificate, "rank.margin").value > 1e9
    assert certificate.content()["rank"]["joints"] == ["rear", "front"]
    assert value(certificate, "units.invariance").value < 1e-9
    assert set(certificate.skipped) == {"linear.range", "engine.difference", "mass.difference", "derivatives"}
    radius, share = value(certificate, "accuracy.radius").value, 1e-5
    nominal, rng, sizes = model.linearize().modes().eigenvalues, np.random.default_rng(0), []
    exact = [name for name in model.parameters if name.startswith(("rear_", "front_")) and "mass" not in name]
    for _ in range(4):
        moved = {name: number + share * half_last_digit(number) * rng.choice([-1.0, 1.0])
                 for name, number in model.parameters.items() if number and name not in exact}  # fmt: skip
        change = np.asarray(model.with_values(moved).linearize().modes().eigenvalues) - nominal
        moving = np.abs(nominal) > 0.0
        sizes.append(np.abs(change[moving] / nominal[moving]).max() / share)
    assert max(sizes) <= radius * 1.01
    assert max(sizes) > 0.1 * radius


def test_rolling_wheels_off_balance_fail():
    off = mv.certify(bicycle().replace("frame", position=(0.3, 0.05, 0.9)))
    assert off.content()["failed"] == ["equilibrium.residual"]


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


@pytest.mark.slow
@pytest.mark.parametrize("engine", engines.OF_TREES)
def test_mass_matrices_of_trees_are_those_of_other_engines(engine):
    pytest.importorskip(engine)
    certificate = mv.certify(mv.library.six_link())
    check = value(certificate, "mass.difference")
    assert check.passed
    assert check.value < 1e-14
    assert engine in certificate.versions
    assert certificate.content()["mass"]["engines"][engine] <= check.value
    assert "has the inertia of trees" in mv.certify(mv.library.four_bar()).skipped["mass.difference"]


@pytest.mark.slow
def test_another_mass_fails(monkeypatch):
    mass_of = engines.masses_of_tree
    pytest.importorskip("mujoco")
    monkeypatch.setattr(certifying, "masses_of_tree", lambda model: mass_of(model.with_values({"link3.mass": 1.001})))
    assert mv.certify(mv.library.six_link()).content()["failed"] == ["mass.difference"]


def test_trees_that_an_engine_refuses_are_skipped():
    """A body without mass, and a hub, which no URDF can say."""
    pytest.importorskip("mujoco")
    model = slider()
    model.add_body("flange", 0.0, (0, 0, 0), (1, 0, 0))
    model.add_joint("pin", "revolute", "m", "flange", (1, 0, 0), axis=(0, 0, 1))
    model.add_torsion_spring("hold", "m", "flange", (0, 0, 1), 5.0)
    assert mv.certify(model).skipped["mass.difference"].startswith("mujoco")
    model = mv.Model("pendulum")
    model.add_hub("hub", 5.0, (0, 0, 1))
    model.add_body("bob", 2.0, (0.3, 0.3, 0.3), (1.3, 0, 0))
    model.add_joint("hinge", "revolute", "hub", "bob", (0.4, 0, 0), axis=(0, 1, 0))
    certificate = mv.certify(model)
    assert certificate.passed
    assert "a URDF has no place for hub 'hub'" in certificate.skipped["mass.difference"]
    assert "hub" in certificate.skipped["engine.difference"]


def test_missing_engines_are_named(monkeypatch):
    monkeypatch.setattr(engines, "find_spec", lambda name: None)
    assert "neither mujoco nor pinocchio is installed" in mv.certify(mv.library.two_link()).skipped["mass.difference"]


def test_drives_are_restated_in_other_units():
    model = mv.Model("axis")
    model.add_body("screw", 2.0, (1e-3, 1e-3, 2e-4))
    model.add_body("table", 40.0, (1, 1, 1), (0, 0, 0.2))
    model.add_ball_screw("drive", "ground", "screw", "table", (0, 0, 0), (0, 0, 1), 0.01, stiffness=2e8)
    model.add_torsion_spring("motor", "ground", "screw", axis=(0, 0, 1), stiffness=5.0)
    assert mv.certify(model).content()["units.invariance"] < 1e-12
    model.add_body("idler", 1.0, (1, 1, 1))
    model.add_joint("j", "revolute", "ground", "idler", (0, 0, 0), axis=(0, 0, 1))
    model.add_coupler("tie", {"j.rz": 0.1, "drive.guide.z": 1.0})
    assert "'tie' has matrices or ratios whose units are not stated" in mv.certify(model).skipped["units.invariance"]
