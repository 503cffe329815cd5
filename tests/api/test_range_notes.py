"""Tables of the modes of small mechanisms tell outputs whose linear range is small."""

import mbsvib as mv
from mbsvib import library

SENTENCE = "the second-order part reaches 10% of the linear one at an amplitude of"


def test_a_toggle_near_its_dead_centre():
    system = library.toggle(angle=0.01).linearize()
    notes = [note for note in system.modes().remarks() if SENTENCE in note]
    assert notes == [text[0].upper() + text[1:] for text in system.linear_range().sentences()]
    assert notes[0].startswith("Output 's': ")
    assert SENTENCE in str(system.modes())
    assert SENTENCE not in str(library.toggle(angle=0.3).linearize().modes())


def test_others_tell_nothing():
    """Loops with other equations than the model's, systems of matrices, and larger mechanisms."""
    system = library.toggle(angle=0.01).linearize()
    space = mv.System.from_matrices(system.M, system.C, system.K)
    tree = library.tree().linearize()
    assert any(SENTENCE in text for text in tree.linear_range().sentences())
    for modes in (space.modes(), tree.modes()):
        assert not any(SENTENCE in note for note in modes.remarks())
