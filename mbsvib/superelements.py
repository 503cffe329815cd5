"""Superelements: reduced finite element models, and the files of other programs that hold them."""

from mbsvib.elements.superelement import Superelement
from mbsvib.elements.superelement_files import Reduced, read_mat, read_op4, read_punch

__all__ = ["Reduced", "Superelement", "read_mat", "read_op4", "read_punch"]
