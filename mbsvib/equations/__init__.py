"""Equations of motion: from the mechanism to the minimal matrices, with loads, spin and massless coordinates."""
