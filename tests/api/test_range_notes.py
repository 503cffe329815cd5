"""Tables of the modes of small mechanisms tell outputs whose linear range is small."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.api.linear_range import LinearRange

SENTENCE = "the second-order part reaches 10% of the linear one at an estimated amplitude of"


@pytest.mark.slow
def test_a_toggle_near_its_dead_centre():
    system = library.toggle(angle=0.01).linearize()
    notes = [note for note in system.modes().remarks() if SENTENCE in note]
    assert notes == [text[0].upper() + text[1:] for text in system.linear_range().sentences()]
    assert notes[0].startswith("Output 's': ")
    assert SENTENCE in str(system.modes())
    assert SENTENCE not in str(library.toggle(angle=0.3).linearize().modes())


@pytest.mark.slow
def test_others_tell_nothing():
    """Loops with other equations than the model's, systems of matrices, and larger mechanisms."""
    system = library.toggle(angle=0.01).linearize()
    space = mv.System.from_matrices(system.M, system.C, system.K)
    tree = library.tree(4).linearize()
    assert any(SENTENCE in text for text in tree.linear_range().sentences())
    for modes in (space.modes(), tree.modes()):
        assert not any(SENTENCE in note for note in modes.remarks())


def test_of_modes_that_coincide_the_best_counts():
    """An output sees one combination of two equal modes not at all, so that the other one tells its range."""
    def notes(second, third):
        travel = np.array([[0.3], [1e-4], [third]])
        found = LinearRange("platform", 0.1, ("y",), ("m",), np.array([10.0, second, 20.0]), 0.5 * travel, travel)
        return [text.partition(" in mode ")[2][0] for text in found.sentences()]

    assert notes(10.0 * (1.0 + 1e-13), 0.4) == []
    assert notes(10.0 * (1.0 + 1e-13), 1e-3) == ["3"]
    assert notes(11.0, 0.4) == ["2"]


def test_amplitudes_that_are_not_finite_are_explained():
    printed = str(mv.library.pendulum_chain(2).linearize().linear_range())
    assert "inf: no second-order part; parts of third order" in printed
    assert "nan: outputs without second derivatives" in printed
    assert "third order" not in str(mv.library.toggle().linearize().linear_range())


def test_a_mode_that_hardly_moves_an_output_tells_nothing():
    """At equal travel mode 1 moves the output by a ten-thousandth of what mode 2 does: what it is worth is not said."""
    travel, moves = np.array([[1e-4], [0.3]]), np.array([[1e-4], [1.0]])
    found = LinearRange("platform", 0.1, ("z",), ("m",), np.array([5.0, 20.0]), travel * moves, travel)
    assert found.sentences() == ()
    (text,) = LinearRange("platform", 0.1, ("z",), ("m",), np.array([5.0, 20.0]), travel * 0.5, travel).sentences()
    assert "in mode 1 (5 Hz); beyond it, only a nonlinear simulation is accurate." in text
