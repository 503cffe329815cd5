"""Superelements: reduced finite element models, and the files of other programs that hold them."""

from mbsvib.superelements.reading import Reduced, read_mat, read_op4, read_punch
from mbsvib.superelements.superelement import Superelement

__all__ = ["Reduced", "Superelement", "read_mat", "read_op4", "read_punch"]
