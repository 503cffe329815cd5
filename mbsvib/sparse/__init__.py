"""Many bodies: the same answers from sparse equations, in time and memory proportional to the number of bodies.

A mechanism keeps, body after body, its displacements, the forces in its joint and the joint's coordinates; eliminating
them from the leaves of the tree to its root is the recursion of articulated bodies, carried out by a sparse LU. Springs
act on relative joint coordinates wherever the path between their ends is short, so that low modes of long chains keep
their digits: no difference of two absolute displacements is ever formed.
"""
