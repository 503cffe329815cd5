"""Which parameters have analytic derivatives: all without loads, beside rotors, beams and reduced models too."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.sensitivities.forms import have_rules
from mbsvib.sensitivities.variables import variables
from tests.hunt import features
from tests.hunt.checks import Subject
from tests.hunt.generate import example
from tests.sensitivities.differences import assert_as_variants, of_variants


def scene(feature, seed=1):
    return Subject(example(seed, frozenset(features.with_needs(feature)))).system


def by_differences(system):
    entries = system.parameters.entries
    analytic = have_rules(system.sensitivity_basis.network, variables(system.parameters, None).layout)
    return {entry.name for entry, known in zip(entries, analytic, strict=True) if not known}


@pytest.mark.few(3)
@pytest.mark.parametrize("feature", [*features.BEAMS, *features.SUPERELEMENTS, "rotor on body", "maxwell",
                                     "massless damped node", "gear", "planar four-bar"])  # fmt: skip
def test_every_parameter_is_analytic(feature):
    assert not by_differences(scene(feature))


def test_what_may_take_a_spinning_body_off_its_axis_is_not():
    assert by_differences(library.rotor_stator().linearize()) == {
        f"{part}.{field}.{entry}" for part, fields in (("rotor", ("inertia", "position", "orientation")),
                                                      ("bearing", ("position", "orientation")))
        for field in fields for entry in {"inertia": ("xx", "yy", "zz", "xy", "xz", "yz"), "position": "xyz",
                                          "orientation": ("rx", "ry", "rz")}[field]
    }  # fmt: skip


@pytest.mark.few(1)
@pytest.mark.parametrize("feature", ["beam between bodies", "modal damping", "superelement", "rotor on body"])
def test_places_beside_beams_reduced_models_and_rotors(feature):
    """Wrenches in joints have what beams, reduced models and rotors do to bodies."""
    system = scene(feature, 2)
    fields = (".position.", ".orientation.", ".start.", ".end.", ".speed", ".inertia", "ratio", ".rho")
    names = [next(reversed([name for name in system.parameters if field in name]), None) for field in fields]
    names = [name for name in dict.fromkeys(names) if name]
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        value = system.parameters[name]
        assert_as_variants(result, k, system, of_variants(system, name), value, 1e-8, 1e-10)


def test_an_overhung_disk_in_closed_form():
    """i lambda of a disk on two torsion springs: a lambda^2 - i h lambda + k = 0, with its derivative to h."""
    moment, along, k, speed = 0.3, 0.5, 40.0, 60.0
    model = mv.Model("disk")
    model.add_body("disk", 2.0, (moment, moment, along))
    model.add_joint("pivot", "universal", "ground", "disk", position=(0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_bushing("spring", "ground", "disk", (0, 0, 0), (0, 0, 0, k, k, 0))
    model.add_rotor("spin", "disk", speed, (0, 0, 1), inertia=along)
    system = model.linearize()
    values, result = system.modes().eigenvalues, system.eigenvalue_sensitivities(["spin.speed", "spin.inertia"])
    for sign in (1, -1):
        omega = np.roots([moment, -sign * along * speed, -k]).real  # lambda = i omega
        slope = sign * omega / (2.0 * moment * omega - sign * along * speed)
        for w, per_momentum in zip(omega, slope, strict=True):
            at = int(np.argmin(np.abs(values - 1j * w)))
            assert result[:, at].imag == pytest.approx([along * per_momentum, speed * per_momentum], rel=1e-12)


@pytest.mark.slow
def test_a_beam_that_spins_carries_its_rotor():
    """A disk in the middle of a shaft: every number against differences of the whole equations."""
    model = mv.Model("shaft")
    model.add_body("disk", 1.5, (0.01, 0.01, 0.02), position=(0, 0, 0.2), orientation=(0, 0, 0))
    for name, ends, points in (("low", ("ground", "disk"), ((0, 0, 0), (0, 0, 0.2))),
                               ("high", ("disk", None), ((0, 0, 0.2), (0, 0.05, 0.35)))):  # fmt: skip
        model.add_beam(name, *ends, start=points[0], end=points[1], elements=2, y_axis=(1, 0, 0),
                       section={"type": "circle", "radius": 0.01}, alpha=3.0, damping_ratio=0.01,
                       material={"E": 7e10, "nu": 0.3, "rho": 2700.0})  # fmt: skip
    model.add_rotor("spin", "disk", 200.0, (0, 0, 1), inertia=0.02)
    system = model.linearize()
    assert not by_differences(system)
    names = ["spin.speed", "disk.position.y", "disk.orientation.rx", "high.end.y", "low.end.x", "high.start.z",
             "low.radius", "high.nu", "low.damping_ratio", "high.alpha"]  # fmt: skip
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        assert_as_variants(result, k, system, of_variants(system, name), system.parameters[name], 1e-8, 1e-10)


@pytest.mark.slow
def test_inerters_torsion_springs_and_strains():
    """Numbers of a scene with all of these, with outputs that are forces in them, against differences."""
    model = mv.Model("mixed")
    model.add_body("a", 1.0, (0.1, 0.2, 0.3), position=(0.3, 0.1, 0.2))
    model.add_body("b", 2.0, (0.1, 0.2, 0.3), position=(0.6, 0.3, 0.1))
    model.add_joint("ball", "spherical", "ground", "a", position=(0, 0, 0))
    model.add_joint("slide", "cylindrical", "a", "b", position=(0.5, 0.2, 0.1), axis=(1, 2, 0))
    model.add_bushing("hold", "ground", "b", (0.6, 0.3, 0.1), (10, 20, 30, 1, 2, 3), damping=(1, 1, 1, 0, 0, 0))
    model.add_inerter("inerter", "ground", "b", (0, 0.5, 0.5), (0.6, 0.3, 0.2), 0.7)
    model.add_torsion_spring("torsion", "a", "b", (1, 2, 0), 5.0, 0.1)
    model.add_beam("beam", "b", None, start=(0.6, 0.3, 0.1), end=(1, 0.3, 0.2), elements=2,
                   section={"type": "circle", "radius": 0.02}, material={"E": 1e9, "nu": 0.3, "rho": 1000.0})
    model.add_strain_output("strain", "beam.e1")
    model.add_input("push", "beam.2", "z")
    model.add_output("tip", "beam.2", "z")
    for name, element, direction in (("fi", "inerter", "z"), ("ft", "torsion", "rz"), ("fj", "ball", "x")):
        model.add_force_output(name, element, direction)
    system = model.linearize()
    assert not by_differences(system)
    names = ["inerter.inertance", "inerter.end.y", "torsion.stiffness", "torsion.damping", "beam.radius", "beam.end.z",
             "b.position.y", "slide.orientation.rx"]  # fmt: skip
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        assert_as_variants(result, k, system, of_variants(system, name), system.parameters[name], 1e-8, 1e-10)
