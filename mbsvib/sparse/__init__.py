"""Many bodies: the same results from sparse equations, in time and memory proportional to the number of bodies.

The unknowns are, for each body, its displacements, the forces in its joint and the joint's coordinates. Eliminating
them from the leaves of the tree to its root is the recursion of articulated bodies; a sparse LU does it. Springs act on
relative joint coordinates wherever the path between their ends is short. So no difference of two absolute displacements
is formed, and low modes of long chains lose no digits.
"""
