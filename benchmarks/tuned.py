"""Six decentral controllers of the Stewart platform, 30 values, against the least H-infinity norm of any controller.

python benchmarks/tuned.py [seed]: forces and displacements along its principal directions, of unit static gain; noise
of sensors and cost of commands of 0.15 each. Beside it the norm of a controller of full order (SLICOT, in ctrlsys).
"""

from __future__ import annotations

import sys
import time

import numpy as np

import mbsvib as mv

SHARE = 0.15
MODES = range(1, 7)


def plant() -> mv.StateSpace:
    """Displacements and costs of commands by forces, noise and commands."""
    space = mv.library.stewart().linearize().state_space("modal")
    static = -space.C @ np.linalg.solve(space.A, space.B)
    unit = 1.0 / np.sqrt(np.diag(static))
    gains, directions = np.linalg.eigh(unit[:, None] * static * unit)
    ports = unit[:, None] * directions
    b, c, n = space.B @ ports / gains, ports.T @ space.C, len(space.A)
    one, none = np.eye(6), np.zeros((6, 6))
    d = np.block([[none, none, none], [none, none, SHARE * one], [none, SHARE * one, none]])
    outputs, inputs = ([f"{kind}{k}" for kind in kinds for k in MODES]
                       for kinds in (("y", "cost", "seen"), ("force", "noise", "u")))  # fmt: skip
    return mv.StateSpace.from_arrays(space.A, np.concatenate((b, np.zeros((n, 6)), b), axis=1),
                                     np.concatenate((c, np.zeros((6, n)), c)), d, outputs=outputs, inputs=inputs)


def tuned(seed: int = 0, starts: int = 3) -> mv.tuning.Design:
    """Tune six controllers: oscillators with feedthrough."""
    law = mv.tunable.diagonal([mv.tunable.state_space(2, f"u{k}", f"seen{k}", "modal") for k in MODES])
    return mv.tune(plant(), law, mv.goals.hinf(["y?", "cost?"], ["force?", "noise?"]), starts=starts, seed=seed,
                   workers=1)


if __name__ == "__main__":
    began = time.process_time()
    design = tuned(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    print(design)
    print(f"{len(design.values)} values, norm {design.objective:.6f}, {time.process_time() - began:.0f} s of CPU")
    print("searches end at", ", ".join(f"{history[-1]:.4f}" for history in design.history))
    try:
        from mbsvib.isolation.synthesis import hinf_synthesis

        space = plant()
        print("full order:", hinf_synthesis((space.A, space.B, space.C, space.D), 6, 6, "benchmark").norm)
    except mv.ExportError as error:
        print(error)
