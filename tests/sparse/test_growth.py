"""Work and memory in proportion to the number of bodies, from a thousand to a hundred thousand.

The run times are held by ``benchmarks/limits.py``.
"""

import json
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from mbsvib.library import chain, ladder

SCRIPT = """
import json, resource, sys
import mbsvib as mv
n = int(sys.argv[1])
model = mv.library.chain(n, line=(0, 1, 0))
system = model.linearize()
modes = system.modes(10)
print(json.dumps({"memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2,
                  "missed": modes.missed, "errors": float(modes.errors.max()),
                  "frequencies": modes.frequencies.tolist(), "filled": int(system.tableau.factor().lu.nnz),
                  "unknowns": system.layout.size, "entries": len(system.tableau.indices)}))
"""


def run(n):
    """Run a chain of n links in a process of its own, on one core."""
    answer = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(n)], capture_output=True, text=True, check=True,
        env={"OPENBLAS_NUM_THREADS": "1", "PATH": ""},
    )  # fmt: skip
    return json.loads(answer.stdout)


@pytest.mark.few(1)
@pytest.mark.parametrize("make", [chain, ladder])
def test_unknowns_and_entries_grow_with_the_bodies(make):
    small, large = (make(n).linearize(method="sparse") for n in (50, 500))
    assert large.layout.size <= 10.05 * small.layout.size
    assert len(large.tableau.indices) <= 10.2 * len(small.tableau.indices)
    factors = [s.tableau.factor().lu for s in (small, large)]
    assert factors[1].nnz <= 10.5 * factors[0].nnz, "nothing fills"


@pytest.mark.slow
def test_linear_from_a_thousand_to_a_hundred_thousand():
    """Linearized with its ten lowest modes: 1.3 GiB, and no more than proportional to the bodies."""
    sizes = (1000, 10_000, 100_000)
    results = [run(n) for n in sizes]
    assert results[-1]["memory"] <= 3.0
    for few, many in pairwise(results):
        for size in ("unknowns", "entries", "filled"):
            assert many[size] <= 10.1 * few[size]
    assert all(result["missed"] == 0 for result in results)
    assert max(result["errors"] for result in results) <= 1e-12
    # a slender cantilever of n rigid links: frequencies fall with the square of its length
    low = np.array([result["frequencies"] for result in results])
    assert np.allclose(low[:-1] / low[1:], 100.0, rtol=0.02)
