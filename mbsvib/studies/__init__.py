"""Design studies: one model at many points of its parameters, and at the best of them.

design, plants    variables, and systems at their values, with what a study makes of these, such as a closed loop
evaluation, derivatives, quantities   numbers of a system with their gradients, and functions of them
measures, responses   frequencies, damping ratios, gains, peaks, root mean squares
machines          running machines: shaking force and moment, drive torques; what balances them
running           results at each point, in batches, or one by one, in processes
sweeps, results, tracks   ``sweep``, with a record in a file, and ``track``: modes that keep their names over a sweep
scatter, first_order   ``tolerances``: scatter of parameters, to first order and by samples
search, optimizing, optimum   ``optimize`` and its result
trade_offs        ``trade_off``: designs of which none is better in all of several quantities
campbell          frequencies over the speed of rotors, critical speeds
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
