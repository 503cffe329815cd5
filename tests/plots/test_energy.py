"""Energy shares."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import energy
from mbsvib.plots.modes import largest


def drawn(figure):
    """{element: shares of the modes, in percent}"""
    axes = figure.axes[0]
    names = [label.get_text() for label in axes.get_yticklabels()]
    return dict(zip(names, np.asarray(axes.images[0].get_array()), strict=True))


@pytest.mark.slow
def test_colours_are_the_shares():
    system = mv.library.build("stewart").linearize()
    shares = system.stiffness_shares(system.modes())
    strain = drawn(energy(system))
    assert list(strain) == list(shares.elements)
    np.testing.assert_allclose([*strain.values()], 100.0 * shares.shares)
    kinetic = drawn(energy(system, "kinetic"))
    np.testing.assert_allclose(kinetic["platform"], 100.0 * system.modes().kinetic_energy["platform"])
    np.testing.assert_allclose(np.sum([*kinetic.values()], axis=0), 100.0)


def test_numbers_are_beside_their_mode_and_element():
    system = mv.library.build("stewart").linearize()
    shares, figure = system.stiffness_shares(system.modes()), energy(system)
    places = {text.get_position(): text.get_text() for text in figure.axes[0].texts}
    numbers = {(row, mode - 1): text for (mode, row), text in places.items()}
    expected = {(i, k): f"{100.0 * share:.0f}" for (i, k), share in np.ndenumerate(shares.shares) if share >= 0.005}
    assert numbers == expected


def test_what_softens_is_red_and_zero_is_white():
    system = mv.library.build("four_bar").linearize()
    shares, image = system.stiffness_shares(system.modes()).shares, energy(system).axes[0].images[0]
    assert shares.min() < 0.0
    red, _, blue, _ = image.cmap(image.norm(100.0 * shares.min()))
    assert red > blue
    np.testing.assert_allclose(image.cmap(image.norm(0.0)), 1.0, atol=0.01)
    assert image.cmap(image.norm(100.0 * shares.max()))[2] > 0.6


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
