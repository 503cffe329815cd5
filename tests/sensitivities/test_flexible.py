"""Sensitivities to material, section and damping of beams: closed forms, and differences of the whole computation."""

import numpy as np
import pytest

import mbsvib as mv
from tests.beams.reference import assembled, matrices
from tests.sensitivities.differences import assert_derivative, difference, eigenvalues, step_of

TUBE = {"type": "tube", "radius": 0.02, "wall": 0.004}
METAL = {"E": 7e10, "nu": 0.33, "rho": 2700.0}


def frame(shear, **damping):
    """A slanted beam with a rigid body off its end, which a bushing holds."""
    model = mv.Model("frame")
    model.add_body("tip", 2.0, (0.02, 0.03, 0.04), position=(1.0, 0.1, 0.05))
    model.add_beam("rod", "ground", "tip", start=(0, 0, 0), end=(0.9, 0.1, 0), section=TUBE, material=METAL,
                   elements=2, shear=shear, **damping)  # fmt: skip
    model.add_bushing("mount", "ground", "tip", (1, 0.1, 0.05), (1e4, 2e4, 3e4, 10, 20, 30),
                      damping=(30, 20, 10, 0, 0, 0))  # fmt: skip
    model.add_input("push", "tip", "y")
    model.add_output("way", "tip", "z")
    return model


def test_frequencies_of_a_cantilever_go_with_the_root_of_stiffness_over_density():
    model = mv.Model("cantilever")
    model.add_beam("rod", "ground", None, start=(0, 0, 0), end=(1, 0, 0), section=TUBE, material=METAL, elements=3)
    system = model.linearize()
    result, f = system.mode_sensitivities(["rod.E", "rod.rho"]), system.modes().frequencies
    bending = np.abs(result.frequencies[0] * METAL["E"] / f - 0.5) < 1e-9
    assert bending.all()  # G goes with E where nu is given
    assert result.frequencies[1] == pytest.approx(-0.5 * f / METAL["rho"], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("shear", [False, True])
def test_differences(shear):
    model = frame(shear, alpha=2.0, beta=1e-5)
    system = model.linearize()
    names = ["rod.E", "rod.nu", "rod.rho", "rod.radius", "rod.wall", "rod.alpha", "rod.beta", "mount.stiffness.y",
             "tip.mass", "tip.inertia.xx"]  # fmt: skip
    result, matrices = system.eigenvalue_sensitivities(names), system.matrix_derivatives(names)
    w = np.array([0.0, 50.0, 900.0])
    responses = system.frequency_response_sensitivities(w, names)
    values, size = system.modes().eigenvalues, np.abs(system.frequency_response(w)).max()
    for k, name in enumerate(names):
        step = step_of(system.parameters, name)
        *three, at, g = difference(model, system, name, lambda s: [s.M, s.C, s.K, eigenvalues(s),
                                                                   s.frequency_response(w)])  # fmt: skip
        assert_derivative(result[k], at, values, step, 1e-7)
        assert np.abs(responses[k] - g).max() <= 1e-7 * np.abs(g).max() + 1e-14 * size / step
        for key, expected in zip("MCK", three, strict=True):
            noise = 1e-12 * np.abs(getattr(system, key)).max() / step
            assert np.abs(getattr(matrices, key)[k] - expected).max() <= 1e-8 * np.abs(expected).max() + noise


def test_places_and_modal_damping():
    """Where a beam ends, and the damping ratio of its modes, act on all of its elements at once."""
    for model, names in ((frame(False), ["rod.end.x", "mount.position.x"]),
                         (frame(False, damping_ratio=0.01), ["rod.E", "rod.damping_ratio"])):  # fmt: skip
        system = model.linearize()
        result, values = system.eigenvalue_sensitivities(names), system.modes().eigenvalues
        for row, name in zip(result, names, strict=True):
            step = step_of(system.parameters, name)
            assert_derivative(row, difference(model, system, name, eigenvalues), values, step, 1e-7)


@pytest.mark.slow
def test_a_beam_that_bends_under_its_load_bends_anew():
    """Every variant of a beam that equilibrium has bent is in an equilibrium of its own."""
    model = mv.Model("shelf", gravity=(0, 0, -9.81))
    model.add_body("tip", 2.0, (0.02, 0.03, 0.04), position=(1.0, 0, 0))
    model.add_beam("rod", "ground", "tip", start=(0, 0, 0), end=(1.0, 0, 0), material=METAL, elements=2,
                   section={"type": "circle", "radius": 0.008})  # fmt: skip
    model = model.equilibrium()
    system, step = model.linearize(), 1e-3
    names = ["gravity.z", "tip.mass"]
    result = system.eigenvalue_sensitivities(names)
    for row, name in zip(result, names, strict=True):
        near, far = (eigenvalues(model.with_values({name: model.parameters[name] + s * step}).equilibrium().linearize())
                     for s in (1, -1))  # fmt: skip
        expected = (near - far) / (2 * step)
        assert row == pytest.approx(expected, rel=1e-5, abs=1e-7 * np.abs(expected).max())


def hanging(reduced, g):
    """A hub on a torsion spring, from which a beam hangs, or its matrices; a body off the end of it is turned by it."""
    model = mv.Model("hanging", gravity=(0, 0, g))
    model.add_body("hub", 1.0, (0.01, 0.02, 0.03))
    model.add_body("tip", 0.5, (0.002, 0.003, 0.004), position=(0, 0, -1.1))
    model.add_joint("hinge", "universal", "ground", "hub", (0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    model.add_bushing("k", "ground", "hub", (0, 0, 0), (0, 0, 0, 15.0, 12.0, 0))
    words = {"section": {"type": "rectangle", "width": 0.02, "height": 0.004}, "material": METAL, "y_axis": (1, 2, 0)}
    if reduced:
        frame, nodes = mv.Model(), [(0, 0, 0), (0, 0, -0.5), (0, 0, -1.0)]
        frame.add_body("hub", 1.0, (1, 1, 1))
        part = frame.add_beam("rod", "hub", None, nodes=nodes, **words)
        (length, axes), *_ = part.frames()
        properties = part.properties
        k, m = assembled(nodes, [axes, axes], lambda _: matrices(
            length, properties.A, properties.Iy, properties.Iz, properties.J, METAL["E"],
            METAL["E"] / (2 + 2 * METAL["nu"]), METAL["rho"]))  # fmt: skip
        model.add_superelement("rod", m, None, k, {f"n{i}": at for i, at in enumerate(nodes)},
                               bodies={"n0": "hub", "n2": "tip"})  # fmt: skip
    else:
        model.add_beam("rod", "hub", "tip", start=(0, 0, 0), end=(0, 0, -1.0), elements=2, **words)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("reduced", [False, True])
def test_gravity_along_a_part_that_bends(reduced):
    """K is linear in gravity: of its weight, of what hangs below, and of what a part that is turned weighs."""
    result = hanging(reduced, -9.81).linearize().matrix_derivatives(["gravity.z"]).K[0]
    far, near = (hanging(reduced, g).linearize().K for g in (-30.0, 10.0))
    expected = (far - near) / -40.0
    assert np.abs(result - expected).max() < 1e-11 * np.abs(expected).max()


def test_modal_damping_of_twist_goes_with_the_root_of_the_shear_modulus():
    """G = E / (2 (1 + nu)) acts on the twist of a straight beam alone: dC / dnu = -C / (2 (1 + nu)) there."""
    model = mv.Model("rod")
    model.add_beam("rod", "ground", None, start=(0, 0, 0), end=(0.5, 0.1, 0.05), elements=2, damping_ratio=0.01,
                   section={"type": "rectangle", "width": 0.04, "height": 0.01}, material=METAL)  # fmt: skip
    system = model.linearize()
    twists = np.array([name.endswith(".rx") for name in system.coordinates])
    expected = -system.C / (2.0 * (1.0 + METAL["nu"])) * np.outer(twists, twists)
    slope = system.matrix_derivatives(["rod.nu"]).C[0]
    assert twists.sum() == 2
    assert np.abs(slope - expected).max() <= 1e-12 * np.abs(expected).max()
