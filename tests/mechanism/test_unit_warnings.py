"""Units that are likely to be wrong are doubted in results, and nothing is doubted where units are right."""

import numpy as np
import pytest

import mbsvib as mv
from tests.support.slow_cases import some


def pad(inertia):
    model = mv.Model("pad")
    model.add_body("plate", 0.1, inertia, position=(0, 0, 0.05))
    model.add_bushing("rubber", "ground", "plate", (0.02, 0, 0), stiffness=(1e4,) * 3 + (10.0,) * 3)
    return model.linearize().explain()


def test_inertia_in_gram_square_millimetres():
    assert "doubtful" not in pad((1e-4, 2e-4, 2.5e-4))
    stated = pad((1e-4 * 1e9, 2e-4 * 1e9, 2.5e-4 * 1e9))
    assert "body 'plate': a radius of gyration of 1.58e+03 m in a mechanism of 0.0539 m" in stated


@pytest.mark.few(1)
@pytest.mark.parametrize("name", some(mv.library.models(), "stewart", "wafer_stage", "quarter_car", "toggle"))
def test_models_of_the_library_are_beyond_doubt(name):
    assert "doubtful" not in mv.library.build(name).linearize().explain()


def test_nodes_and_bodies_at_one_point_have_no_size():
    model = mv.Model("point")
    model.add_body("b", 1.0, (1, 1, 1))
    assert "doubtful" not in model.linearize().explain()


@pytest.mark.parametrize(("modulus", "density", "doubted"), [
    (2.1e11, 7800.0, False), (1e6, 1100.0, False), (210.0, 7800.0, True), (2.1e5, 7800.0, True), (2.1e11, 7.8, True),
])  # fmt: skip
def test_materials_in_other_units(modulus, density, doubted):
    model = mv.Model("mast")
    model.add_beam("tube", "ground", None, {"type": "tube", "radius": 0.02, "wall": 0.002},
                   {"E": modulus, "nu": 0.3, "rho": density}, start=(0, 0, 0), end=(0, 0, 1), elements=2)
    stated = model.linearize().explain()
    assert ("beam 'tube': E = " in stated) is doubted
    assert ("N/m^2 and kg/m^3?" in stated) is doubted


def in_metres(scale):
    model = mv.Model("arm")
    model.add_body("b", 2.0, (0.01, 0.01, 0.01), position=(0.0, 0.0, 0.25 * scale))
    model.add_joint("r", "revolute", "ground", "b", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("k", "ground", "b", (0.1 * scale, 0, 0), (0, 0, 0.25 * scale), stiffness=1e3)
    return model


def test_positions_in_millimetres_are_doubted_where_modes_are_read():
    doubt = "Doubtful: a mechanism of 269 m, in which no body has a radius of gyration above 0.0707 m; are positions"
    assert doubt in str(in_metres(1e3).linearize().modes())
    assert "Doubtful" not in str(in_metres(1.0).linearize().modes())


def test_inertia_in_gram_square_millimetres_is_doubted_where_modes_are_read():
    model = in_metres(1.0).with_values({"b.inertia.yy": 1e4, "b.inertia.xx": 1e4, "b.inertia.zz": 1e4})
    assert "is its inertia in kg m^2?" in str(model.linearize().modes())


def test_angles_in_degrees_are_doubted_where_modes_are_read():
    arm = in_metres(1.0)
    doubt = "'r.rz' is displaced by 30 rad, 4.77 turns; is it in rad, not in degrees?"
    there = arm.moved({"r.rz": 30.0}, relaxed=True)
    assert f"Doubtful: {doubt}" in str(there.linearize().modes())
    assert doubt in there.linearize().explain()
    assert doubt in str(there.with_values({"b.mass": 3.0}).linearize().modes())
    family = arm.family({"r.rz": [0.0, 15.0, -30.0]})
    assert doubt in str(family[0].modes())
    assert doubt in str(family.models[2].linearize().modes())
    around = arm.moved({"r.rz": 2.0 * np.pi}, relaxed=True)
    for fine in (arm, around, arm.family({"r.rz": np.radians([0.0, 30.0])}).models[1]):
        assert fine.doubts == ()
        assert "Doubtful" not in str(fine.linearize().modes())


def test_angles_in_degrees_are_doubted_where_the_pose_is_refused():
    model = in_metres(1.0)
    model.add_torsion_spring("t", "ground", "b", axis=(0, 0, 1), stiffness=10.0)
    with pytest.raises(mv.ModelError, match=r"angle is not unique.* 14.3 turns; is it in rad, not in degrees\?$"):
        model.moved({"r.rz": 90.0})


def test_displacements_are_not_angles():
    model = mv.Model("slide")
    model.add_body("b", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1))
    model.add_joint("rail", "cylindrical", "ground", "b", position=(0, 0, 0))
    assert model.moved({"rail.z": 30.0}).doubts == ()
    assert len(model.moved({"rail.rz": 30.0}).doubts) == 1


@pytest.mark.slow
def test_angles_in_degrees_are_doubted_by_paths_cycles_and_runs():
    path = mv.library.hinged_rod().path("hinge.rz", [0.0, 10.0])
    assert "Doubtful: 'hinge.rz' is displaced by 10 rad, 1.59 turns" in str(path)
    assert "Doubtful" not in str(mv.library.hinged_rod().path("hinge.rz", [0.0, 0.2]))
    linkage = mv.library.hoeken()
    for angles, doubted in ((np.arange(0.0, 360.0, 5.0), True), (np.linspace(0.0, 4.0 * np.pi, 49), False)):
        assert ("Doubtful: 'crank.rz' is displaced by" in str(linkage.cycle("crank.rz", angles, speed=1.0))) is doubted
    for angle, doubted in ((45.0, True), (0.5, False)):
        run = mv.library.hinged_rod().simulate([0.0, 0.01], initial={"hinge.rz": angle})
        assert ("Doubtful: 'hinge.rz' is displaced by" in str(run)) is doubted


@pytest.mark.parametrize(("length", "mass", "inertia"), [(67.0, 28.0, 0.1), (60.0, 2000.0, 20.0), (150.0, 50.0, 1.0)])
def test_long_pendulums_are_beyond_doubt(length, mass, inertia):
    """Foucault's, a crane's hook, a gondola on its rope."""
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", mass, (inertia,) * 3, position=(0, 0, -length))
    model.add_joint("hook", "universal", "ground", "bob", position=(0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    modes = model.linearize().modes()
    assert "Doubtful" not in str(modes)
    np.testing.assert_allclose(modes.natural, np.sqrt(9.81 * length * mass / (mass * length**2 + inertia)), rtol=1e-12)
