"""Finite motion as expressions of CasADi: positions, velocities, loop closures, energies and forces of a mechanism."""
