"""What is no measurement: refused by name, with what was expected."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ResponseError

RECORD = np.random.default_rng(0).standard_normal(64)


def measured(**changed):
    known = {"omega": [1.0, 2.0], "responses": np.ones((1, 1, 2)), "outputs": ["1X+"], "inputs": ["F"]}
    return mv.Measurement(**(known | changed))


def estimated(step=0.01, **words):
    return mv.Measurement.from_records(step, {"F": RECORD}, {"z": RECORD[::-1]}, **words)


def from_channels(*channels):
    return mv.Measurement.from_sep005(list(channels), "F")


@pytest.mark.parametrize(("call", "said"), [
    (lambda: measured(averages="ten"), "averages = 'ten'; expected their number"),
    (lambda: measured(averages=np.inf), "averages = inf; expected their number"),
    (lambda: measured(output_units=[3]), r"output_units = \[3\]; expected texts"),
    (lambda: measured(nodes=[(0, 0, 0)]), r"nodes = \[\(0, 0, 0\)\]; expected positions \[m\] by their numbers"),
    (lambda: measured(nodes={"a": (0, 0, 0)}), r"nodes = \{'a'.*; expected positions \[m\] by their numbers"),
    (lambda: measured(modes="abc"), "modes = .*; expected MeasuredMode objects"),
    (lambda: measured(nodes={1: (0, 0, 0)}).virtual_point("p", (0, 0, 0), []), r"outputs = \[\]; expected some"),
    (lambda: estimated(method="periodic", period="a"), r"period = 'a'; expected a time \[s\]"),
    (lambda: estimated(method="Hv", segments=4, noise_ratio="a"), "noise_ratio = 'a'; expected a positive number"),
    (lambda: estimated(method="Hv", segments=4, noise_ratio=np.inf), "noise_ratio = inf with"),
    (lambda: estimated(-1.0, method="local"), "t = -1; expected a positive time between samples"),
    (lambda: mv.Records(np.inf, {"F": RECORD}, {"z": RECORD}), "Records: t = inf; expected a positive time"),
    (lambda: from_channels(3), r"channels = \[3\]; expected dicts with 'name'"),
    (lambda: from_channels({"name": "F", "data": RECORD, "fs": "x"}), r"'fs' of 'F' = 'x'; expected a rate \[Hz\]"),
    (lambda: from_channels({"name": "F", "data": 3.0, "fs": 1.0}), r"'data' of 'F' has shape \(\); expected one"),
])  # fmt: skip
def test_what_is_no_measurement_is_refused(call, said):
    with pytest.raises(ResponseError, match=said):
        call()


def test_one_note_is_a_note():
    assert measured(notes="by hammer").notes == ("by hammer",)
