"""Co-simulation of plants and controllers: whether their FMUs are right, and up to which step.

unit         FMUs from files, run through fmpy, and the equations that they obey
connections  which output goes to which input; what cannot work is refused here
masters      one step of each kind of master, on exactly discretised equations; spectral radius against step
running      the same masters with the FMUs themselves
result       what came out, as a table and a figure
check        all of it in one call
archive      both FMUs and their connections in one file, SSP
"""

from mbsvib_export.cosimulation.archive import to_ssp
from mbsvib_export.cosimulation.check import check_cosimulation
from mbsvib_export.cosimulation.result import CosimulationCheck, MasterCheck

__all__ = ["CosimulationCheck", "MasterCheck", "check_cosimulation", "to_ssp"]
