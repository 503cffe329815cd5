"""Derivatives through the equilibrium of loaded scenes.

loaded_network      a network under its forces: what these do to forms, by parameters and by the pose
pose_motion         how the pose gives way to parameters, dq/dp = K^-1 dR/dp
moved_parameters    how parameters and forces follow the bodies as these move
force_changes       what parameters change of the forces: their points and wrenches
reference_pose      what parameters as described do, where the equilibrium was found in another pose
second_order_work   the work of the forces on small motions to second order, with derivatives
forces              the forces at the pose; forces_at_rest collects them from the equations
displaced_bodies    bodies in the pose against where they are described
"""
