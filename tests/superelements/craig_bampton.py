"""A reduced model to test with: a bent beam by text-book matrices, reduced to two nodes after Craig and Bampton."""

import numpy as np
from scipy.linalg import eigh

import mbsvib as mv
from mbsvib.beams import Material, Section
from tests.beams.reference import assembled, matrices

NODES = [(0.1, -0.2, 0.3), (0.3, -0.1, 0.3), (0.5, -0.1, 0.4), (0.5, 0.15, 0.5), (0.6, 0.25, 0.8)]
SECTION = Section(A=3e-4, Iy=2e-8, Iz=5e-9, J=1e-8)
ALLOY = Material(E=7e10, nu=0.33, rho=2700.0)


def beam(name, a, b):
    model = mv.Model(name)
    model.add_body("hub", 0.8, (0.002, 0.003, 0.002), position=(0, -0.25, 0.3))
    model.add_beam("pipe", a, b, SECTION, ALLOY, nodes=NODES, y_axis=(1, 2, 5))
    return model


def reduced(retained):
    """M and K on the two ends and the lowest modes that are held there."""
    frames = beam("frames", None, None).beams["pipe"].frames()
    numbers = (SECTION.A, SECTION.Iy, SECTION.Iz, SECTION.J, ALLOY.E, ALLOY.shear_modulus, ALLOY.rho)
    k, m = assembled(NODES, [axes for _, axes in frames], lambda i: matrices(frames[i][0], *numbers))
    return on_ends(k, m, retained)


def on_ends(k, m, retained):
    """M and K on the first and the last node, six coordinates each, and the lowest modes that are held there."""
    ends, inner = [*range(6), *range(len(k) - 6, len(k))], list(range(6, len(k) - 6))
    _, modes = eigh(k[np.ix_(inner, inner)], m[np.ix_(inner, inner)])
    basis = np.zeros((len(k), 12 + retained))
    basis[ends, range(12)] = 1.0
    basis[inner, :12] = -np.linalg.solve(k[np.ix_(inner, inner)], k[np.ix_(inner, ends)])
    basis[np.ix_(inner, range(12, 12 + retained))] = modes[:, :retained]
    stiffness = basis.T @ k @ basis
    stiffness[:12, 12:] = 0.0
    stiffness[12:, :12] = 0.0
    return basis.T @ m @ basis, stiffness
