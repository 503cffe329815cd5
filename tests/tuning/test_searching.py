"""The search on functions whose least values are known: penalties, barriers, what goes on and what begins anew."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.tuning import searching
from mbsvib.tuning.problem import SPARE
from mbsvib.tuning.searching import BARRIERS, End, _honest, _penalised, searched, stabilised

G = mv.goals


@dataclass(frozen=True)
class Steep:
    """100 (x - 3)^2 + the other squares, minimised subject to x <= 1; what is beyond x = 5 is not stable.

    ``hidden``: by how much the value is larger than the search knows, until it is told.
    """

    goals: tuple[Any, ...] = (G.hinf(), G.hinf(most=1.0))
    hidden: float = 0.0
    told: list[Any] = field(default_factory=list)

    def measured(self, x):
        value = 100.0 * (x[0] - 3.0) ** 2 + float((x[1:] ** 2).sum())
        return (value, x[0] - 1.0) if x[0] < 5.0 else (np.inf, np.inf)

    def objective(self, x, penalty, barrier=0.0):
        if x[0] >= 5.0:
            return np.inf, np.zeros(len(x))
        value, missed = self.measured(x)
        slope = np.concatenate(([200.0 * (x[0] - 3.0)], 2.0 * x[1:]))
        if missed > -SPARE:
            value, slope = value + penalty * (missed + SPARE), slope + penalty * np.eye(len(x))[0]
        return value + barrier * x[-1], slope + barrier * np.eye(len(x))[-1]

    def growth(self, x):
        return (x[0] - 4.0) ** 2 - 1.0, 2.0 * (x[0] - 4.0) * np.eye(len(x))[0]

    def stable(self, x):
        return [] if x[0] < 5.0 else None

    def knowing(self, x):
        self.told.append(x)
        return self


def test_penalties_grow_until_limits_hold():
    """A penalty of the first value, 1, leaves x at 2.995; one of 400 is needed."""
    end = _penalised(Steep(), np.array([3.1, 0.5]), 200, 0.0)
    assert end.rank[0] == 0.0
    np.testing.assert_allclose(end.x, [1.0, 0.0], atol=1e-4)
    assert end.rank[1] == pytest.approx(400.0, rel=1e-4)


def test_barriers_act_in_parts_of_the_objective():
    """x^2 + b s x is least at -b s / 2, with the first value s."""
    end = _penalised(Steep(), np.array([0.9, 3.0]), 300, 1e-2)
    size = 100.0 * 2.1**2 + 9.0
    assert end.x[1] == pytest.approx(-0.5e-2 * size, rel=1e-3)


def test_starts_that_are_not_stable_are_stabilised_first():
    start, first = stabilised(Steep(), np.array([9.0, 1.0]))
    assert start.x[0] < 5.0
    assert start.rank == (pytest.approx(start.x[0] - 1.0), pytest.approx(Steep().measured(start.x)[0]))
    assert first.rank < start.rank
    near, _ = stabilised(Steep(), np.array([4.0, 1.0]))
    np.testing.assert_array_equal(near.x, [4.0, 1.0])  # a stable start stays where it is

    class Lost(Steep):
        def stable(self, x):
            return None

    assert stabilised(Lost(), np.array([9.0, 1.0])) == (None, None)


def test_a_descent_that_gains_nothing_is_not_asked_again():
    problem = Steep()
    best = End(np.array([1.0 - SPARE, 0.0]), (-1.0, 0.0), problem, ())
    assert len(_honest(0.0, best).history) > 0
    assert not problem.told
    start = End(np.array([3.1, 0.5]), (2.1, 1.25), problem, ())
    end = _honest(0.0, start)
    assert len(problem.told) == 1  # the library agrees
    assert end.rank < start.rank


def test_a_descent_is_told_of_higher_peaks():
    """The problem that knows them has its least value elsewhere."""
    class Blind(Steep):
        def knowing(self, x):
            self.told.append(x)
            return Told(told=self.told)

    class Told(Steep):
        def measured(self, x):
            value, missed = super().measured(x)
            return value + 5.0 * (x[1] - 2.0) ** 2, missed

        def objective(self, x, penalty, barrier=0.0):
            value, slope = super().objective(x, penalty, barrier)
            return value + 5.0 * (x[1] - 2.0) ** 2, slope + 10.0 * (x[1] - 2.0) * np.eye(len(x))[1]

    problem = Blind()
    end = _honest(0.0, End(np.array([3.1, 0.5]), (2.1, 1.25), problem, ()))
    assert len(problem.told) == 2
    np.testing.assert_allclose(end.x, [1.0, 10.0 / 6.0], atol=0.2)


@pytest.mark.parametrize("gain", [0.5, 1.0, 1.5])
def test_restarts_go_on_from_the_best_while_they_gain(monkeypatch, gain):
    """Descents that come nearer to 0 by a factor."""
    called = []

    def honest(barrier, start):
        called.append((barrier, start.x))
        x = gain * start.x
        return End(x, (0.0, float(np.linalg.norm(x))), start.problem, (float(len(called)),))

    monkeypatch.setattr(searching, "_honest", honest)
    monkeypatch.setattr(searching, "_told", lambda end: end)
    first = [End(np.full(2, size), (0.0, size * np.sqrt(2.0)), None, (0.0,)) for size in (7.0, 4.0, 9.0, 5.0, 6.0)]
    told = []
    best, histories = searched(first, first, np.random.default_rng(0), 1, told.append)
    assert sorted(x[0] for barrier, x in called if barrier == BARRIERS[1]) == [4.0, 5.0, 6.0]
    again = [x for barrier, x in called if barrier == BARRIERS[2]]
    assert len(called) == len(again) + 3 == sum(told)
    if gain < 1.0:
        assert len(again) == searching.RESTARTS
        np.testing.assert_allclose(best, 4.0 * 0.5**5, rtol=0.2)
        for pair in range(0, len(again), 2):
            np.testing.assert_allclose(again[pair], 4.0 * 0.5 ** (1 + pair // 2), rtol=0.2)
            assert (again[pair] != again[pair + 1]).all()
    else:
        assert np.linalg.norm(best) <= 4.0 * np.sqrt(2.0)
        np.testing.assert_allclose(best, 4.0, rtol=0.2)
        assert len(again) <= searching.RESTARTS
    assert len(again) == (2 if gain > 1.0 else len(again))
    assert len(histories) == 5 + len(again)
    assert [len(history) for history in histories[:5]] == [1, 2, 1, 2, 2]
