"""What a fit prints: digits that its intervals leave, what is not told, residuals that are no noise."""

from dataclasses import replace

import numpy as np

from mbsvib.fitting import knowledge
from mbsvib.fitting.result import NOT_CONVERGED
from tests.fitting.scenes import chain, measured

OMEGA = 2 * np.pi * np.linspace(2.0, 60.0, 80)


def table_of(result):
    """Rows and notes of a printed table."""
    table = result.table()
    return table["rows"], list(table.get("notes", ()))


def test_a_fit_prints_its_values_and_what_it_does_not_know():
    """As many digits as an interval leaves; what is not told; residuals and bands that are no noise."""
    model = chain()
    fit = model.fit(measured(model, OMEGA, 0.02, 3), ["k0.stiffness", "k1.stiffness"])
    shown = replace(fit, values={"a": 12345.678, "b": 2e-5, "c": -0.5, "d": 3.0, "e": 0.999},
                    intervals={"a": (12340.1, 12351.2), "b": (1.9e-5, 2.1e-5), "c": (-0.75, -0.25), "d": (0.0, np.inf),
                               "e": (0.0004, 1.9976)},
                    units={"a": "N/m", "b": "m", "c": "", "d": "kg", "e": ""})  # fmt: skip
    rows, notes = table_of(shown)
    assert rows == [("a", "12346", "12340 ... 12351", "N/m"), ("b", "2.00e-05", "1.90e-05 ... 2.10e-05", "m"),
                    ("c", "-0.50", "-0.75 ... -0.25", ""), ("d", "3", "not determined by the data", "kg"),
                    ("e", "1.0", "0.0 ... 2.0", "")]  # fmt: skip
    assert notes == ["The residuals are noise."]
    test = knowledge.ResidualTest(False, 6.25, 0.456, ((1.0, 2.0), (30.126, 40.0)))
    rows, notes = table_of(replace(fit, converged=False, unidentified=("a with b",), residual_test=test))
    assert notes == [NOT_CONVERGED, "Not determined by the data: a with b.",
                     "The model does not explain the data: residuals 2.5 times as large as the stated noise, with a "
                     "correlation of 0.46 from line to line are no noise.", "Intervals come from the residuals.",
                     "Not reached: 1 to 2, 30.13 to 40 Hz."]  # fmt: skip
    many = knowledge.ResidualTest(False, np.nan, 0.4, tuple((float(k), k + 1.0) for k in range(8)))
    rows, notes = table_of(replace(fit, residual_test=many))
    assert notes[0].startswith("The model does not explain the data: residuals with a")
    assert notes[-1] == "Not reached: 0 to 1, 1 to 2, 2 to 3, 3 to 4, 4 to 5, 5 to 6 ... Hz."
    assert repr(fit) == "Fit('chain': 2 values)"
