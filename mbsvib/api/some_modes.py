"""Some modes of a sparse system as users get them; modes of dense systems need nothing of sparse ones."""

from __future__ import annotations

from mbsvib.api.modes import Modes
from mbsvib.sparse import modes as sparse


class SomeModes(Modes, sparse.SomeModes):
    """Some modes of a large system: ``Modes`` with the system ``reduced`` that they make.

    ``shapes`` are in the coordinates of ``reduced`` (mode1, mode2, ...), ``body_shapes`` those of the bodies.
    ``missed`` is the number of modes below the highest one that are not among these, by a count of eigenvalues
    (0; None where they cannot be counted: rows were exchanged, or the equations have no symmetry).
    """
