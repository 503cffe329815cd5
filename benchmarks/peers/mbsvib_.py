"""mbsvib, asked for different accuracies, and the bare LAPACK call on its matrices."""

from dataclasses import dataclass

import mbsvib
from benchmarks.peers import harness
from benchmarks.peers.scenes import SCENES
from mbsvib.api.system import System
from mbsvib.modes import modes
from mbsvib.modes.undamped import undamped

NOTE = "eigenvalues, shapes and an error estimate for each"


@dataclass(frozen=True)
class Linear:
    """A system, dense or sparse, with the accuracy that is asked of its modes."""

    system: System
    rtol: float

    def eigenvalues(self):
        """Damped, all 2m."""
        return modes(self.system, self.rtol, clean=False).eigenvalues

    def omega(self):
        """Undamped [rad/s]."""
        return undamped(self.system, self.rtol, clean=False).omega

    def lowest(self, n):
        """The n lowest undamped frequencies [rad/s], of a chain whose damping is proportional."""
        return self.system.modes(n).natural


def method(rtol):
    """Build, linearise and solve to this accuracy."""
    return harness.Method(lambda make: make(), lambda model: Linear(model.linearize(), rtol),
                          lambda name: SCENES[name][0], NOTE)  # fmt: skip


METHODS = {f"mbsvib {rtol:.0e}".replace("e-0", "e-"): method(rtol) for rtol in (1e-6, 1e-10, 1e-14)}

if __name__ == "__main__":
    harness.main(mbsvib.__version__, METHODS)
