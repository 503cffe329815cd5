"""A beam that sags between clamps: what `linearize` and `simulate` take it for, and what their difference is."""

import numpy as np
import pytest
from scipy.linalg import eigh

import mbsvib as mv
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.simulation.outputs import measured
from mbsvib.simulation.second_order import second_order


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
