"""Design studies: one model at many points of its parameters, and at the best of them.

design            variables: parameters, patterns of parameters, joint coordinates, functions of several
plants, derivatives   what a study makes of each system, such as a closed loop, and derivatives through it
evaluation, quantities   numbers of a system with their gradients, and functions of them
measures, responses   frequencies, damping ratios, gains, peaks, root mean squares
machines, point_masses   running machines: shaking force and moment, drive torques; what balances them
running           results at each point, in batches, or one by one, in processes
record            results in a file as they are computed
sweeps, results   ``sweep``, its points and results
tracks            ``track``: modes that keep their names over a sweep
scatter, first_order   ``tolerances``: scatter of parameters, to first order and by samples
search, solvers, optimizing   ``optimize`` and its result
trade_offs        ``trade_off``: designs of which none is better in all of several quantities
campbell, speed_sweep   frequencies over the speed of rotors, critical speeds
figures           figures of all of these
"""

from functools import partial

from mbsvib.common.misplaced import missing
from mbsvib.studies.design import Tie, rates_at
from mbsvib.studies.machines import CycleMeasures, cycle, equimomental, with_counterweights
from mbsvib.studies.measures import damping_ratio, frequency, gain, given, peak, placement, variable
from mbsvib.studies.optimizing import optimize
from mbsvib.studies.optimum import Optimum
from mbsvib.studies.quantities import Constraint, Quantity, largest, smallest
from mbsvib.studies.responses import rms
from mbsvib.studies.results import Sweep
from mbsvib.studies.scatter import Tolerances, tolerances
from mbsvib.studies.sweeps import sweep
from mbsvib.studies.tracks import Tracks, track
from mbsvib.studies.trade_offs import TradeOff, trade_off

__all__ = [
    "Constraint", "CycleMeasures", "Optimum", "Quantity", "Sweep", "Tie", "Tolerances", "Tracks", "TradeOff", "cycle",
    "damping_ratio", "equimomental", "frequency", "gain", "given", "largest", "optimize", "peak", "placement",
    "rates_at", "rms", "smallest", "sweep", "tolerances", "track", "trade_off", "variable", "with_counterweights",
]  # fmt: skip
__dir__ = __all__.copy
__getattr__ = partial(missing, __name__)
