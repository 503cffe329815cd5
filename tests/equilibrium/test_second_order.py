"""Beams whose slopes add to their strain: tension that resists bending, ends held apart, and buckling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib.elements.beam_expansion import elastic_part
from mbsvib.elements.elastic_part import stiffness_rows

LENGTH, SIDE = 1.0, 4e-3
STEEL = {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}
SQUARE = {"type": "rectangle", "width": SIDE, "height": SIDE}
AREA, EI = SIDE**2, STEEL["E"] * SIDE**4 / 12


def cantilever(elements, force, **words):
    model = mv.Model("cantilever")
    model.add_beam("rod", "ground", None, SQUARE, STEEL, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=elements,
                   **words)  # fmt: skip
    model.add_load("P", f"rod.{elements}", force)
    return model


def deflection(tension, force):
    """Of the tip under a force across: the closed form of EI w'''' = N w'."""
    k = np.sqrt(abs(tension) / EI)
    of = np.tanh if tension > 0.0 else np.tan
    return force / tension * (LENGTH - of(k * LENGTH) / k)


@pytest.mark.slow
@pytest.mark.parametrize("tension", [5.0, 50.0, -10.0])
def test_tension_resists_bending(tension):
    """The error falls with the fourth power of the elements' length, as that of the cubic deflection."""
    errors = []
    for elements in (2, 4, 8):
        tip = cantilever(elements, (tension, 3e-3, -2e-3)).equilibrium().beams["rod"].points[-1]
        exact = deflection(tension, 1.0)
        errors.append(abs(tip[2] / (-2e-3 * exact) - 1.0))
        assert tip[1] / tip[2] == pytest.approx(-1.5, rel=1e-6)
    assert errors[2] < 2e-5
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.1)


def test_shear_deformation_beside_tension():
    """A short Timoshenko beam; its shear angle adds to the slope on which tension acts."""
    short, tension, force = 0.02, 2e4, 1e-2
    model = mv.Model("short")
    model.add_beam("rod", "ground", None, SQUARE, STEEL, start=(0, 0, 0), end=(short, 0, 0), elements=16, shear=True)
    model.add_load("P", "rod.16", (tension, 0, -force))
    beam = model.beams["rod"]
    stiff = beam.properties.kz * beam.material.shear_modulus * AREA
    # with the rotation psi: kGA (w' - psi) + N w' = force, EI psi'' + kGA (w' - psi) = 0
    ratio = 1.0 + tension / stiff
    k = np.sqrt(tension / (EI * ratio))
    exact = force / tension * (short - np.tanh(k * short) / (k * ratio))
    there = model.equilibrium().beams["rod"].points[-1][2]
    assert there == pytest.approx(-exact, rel=1e-4)
    without = force * (short**3 / (3 * EI) + short / stiff)
    assert abs(there) < 0.9 * without


@pytest.mark.slow
@pytest.mark.parametrize(("side", "force", "stiffer"), [(4e-3, 12.0, 1.6), (1e-3, 10.0, 150.0)])
def test_a_beam_between_walls_stretches(side, force, stiffer):
    """By 1.4 and by 18 of its thicknesses; tension and sag follow from the length of the line."""
    area, bending = side**2, STEEL["E"] * side**4 / 12

    def excess(n):
        k = np.sqrt(n / bending)
        ratio = np.tanh(0.25 * k * LENGTH)
        slope = lambda x: 1.0 - np.exp(-k * x) - (1.0 - ratio) * np.sinh(k * x)  # noqa: E731
        longer = quad(lambda x: (force / (2 * n) * slope(x)) ** 2, 0.0, 0.5 * LENGTH, epsabs=1e-13)[0]
        return longer - n * LENGTH / (STEEL["E"] * area)

    n = brentq(excess, 1.0, 5000.0, xtol=1e-9)
    k = np.sqrt(n / bending)
    exact = force / (2 * n) * (0.5 * LENGTH - 2.0 / k * np.tanh(0.25 * k * LENGTH))
    model = mv.Model("walls")
    model.add_beam("rod", "ground", "ground", {"type": "rectangle", "width": side, "height": side}, STEEL,
                   start=(0, 0, 0), end=(LENGTH, 0, 0), elements=16)  # fmt: skip
    model.add_load("P", "rod.8", (0, 0, -force))
    there = model.equilibrium()
    assert there.beams["rod"].points[8][2] == pytest.approx(-exact, rel=1e-2 if side < 2e-3 else 1e-4)
    assert exact < force * LENGTH**3 / (192 * bending) / stiffer
    part = elastic_part(there.beams["rod"])
    np.testing.assert_allclose(-part.row_forces.reshape(16, 6)[:, 0], n, rtol=2e-2 if side < 2e-3 else 1e-4)


def test_a_beam_that_bends_comes_nearer():
    force = 0.05
    tip = cantilever(8, (0, 0, -force)).equilibrium().beams["rod"].points[-1]
    assert tip[2] == pytest.approx(-force * LENGTH**3 / (3 * EI), rel=1e-9)
    assert LENGTH - tip[0] == pytest.approx(force**2 * LENGTH**5 / (15 * EI**2), rel=1e-6)


@pytest.mark.slow
def test_a_strut_buckles_where_euler_says():
    """The path of a strut that its end compresses crosses the bent one at 4 pi^2 EI / L^2."""
    model = mv.Model("strut")
    model.add_body("end", 0.01, (1e-6,) * 3, (LENGTH, 0, 0))
    model.add_joint("guide", "prismatic", "ground", "end", (LENGTH, 0, 0), axis=(1, 0, 0))
    model.add_beam("rod", "ground", "end", {"type": "rectangle", "width": SIDE, "height": 0.5 * SIDE}, STEEL,
                   start=(0, 0, 0), end=(LENGTH, 0, 0), elements=8)  # fmt: skip
    euler = 4.0 * np.pi**2 * (EI / 8.0) / LENGTH**2
    shortening = euler * LENGTH / (STEEL["E"] * 0.5 * AREA)
    path = model.path("guide.z", [-0.5 * shortening, -1.5 * shortening])
    branch = next(point for point in path.points if point.kind == "branch")
    assert abs(branch.force) == pytest.approx(euler, rel=6e-4)
    assert path.stable.tolist() == [True, False]


def test_forces_and_stiffness_are_those_of_the_potential():
    """Slopes in all directions: F = -dV/dx by complex steps, and its derivative by differences."""
    rod, rng = cantilever(3, (0, 0, 1.0), shear=True).beams["rod"], np.random.default_rng(1)
    bent = rod.through(np.array(rod.points), rod.y_axes(), rng.normal(0.0, 1e-2, (4, 6)))
    part = elastic_part(bent)
    assert part.slopes is not None

    def potential(x):
        e, along = part.rows @ x, part.slopes.matrix @ x
        np.add.at(e, part.slopes.rows, 0.5 * part.slopes.weights * along * along)
        return 0.5 * part.values @ (e * e)

    def gradient(x):
        return np.array([potential(x + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(x))])

    size = np.abs(part.forces(part.row_forces)).max()
    np.testing.assert_allclose(part.forces(part.row_forces), -gradient(part.state), rtol=1e-12, atol=1e-12 * size)
    flat = replace(part, state=part.state * ([1, 1, 1, 0, 0, 0] * 3))  # rotation vectors without second order
    rows, h = stiffness_rows(flat), 1e-6
    differences = [(gradient(flat.state + h * unit) - gradient(flat.state - h * unit)) / (2 * h)
                   for unit in np.eye(len(flat.state))]  # fmt: skip
    stiffness = (rows.matrix * rows.stiffness[:, None]).T @ rows.matrix
    np.testing.assert_allclose(stiffness, differences, rtol=1e-6, atol=1e-9 * np.abs(stiffness).max())


def test_a_stated_choice_goes_through_files(tmp_path):
    model = cantilever(2, (5.0, 0, -0.1), second_order=False)
    mv.save(model, tmp_path / "linear.yaml")
    assert "second_order: false" in (tmp_path / "linear.yaml").read_text()
    assert mv.load(tmp_path / "linear.yaml").beams["rod"] == model.beams["rod"]
    with pytest.raises(mv.ModelError, match=r"second_order = 1; expected True .* or False"):
        cantilever(2, (0, 0, 0), second_order=1)
