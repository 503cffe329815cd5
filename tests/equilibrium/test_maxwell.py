"""Maxwell elements with a static spring under loads: that spring beside an element that gives way."""

import numpy as np
import pytest

import mbsvib as mv
from tests.equilibrium.test_moved import four_bar

G = (0.3, 0.0, -9.81)


def held(together, static=(900.0, 400.0)):
    """A four-bar linkage that two elements hold, as they are or as springs beside elements without static spring."""
    model = mv.Model("held", gravity=G)
    source, _ = four_bar()
    for body in source.bodies.values():
        model.add_body(**body.constructor_kwargs())
    for joint in source.joints.values():
        model.add_joint(**joint.constructor_kwargs())
    bodies = list(source.bodies.values())
    for i, k0 in enumerate(static):
        end = np.array(bodies[i].position)
        line = {"first": "ground", "second": bodies[i].name, "start": np.add(end, (0.2 * i, 0.05, 0.4)), "end": end}
        model.add_maxwell(f"m{i}", **line, stiffness=300.0, damping=20.0, static_stiffness=k0 if together else 0.0)
        if not together:
            model.add_spring(f"s{i}", **line, stiffness=k0)
    return model


def test_the_pose_is_that_of_springs():
    first, second = held(True).equilibrium(report=True), held(False).equilibrium(report=True)
    for name, six in second.displacements.items():
        np.testing.assert_allclose(first.displacements[name], six, atol=1e-12)
    assert max(np.abs(six).max() for six in second.displacements.values()) > 1e-3
    for i in range(2):
        assert first.model.springs[f"m{i}"].preload == pytest.approx(second.model.springs[f"s{i}"].tension, rel=1e-9)
    result, expected = (report.model.linearize() for report in (first, second))
    values = [np.sort_complex(system.modes().eigenvalues) for system in (result, expected)]
    np.testing.assert_allclose(*values, rtol=1e-9)
    assert first.model.equilibrium(report=True).iterations == 0


def test_a_mass_sags():
    model = mv.Model("mass", gravity=(0, 0, -9.81))
    model.add_body("m", 2.0, (0.01, 0.01, 0.01))
    model.add_joint("rail", "prismatic", "ground", "m", (0, 0, 0), axis=(0, 0, 1))
    model.add_maxwell("leg", "ground", "m", (0, 0, 1), (0, 0, 0), 5e3, 10.0, 1e3, preload=5.0)
    there = model.equilibrium()
    assert there.bodies["m"].position[2] == pytest.approx(-(2 * 9.81 - 5.0) / 1e3, rel=1e-12)
    assert there.springs["leg"].preload == pytest.approx(2 * 9.81, rel=1e-12)


@pytest.mark.slow
def test_files_and_parameters_keep_the_preload(tmp_path):
    there = held(True).equilibrium()
    mv.save(there, tmp_path / "there.yaml")
    assert mv.load(tmp_path / "there.yaml").springs == there.springs
    name = "m0.preload"
    system = there.linearize()
    assert there.parameters[name] == there.springs["m0"].preload
    assert there.parameters.units[name] == "N"
    sensitivities = system.eigenvalue_sensitivities(["m0.static_stiffness", "m0.damping"])
    eigenvalues = system.modes().eigenvalues
    for k, parameter in enumerate(["m0.static_stiffness", "m0.damping"]):
        value, step = there.parameters[parameter], 1e-4 * there.parameters[parameter]
        up, down = (there.with_values({parameter: value + sign * step}).linearize().modes().eigenvalues
                    for sign in (1, -1))  # fmt: skip
        np.testing.assert_allclose(sensitivities[k], (up - down) / (2 * step),
                                   atol=1e-6 * np.abs(eigenvalues).max() / value)  # fmt: skip


def test_a_preload_needs_a_spring_that_carries_it():
    model = mv.Model("slack")
    model.add_body("m", 2.0, (0.01, 0.01, 0.01))
    with pytest.raises(mv.ModelError, match=r"maxwell 'leg': preload = 5\.0 needs a static_stiffness"):
        model.add_maxwell("leg", "ground", "m", (0, 0, 1), (0, 0, 0), 5e3, 10.0, preload=5.0)
