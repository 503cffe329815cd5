"""Modal disparity of a free and a held system."""

import numpy as np
import pytest

import mbsvib as mv


def chain(held):
    """Two equal masses between three equal springs; held: rigidly joined, so that they move together."""
    model = mv.Model("held" if held else "free")
    for name, x in (("a", 1.0), ("b", 2.0)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), (x, 0, 0))
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(1, 0, 0))
    for i, (first, second) in enumerate((("ground", "a"), ("a", "b"), ("b", "ground"))):
        model.add_spring(f"k{i}", first, second, (i, 0, 0), (i + 1.0, 0, 0), 100.0)
    if held:
        model.add_joint("lock", "fixed", "a", "b")
    return model.linearize()


def test_the_common_mode_stays_and_the_other_is_caught():
    np.testing.assert_allclose(mv.modal_disparity(chain(False), chain(True)), [[1.0], [0.0]], atol=1e-14)


def test_a_system_has_no_disparity_with_itself():
    system = mv.library.stewart().linearize()
    shares = mv.modal_disparity(system, system)
    # a pair of equal frequencies may mix; what it holds together does not
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, atol=1e-9)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-9)


def test_held_beam():
    """A point in the middle held: antisymmetric modes go on as they are, symmetric ones spread and lose energy."""
    systems = []
    for held in (False, True):
        model = mv.Model("beam")
        model.add_beam("b", "ground", "ground", {"type": "rectangle", "width": 0.02, "height": 0.004},
                       {"E": 2.1e11, "rho": 7800.0, "nu": 0.3}, (0, 0, 0), (1.0, 0, 0), elements=4)  # fmt: skip
        if held:
            model.add_joint("pin", "spherical", "ground", "b.2", (0.5, 0, 0))
        systems.append(model.linearize())
    shares = mv.modal_disparity(*systems)
    assert shares.shape == (systems[0].dof, systems[1].dof)
    lost = 1.0 - shares.sum(axis=1)
    assert (lost > -1e-9).all()
    frequencies = [system.modes().frequencies for system in systems]
    stays = np.abs(frequencies[0][:, None] - frequencies[1]).min(axis=1) < 1e-6 * frequencies[0]
    assert stays.any()
    assert not stays.all()
    np.testing.assert_allclose(lost[stays], 0.0, atol=1e-8)
    assert (lost[~stays] > 1e-3).all()


def test_the_wrong_order_is_refused():
    with pytest.raises(mv.ResponseError, match="without the constraints first"):
        mv.modal_disparity(chain(True), chain(False))
