"""Design studies: one model at many points of its parameters.

points, design    values of variables: parameters, patterns of parameters, linear maps
question          what is asked: results by name, functions
running           in batches, or one by one, in processes
record            answers in a file as they come
sweeps, results   ``sweep`` and what it returns
"""

from mbsvib.studies.results import Sweep
from mbsvib.studies.sweeps import sweep

__all__ = ["Sweep", "sweep"]
