"""Beams: sections and materials.

>>> from mbsvib.beams import Material, Tube
>>> steel = Material(E=2.1e11, nu=0.3, rho=7800)
>>> Tube(radius=0.175, wall=0.015).properties(steel.poisson).A
0.01578650305428617
"""

from mbsvib.elements.beam import Beam
from mbsvib.elements.material import Material
from mbsvib.elements.sections import Circle, Properties, Rectangle, Section, Tube

__all__ = ["Beam", "Circle", "Material", "Properties", "Rectangle", "Section", "Tube"]
