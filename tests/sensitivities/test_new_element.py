"""A force element that sensitivities know nothing of: its parameters act by the rows that it states."""

from dataclasses import dataclass

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements import families, spring
from mbsvib.elements.connection import ENDS, LINE, Connection
from mbsvib.elements.roles import number, stated
from mbsvib.elements.rows import ElementRows, columns
from mbsvib.linalg.differences import slope
from mbsvib.sensitivities.forms import have_rules


@dataclass(frozen=True, slots=True)
class Strap(Connection):
    """A strap from ``start`` to ``end`` of stiffness ``modulus`` [N/m^2] times ``width``^2 [m] over its length."""

    roles = stated(**ENDS, modulus=number("N/m^2"), width=number("m"), loss=number("s"), **LINE)

    start: tuple[float, ...]
    end: tuple[float, ...]
    modulus: float
    width: float
    loss: float


def rows(parts, number):
    lines = [np.subtract(p.end, p.start) for _, p in parts]
    lengths = [np.linalg.norm(line) for line in lines]
    k = np.array([p.modulus * p.width**2 / length for (_, p), length in zip(parts, lengths, strict=True)])
    table = columns([(number[p.first], number[p.second], i, *p.start, *(line / length))
                     for (i, p), line, length in zip(parts, lines, lengths, strict=True)], 9)  # fmt: skip
    return ElementRows.along_lines(table[:3], table[3:6], table[6:9], k, k * [p.loss for _, p in parts])


@pytest.fixture
def model(monkeypatch):
    monkeypatch.setitem(families._ROWS, Strap, rows)
    result = mv.Model("straps")
    result.add_body("plate", mass=3.0, inertia=[0.2, 0.3, 0.4], position=(0.1, 0.2, 0.9))
    result.add_bushing("foot", "ground", "plate", (0.0, 0.0, 0.5), stiffness=[900.0, 800.0, 700.0, 60.0, 50.0, 40.0])
    strap = Strap("strap", "ground", "plate", (0.3, -0.4, 0.0), (0.5, 0.1, 0.8), 4e5, 0.02, 1e-3)
    return result.with_parts(springs=dict(result.springs) | {"strap": strap})


def test_rows_of_a_new_element_say_its_derivatives(model):
    system = model.linearize()
    basis = system.sensitivity_basis
    assert have_rules(basis.network, basis.groups().variables.layout).all()
    names = [name for name in system.parameters if name.startswith("strap.")]
    assert len(names) == 9
    result = system.mode_sensitivities(names).eigenvalues
    for name, derivative in zip(names, result, strict=True):
        value = system.parameters[name]

        def at(change, name=name, value=value):
            return model.with_values({name: value + change}).linearize().modes().eigenvalues

        expected, error = slope(at, 3e-4 * (abs(value) or 1.0))
        np.testing.assert_allclose(derivative, expected, rtol=0, atol=5e-9 * np.abs(expected).max() + 20 * error.max())


def test_a_new_element_as_a_line_spring(model):
    strap = model.springs["strap"]
    length = float(np.linalg.norm(np.subtract(strap.end, strap.start)))
    stiffness = strap.modulus * strap.width**2 / length
    other = model.with_parts(springs={"foot": model.springs["foot"], "strap": spring.make(
        "strap", "ground", "plate", strap.start, strap.end, stiffness, stiffness * strap.loss)})  # fmt: skip
    by_rows = model.linearize().mode_sensitivities(["strap.modulus"]).eigenvalues
    exact = other.linearize().mode_sensitivities(
        {"modulus": {"strap.stiffness": stiffness / strap.modulus,
                     "strap.damping": stiffness * strap.loss / strap.modulus}}).eigenvalues  # fmt: skip
    np.testing.assert_allclose(by_rows, exact, rtol=0, atol=1e-13 * np.abs(exact).max())
