"""What stages cost, counted: functions entered, of Python and of C, the same on every machine.

Where work is done for all coordinates, frequencies or variants at once the count does not grow with their number, and
a loop over them that slips in shows. Limits are about twice the count when they were set (the number behind each).
``benchmarks/limits.py`` holds the run times of the same calls.
"""

from functools import partial

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib.modes import modes
from tests.support.work import calls

ALONG_Y = (0, 1, 0)


@pytest.fixture(scope="module")
def chain():
    return library.chain(200, line=ALONG_Y).linearize()


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("rtol", "clean", "limit"), [(1e-6, False, 160), (1e-10, False, 370), (1e-12, False, 370), (1e-13, True, 410)],
)  # counted: 91, 156, 155, 228
def test_modes_of_two_hundred_coordinates(chain, rtol, clean, limit):
    assert calls(lambda: modes(chain, rtol, clean)) < limit


@pytest.mark.slow
def test_linearize_costs_in_proportion_to_the_bodies():
    few, many = (calls(library.chain(n, line=ALONG_Y).linearize) for n in (50, 200))
    assert few < 2300  # 1136
    assert many < 4.2 * few  # 4.05


@pytest.mark.slow
def test_frequencies_are_answered_at_once(chain):
    few, many = (calls(partial(chain.frequency_response, np.geomspace(1.0, 1e4, n))) for n in (10, 1000))
    assert few < 240  # 118
    assert many < 430  # 214: a thousand come in some blocks


@pytest.mark.slow
def test_small_scenes_are_not_lost_in_overhead():
    """A platform of 14 bodies."""
    model = library.stewart()
    system = model.linearize()
    assert calls(library.stewart) < 4000  # 1958
    assert calls(model.linearize) < 1400  # 701
    assert calls(lambda: modes(system, 1e-10, clean=False)) < 160  # 86
    assert calls(lambda: model.moved({"leg1.head.ry": 0.01})) < 4400  # 2217
    coupled = library.stewart_isolator().linearize()
    assert calls(lambda: modes(coupled, 1e-10, clean=False)) < 430  # 246


@pytest.mark.slow
def test_variants_in_one_pass():
    model = library.stewart()
    values = ({"leg1.k.stiffness": np.linspace(1e7, 3e7, n)} for n in (10, 100))
    few, many = (calls(partial(model.linearize, values=v)) for v in values)
    assert few == many
    assert many < 3400  # 1699


@pytest.mark.slow
def test_many_bodies_cost_in_proportion():
    """Sparse: what is built grows with the bodies, what is done for the modes does not grow at all."""

    def cost(n):
        model = library.chain(n, line=ALONG_Y)
        made = calls(lambda: model.linearize(method="sparse"))
        return made, calls(lambda: model.linearize(method="sparse").modes(5)) - made

    (few, low), (many, high) = cost(100), cost(400)
    assert many < 2.6 * few  # 11012, 18812
    assert high < 1.1 * low  # 5460 both


@pytest.mark.slow
def test_a_study_of_isolation_does_not_go_from_frequency_to_frequency():
    model = library.stewart()

    def study(n):
        result = isolation.study(model, "platform", frequencies=np.geomspace(1.0, 1e4, n))
        return (result.index, result.singular_values, result.compliance_values, result.amplification,
                result.crossover, result.roll_off)  # fmt: skip

    few, many = (calls(partial(study, n)) for n in (40, 400))
    assert many < 1.5 * few  # 8533, 8275


@pytest.mark.parametrize("kind", [mv.Model, mv.System], ids=lambda kind: kind.__name__)
def test_attributes_are_read_at_once(kind):
    """A ``__getattr__`` of the class would double the time of each access."""
    assert not hasattr(kind, "__getattr__")
