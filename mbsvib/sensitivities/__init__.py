"""Sensitivities of everything that a system answers to every number it was made of.

Verbs, one for each kind of answer:
eigenvalues            derivatives of the eigenvalues, repeated ones included; of variants of a compiled plant, too
shapes                 derivatives of frequencies, damping ratios and mode shapes
responses              derivatives of frequency responses, by the adjoint, and of time responses
sparse_modes           derivatives of some modes of sparse equations
norms                  H2 and Hinf norms with their derivatives

What they share:
basis                  all that is kept for repeated questions, derivatives of the matrices among it
matrix_derivatives     derivatives of the matrices, whole and as factors of low rank
spectrum               eigenvalues with right and left vectors, and the branches of those that coincide
states                 first-order equations and their derivatives

Parameters:
variables              names, patterns and linear maps of parameters; their layout by the fields of parts
parameter_groups       the variables asked for with the groups of the parameters that they move, and which lose freedom
forms                  groups: one field of many parts, which one rule holds for; forms between many pairs of motions
variants               derivatives of whole matrices, for all other parameters; matrix_entries measures differences
families               the derivatives of the equations as products of motions and wrenches, said by families of parts

The mechanism in numbers:
network                bodies and connections, what more than two bodies share and spin; network_assembly makes it
network_kinematics     coordinates, what closes loops, and elements that keep their shape
adjoint_fields         motions, the wrenches that they put into bodies and connections, and those in joints
ports                  inputs and outputs as loads of the network; derivatives of a response from their motions

Loaded scenes, through the equilibrium:
loaded_network         a network under its forces: what these do to forms, by parameters and by the pose
pose_motion            how the pose changes with parameters, dq/dp = K^-1 dR/dp, also to those as described elsewhere
forces                 the forces at the pose, with their work on small motions to second order
"""

from collections.abc import Callable
from typing import Any

from mbsvib.responses.norms import Norm
from mbsvib.sensitivities.matrix_derivatives import MatrixDerivatives
from mbsvib.sensitivities.norms import h2_norm, hinf_norm
from mbsvib.sensitivities.responses import frequency_response_sensitivities, time_response_sensitivities
from mbsvib.sensitivities.shapes import ModeSensitivities

__all__ = ["MatrixDerivatives", "ModeSensitivities", "Norm"]

# What systems answer by a function of their basis, by the name of the method.
QUESTIONS: dict[str, Callable[..., Any]] = {question.__name__: question for question in (
    h2_norm, hinf_norm, frequency_response_sensitivities, time_response_sensitivities)}  # fmt: skip
