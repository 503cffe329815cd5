"""The discretisation is that of the text books, and its frequencies keep the digits that theirs lose."""

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.beams import Material, Rectangle, Section
from mbsvib.elements.beam_element import Prismatic, deflection, rotation, shapes_at, shear_ratios
from tests.beams.reference import assembled, cantilever_plane, eigenvalue_near, matrices

MATERIAL = Material(E=7e10, nu=0.33, rho=2700.0)
SECTION = Section(A=3e-4, Iy=2e-8, Iz=5e-9, J=1e-8, ky=0.8, kz=0.7)


def book(length, shear):
    p = SECTION.properties(MATERIAL.poisson)
    phi = shear_ratios(length, p, MATERIAL, shear)
    return matrices(length, p.A, p.Iy, p.Iz, p.J, MATERIAL.E, MATERIAL.shear_modulus, MATERIAL.rho, *phi, rotary=shear)


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("length", [0.05, 0.8])
def test_element_matrices_are_those_of_the_book(length, shear):
    p = SECTION.properties(MATERIAL.poisson)
    rows = Prismatic(length, p, MATERIAL, shear).mass_rows()
    k, m = (np.array(part) for part in book(length, shear))
    size = np.sqrt(np.outer(m.diagonal(), m.diagonal()))
    assert np.abs((rows.T @ rows - m) / size).max() < 1e-14
    half = 0.5 * length
    middle = np.eye(6)
    middle[1, 5], middle[2, 4] = half, -half
    other = middle.copy()
    other[1, 5], other[2, 4] = -half, half
    deformation = np.hstack((-middle, other))
    result = deformation.T @ np.diag(Prismatic(length, p, MATERIAL, shear).stiffness()) @ deformation
    size = np.sqrt(np.outer(k.diagonal(), k.diagonal()))
    assert np.abs((result - k) / size).max() < 1e-14


def test_shape_functions_at_the_ends_and_under_rigid_motion():
    x, phi = np.array([0.0, 1.0, 0.3]), np.array([0.0, 0.7])
    shapes = shapes_at(x, np.ones(3))
    deflections, rotations = deflection(shapes.deflection, 2.0, phi), rotation(shapes.rotation, 2.0, phi)
    turned = np.array([-0.6, 1.0, 1.4, 1.0])  # about x = 0.3 of the length 2
    for i in range(2):
        assert deflections[i, 0] == pytest.approx([1, 0, 0, 0], abs=1e-15)
        assert deflections[i, 1] == pytest.approx([0, 0, 1, 0], abs=1e-15)
        assert rotations[i, 0] == pytest.approx([0, 1, 0, 0], abs=1e-15)
        assert deflections[i, 2] @ turned == pytest.approx(0.0, abs=1e-15)
        assert rotations[i, 2] @ turned == pytest.approx(1.0, rel=1e-15)
        np.testing.assert_array_equal(deflections[i], deflection(shapes.deflection, 2.0, phi[i]))


@pytest.mark.parametrize("shear", [False, True])
def test_bent_line_has_the_frequencies_of_the_assembled_matrices(shear):
    nodes = [(0, 0, 0), (0.2, 0.05, 0), (0.4, 0.05, 0.1), (0.4, 0.3, 0.2), (0.5, 0.4, 0.5)]
    model = mv.Model("pipe")
    part = model.add_beam("pipe", None, "ground", SECTION, MATERIAL, nodes=nodes, y_axis=(1, 2, 5), shear=shear)
    frames = part.frames()
    k, m = assembled(nodes, [axes for _, axes in frames], lambda i: book(frames[i][0], shear))
    square = eigh(k[:-6, :-6], m[:-6, :-6], eigvals_only=True)
    assert model.linearize().modes().frequencies == pytest.approx(np.sqrt(square) / (2 * np.pi), rel=1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("n", [20, 60, pytest.param(200, marks=pytest.mark.slow)])
def test_lowest_modes_of_fine_beams_keep_all_digits(n):
    """Assembled matrices lose (highest / lowest frequency)^2 eps; deformations as coordinates lose nothing."""
    bar, material = Rectangle(0.02, 0.03), Material(E=2e11, nu=0.3, rho=7800.0)
    p = bar.properties(material.poisson)
    model = mv.Model("fine")
    model.add_beam("rod", "ground", None, bar, material, start=(0, 0, 0), end=(1, 0, 0), elements=n)
    result = model.linearize(method="dense").modes().frequencies
    with mp.workdps(50):
        k, m = cantilever_plane(n, mp.mpf(1), p.A, p.Iz, material.E, material.rho, mp.mpf(1))
        square = [beta**4 * material.E * p.Iz / (material.rho * p.A) for beta in (1.875104, 4.694091, 7.854757)]
        exact = [mp.sqrt(eigenvalue_near(k, m, mp.mpf(value))) / (2 * mp.pi) for value in square]
        assert max(min(abs(f / item - 1) for f in result) for item in exact) < 3e-15
    assembled_k, assembled_m = (np.array([[float(row.get(j, 0)) for j in range(2 * n)] for row in part])
                                for part in (k, m))  # fmt: skip
    lost = np.sqrt(eigh(assembled_k, assembled_m, eigvals_only=True)[0]) / (2 * np.pi * float(exact[0])) - 1.0
    assert abs(lost) > 1e-13


def test_supported_timoshenko_beam_converges_to_the_frequency_equation():
    """rho A rho I / (k G A) w^4 - (rho A + (rho I + E I rho A / (k G A)) b^2) w^2 + E I b^4 = 0, b = n pi / L."""
    bar, length = Rectangle(0.1, 0.2), 1.5
    p = bar.properties(MATERIAL.poisson)
    e, rho, shear = MATERIAL.E, MATERIAL.rho, p.kz * MATERIAL.shear_modulus * p.A
    b = np.arange(1, 4) * np.pi / length
    line, turn, bend = rho * p.A, rho * p.Iy, e * p.Iy
    middle = line + (turn + bend * line / shear) * b**2
    square = 2 * bend * b**4 / (middle + np.sqrt(middle**2 - 4 * line * turn / shear * bend * b**4))
    errors = []
    for n in (8, 16, 32):
        model = mv.Model("short")
        model.add_beam("beam", None, None, bar, MATERIAL, start=(0, 0, 0), end=(length, 0, 0), elements=n, shear=True)
        model.add_joint("left", None, "ground", "beam.0", position=(0, 0, 0), free=("ry",))
        model.add_joint("right", None, "ground", f"beam.{n}", position=(length, 0, 0), free=("x", "ry"))
        result = model.linearize().modes().frequencies
        errors.append(np.abs(result[:, None] / (np.sqrt(square) / (2 * np.pi)) - 1.0).min(axis=0))
    # elements have constant shear strain, the beam cos(b x): the energy is off by (b h)^2 / 12 of the shear's share
    share = bend * b**2 / (shear + bend * b**2)
    assert errors[2] == pytest.approx(share * (b * length / 32) ** 2 / 24, rel=0.15)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.03)


def test_frequencies_of_short_beams_converge_with_the_square_of_the_length_of_elements():
    """The second one of a clamped beam, five times as long as high, by Timoshenko's equations."""
    E, G, rho, A, Iy, shear = 2e11, 8e10, 7800.0, 0.01, 0.05 * 0.2**3 / 12, 5 / 6

    def free_end(w):
        """Determinant of moment and shear force at the end, of (deflection, slope, moment, shear force) along x."""
        slopes = np.array([[0, 1, 0, 1 / (shear * G * A)], [0, 0, 1 / (E * Iy), 0], [0, -rho * Iy * w**2, 0, -1],
                           [-rho * A * w**2, 0, 0, 0]])  # fmt: skip
        return np.linalg.det(expm(slopes)[2:, 2:])

    def second(elements):
        model = mv.Model("short")
        section = {"A": A, "Iy": Iy, "Iz": 9 * Iy, "J": Iy, "ky": shear, "kz": shear}
        model.add_beam("beam", "ground", None, section, {"E": E, "G": G, "rho": rho}, start=(0, 0, 0), end=(1, 0, 0),
                       elements=elements, shear=True, y_axis=(0, 1, 0))  # fmt: skip
        frequencies = 2 * np.pi * model.linearize().modes().frequencies
        return min(frequencies, key=lambda w: abs(w - 5400.0))

    exact = brentq(free_end, 5000.0, 6000.0, xtol=1e-8)
    errors = [second(count) / exact - 1 for count in (8, 16)]
    assert errors[1] == pytest.approx(5.3e-4, rel=0.01)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
