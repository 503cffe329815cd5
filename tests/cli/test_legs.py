"""The legs that get actuators in ``mbsvib isolation``."""

import json
import re

import pytest

from mbsvib import isolation, library
from tests.support.cli import invoke

FEEDBACK = ("isolation", "stewart_isolator", "platform", "--feedback", "force", "--gain", "60")


@pytest.mark.slow
def test_chosen_legs_get_actuators():
    result = invoke([*FEEDBACK, "--legs", "leg[1-3].k", "--json"])
    plant = isolation.actuated(library.stewart_isolator(), "platform", ["leg[1-3].k"])
    loop = plant.with_gains(isolation.force_feedback(plant, 60.0))
    told = json.loads(result.stdout)["closed_loop"]["damping_ratios"]
    assert told == pytest.approx(loop.damping_ratios.tolist(), rel=1e-9)
    words = invoke([*FEEDBACK, "--legs", "leg1.k", "--legs", "leg4.k"]).stdout
    assert [name for name in (f"leg{i}.k.actuator" for i in range(1, 7)) if name in words] == [
        "leg1.k.actuator", "leg4.k.actuator"]  # fmt: skip


@pytest.mark.parametrize(("args", "message"), [
    ([*FEEDBACK, "--legs", "legg1.k"], "leg 'legg1.k' is not a line spring.*Did you mean 'leg1.k'"),
    (["isolation", "stewart_isolator", "platform", "--legs", "leg1.k"], "--legs leg1.k: legs get actuators for"),
])  # fmt: skip
def test_legs_that_are_none_are_refused(args, message):
    result = invoke(args)
    assert result.exit_code == 2
    assert re.search(message, result.stderr)
