"""Design studies: one model at many points of its parameters, and at the best of them.

sweep_points, design, parameter_maps   values of variables: parameters, patterns of parameters, functions of several
question          results at each point, by name or as functions
running           in batches, or one by one, in processes
record            results in a file as they are computed
sweeps, results   ``sweep`` and its results
figures           figures of all of these
tracks            ``track``: modes that keep their names over a sweep
scatter, parameter_tolerances, first_order   ``tolerances``: scatter of parameters, to first order and by samples
plants, derivatives   what a study makes of each system, such as a closed loop, and derivatives through it
dual, evaluation, quantities, extremes   numbers of a system with their gradients, and functions of them
machines, point_masses   running machines: shaking force and moment, drive torques; what balances them
measures, modal, responses   frequencies, damping ratios, gains, peaks, root mean squares
scales, search, solvers, optimizing   ``optimize`` and its result
trade_offs        ``trade_off``: designs of which none is better in all of several quantities
"""

from mbsvib.studies.design import rates_at
from mbsvib.studies.extremes import largest, smallest
from mbsvib.studies.machines import CycleMeasures, cycle
from mbsvib.studies.measures import damping_ratio, frequency, gain, given, peak, placement, variable
from mbsvib.studies.optimizing import Optimum, optimize
from mbsvib.studies.parameter_maps import Tie
from mbsvib.studies.point_masses import equimomental, with_counterweights
from mbsvib.studies.quantities import Constraint, Quantity
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


def __dir__() -> list[str]:
    """The public names."""
    return __all__
