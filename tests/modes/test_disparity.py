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


def changed(change):
    """The free chain with a change, and the chain that is held."""
    model = mv.Model("changed")
    for name, x in (("a", 1.0), ("b", 2.0)):
        model.add_body(name, *((0.0, (0, 0, 0)) if (change, name) == ("massless", "b") else (1.0, (0.1, 0.1, 0.1))),
                       position=(x, 0, 0))  # fmt: skip
        model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring(f"k.{name}", "ground", name, (x - 1.0, 0, 0), (x, 0, 0), 100.0, damping=3.0)
    if change == "follower":
        model.add_body("c", 1.0, (0.1, 0.1, 0.1), (1.0, 1.0, 0))
        model.add_joint("hinge", "revolute", "a", "c", (1.0, 0, 0), axis=(0, 0, 1))
        model.add_load("thrust", "c", force=(0, -20.0, 0), follower=True)
    return model.linearize()


@pytest.mark.parametrize(("free", "held", "words"), [
    (lambda: chain(True), lambda: chain(False), "'free' moves in ways that 'held' does not"),
    (lambda: changed("follower"), lambda: chain(True), "'changed' has follower loads"),
    (lambda: changed("massless"), lambda: chain(True), "'changed' has coordinates without mass"),
    (lambda: chain(False), lambda: changed("follower"), "has follower loads"),
    (lambda: chain(False), lambda: mv.library.quarter_car().linearize(), "none of 'free'"),
])  # fmt: skip
def test_what_has_no_disparity_is_refused(free, held, words):
    with pytest.raises(mv.ResponseError, match=words):
        mv.modal_disparity(free(), held())


@pytest.mark.parametrize("mass", [1.0, 4.0])
def test_shares_of_unequal_masses(mass):
    """psi = (1, 1): (psi^T M phi)^2 / (phi^T M phi psi^T M psi) with phi from tan of twice the angle of the pair."""
    systems = []
    for held in (False, True):
        model = mv.Model("held" if held else "free")
        for name, x, m in (("a", 1.0, mass), ("b", 2.0, 1.0)):
            model.add_body(name, m, (0.1, 0.1, 0.1), (x, 0, 0))
            model.add_joint(f"rail.{name}", "prismatic", "ground", name, axis=(1, 0, 0))
        model.add_spring("k1", "ground", "a", (0, 0, 0), (1, 0, 0), 100.0)
        model.add_spring("k2", "a", "b", (1, 0, 0), (2, 0, 0), 50.0)
        if held:
            model.add_joint("lock", "fixed", "a", "b")
        systems.append(model.linearize())
    # mass-weighted: tan 2 t = 2 k12 / (k11 - k22) of the symmetric matrix K_ij / sqrt(m_i m_j)
    k11, k22, k12 = 150.0 / mass, 50.0, -50.0 / np.sqrt(mass)
    angle = 0.5 * np.arctan2(2.0 * k12, k11 - k22)
    high, held = np.array([np.cos(angle), np.sin(angle)]), np.array([np.sqrt(mass), 1.0]) / np.sqrt(mass + 1.0)
    exact = (high @ held) ** 2
    np.testing.assert_allclose(mv.modal_disparity(*systems), [[1.0 - exact], [exact]], rtol=1e-12)
