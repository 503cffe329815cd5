"""Sensitivities of everything that a system answers to every number it was made of.

Verbs, one for each kind of answer:
eigenvalues            derivatives of the eigenvalues, repeated ones included
shapes                 derivatives of frequencies, damping ratios and mode shapes
responses              derivatives of frequency responses, by the adjoint
transients             derivatives of time responses
sparse_modes           derivatives of some modes of sparse equations
plant_slopes           derivatives of variants of a compiled plant, by complex steps or the adjoint
norms                  H2 and Hinf norms with their derivatives

What they share:
basis                  all that is kept for repeated questions, derivatives of the matrices among it
matrix_derivatives     derivatives of the matrices, whole and as factors of low rank
port_forms             derivatives of a response, from the motions of its inputs and outputs; checks of these as loads
spectrum               eigenvalues with right and left vectors; branches has those that coincide
states                 first-order equations and their derivatives

Parameters:
variables              names, patterns and linear maps of parameters; their layout by the fields of parts
parameter_groups       the variables asked for with the groups of the parameters that they move, and which lose freedom
parameter_group        one field of many parts of a kind, which one rule holds for
applicability          which parameters act by rules under load
variants               derivatives of whole matrices by differences, for all other parameters; variant_poses moves them

Rules, the derivatives of the equations as products of motions and wrenches:
products               forms of many parameters between many pairs of motions, those of whole matrices among them
families               what each family of parts says of its parameters, one file a family

The mechanism in numbers:
network                bodies and connections; network_assembly makes it of a system
element_matrices       connections as matrices on the relative motion at a point of each
adjoint_fields         motions, with the wrenches that they put into bodies and connections
transmitted_wrenches   what joints transmit, loops included; motions in which joints come apart
shared_wrenches        what beams, reduced models and rotors do to bodies
network_kinematics     coordinates of a network, and what closes its loops; sparse_modes has amplitudes of modes
ports                  inputs and outputs as loads of the network

Loaded scenes, through the equilibrium:
loaded_network         a network under its forces: what these do to forms, by parameters and by the pose
pose_motion            how the pose gives way to parameters, dq/dp = K^-1 dR/dp
force_changes          what parameters change of the forces, and how both follow the bodies as these move
reference_pose         what parameters as described do, where the equilibrium was found in another pose
second_order_work      the work of the forces on small motions to second order, with derivatives
forces                 the forces at the pose; forces_at_rest collects them from the equations
force_layout           changes of these forces in one row; element_reactions has those of beams that keep their shape
displaced_bodies       bodies in the pose against where they are described
"""

from mbsvib.responses.norms import Norm
from mbsvib.sensitivities.eigenvalues import eigenvalue_sensitivities
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.norms import h2_norm, hinf_norm
from mbsvib.sensitivities.responses import frequency_response_sensitivities
from mbsvib.sensitivities.shapes import ModeSensitivities, mode_sensitivities
from mbsvib.sensitivities.sparse_modes import sparse_mode_sensitivities
from mbsvib.sensitivities.transients import time_response_sensitivities

__all__ = [
    "MatrixDerivatives", "ModeSensitivities", "Norm", "eigenvalue_sensitivities", "frequency_response_sensitivities",
    "h2_norm", "hinf_norm", "mode_sensitivities", "sparse_mode_sensitivities", "time_response_sensitivities",
]  # fmt: skip
