"""Run times over commits, by pytest-benchmark: every stage of some scenes, kept and compared with what was before.

    OPENBLAS_NUM_THREADS=1 python -m pytest benchmarks/regression.py --benchmark-autosave
    OPENBLAS_NUM_THREADS=1 python -m pytest benchmarks/regression.py --benchmark-compare \\
        --benchmark-compare-fail=median:25%

Times are CPU times. Each line carries its ratio to the bare LAPACK call on the same matrices (``floor``, in the saved
JSON), which machines change by less; ``benchmarks/limits.py`` holds such ratios to limits.
"""

import statistics
import time

import numpy as np
import pytest
import scipy.linalg as la

from mbsvib import library
from mbsvib.modes import modes

SCENES = {
    "C10": lambda: library.chain(10, line=(0, 1, 0)),
    "C50": lambda: library.chain(50, line=(0, 1, 0)),
    "C200": lambda: library.chain(200, line=(0, 1, 0)),
    "T7": lambda: library.tree(7),
    "L5": lambda: library.ladder(5),
    "L20": lambda: library.ladder(20),
    "stewart": library.stewart,
}
FREQUENCIES = 1000

pytestmark = pytest.mark.benchmark(timer=time.process_time, min_rounds=15, max_time=0.5, warmup=True)


def floor(system, repeat=15):
    """Median CPU time [s] of the bare eigenproblem."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        la.eigh(system.K, system.M)
        times.append(time.process_time() - start)
    return statistics.median(times)


@pytest.fixture(params=SCENES)
def scene(request):
    return SCENES[request.param]


def measured(benchmark, call, system):
    """Measure a call, and note the floor beside it."""
    result = benchmark(call)
    benchmark.extra_info["floor"] = floor(system)
    return result


def test_build(benchmark, scene):
    assert benchmark(scene).bodies


def test_linearize(benchmark, scene):
    model = scene()
    assert measured(benchmark, model.linearize, model.linearize()).dof


@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
def test_modes(benchmark, scene, rtol):
    system = scene().linearize()
    assert measured(benchmark, lambda: modes(system, rtol, clean=False), system).errors.max() <= rtol


def test_frequency_response(benchmark, scene):
    system = scene().linearize()
    natural = system.modes().natural
    omega = np.geomspace(natural[0] / 10, 2 * natural[-1], FREQUENCIES)
    system.frequency_response(omega)
    assert np.isfinite(measured(benchmark, lambda: system.frequency_response(omega), system)).all()


def test_variants(benchmark):
    model = library.stewart()
    values = {"leg1.k.stiffness": np.linspace(1e7, 3e7, 1000)}
    assert len(benchmark(lambda: model.linearize(values=values))) == len(values["leg1.k.stiffness"])


@pytest.mark.parametrize("bodies", [1000, 10_000])
def test_many_bodies(benchmark, bodies):
    model = library.chain(bodies, line=(0, 1, 0))
    found = benchmark.pedantic(lambda: model.linearize().modes(10), rounds=3, warmup_rounds=1)
    assert len(found) == 10
