"""Sensitivities of everything that a system answers to every number it was made of.

network       the mechanism as bodies and connections with their parameters, in numbers
ties          the forces that close loops and couple coordinates
fields        motions, and the wrenches that they put into every connection
factors       derivatives of the equations as products of such motions and wrenches
variables     names, patterns and linear maps of parameters
plans         parameters grouped into families that one rule holds for
products      derivatives of the equations between many pairs of motions
eigenvalues   derivatives of the eigenvalues, repeated ones included
loads         inputs and outputs as connections of the network
gaps          motions in which joints come apart, on which their forces do work
responses     derivatives of frequency responses
matrices      derivatives of the matrices, whole and as factors
shapes        derivatives of frequencies, damping ratios and mode shapes
flexible      beams: material, section and damping
coupled       couplers: their coefficients
relaxing      Maxwell elements: lines, a node and their numbers
balance       loaded scenes: through the equilibrium, by what the forces at the pose do to second order
limits        which parameters act by rules of their own under load, with spin or beams, and where balance is known
variants      all others: differences of whole equations, through the equilibrium where loads act
differences   slopes of smooth functions, extrapolated to rounding
whole         parameters whose derivatives are whole matrices, as a family of a plan
vectors       vector algebra of many parts at once
states        first-order equations and their derivatives
transients    derivatives of time responses
norms         H2 and Hinf norms with their derivatives
"""

from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.norms import Norm, h2_norm, hinf_norm
from mbsvib.sensitivities.responses import frequency_response_sensitivities
from mbsvib.sensitivities.shapes import ModeSensitivities, mode_sensitivities
from mbsvib.sensitivities.transients import time_response_sensitivities

__all__ = [
    "MatrixDerivatives", "ModeSensitivities", "Norm", "eigenvalue_sensitivities", "frequency_response_sensitivities",
    "h2_norm", "hinf_norm", "mode_sensitivities", "time_response_sensitivities",
]  # fmt: skip
