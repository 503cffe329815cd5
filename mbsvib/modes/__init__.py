"""Modes: eigenvalues, frequencies, damping ratios and shapes, to the accuracy that is asked for.

``result``    what the modes of a system are, and which solver it needs
``undamped``  K phi = omega^2 M phi from the factors, by a ladder of solvers
``damped``    modes that dampers couple, in energy coordinates; ``strong_damping`` far beyond critical
``general``   systems without symmetry or with massless motions: spin, follower loads, Maxwell elements
"""

from mbsvib.modes.result import RTOL, Modes, modes

__all__ = ["RTOL", "Modes", "modes"]
