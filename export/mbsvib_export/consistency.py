"""Files that hold one system twice, as M, C, K and as A, B, C, D: the two must be the same system."""

from __future__ import annotations

import numpy as np

from mbsvib.errors import ExportError
from mbsvib_export.neutral import SystemData
from mbsvib_export.responses import (
    check_points,
    poles,
    response_error,
    second_order_response,
    state_space_response,
)

# Largest difference of the two responses. That of physical states near a resonance is 1e-8 at worst, from rounding; an
# entry that was changed in one of them only makes more.
CONTRADICTION = 1e-4
# Poles below this share of the largest are those of rigid-body motions, moved by rounding.
RIGID = 1e-6


def consistent(data: SystemData) -> SystemData:
    """Return what was read of a file, or refuse it where its two forms of the equations contradict each other."""
    values = poles(data.state_space.A)
    omega = check_points(values[np.abs(values) > RIGID * np.abs(values).max(initial=0.0)])
    try:
        truth, actual = second_order_response(data, omega), state_space_response(data.state_space, omega)
    except np.linalg.LinAlgError as error:
        raise ExportError(f"'{data.name}': M, C, K or A have no response between {omega[0]:g} and {omega[-1]:g} rad/s; "
                          f"expected two forms of one system. Write the file again.") from error  # fmt: skip
    difference = response_error(actual, truth, data, omega)
    if not difference <= CONTRADICTION:
        raise ExportError(f"'{data.name}': the frequency responses of M, C, K, B, Cq, Cv, Ca, D and of the state space "
                          f"A, B, C, D differ by {difference:.2g}; expected two forms of one system. Change both, or "
                          f"write the file again.")  # fmt: skip
    return data
