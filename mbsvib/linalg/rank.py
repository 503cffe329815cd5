"""Tolerances of rank and zero decisions: what counts as rounding, each with its reason.

A decision compares a scaled quantity, of the size of one where nothing is known to be small, with one of these.
Tolerances of iterations, and of bounds of errors, stand beside the algorithms that they belong to.
"""

from __future__ import annotations

import numpy as np

# Spacing of double precision at 1.
EPS = float(np.finfo(float).eps)
# Entries of the scaled Phi carry a rounding error of a few eps times (distance from the origin / loop size); pivots
# below this many times that error count as zero, however large the others are: rows and columns are of the size of one.
RANK_FACTOR = 50.0
# A pivot that small means that coordinates lose as many digits: eigenvalues good to 1e-12 are no longer certain.
NEAR_SINGULAR = 1e-4
# Loops with a smaller pivot may lock by an angle that nobody means: pivots are about as large as the angle is.
NEARLY_LOCKED = 0.1
# Loops without any motion and with a smaller pivot are nearly movable; frames of bars that are meant stand above it.
NEARLY_REDUNDANT = 1e-2
# Axes out of line by less [rad], three degrees, may be meant to be in line; larger angles are seen in a drawing.
ALMOST_ALIGNED = 0.05
# Axes that differ by less are in line but for rounding.
ALIGNED = 1e-14
# Sums of n products that cancel to less than this times n of their size are zero but for rounding.
ZERO_PRODUCT = 4.0 * EPS
# Kept and dropped pivots closer than this leave the rank itself in doubt.
RANK_GAP = 1e3
# Sizes that differ by less are equal: what comes first or last among them is chosen, by its order, never by rounding.
TIE_BREAK = 1e-6
# Points closer than this share of their distance from the origin, or from the centres of mass about which their bodies
# turned, are one point, told apart by rounding.
SAME_POINT = 1e-13
# Neighbouring poses are this far (rad, or loop sizes) to first order; loops then close to its square, and a constraint
# that has become independent shows as a pivot of its size.
NEIGHBOUR_STEP = 1e-4
# The limit lies between the two.
NEIGHBOUR_PIVOT = 1e-6
# Axes of joints that differ by less are parallel: what they differ by shows in no pivot near that limit.
PARALLEL_AXES = 1e-9
# An entry of no more than so many roundings of what it is the sum of is zero: an axis met, or taken across.
ZERO_MOTION = 32.0 * EPS
# An entry above this [m, rad] is none, of points up to 1e6 m off: it need not be looked at.
LARGEST_ROUNDING = 1e-8
# Rows of unit length that depend on each other differ by rounding of the geometry, far below this.
DEPENDENT_ROWS = 1e-11
# Squared pivots of such rows, and pivots of M, each column over what it could be, are no rounding above this.
CERTAIN_MASS = 1e-10
# Entries of B'' below this (of coordinates scaled to lengths) are rounding of the loops.
CLOSURE_NOISE = 1e-13
# Sums of ten to a hundred terms that cancel to less than so many roundings of their terms are zero: entries, energies,
# strains of rigid-body motions.
ZERO_SUM = 64.0 * EPS
# Rows below this share of their terms are not scaled up any more: their rounding would come near DEPENDENT_ROWS.
LEAST_ROW = 1e-3
# Pivots of the mass matrix, scaled to a unit diagonal, below this are rounding: the coordinate has no inertia.
MASSLESS = 1e-14
# Second-order forms of a body, and components of wrenches, below this share of the forces that make them are rounding.
ZERO_FORM = 16.0 * EPS
# States of self-stress that are this small in all joints are shared among couplers only, and no joint feels them.
STRESS_IN_COUPLERS = 1e-10
# A unit wrench with a smaller part of self-stress in it is determined: 1e-9 is the accuracy promised of results.
DETERMINED = 1e-9
# The inverse condition of N^T K N, brought to a unit diagonal, below which springs of both signs cancel.
CANCELLING_SPRINGS = 1e-13
# Bodies that a motion moves by less than this share of its largest motion are not among those it is said to move.
MOVES_NOTHING = 1e-9
# What inputs do at once is zero below this share of the terms it is the sum of.
ZERO_FEEDTHROUGH = 1e-12
# A response is zero if changes of all numbers of the model by this share make more of it at any frequency: rotations
# and sums leave some hundred to thousand eps of what is zero by symmetry.
ZERO_RESPONSE = 1e-12
# Sine of the angle between a turning ground and what it turns, below which they are parallel.
PARALLEL_DIRECTIONS = 1e-12
# What is left over, against the forces that should cancel. A pose off balance by this share gives stiffness that is off
# by about as much, and 1e-9 is the accuracy that results are promised to; rounding leaves a thousandth of it.
BALANCE = 1e-9
# Positions carry rounding errors, which springs turn into forces: what so many roundings of every coordinate do is
# allowed for on top.
POSITION_ROUNDING = 64.0 * EPS
# Forces of this share of the largest (each over the root of its stiffness) are what rounding leaves of zero.
ZERO_PRESTRESS = 1e-14
# Coordinates that strain elements by less than this share of the one that strains them most, or than joints would with
# open loops (energies, as roots), do so by the rounding of loops; stiffnesses and lengths of one beam span far less.
STRAINED = 1e-11
# Deformations of elements that coordinates give depend on each other below this share of the largest singular value.
DEPENDENT = 1e-12
# Singular values of the scaled loop equations below this are redundant rows. Rows are of the size of one; in loops that
# are redundant as a whole the largest value is rounding too, and what they are open by then moves nothing.
REDUNDANT_LOOPS = 1e-9
# Pivots above this share of the largest are those of full rank, however rank is decided.
FULL_RANK = 1e-4
# What is open by so few roundings gets no closer.
CLOSED_EXACTLY = 4.0 * EPS
# Combinations of preloads that act on the coordinates by less than this share of the strongest hold nothing.
HOLDS_NOTHING = 1e-10
# Eigenvalues of the tangent below this share of the largest are stiffness that is not there.
ZERO_STIFFNESS = 1e-10
# Forces along motions that no stiffness holds are rounding below this share of the products that they are sums of.
ZERO_UNHELD_FORCE = 1e-9
# What is left of forces that cancel is rounding below this share of them.
CANCELLED = 16.0 * EPS
# Differences of forces that balance, and the motions that they make, are rounding below this share of the forces that
# cancel, and of the largest motion.
ZERO_DIFFERENCE = 1e-12
# Regularisation of S S^T, S unit rows of loops: above the rounding of its entries.
REGULARISATION = 1e-14
# Squared distances above this are far above the regularisation and what it grows to.
CERTAIN_DISTANCE = 1e-8
# Unit rows, freed of others three times over, are rounding below this: eps times the conditioning that the distance
# above allows.
DEPENDENT_DISTANCE = 1e-10
# Singular values of inertia rows, scaled to the size of one, above this are certainly not zero.
CERTAIN_INERTIA = 1e-6
# Work and strain energy of a random load agree to this where the stiffness holds everything; a motion that meets no
# spring does work without bound, and they differ by many orders.
SAME_ENERGY = 1e-6
# Regularises columns of unit length: far below the squares of singular values that loops have, far above rounding.
COLUMN_REGULARISATION = 1e-12
# Eigenvalues of a 6x6 coefficient matrix, scaled to a unit diagonal, are rounding below this share of the largest.
ZERO_EIGENVALUE = 1e-14
# A 6x6 coefficient matrix differs from its transpose by rounding below this share of the largest entries that have the
# same units: it was transformed to other axes, or printed.
UNSYMMETRIC = 1e-9

# Reduced models.
# Unit rows of an interface of which one is a combination of the others but for this: rows carry the rounding of paths
# and loops, some hundred eps.
SAME_ROW = 1e-12
# A pivot of the scaled stiffness with the interface held below this belongs to a motion that nothing holds.
FREE_PIVOT = 1e-13
# A free motion is damped if its damping exceeds this share of the largest, in coordinates with a mass of one.
DAMPED_FREE_MOTION = 1e3 * EPS
# A pole decays if its real part is below minus this share of its size.
DECAYS = 1e-12
# An eigenvalue is known to so many times the error that a rounding of its matrix makes: LAPACK's, of up to some hundred
# states, are within a few of it.
POLE_ROUNDINGS = 16.0

# Sensitivities.
# Slopes of the numbers that a part is made of below this share of the largest of their kind are what differences leave.
ZERO_SLOPE = 1e-11
# Slopes that differ by more than this share with the step are those of what jumps; extrapolated ones agree to 1e-12.
AGREEING_SLOPES = 1e-8
# Derivatives of rates of motions, which are sums, below this share of their terms are rounding.
CANCELLED_RATE = 1e-12
# A product of vectors below this share of their lengths is rounding of the motions, which are orthogonal to so much.
ORTHOGONAL_STATES = 32 * EPS
# B, H and D of the network and those of the system are the same numbers but for rounding.
SAME_PORT_ROW = 1e-9
# The same against the largest among all rows, of which a row that is zero has the rounding.
ZERO_PORT_ROW = 1e-12
# What differences leave of a number that is zero, against the largest of a matrix.
ZERO_MATRIX_SLOPE = 1e-10
# Rounding of the work of a motion, relative to its terms, is far below this; a missing force is not.
SAME_WORK = 1e-8
# Work of a motion that strains nothing: the square of a hundred roundings of the largest relative motion.
NO_WORK = (100.0 * EPS) ** 2
# Work of a state of self-stress is rounding below this share of the largest force times the largest motion anywhere.
ZERO_STRESS_WORK = 1e-9
# Along a direction in the space of parameters, what contradicts redundant constraints, or gives mass or damping to a
# motion without, is rounding below this share of the change itself.
ZERO_ALONG = 1e-9
# Forces of a state of self-stress below this share of the largest are rounding.
ZERO_STRESS = 1e-9
# Bodies that turned by less than this [rad] against each other did not.
ZERO_TURN = 1e-14
# Where eigenvalues coincide, less than this share of the largest derivative to the same variable is rounding: it parts
# no branches.
ONE_BRANCH = 8.0 * EPS
# Deformations, each scaled to its largest, that depend on each other but for this share are not independent.
DEPENDENT_DEFORMATION = 1e-9
# Vectors of eigenvalues that are closer than this (relative) are known to eps over it, and no better: they are taken
# for one eigenvalue with a subspace.
SAME_EIGENVALUE = 1e-9
# A form in a rigid-body motion below this share of the largest in any motion is zero but for rounding.
ZERO_RIGID_FORM = 1e-12
# The same if derivatives are differences of whole matrices, or go through the equilibrium: more may cancel there.
ZERO_RIGID_FORM_BY_MATRICES = 1e-8
# An eigenvalue of a derivative, whose rows are scaled alike, below this share of the largest is rounding.
ZERO_FACTOR = 1e-12
# A correlation matrix typed with so many digits may be indefinite by its rounding.
SEMIDEFINITE = 1e-9
# Its diagonal is 1 to so many digits.
UNIT_CORRELATION = 1e-12
# A Markov parameter or feedthrough below this share of the sum of its terms' magnitudes is rounding: sums over a
# hundred motions lose two or three of sixteen digits.
ZERO_MARKOV = 1e-12
# Singular values of the change by a parameter below this share of the largest are rounding: it enters by no more.
ZERO_BLOCK = 1e-10
# A mode of which a sensor shows, or that an actuator moves by, less than this share of the sum of its terms'
# magnitudes has a node there: vectors of close eigenvalues lose some digits.
AT_NODE = 1e-9
# The least eigenvalue of information, scaled to ones on its diagonal, below which directions are not told apart.
NO_INFORMATION = 1e-11
# Sets whose figures differ by less than this share are equal: Riccati's equations are solved to some digits less.
SAME_FIGURE = 1e-6
# Damping ratio below which modes count as equally damped, which then drops out of shares.
LEAST_DAMPING = 1e-6
# An output that misses being the rate of a combination of states by more than this share of its size is none.
ZERO_RATE = 1e-9
# Equations that leave a straight line between the limits of a parameter by more than this share of the change are not
# affine in it.
NOT_AFFINE = 1e-8
# Measured inputs are independent, and a line is excited, if the least singular value of their spectra is above this
# share of the largest: below, noise of 0.1 % decides.
INPUTS_APART = 1e-3
# Columns of powers over neighbouring lines are independent above this share of the largest pivot: where every second
# line is not excited it is rounding, of random signals it is 0.01 and more.
NO_PIVOT = 1e-8
# Damping that couples modes of sparse matrices by a smaller share of their own damping is rounding of shapes.
UNCOUPLED = 1e-9
# Strain energies of modes of sparse matrices below this share of their terms are rounding: rigid-body modes.
RIGID_ENERGY = 100.0 * EPS
