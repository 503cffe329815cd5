"""Isolation of a body from the vibration of its base: analysis and design.

study      transmissibility, compliance and derived figures; ``.under(spectra)`` the vibration under base noise
white, shaped, table      power spectral densities of the base's acceleration
vc_curve   vibration criteria VC-A to VC-G
vc_spectrum, seismic_spectrum, road_spectrum      densities of floors, of the seismic background, of roads
road_profile, road_bump       heights of roads over distance, and under wheels over time
road_correlation      one road under several wheels, as ``correlation`` of noise
iso_2631, moving_average, moving_deviation, integrated        weightings of outputs under noise
actuated   actuators and sensors in the legs; ``.with_gains(controller)`` closes loops
force_feedback, velocity_feedback, skyhook, lqg, hinf, controller      controllers
collocation, root_locus, force_feedback_optimum, structured_singular_values      analysis of controllers
passive    quantities for ``studies.optimize``, best values of springs, dampers, masses and places, Pareto fronts
unfolded   relaxation legs as springs, dampers and nodes, whose derivatives are known
struts, ring      ideal legs J^T k J, and their ends as variables
placement         sets of sensors and actuators, ranked
platform          radius, height, spread and angle of both rings of ends as variables, legs with bodies following
"""

from functools import partial

from mbsvib.common.misplaced import missing
from mbsvib.feedback.controller import Controller, controller
from mbsvib.feedback.margins import Margins
from mbsvib.isolation.actuated import Active, ClosedLoop, SampledLoop, actuated
from mbsvib.isolation.collocation import Collocation, Pair, collocation
from mbsvib.isolation.design import Design, Front
from mbsvib.isolation.feedback_laws import force_feedback, force_feedback_optimum, skyhook, velocity_feedback
from mbsvib.isolation.isolation_study import Isolation, Vibration, study
from mbsvib.isolation.passive import Passive, passive
from mbsvib.isolation.placement import PlacedSet, Placement, placement
from mbsvib.isolation.platform import Platform, platform
from mbsvib.isolation.root_locus import RootLocus, root_locus
from mbsvib.isolation.structured import structured_singular_values
from mbsvib.isolation.struts import Struts, ring, struts, unfolded
from mbsvib.isolation.synthesis import hinf, lqg
from mbsvib.random.curves import road_spectrum, seismic_spectrum, vc_curve, vc_spectrum
from mbsvib.random.roads import RoadCorrelation, RoadProfile, road_bump, road_correlation, road_profile
from mbsvib.random.sources import BaseNoise
from mbsvib.random.weights import Integrated, Window, integrated, iso_2631, moving_average, moving_deviation
from mbsvib.responses.densities import Shaped, Table, shaped, table, white

__all__ = [
    "Active", "BaseNoise", "ClosedLoop", "Collocation", "Controller", "Design", "Front", "Integrated", "Isolation",
    "Margins", "Pair", "Passive", "PlacedSet", "Placement", "Platform", "RoadCorrelation", "RoadProfile", "RootLocus",
    "SampledLoop", "Shaped", "Struts", "Table", "Vibration", "Window", "actuated", "collocation", "controller",
    "force_feedback", "force_feedback_optimum", "hinf", "integrated", "iso_2631", "lqg", "moving_average",
    "moving_deviation", "passive", "placement", "platform", "ring", "road_bump", "road_correlation", "road_profile",
    "road_spectrum", "root_locus", "seismic_spectrum", "shaped", "skyhook", "structured_singular_values", "struts",
    "study", "table", "unfolded", "vc_curve", "vc_spectrum", "velocity_feedback", "white",
]  # fmt: skip
__dir__ = __all__.copy
__getattr__ = partial(missing, __name__)
