"""Loads: gravity, forces on bodies and preloads; what they do in joints, and the stiffness that comes of it.

At a loaded pose the forces in springs and joints have second-order terms, the geometric stiffness: a rod that hangs on
a hinge has no other. A mechanism without loads never comes here.

``wrenches``   what gravity, loads and preloads do to each body
``statics``    do they balance? if not, EquilibriumError
``reactions``  the wrench in every joint, of the tree, cut or redundant
``geometric``  the second-order terms as signed rows, K_g = D^T diag(k) D
``shares``     who carries a mode: strain energies by element, load and joint
"""
