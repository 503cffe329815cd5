"""The floor: nothing but the symmetric-definite eigenproblem of LAPACK, on the M and K that mbsvib made."""

import numpy as np
import scipy

from benchmarks.peers import harness
from benchmarks.peers.scenes import SCENES


class Bare(harness.Second):
    """M, C, K as they are: symmetric already."""

    def omega(self):
        """Undamped [rad/s]; eigenvectors are computed too."""
        return np.sqrt(np.abs(scipy.linalg.eigh(self.K, self.M)[0]))


METHODS = {
    "LAPACK floor": harness.Method(
        lambda system: Bare(system.M, system.C, system.K), lambda second: second,
        lambda name: SCENES[name][0]().linearize(), "eigenproblem alone, on matrices made by mbsvib"),
}  # fmt: skip

if __name__ == "__main__":
    harness.main(f"scipy {scipy.__version__}", METHODS)
