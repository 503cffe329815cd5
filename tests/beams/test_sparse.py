"""Beams and superelements by the sparse equations: the same answers, and long ones in no time."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.beams import Material, Rectangle
from tests.superelements.craig_bampton import NODES, reduced
from tests.support.sizes import few

STEEL = Material(E=2e11, nu=0.3, rho=7800.0)
OMEGA = 2 * np.pi * np.array([3.0, 20.0, 300.0])


def mast(n, **words):
    model = mv.Model("mast")
    model.add_body("tip", 3.0, (0.01, 0.01, 0.01), position=(1, 0, 0.2))
    model.add_beam("rod", "ground", "tip", Rectangle(0.02, 0.03), STEEL, start=(0, 0, 0), end=(1, 0, 0), elements=n,
                   **words)  # fmt: skip
    if n > 2:
        model.add_input("F", "rod.2", "z")
    model.add_output("z", "tip", "z")
    model.add_output("a", "tip", "y", quantity="acceleration")
    model.add_base_motion("shake", (1, 2, 3, 0.1, 0.2, 0.3), position=(0.1, 0.2, 0.3))
    model.add_force_output("shear", "rod.e1", "z")
    return model


@pytest.mark.few(2)
@pytest.mark.parametrize("words", [{}, {"alpha": 1.0, "beta": 1e-6, "shear": True}, {"damping_ratio": 0.01}])
@pytest.mark.parametrize("n", few([2, 9, 34], 2))
def test_same_answers_as_dense(n, words):
    model = mast(n, **words)
    dense, sparse = model.linearize(method="dense"), model.linearize(method="sparse")
    first, second = dense.modes(6), sparse.modes(6)
    assert second.frequencies == pytest.approx(first.frequencies, rel=1e-12)
    assert second.damping_ratios == pytest.approx(first.damping_ratios, rel=1e-9, abs=1e-14)
    assert sparse.frequency_response(OMEGA) == pytest.approx(dense.frequency_response(OMEGA), rel=1e-9)


def test_superelement_and_beam_between_two_bodies():
    m, k = reduced(5)
    model = mv.Model("both")
    model.add_body("hub", 0.8, (0.002, 0.003, 0.002), position=(0, -0.25, 0.3))
    model.add_superelement("pipe", m, 1e-5 * k, k, {"left": NODES[0], "right": NODES[-1]}, bodies={"left": "hub"})
    model.add_beam("rod", "hub", "pipe.right", Rectangle(0.02, 0.03), STEEL, start=NODES[0], end=NODES[-1], elements=3)
    model.add_joint("pin", "revolute", "ground", "hub", position=(0, 0, 0), axis=(0, 1, 0))
    dense, sparse = model.linearize(method="dense").modes(8), model.linearize(method="sparse").modes(8)
    assert sparse.frequencies == pytest.approx(dense.frequencies, rel=1e-10)
    assert sparse.frequencies[0] == dense.frequencies[0] == 0.0


def test_strain_energy_of_two_superelements():
    m, k = reduced(1)
    model = mv.Model("two")
    model.add_body("hub", 0.8, (0.002, 0.003, 0.002), position=(0, -0.25, 0.3))
    for name, stiffer in (("soft", 1.0), ("stiff", 3.0)):
        model.add_superelement(name, m, None, stiffer * k, {"left": NODES[0], "right": NODES[-1]},
                               bodies={"left": "hub"})  # fmt: skip
    model.add_joint("pin", "revolute", "ground", "hub", position=(0, 0, 0), axis=(0, 1, 0))
    expected = model.linearize(method="dense").stiffness_shares()
    shares = model.linearize(method="sparse").reduced(8).stiffness_shares()
    assert set(shares.elements) == set(expected.elements) == {"soft", "stiff"}
    for name in expected.elements:
        assert shares.of(name)[:8] == pytest.approx(expected.of(name)[:8], rel=1e-8, abs=1e-10)


@pytest.mark.slow
def test_many_elements_are_taken_sparse_of_their_own_accord():
    system = mast(800).linearize()
    assert type(system).__name__ == "SparseSystem"
    exact = mast(60).linearize().modes(4).frequencies
    assert system.modes(4).frequencies == pytest.approx(exact, rel=1e-6)
