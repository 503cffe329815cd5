"""A beam that sags between clamps: what `linearize` and `simulate` take it for, and what their difference is."""

import numpy as np
import pytest
from scipy.linalg import eigh

import mbsvib as mv
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.simulation.linear_range import second_order
from mbsvib.simulation.outputs import measured


def of_small_motion(model):
    """Lowest frequency [Hz] of the equations that `simulate` integrates, linearized in the pose as described."""
    statement = finite_motion(model.with_parts(outputs={}))
    blank = model.with_parts(outputs={})
    names = statement.motion.names
    dependent = ("base.rz", "rail.z", "beam.4.z")  # loops at the pin and at the contact
    candidates = [i for i, name in enumerate(names) if name not in dependent]
    parts = second_order(statement, measured(blank, statement), np.array(candidates), np.zeros(len(statement.inputs)))
    stiffness, _, mass = (parts.to_all.T @ matrix @ parts.to_all for matrix in parts.linear)
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[0]) / (2.0 * np.pi)


def without_stretch(model, share):
    """The same model whose beam has a share of its cross section, with the same bending and mass per length."""
    beam = model.composed["beam"]
    words = dict(beam.constructor_kwargs())
    own = beam.properties
    words["section"] = {"A": share * own.A, "Iy": own.Iy, "Iz": own.Iz, "J": own.J}
    words["material"] = {"E": beam.material.E, "G": beam.material.E / 2.6, "rho": beam.material.rho / share}
    other = mv.Model("beam")
    other.add_beam(**words)
    return model.with_parts(composed=other.composed)


def test_linearize_sees_an_arch_and_simulate_a_beam_that_bends_only():
    model = mv.library.singular_beam()
    arch = model.linearize().modes().frequencies
    assert arch[0] == pytest.approx(35.433, rel=1e-4)
    bends_only = of_small_motion(model)
    assert bends_only == pytest.approx(16.44, rel=1e-3)
    soft = without_stretch(model, 1e-4).linearize().modes().frequencies
    assert np.abs(soft / bends_only - 1.0).min() < 1e-3
    assert np.abs(arch / bends_only - 1.0).min() > 0.5


def clamped(held):
    """A beam between clamps, or guided at its right end so that this end may come nearer."""
    model = mv.Model("clamped")
    if not held:
        model.add_body("end", 0.01, (1e-6,) * 3, (1.0, 0, 0))
        model.add_joint("guide", "prismatic", "ground", "end", (1.0, 0, 0), axis=(1, 0, 0))
    section, steel = {"type": "rectangle", "width": 0.02, "height": 0.004}, {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}
    model.add_beam("rod", "ground", "ground" if held else "end", section, steel, (0, 0, 0), (1, 0, 0), elements=2,
                   y_axis=(0, 1, 0))  # fmt: skip
    model.add_input("F", "rod.1", "z")
    model.add_output("w", "rod.1", "z")
    return model


@pytest.mark.slow
def test_only_a_beam_whose_ends_are_held_apart_is_stretched():
    """By a sag of 0.24 of its thickness, which makes it stiffer by about 0.75 times the square of that."""
    t, off = np.linspace(0.0, 0.04, 41), []
    for held in (True, False):
        model = clamped(held)
        linear = model.linearize().time_response(t, np.full((1, 41), 2.0))[0]
        off.append(np.abs(model.simulate(t, {"F": 2.0})["w"] - linear).max() / np.abs(linear).max())
    assert np.abs(linear).max() == pytest.approx(0.24 * 0.004, rel=0.1)
    assert 0.02 < off[0] < 0.2
    assert off[1] < 1e-3
