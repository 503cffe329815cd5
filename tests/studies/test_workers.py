"""Sweeps in processes, on back-ends of joblib, and on the workers of a dask cluster."""

import os
import signal
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from types import SimpleNamespace

import joblib
import numpy as np
import pytest

from mbsvib.library import quarter_car
from mbsvib.studies import running, sweep

VALUES = {"tyre.stiffness": np.linspace(1e5, 3e5, 9)}


def where(system):
    return {"pid": os.getpid(), "low": system.modes().frequencies[0]}


def expected():
    return sweep(quarter_car(), VALUES, where, workers=1)


def same(result, here):
    # variants of larger pieces are summed in another order
    return np.allclose(result["low"], here["low"], rtol=1e-13, atol=0)


@pytest.mark.slow
def test_processes_give_the_same_numbers():
    here = expected()
    assert set(here["pid"].tolist()) == {os.getpid()}
    result = sweep(quarter_car(), VALUES, where, workers=2)
    assert os.getpid() not in result["pid"].tolist()
    assert same(result, here)


def test_joblib_says_where():
    with joblib.parallel_config("threading", n_jobs=2):
        result = sweep(quarter_car(), VALUES, where)
    assert set(result["pid"].tolist()) == {os.getpid()}
    assert same(result, expected())


@pytest.mark.parametrize(("first", "call", "point", "kind", "points", "processors", "split"), [
    (0.2, 0.01, 1e-4, "batch", 10_000, 2, False),  # the first piece takes long, as it includes what is computed once
    (0.2, 0.05, 1e-4, "single", 3000, 8, False),  # calls of few points cost more for each
    (0.1, 0.0, 5e-3, "variants", 1000, 2, False),  # two processes save less than their start takes
    (0.1, 0.0, 5e-3, "variants", 1000, 8, True),
    (0.1, 0.0, 5e-3, "variants", 2000, 2, True),
    (0.1, 0.0, 5e-3, "variants", 100_000, 1, False),
    (9.0, 0.0, 10.0, "single", 3, 2, True),
])  # fmt: skip
def test_processes_are_started_where_they_save_time(first, call, point, kind, points, processors, split, monkeypatch):
    """By a clock on which the first piece takes ``first`` seconds more, a piece ``call``, and each of its points
    ``point``."""
    clock, left = [0.0], []

    def computed(numbers, columns):
        clock[0] += call + point * len(numbers) + (first if numbers[0] == 0 else 0.0)
        return [(number, {}) for number in numbers]

    def parallel(task, columns, todo, *others):
        left.extend(todo)
        return iter([[(number, {}) for number in todo]])

    monkeypatch.setattr(running, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(running, "_processors", lambda: processors)
    monkeypatch.setattr(running, "_parallel", parallel)
    task = SimpleNamespace(run=computed, kind=kind, dof=6)
    done = [number for part in running.run(task, {}, range(points), None) for number, _ in part]
    assert done == list(range(points))
    assert bool(left) == split


@pytest.mark.slow
def test_back_ends_that_answer_at_the_end_are_given_some_at_a_time():
    counts = []
    with joblib.parallel_config("multiprocessing", n_jobs=2):
        result = sweep(quarter_car(), VALUES, where, progress=lambda done, total: counts.append(done))
    assert len(counts) > 2
    assert counts[-1] == 9
    assert same(result, expected())


@pytest.mark.slow
def test_a_point_that_fails_in_a_process_is_recorded(tmp_path):
    def fails(system):
        if system.K.max() > 2.9e5:
            raise ArithmeticError("too stiff")
        return 1.0

    result = sweep(quarter_car(), VALUES, fails, workers=2, file=tmp_path / "record.jsonl")
    assert set(result.errors.values()) == {"ArithmeticError: too stiff"}
    assert 0 < len(result.errors) < 9
    assert len((tmp_path / "record.jsonl").read_text().splitlines()) == 10


@pytest.mark.slow
def test_a_point_that_kills_its_process_fails_alone():
    """It ended the sweep with a traceback of the pool, and the other points were lost."""
    mine = os.getpid()

    def kills(system):
        if os.getpid() != mine and system.parameters["tyre.stiffness"] == VALUES["tyre.stiffness"][6]:
            os.kill(os.getpid(), signal.SIGKILL)
        return 1.0

    result = sweep(quarter_car(), VALUES, kills, workers=2)
    assert list(result.errors) == [6]
    assert "was ended from outside" in result.errors[6]
    assert np.nansum(result["kills"]) == 8


@pytest.mark.parametrize("killers", [[], [0], [3, 4], [0, 8], list(range(9))])
def test_points_that_kill_are_told_from_those_that_were_computed_beside_them(killers, monkeypatch):
    """A pool in this process, which breaks as one of joblib does: all that it was computing is lost."""

    class Pool:
        def __init__(self, n_jobs, return_as):
            assert (n_jobs, return_as) == (2, "generator_unordered")

        def __call__(self, calls):
            for start in range(0, len(calls), 2):
                both = calls[start : start + 2]
                if {number for _, arguments, _ in both for number in arguments[0]} & set(killers):
                    raise BrokenExecutor
                yield from [function(*arguments) for function, arguments, _ in both]

    monkeypatch.setattr(joblib, "Parallel", Pool)
    context = pytest.warns(UserWarning, match="all 9 points failed") if len(killers) == 9 else nullcontext()
    with context:
        result = sweep(quarter_car(), VALUES, where, workers=2)
    assert list(result.errors) == killers
    if len(killers) < 9:
        assert np.isnan(result["low"]).sum() == len(killers)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_dask_workers_over_loopback():
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    words = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
    with distributed.LocalCluster(processes=True, **words) as cluster, distributed.Client(cluster), \
            joblib.parallel_config("dask"):  # fmt: skip
        result = sweep(quarter_car(), VALUES, where)
    assert os.getpid() not in result["pid"].tolist()
    assert same(result, expected())
