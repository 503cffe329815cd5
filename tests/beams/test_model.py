"""Beams as parts of a model: damping, words, parameters, files, refusals."""

import json

import jsonschema
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.beams import Circle, Material, Rectangle, Section, Tube
from mbsvib.files import schema

STEEL = Material(E=2.1e11, nu=0.3, rho=7800.0)
BAR = Rectangle(0.02, 0.05)


def cantilever(elements=4, **words):
    model = mv.Model("cantilever")
    model.add_beam("rod", "ground", None, BAR, STEEL, start=(0, 0, 0), end=(1, 0.2, 0), elements=elements, **words)
    return model


def arm():
    """A body between two beams, with a joint, a spring, inputs and outputs at nodes."""
    model = mv.Model("arm")
    model.add_body("hub", 2.0, (0.01, 0.01, 0.02), position=(0, 0, 0.1))
    model.add_beam("tube", "hub", None, Tube(0.02, 0.002), STEEL, start=(0.05, 0, 0), end=(1, 0, 0), elements=4,
                   beta=1e-5)  # fmt: skip
    arguments = {"A": 1e-4, "Iy": 1e-9, "Iz": 2e-9, "J": 1e-9, "ky": 0.8, "kz": 0.9}
    points = [(1, 0, 0), (1, 0.1, -0.3), (1, 0, -0.6)]
    model.add_beam("strut", "tube.4", "ground", arguments, {"E": 7e10, "G": 2.6e10, "rho": 2700}, nodes=points,
                   shear=True, y_axis=(1, 0, 0), damping_ratio=0.01)  # fmt: skip
    model.add_joint("pivot", "revolute", "ground", "hub", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_spring("stay", "ground", "tube.2", start=(0.5, 0, 1), end=(0.5, 0, 0), stiffness=1e4)
    model.add_input("F", "tube.4", "z")
    model.add_output("z", "strut.1", "y", quantity="acceleration")
    model.add_force_output("N", "tube.e2", "x")
    return model


def test_nodes_and_elements_have_names():
    model = arm()
    assert tuple(model.beams) == ("tube", "strut")
    assert tuple(model.beams["tube"].node_names) == ("tube.1", "tube.2", "tube.3", "tube.4")
    assert tuple(model.beams["strut"].node_names) == ("strut.1",)
    system = model.linearize()
    assert {"tube.1", "tube.4", "strut.1"} < set(system.bodies)
    assert "tube.e1.rx" in system.coordinates
    assert "stay" in system.provenance.springs


def test_all_parameters_are_numbers():
    """What a beam does not have is no parameter: a length beside nodes, shear factors that follow from the section."""
    known = arm().parameters
    assert all(isinstance(value, float) and np.isfinite(value) for value in known.values())
    own = {name.partition(".")[2] for name in known if name.startswith("strut.")}
    assert own == {"E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz", "alpha", "beta", "damping_ratio"}


def test_rayleigh_damping_is_that_of_each_mode():
    alpha, beta = 3.0, 2e-5
    modes = cantilever(alpha=alpha, beta=beta).linearize().modes()
    omega = 2 * np.pi * modes.frequencies
    assert modes.damping_ratios == pytest.approx(0.5 * (alpha / omega + beta * omega), rel=1e-9)


def test_modal_damping_is_that_of_the_free_beam():
    model = mv.Model("free")
    model.add_beam("rod", None, None, BAR, STEEL, start=(0, 0, 0), end=(1, 0, 0.3), elements=5, damping_ratio=0.02)
    modes = model.linearize().modes()
    assert (modes.frequencies[:6] == 0.0).all()
    assert (modes.eigenvalues[:12] == 0.0).all()
    assert modes.damping_ratios[6:] == pytest.approx(np.full(30, 0.02), rel=1e-9)


def test_modal_damping_of_a_clamped_beam_damps_no_rigid_motion():
    model = mv.Model("hinged")
    model.add_beam("rod", None, None, BAR, STEEL, start=(0, 0, 0), end=(1, 0, 0.3), elements=5, damping_ratio=0.02)
    model.add_joint("hinge", "revolute", "ground", "rod.0", position=(0, 0, 0), axis=(0, 1, 0))
    system = model.linearize()
    swings = np.zeros(system.dof)
    swings[system.coordinates.index("hinge.rz")] = 1.0
    assert not (system.C @ swings).any()
    assert (system.modes().damping_ratios[1:] > 1e-3).all()


def test_force_in_an_element_is_that_of_statics():
    model = cantilever(elements=5)
    model.add_input("F", "rod.5", "z")
    model.add_force_output("shear", "rod.e2", "z")
    model.add_force_output("moment", "rod.e2", "ry")
    system = model.linearize()
    result = system.Cq @ np.linalg.solve(system.K, system.B)
    length = np.hypot(1, 0.2)
    assert result[:, 0] == pytest.approx([1.0, -0.7 * length], rel=1e-12)


def test_base_motion_acts_on_the_mass_of_the_beam():
    """Relative coordinates of a shaken clamp: the force a moving ground exerts is that of the beam's whole mass."""
    model = cantilever(elements=3)
    model.add_base_motion("ax", "x")
    model.add_base_motion("spin", "rz", position=(0.3, -0.2, 0.1))
    system = model.linearize()
    free = mv.Model("free")
    free.add_beam("rod", None, None, BAR, STEEL, start=(0, 0, 0), end=(1, 0.2, 0), elements=3)
    full = free.linearize()
    names = [full.coordinates.index(name) for name in system.coordinates]
    rigid = [full.coordinates.index(f"rod.0.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    carried = np.zeros((6, 2))
    carried[0, 0] = 1.0
    carried[:3, 1], carried[5, 1] = np.cross([0, 0, 1], np.subtract((0, 0, 0), (0.3, -0.2, 0.1))), 1.0
    expected = -full.M[np.ix_(names, rigid)] @ carried
    assert np.abs(system.B - expected).max() < 1e-13 * np.abs(expected).max()


def test_total_mass_and_moments_of_a_free_beam():
    model = mv.Model("free")
    model.add_beam("rod", None, None, BAR, STEEL, start=(0, 0, 0), end=(2, 0, 0), elements=3, shear=True)
    system = model.linearize()
    at = [system.coordinates.index(f"rod.0.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    p = BAR.properties(0.3)
    mass = STEEL.rho * p.A * 2
    turn = [STEEL.rho * 2 * (p.Iy + p.Iz), mass * 4 / 3 + 2 * STEEL.rho * p.Iy, mass * 4 / 3 + 2 * STEEL.rho * p.Iz]
    assert system.M[np.ix_(at, at)].diagonal() == pytest.approx([mass] * 3 + turn, rel=1e-13)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_files_bring_beams_back(tmp_path, suffix):
    model = arm()
    path = mv.save(model, tmp_path / f"arm{suffix}")
    back = mv.load(path)
    assert dict(back.beams) == dict(model.beams)
    assert back.joints == model.joints
    first, second = model.linearize(), back.linearize()
    assert first.coordinates == second.coordinates
    assert np.array_equal(first.M, second.M)
    assert np.array_equal(first.K, second.K)
    if suffix == ".json":
        jsonschema.Draft202012Validator(schema()).validate(json.loads(path.read_text("utf-8")))


def test_replace_and_parameters():
    model = arm()
    longer = model.replace("tube", elements=6, end=(1, 0, 0))
    assert longer.beams["tube"].elements == 6
    assert model.parameters["tube.E"] == 2.1e11
    assert model.parameters["strut.G"] == 2.6e10
    assert model.parameters["strut.Iz"] == 2e-9
    assert model.parameters["tube.end.x"] == 1.0
    assert model.parameters.units["tube.rho"] == "kg/m^3"
    assert "tube.nu" in model.parameters
    assert "tube.G" not in model.parameters
    assert not any(name.startswith(("tube.1", "tube.e1")) for name in model.parameters)
    changed = model.with_values({"tube.wall": 0.004, "strut.A": 2e-4, "tube.E": 1e11, "tube.end.z": 0.1})
    assert changed.beams["tube"].section == Tube(0.02, 0.004)
    assert changed.beams["tube"].material.E == 1e11
    assert changed.beams["tube"].end == (1, 0, 0.1)
    assert changed.beams["strut"].section.A == 2e-4
    assert model.beams["tube"].section == Tube(0.02, 0.002)
    assert changed.linearize().parameters["tube.wall"] == 0.004


def test_axis_and_length(tmp_path):
    model = mv.Model("along")
    model.add_beam("rod", "ground", None, BAR, STEEL, start=(0, 0, 0), axis=(1, 0.2, 0), length=np.hypot(1, 0.2))
    expected = cantilever(8).linearize().modes().frequencies
    assert model.linearize().modes().frequencies == pytest.approx(expected, rel=1e-10)
    back = mv.load(mv.save(model, tmp_path / "along.yaml"))
    assert dict(back.beams) == dict(model.beams)
    longer = model.with_values({"rod.length": 2.0})
    assert longer.beams["rod"].points[-1] == pytest.approx((2 / np.hypot(1, 0.2), 0.4 / np.hypot(1, 0.2), 0))


def test_softer_material_scales_frequencies():
    model = cantilever()
    f = model.linearize().modes().frequencies
    softer = model.with_values({"rod.E": STEEL.E / 4}).linearize().modes().frequencies
    assert softer == pytest.approx(f / 2, rel=1e-10)


def test_scenes_without_beams_are_untouched():
    model = mv.library.quarter_car()
    assert not model.composed
    parts = (*model.bodies.values(), *model.joints.values(), *model.springs.values())
    assert model.linearize().provenance.parts == parts


LINE = {"start": (0, 0, 0), "end": (1, 0, 0)}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"start": (0, 0, 0), "end": (0, 0, 0)}, r"beam 'rod': end = .* A beam needs a length"),
        ({"start": (0, 0, 0)}, r"beam 'rod': end = None; expected a point"),
        ({**LINE, "nodes": [(0, 0, 0), (1, 0, 0)]}, r"leave out start, end"),
        ({"nodes": [(0, 0, 0), (1, 0, 0), (1, 0, 0)]}, r"two of its nodes are both at"),
        ({"start": (0, 0, 0), "axis": (1, 0, 0)}, r"axis and length go together"),
        ({**LINE, "axis": (1, 0, 0), "length": 1}, r"leave out end"),
        ({"start": (0, 0, 0), "axis": (1, 0, 0), "length": 0}, r"length = 0; expected a positive number"),
        ({"axis": (1, 0, 0), "length": 1}, r"start = None; expected a point"),
        ({"nodes": [(0, 0, 0)]}, r"two or more points"),
        ({**LINE, "elements": 0}, r"elements = 0; expected a whole number"),
        ({**LINE, "y_axis": (2, 0, 0)}, r"y_axis = .* a direction across the beam"),
        ({**LINE, "alpha": -1.0}, r"alpha = -1.0; expected a number that is not negative"),
        ({**LINE, "shear": 1}, r"shear = 1"),
        ({**LINE, "b": "ground", "elements": 1}, r"both ends are on 'ground'"),
        ({**LINE, "b": "tip"}, r"b = 'tip' is not a body"),
        ({**LINE, "section": {"A": 1, "Iy": 1, "Iz": 1, "J": 1}, "shear": True}, r"needs the section's shear factors"),
        ({**LINE, "section": {"type": "tube", "radius": 0.1}}, r"needs wall"),
        ({**LINE, "section": {"type": "tub", "radius": 0.1}}, r"type: one of tube.*tube"),
        ({**LINE, "section": {"type": "circle", "radius": -0.1}}, r"beam 'rod': section: circle: radius = -0.1"),
        ({**LINE, "section": {"type": "circle", "diameter": 0.1}}, r"no 'diameter'"),
        ({**LINE, "section": 3}, r"section = 3"),
        ({**LINE, "section": {"radius": 0.1}}, r"has no type; expected 'type': 'circle' beside it"),
        ({**LINE, "section": {"radius": 0.1, "wall": 0.01}}, r"has no type; expected 'type': 'tube' beside it"),
        ({**LINE, "material": {"E": 1e9, "rho": 1}}, r"one of nu"),
        ({**LINE, "material": {"E": 0.0, "nu": 0.3, "rho": 1}}, r"material: E = 0.0; expected a positive"),
        ({**LINE, "material": {"E": 1e9, "nu": 0.6, "rho": 1}}, r"nu = 0.6"),
        ({**LINE, "material": "steel"}, r"material = 'steel'"),
    ],
)  # fmt: skip
def test_refusals(words, message):
    model = mv.Model("refused")
    with pytest.raises(mv.ModelError, match=message):
        model.add_beam("rod", **({"a": "ground", "b": None, "section": BAR, "material": STEEL} | words))
    assert not model.beams


def test_names_are_taken():
    model = cantilever()
    for name in ("rod", "rod.2", "rod.e1"):
        with pytest.raises(mv.ModelError, match=r"taken by a beam"):
            model.add_body(name, 1.0, (1, 1, 1))
    model.add_body("bar.1", 1.0, (1, 1, 1))
    with pytest.raises(mv.ModelError, match=r"bar.*taken by a body"):
        model.add_beam("bar", None, None, BAR, STEEL, **LINE)


def test_end_that_a_body_holds_is_no_node():
    with pytest.raises(mv.ModelError, match=r"'rod\.0' is not a body"):
        cantilever().add_input("F", "rod.0", "x")


def test_variants_of_a_beam_are_the_beams_themselves():
    model = cantilever()
    batch = model.linearize(values={"rod.E": [1e9, 2e9, 5e10], "rod.rho": [1e3, 1e3, 7e3]})
    modes = batch.modes()
    for i, (modulus, density) in enumerate(zip((1e9, 2e9, 5e10), (1e3, 1e3, 7e3), strict=True)):
        single = model.with_values({"rod.E": modulus, "rod.rho": density}).linearize()
        assert all((getattr(batch, key)[i] == getattr(single, key)).all() for key in ("M", "C", "B", "Cq"))
        np.testing.assert_allclose(batch.K[i], single.K, rtol=4e-16, atol=0.0)  # sums in another order
        np.testing.assert_allclose(modes.frequencies[i], single.modes().frequencies, rtol=1e-13)
    assert batch[1].explain() == model.with_values({"rod.E": 2e9, "rod.rho": 1e3}).linearize().explain()


def test_a_beam_that_one_variant_cannot_have_is_refused_by_index():
    with pytest.raises(mv.ModelError, match=r"variant 1: .*rod"):
        cantilever().linearize(values={"rod.E": [1e9, -1.0]})


def test_closed_forms_of_sections():
    tube, full = Tube(0.1, 0.1).properties(0.3), Circle(0.1).properties(0.3)
    assert [tube.A, tube.Iy, tube.J, tube.ky] == pytest.approx([full.A, full.Iy, full.J, full.ky], rel=1e-14)
    strip = Tube(1.0, 1e-6).properties(0.3)
    assert max(abs(value / (2e-6 * np.pi) - 1) for value in (strip.A, strip.J)) < 1e-5
    # Timoshenko & Goodier, Theory of Elasticity, table of k1: 0.1406, 0.229, 1/3 for a/b = 1, 2, infinity
    sides = ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0), (1e4, 1.0))
    square, flat, high, thin = (Rectangle(*pair).properties(0.3).J for pair in sides)
    assert square == pytest.approx(0.1405770149, rel=1e-9)
    assert flat == high == pytest.approx(0.4574, rel=1e-4)
    assert thin == pytest.approx(1e4 / 3, rel=1e-4)
    assert Section(1, 2, 3, 4).properties(0.3).kz is None


@pytest.mark.parametrize("inner", [0.0, 0.3, 0.8, 0.99])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_shear_factor_of_a_tube_by_cowper_s_integral(nu, inner):
    """k = 2 (1 + nu) I / -(A / I) int x (chi + x y^2) dA, chi = (a r + b / r) cos phi + ... harmonic."""
    s = 0.75 + 0.5 * nu
    a, b = -s * (1 + inner**2), -s * inner**2
    integral = np.pi * (a * (1 - inner**4) / 4 + b * (1 - inner**2) / 2 + (1 - inner**6) / 24)
    area, second = np.pi * (1 - inner**2), np.pi / 4 * (1 - inner**4)
    expected = -2 * (1 + nu) * second**2 / (area * integral)
    tube = Tube(2.0, 2.0 * (1 - inner)).properties(nu)
    assert (tube.ky, tube.kz) == pytest.approx((expected, expected), rel=1e-13)
    if not inner:
        assert Circle(2.0).properties(nu).kz == pytest.approx(expected, rel=1e-13)


def test_shear_factors_that_are_given_count():
    for shape in (Tube(0.1, 0.02, 0.4, 0.6), Circle(0.1, 0.4, 0.6), Rectangle(0.1, 0.2, 0.4, 0.6)):
        result = shape.properties(0.3)
        assert (result.ky, result.kz) == (0.4, 0.6)
    square = Rectangle(0.1, 0.2).properties(0.5)
    assert (square.ky, square.kz) == pytest.approx((15 / 17.5, 15 / 17.5), rel=1e-14)  # Cowper 1966, table 1


def test_explain_tells_what_flexible_parts_are_made_of():
    model = arm()
    model.add_superelement("lump", np.diag([2.0] * 3 + [0.1] * 3 + [1.0]), None, np.diag([0.0] * 6 + [1e4]),
                           {"node": (1, 0, 0)}, bodies={"node": "tube.4"})  # fmt: skip
    text = model.linearize().explain()
    assert "beam 'tube': 4 Euler-Bernoulli elements, 4 nodes" in text
    assert "beam 'strut': 2 Timoshenko elements, 1 node of its own" in text
    assert "superelement 'lump': 1 node, 1 internal coordinates; rank of M 7 and of K 1 of 7" in text


def test_other_poses_are_refused_by_name():
    model = cantilever()
    with pytest.raises(mv.ModelError, match=r"'rod\.e1\.x' is not a joint coordinate"):
        model.moved({"rod.e1.x": 0.1})
    assert model.equilibrium(report=True).iterations == 0


def test_longer_beams_bend_slower_by_the_square_and_stretch_by_the_first_power():
    """omega ~ 1 / L^2 in bending, 1 / L along the beam and in torsion, however many elements there are."""
    system = cantilever().linearize()
    result = system.eigenvalue_sensitivities({"stretch": {"rod.end.x": 1.0, "rod.end.y": 0.2}})[0]
    powers = (result / system.modes().eigenvalues).real
    assert np.abs(powers - np.round(powers)).max() < 1e-9
    assert set(np.round(powers)) == {-2.0, -1.0}
