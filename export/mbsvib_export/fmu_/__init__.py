"""Functional mock-up units (FMI 2.0 and 3.0) of linear systems and controllers.

plant        what goes into an FMU: a state space, nominal values, parameters on which the matrices depend affinely
names        names and units as FMI holds them
variables    the scalar variables and what depends on what
description  modelDescription.xml of FMI 2.0 and 3.0
matrices     the file of numbers that the binary reads
binaries     the binary for each platform: from the wheel, from the cache, or compiled now
source       the binary's source in C
"""

from mbsvib_export.fmu_.export import FmuFile, to_fmu

__all__ = ["FmuFile", "to_fmu"]
