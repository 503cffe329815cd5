"""Modes: eigenvalues, frequencies, damping ratios and shapes, to a requested accuracy.

``result``    the modes of a system, and the choice of the solver
``undamped``  K phi = omega^2 M phi from the factors, by solvers of increasing accuracy
``damped``    modes that dampers couple, in energy coordinates; ``rayleigh``: their last step, with bounds of the
              errors; ``strong_damping``: far beyond critical damping
``general``   systems without symmetry or with massless motions: spin, follower loads, Maxwell elements; their
              eigenvalues are those of ``general_spectrum``, with ``zero_subspaces`` for the eigenvalue 0
"""

from mbsvib.modes.result import RTOL, Modes, modes

__all__ = ["RTOL", "Modes", "modes"]
