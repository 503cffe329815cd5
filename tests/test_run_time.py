"""Run times as ratios to a bare call of the same size in the same process, which no machine changes by much.

A stage that comes out slower than its limit has become so: limits are about twice what was measured when they were
set (the number behind each). Calls take turns and the best turn of each counts, which a busy machine disturbs least.
Scenes so small that only the number of calls matters are counted, not timed.
"""

import sys
import time

import numpy as np
import pytest
import scipy.linalg as la
from scipy.linalg import lapack

from mbsvib import library
from mbsvib.modes import modes

pytestmark = pytest.mark.slow


def ratio(call, floor, repeat=25):
    """CPU time of the best turn of a call to that of another."""
    times = {call: [], floor: []}
    for _ in range(repeat + 2):
        for each, samples in times.items():
            start = time.process_time_ns()
            each()
            samples.append(time.process_time_ns() - start)
    return min(times[call]) / max(min(times[floor]), 1)


def calls(function):
    """Functions entered, of Python and of C, in a second run of `function`: the same on every machine."""
    function()
    count = 0

    def entered(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(entered)
    try:
        function()
    finally:
        sys.setprofile(None)
    return count


@pytest.fixture(scope="module")
def chain():
    model = library.chain(200, line=(0, 1, 0))
    return model, model.linearize()


@pytest.mark.parametrize(
    ("rtol", "clean", "limit"), [(1e-6, False, 2.0), (1e-10, False, 2.2), (1e-12, False, 2.4), (1e-13, True, 4.0)],
)  # measured: 1.02, 1.28, 1.30, 1.9
def test_modes_of_two_hundred_coordinates(chain, rtol, clean, limit):
    """Against the eigenproblem alone, which has seven digits here."""
    _, system = chain
    assert ratio(lambda: modes(system, rtol, clean), lambda: la.eigh(system.K, system.M)) < limit


def test_linearize_two_hundred_bodies(chain):
    """Against the eigenproblem of the result: measured 0.8."""
    model, system = chain
    assert ratio(model.linearize, lambda: la.eigh(system.K, system.M)) < 2.0


def test_frequency_response_with_the_modes_known(chain):
    """A thousand frequencies, against what nobody can spare, a complex number for each mode and frequency: as many
    exponentials, measured 2.5.
    """
    _, system = chain
    omega = np.geomspace(1.0, 1e4, 1000)
    system.frequency_response(omega)
    many = np.ones((200, 1000), dtype=complex)
    assert ratio(lambda: system.frequency_response(omega), lambda: np.exp(many)) < 6.0


def test_small_scenes_are_not_lost_in_overhead():
    """A platform of 14 bodies: what it enters, Python's functions and numpy's."""
    model = library.stewart()
    system = model.linearize()
    assert calls(library.stewart) < 4000  # counted: 1958
    assert calls(model.linearize) < 1400  # 701
    assert calls(lambda: modes(system, 1e-10, clean=False)) < 160  # 78


def test_variants_in_one_pass():
    """A hundred variants of a stiffness, against ten of them one by one: measured 0.3."""
    model = library.stewart()
    values = {"leg1.k.stiffness": np.linspace(1e7, 3e7, 100)}
    assert ratio(lambda: model.linearize(values=values), lambda: [model.linearize() for _ in range(10)], 10) < 1.0


def test_many_bodies_cost_in_proportion():
    """Ten times the bodies, ten times the time: measured 10."""
    small, large = library.chain(1000, line=(0, 1, 0)), library.chain(10_000, line=(0, 1, 0))
    assert ratio(lambda: large.linearize().modes(5), lambda: small.linearize().modes(5), 3) < 25.0


def test_the_eigenproblem_alone_is_what_it_was(chain):
    """Were the floor itself to slow down, all ratios above would be too kind: against a Cholesky
    factorisation, measured 27.
    """
    _, system = chain
    assert ratio(lambda: la.eigh(system.K, system.M), lambda: lapack.dpotrf(system.M)) < 80.0
