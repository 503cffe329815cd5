"""Sensitivities of everything that a system answers to every number it was made of, without finite differences.

network       the mechanism as bodies and connections with their parameters, in numbers
fields        motions, and the wrenches that they put into every connection
factors       derivatives of the equations as products of such motions and wrenches
variables     names, patterns and linear maps of parameters
eigenvalues   derivatives of the eigenvalues, repeated ones included
"""

from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities

__all__ = ["eigenvalue_sensitivities"]
