"""What every method's script does in its own process: repeat build, linearise and modes, and print one JSON line."""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg as la

if TYPE_CHECKING:
    from collections.abc import Callable

# No stage needs more repeats than this for a median.
MOST = 300


@dataclass(frozen=True)
class Second:
    """M q'' + C q' + K q = 0."""

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray

    def eigenvalues(self):
        """Of the first-order form, all 2m."""
        m = len(self.M)
        mass = la.cho_factor(0.5 * (self.M + self.M.T))
        a = np.zeros((2 * m, 2 * m))
        a[:m, m:] = np.eye(m)
        a[m:, :m], a[m:, m:] = -la.cho_solve(mass, self.K), -la.cho_solve(mass, self.C)
        return la.eigvals(a)

    def omega(self):
        """Undamped frequencies [rad/s], from the symmetric-definite pair."""
        square = la.eigh(0.5 * (self.K + self.K.T), 0.5 * (self.M + self.M.T))[0]
        return np.sqrt(np.abs(square))

    def lowest(self, n):
        """The n lowest undamped frequencies [rad/s]; shapes are computed too."""
        return np.sqrt(np.abs(la.eigh(self.K, self.M, subset_by_index=[0, n - 1])[0]))


@dataclass(frozen=True)
class First:
    """x' = A x."""

    A: np.ndarray
    omega = None

    def eigenvalues(self):
        """All of them."""
        return la.eigvals(self.A)


@dataclass(frozen=True)
class Discrete:
    """x[k+1] = A x[k], a step of ``dt`` [s]."""

    A: np.ndarray
    dt: float
    omega = None

    def eigenvalues(self):
        """Those of the continuous system that would step like this."""
        z = la.eigvals(self.A).astype(complex)
        return np.log(z[z != 0.0]) / self.dt


@dataclass(frozen=True)
class Method:
    """How a library treats a scene: ``prepare(name)`` is not timed, ``build(scene)`` and ``linearise(built)`` are.

    ``linearise`` returns an object with ``eigenvalues()`` and ``omega()`` (or ``omega`` None). ``note`` says what the
    method leaves out or approximates. ``fits(scene)`` says whether it can treat a scene at all.
    """

    build: Callable[[Any], Any]
    linearise: Callable[[Any], Any]
    prepare: Callable[[str], Any]
    note: str = ""
    fits: Callable[[Any], bool] = lambda _: True


def null_space(jacobian, tolerance=1e-10):
    """Return an orthonormal basis (columns) of the null space, by a singular value decomposition."""
    _, values, vectors = np.linalg.svd(jacobian)
    return vectors[int((values > tolerance * values[0]).sum()) :].T


def projected(M, C, K, jacobian):
    """Return the second-order system on the null space of the constraints."""
    n = null_space(jacobian)
    return Second(n.T @ M @ n, n.T @ C @ n, n.T @ K @ n)


def repeat(stages, budget):
    """Run a chain of stages over and over for ``budget`` seconds of CPU time; return medians [s] and last results."""
    times: list[list[float]] = [[] for _ in stages]
    results: list[Any] = []
    start = time.process_time()
    while len(times[0]) < MOST:
        results = []
        for stage, samples in zip(stages, times, strict=True):
            before = time.process_time_ns()
            results.append(stage(results))
            samples.append(1e-9 * (time.process_time_ns() - before))
        used, runs = time.process_time() - start, len(times[0])
        if used + used / runs > budget:
            break
    # the first run pays for imports, caches and page faults
    return [statistics.median(t[1:] or t) for t in times], results


def peak():
    """Largest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main(version, methods):
    """Measure one method on one scene, as the command line says."""
    parser = argparse.ArgumentParser()
    parser.add_argument("method", choices=methods)
    parser.add_argument("scene")
    parser.add_argument("--budget", type=float, default=1.0, help="CPU seconds to repeat for")
    parser.add_argument("--lowest", type=int, help="only so many modes, the lowest, undamped")
    given = parser.parse_args()
    method = methods[given.method]
    scene = method.prepare(given.scene)
    if not method.fits(scene):
        print(json.dumps({"skipped": "not for this scene", "note": method.note}))
        return
    before = peak()
    last = (lambda r: r[1].eigenvalues()) if given.lowest is None else lambda r: r[1].lowest(given.lowest)
    stages = [lambda _: method.build(scene), lambda r: method.linearise(r[0]), last]
    (build, linearise, modes), results = repeat(stages, given.budget)
    answer = {"version": version, "note": method.note, "build": build, "linearise": linearise, "modes": modes,
              "base_mb": before, "peak_mb": peak()}  # fmt: skip
    if given.lowest is not None:
        print(json.dumps(answer | {"omega": np.asarray(results[2]).tolist()}))
        return
    values = np.asarray(results[2], dtype=complex)
    answer["eigenvalues"] = [values.real.tolist(), values.imag.tolist()]
    if results[1].omega is not None:
        (undamped,), (omega,) = repeat([lambda _: results[1].omega()], 0.5 * given.budget)
        answer.update(undamped=undamped, omega=np.asarray(omega).tolist())
    print(json.dumps(answer))
