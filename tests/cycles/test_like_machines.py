"""Cycles of machines that differ by some numbers: equations serve again, and the motion where loops close alike."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from mbsvib import library
from mbsvib.api.running import compiled_for, cycle_of

NONE = dict.fromkeys(("drive", "angles", "speed", "motion", "about"))
WORDS = NONE | {"drive": "crank.rz", "angles": 2 * np.pi * np.arange(12) / 12, "speed": 2 * np.pi}


@pytest.mark.few(1)
@pytest.mark.parametrize(("changed", "alike"), [({"link2.mass": 3.0}, True), ({"link2.position.x": 0.12}, True),
                                                ({"pin12.position.y": 0.001}, False)])  # fmt: skip
def test_a_like_machine_has_the_cycle_of_its_own(changed, alike):
    model = library.hoeken(angle=0.3)
    first = cycle_of(model, WORDS, compiled_for(model, WORDS, tuple(changed)))
    after = model.with_values(changed)
    again, own = cycle_of(after, WORDS, first.machine), after.cycle(**WORDS)
    assert again.machine.statement is first.machine.statement
    assert (again.machine.solved is first.machine.solved) is alike
    for what in ("force", "moment", "torque"):
        assert again.values(what) == pytest.approx(own.values(what), rel=1e-10, abs=1e-10 * own.peak(what))
        assert abs(own.rms(what) - first.rms(what)) > 1e-5 * first.rms(what)


def test_an_open_chain_moves_alike_whatever_its_numbers():
    model = library.two_link()
    words = NONE | {"motion": {"joint1.rz": ([0.0, 1.0], 1, 0), "joint2.rz": ([0.0, 1.0], 2, 0)}}
    lengths = ("joint2.position.x",)
    first = cycle_of(model, words, compiled_for(model, words, lengths))
    after = model.with_values({lengths[0]: model.parameters[lengths[0]] + 0.05})
    again, own = cycle_of(after, words, first.machine), after.cycle(**words)
    assert again.machine.solved is first.machine.solved
    assert_array_equal(again.torques["joint1.rz"], own.torques["joint1.rz"])
    assert abs(own.torques["joint1.rz"] - first.torques["joint1.rz"]).max() > 1e-3
