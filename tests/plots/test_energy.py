"""Energy shares."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import energy
from mbsvib.plots.energy import largest


def heights(figure):
    """{name: heights of its bars}"""
    return {item.get_label(): [bar.get_height() for bar in item] for item in figure.axes[0].containers}


def test_bars_are_the_shares():
    system = mv.library.build("stewart").linearize()
    shares = system.stiffness_shares(system.modes())
    drawn = heights(energy(system))
    assert list(drawn) == list(shares.elements)
    np.testing.assert_allclose([*drawn.values()], 100.0 * shares.shares)
    kinetic = heights(energy(system, "kinetic"))
    np.testing.assert_allclose(kinetic["platform"], 100.0 * system.modes().kinetic_energy["platform"])
    np.testing.assert_allclose(np.sum([*kinetic.values()], axis=0), 100.0)


def test_small_shares_are_summed():
    values = np.array([[0.9, 0.5], [0.001, 0.004], [0.002, 0.004], [0.097, 0.492]])
    rows = largest("abcd", values)
    assert [name for name, _ in rows] == ["a", "d", "all others"]
    np.testing.assert_allclose(rows[2][1], [0.003, 0.008])
    assert [name for name, _ in largest("abcd", values * [[1], [0.3], [0.3], [1]])] == ["a", "d"]  # thinner than a line


def test_refusals(slider):
    with pytest.raises(mv.ResponseError, match="'strain' or 'kinetic'"):
        energy(slider(), "potential")
    model = mv.Model("locked")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("weld", "fixed", "ground", "b")
    with pytest.raises(mv.ResponseError, match="fully locked"):
        energy(model.linearize())
