"""Isolation: how well a mechanism keeps the vibration of its base from a body, and how to make it do so better.

study      transmissibility, compliance and what is read off them; ``.under(spectra)`` the vibration under base noise
white, shaped, table      power spectral densities of the base's acceleration
vc_curve   vibration criteria VC-A to VC-G
"""

from mbsvib.isolation.figures import Isolation, study
from mbsvib.isolation.noise import BaseNoise, Shaped, Table, shaped, table, white
from mbsvib.isolation.octaves import vc_curve
from mbsvib.isolation.vibration import Vibration

__all__ = [
    "BaseNoise", "Isolation", "Shaped", "Table", "Vibration", "shaped", "study", "table", "vc_curve", "white",
]  # fmt: skip
