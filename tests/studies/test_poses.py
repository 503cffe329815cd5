"""Studies over poses: joint coordinates as variables, against the closed form of a planar arm of two links."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from mbsvib.errors import ModelError
from mbsvib.studies.design import design
from mbsvib.studies.evaluation import DesignPoint
from mbsvib.studies.plants import Systems

MASSES, ARMS, LENGTH, MOMENTS, STIFFNESS = (3.0, 2.0), (0.4, 0.3), 0.8, (0.2, 0.1), (50.0, 20.0)
ELBOW, MASS = "elbow.rz", "lower.mass"
ANGLES = np.array([-1.0, 0.0, 1.5])


def arm():
    """Two links in the plane, straight as described, torsion springs at both joints."""
    model = mv.Model("arm")
    model.add_body("upper", MASSES[0], (1.0, 1.0, MOMENTS[0]), (ARMS[0], 0, 0))
    model.add_body("lower", MASSES[1], (1.0, 1.0, MOMENTS[1]), (LENGTH + ARMS[1], 0, 0))
    for name, ends, place, stiffness in zip(("shoulder", "elbow"), (("ground", "upper"), ("upper", "lower")),
                                            (0.0, LENGTH), STIFFNESS, strict=True):  # fmt: skip
        model.add_joint(name, "revolute", *ends, (place, 0, 0), axis=(0, 0, 1))
        model.add_torsion_spring(f"{name}.k", *ends, (0, 0, 1), stiffness)
    model.add_input("torque", "upper", "rz")
    model.add_output("rate", "upper", "rz", quantity="velocity")
    return model


def frequencies(angle, mass=MASSES[1]):
    """f [Hz] of K x = w^2 M x, M of the elbow's angle."""
    b = mass * LENGTH * ARMS[1] * np.cos(angle)
    d = mass * ARMS[1] ** 2 + MOMENTS[1]
    a = MASSES[0] * ARMS[0] ** 2 + MOMENTS[0] + mass * LENGTH**2 + d
    squares = np.linalg.eigvals(np.linalg.solve(np.array([[a + 2 * b, d + b], [d + b, d]]), np.diag(STIFFNESS)))
    return np.sqrt(np.sort(squares)) / (2 * np.pi)


def slope(mode, angle, step=1e-3):
    return (8 * (frequencies(angle + step) - frequencies(angle - step)) - frequencies(angle + 2 * step)
            + frequencies(angle - 2 * step))[mode] / (12 * step)  # fmt: skip


def test_sweeps_and_tracks():
    """Beside a parameter, in batches, system by system, and around each system."""
    values = {ELBOW: ANGLES, MASS: [1.0, 4.0]}
    expected = np.array([frequencies(angle, mass) for angle in ANGLES for mass in values[MASS]])
    swept = mv.sweep(arm(), values, {"f": "modes.frequencies", "g": lambda system: system.modes().frequencies},
                     relaxed=True, workers=1)  # fmt: skip
    assert not swept.errors
    assert swept.units[ELBOW] == "rad"
    assert swept["f"] == pytest.approx(expected, rel=1e-12)
    assert swept["g"] == pytest.approx(expected, rel=1e-12)
    together = mv.sweep(arm(), values, "modes.frequencies", relaxed=True)
    assert together["modes.frequencies"] == pytest.approx(expected, rel=1e-12)
    around = mv.sweep(arm(), values, "modes.frequencies", relaxed=True, plant=lambda system: system["rate", "torque"])
    assert around["modes.frequencies"] == pytest.approx(expected, rel=1e-12)
    tracks = mv.track(arm(), {ELBOW: ANGLES}, relaxed=True)
    assert tracks["frequencies"] == pytest.approx(np.array([frequencies(x) for x in ANGLES]), rel=1e-12)


def test_poses_under_loads_are_computed_at_once(monkeypatch):
    """The arm hangs in the plane that gravity is normal to, so that each pose balances."""
    model = arm()
    model.gravity = (0.0, 0.0, -9.81)
    model.add_load("tip", "lower", (0.0, 0.0, -20.0), position=(LENGTH + 0.6, 0, 0))
    monkeypatch.setattr("mbsvib.equations.batch_assembly.one_by_one", None)
    swept = mv.sweep(model, {ELBOW: ANGLES}, "modes.frequencies", relaxed=True, workers=1)
    assert not swept.errors
    assert swept["modes.frequencies"] == pytest.approx(np.array([frequencies(x) for x in ANGLES]), rel=1e-12)
    system = Systems(model, design(model, {ELBOW: (-1.0, 1.0)}, relaxed=True)).compiled
    assert system is not None


def test_springs_that_a_pose_strains_have_to_balance(tmp_path):
    with pytest.warns(UserWarning, match="all 2 points failed.*EquilibriumError"):
        mv.sweep(arm(), {ELBOW: [0.5, 1.0]}, "modes.frequencies")
    file = tmp_path / "record.jsonl"
    mv.sweep(arm(), {ELBOW: [0.0]}, "modes.frequencies", file=file)
    with pytest.raises(ModelError, match="record of another study"):
        mv.sweep(arm(), {ELBOW: [0.0]}, "modes.frequencies", file=file, relaxed=True)


def test_tolerances_of_a_pose():
    """An angle that is off by 0.03 beside a mass that is off by 2 %."""
    model = arm().moved({ELBOW: 1.2}, relaxed=True)
    result = mv.tolerances(model, {ELBOW: 0.03, MASS: "2 %"}, st.frequency(1), samples=50, relaxed=True, workers=1)
    change = [slope(0, 1.2) * 0.03, (frequencies(1.2, 2.0 * 1.01) - frequencies(1.2, 2.0 * 0.99))[0] / 0.02 * 0.02]
    assert result.worst == pytest.approx([np.abs(change).sum()], rel=1e-4)
    assert result.shares[0] == pytest.approx(np.square(change) / np.square(change).sum(), rel=1e-4)
    assert result.sampled[:, 0] == pytest.approx([
        frequencies(1.2 + angle, mass)[0] for angle, mass in zip(result.sweep[ELBOW], result.sweep[MASS], strict=True)
    ], rel=1e-12)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plant", [None, lambda system, c=1.0: system.feedback([[-c]], ["rate"], ["torque"])])
def test_a_pose_is_found_by_its_frequency(plant):
    """Its derivative is that of the closed form; a quantity of one's own has it as well."""
    target = frequencies(1.0)[0]
    variables = {ELBOW: (0.3, 1.6)} | ({} if plant is None else {"c": (1e-9, 1e-3)})
    result = mv.optimize(arm(), variables, (st.frequency(1) / target - 1.0) ** 2, relaxed=True, plant=plant,
                         start={ELBOW: 0.5} | ({} if plant is None else {"c": 1e-6}))  # fmt: skip
    assert result.values[ELBOW] == pytest.approx(1.0, rel=1e-5)
    assert result.model.linearize().modes().frequencies == pytest.approx(frequencies(result.values[ELBOW]))
    assert (result.plant is None) == (plant is None)


def test_slopes_are_those_of_the_closed_form():
    variables = design(arm(), [ELBOW, MASS], relaxed=True)
    point = DesignPoint.at(Systems(arm(), variables), {ELBOW: 0.7, MASS: 2.0}, np.ones(2), np.array([1.0, 2.0]))
    expected = [slope(0, 0.7), (frequencies(0.7, 2.0 + 1e-4) - frequencies(0.7, 2.0 - 1e-4))[0] / 2e-4]
    assert st.frequency(1).at(point).slope[0] == pytest.approx(expected, rel=1e-7)
    own = st.given(lambda system, rates: (system.modes().frequencies[:1], np.full((1, len(rates)), np.nan)), "first")
    assert own.at(point).slope[0] == pytest.approx(expected, rel=1e-7)


def test_cycles_have_no_derivatives_to_poses():
    force = st.cycle("elbow.rz", ANGLES, speed=1.0).mean_square("force")
    with pytest.raises(ModelError, match=f"'{ELBOW}' displaces joints"):
        mv.optimize(arm(), {ELBOW: (0.1, 1.0)}, force, relaxed=True)
