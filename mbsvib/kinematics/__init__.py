"""Kinematics: displacements by joint coordinates, closed loops, couplers and mobility."""
