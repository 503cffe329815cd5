"""Isolation: how well a mechanism keeps the vibration of its base from a body, and how to make it do so better.

study      transmissibility, compliance and what is read off them; ``.under(spectra)`` the vibration under base noise
white, shaped, table      power spectral densities of the base's acceleration
vc_curve   vibration criteria VC-A to VC-G
actuated   actuators and sensors in the legs; ``.with_gains(law)`` closes loops
force_feedback, velocity_feedback, skyhook, lqg, hinf, controller      laws
collocation, root_locus, force_feedback_optimum      what a law can do
"""

from mbsvib.isolation.actuated import Active, actuated
from mbsvib.isolation.closed_loop import ClosedLoop
from mbsvib.isolation.collocation import Collocation, Pair, collocation
from mbsvib.isolation.controller import (
    Controller,
    controller,
    force_feedback,
    force_feedback_optimum,
    skyhook,
    velocity_feedback,
)
from mbsvib.isolation.figures import Isolation, study
from mbsvib.isolation.margins import Margins
from mbsvib.isolation.noise import BaseNoise, Shaped, Table, shaped, table, white
from mbsvib.isolation.octaves import vc_curve
from mbsvib.isolation.root_locus import RootLocus, root_locus
from mbsvib.isolation.sampled import SampledLoop
from mbsvib.isolation.synthesis import hinf, lqg
from mbsvib.isolation.vibration import Vibration

__all__ = [
    "Active", "BaseNoise", "ClosedLoop", "Collocation", "Controller", "Isolation", "Margins", "Pair", "RootLocus",
    "SampledLoop", "Shaped", "Table", "Vibration", "actuated", "collocation", "controller", "force_feedback",
    "force_feedback_optimum", "hinf", "lqg", "root_locus", "shaped", "skyhook", "study", "table", "vc_curve",
    "velocity_feedback", "white",
]  # fmt: skip
