"""The reference of the other tests is itself held to closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.exact import Exact


def chain(kind, axis, n=3):
    """Chain of n bodies of 1 kg along z, joints at their lower ends, spring-dampers along or about the axis."""
    model = mv.Model("chain")
    stiffness, damping = np.full(6, 1e4), np.full(6, 10.0)
    stiffness[3:] *= 180 / np.pi
    damping[3:] *= 180 / np.pi
    below = "ground"
    for i in range(1, n + 1):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), position=(0, 0, 0.2 * i - 0.1))
        model.add_joint(f"j{i}", kind, below, f"b{i}", position=(0, 0, 0.2 * i - 0.2), axis=axis)
        model.add_bushing(f"k{i}", below, f"b{i}", (0, 0, 0.2 * i - 0.2), stiffness, damping)
        below = f"b{i}"
    return model


@pytest.mark.parametrize(
    ("kind", "stiffness", "damping"), [("prismatic", 1e4, 10.0), ("revolute", 1e4 * 180 / np.pi, 0)],
)
def test_chain_in_line_has_the_frequencies_of_the_closed_form(kind, stiffness, damping):
    n = 3
    reference = Exact(chain(kind, (0, 0, 1), n))
    j = np.arange(1, n + 1)
    omega = 2 * np.sqrt(stiffness) * np.sin((2 * j - 1) * np.pi / (2 * (2 * n + 1)))
    assert_allclose(np.sqrt(reference.squares), omega, rtol=1e-14)
    if damping:
        values = reference.eigenvalues[reference.eigenvalues.imag > 0]
        values = values[np.argsort(abs(values))]
        assert_allclose(-values.real / abs(values), damping * omega / (2 * stiffness), rtol=1e-14)


def test_published_spherical_chain():
    reference = Exact(chain("spherical", None))
    hertz = np.sqrt(reference.squares) / (2 * np.pi)
    assert_allclose(hertz[[1, 4, 7]], [51.507353, 146.095638, 216.523831][:3], atol=0.5e-6)


def ladder(layers):
    """Ladder in a plane, all revolute: per layer two side bodies and a rung, three redundant rows a loop."""
    model = mv.Model("ladder")
    stiffness, damping = (0, 0, 0, 0, 0, 1e4 * 180 / np.pi), (0, 0, 0, 0, 0, 1e1 * 180 / np.pi)
    below = ("ground", "ground")
    for i in range(1, layers + 1):
        model.add_body(f"rung{i}", 1.0, (1, 1, 1), position=(0, 0.2 * i, 0))
        for side, x in enumerate((-0.1, 0.1)):
            name = f"side{i}.{side}"
            model.add_body(name, 1.0, (1, 1, 1), position=(x, 0.2 * i - 0.1, 0))
            for end, other, y in (("low", below[side], 0.2 * i - 0.2), ("high", f"rung{i}", 0.2 * i)):
                model.add_joint(f"{name}.{end}", "revolute", other, name, position=(x, y, 0))
                model.add_bushing(f"{name}.{end}.k", other, name, (x, y, 0), stiffness, damping)
        below = (f"rung{i}", f"rung{i}")
    return model


def test_ladder_of_fifty_digits():
    """Three redundant rows a loop, and frequencies published to 30 digits."""
    reference = Exact(ladder(5))
    assert (reference.dof, reference.redundant) == (5, 15)
    omega = [834.770107418131963273104675436, 1036.00663705973173814916123278, 1058.92091335882734519080126733]
    assert_allclose(np.sqrt(reference.squares[:3]), omega, rtol=1e-14)
