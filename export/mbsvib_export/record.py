"""What files keep of a system, by key: the record that each exporter writes, and from which each reader makes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mbsvib.api.state_space import StateSpace
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace as FirstOrder
from mbsvib_export.neutral import ERROR_BOUND, FIRST_ORDER, OF_SPACE, SECOND_ORDER, THROUGH, SystemData, checked
from mbsvib_export.responses import check_points, poles, response_error, second_order_response, state_space_response

FORMAT = "mbsvib-system"
SPACE_FORMAT = "mbsvib-state-space"  # first-order equations alone
VERSION = 1  # counts up when a key changes its meaning or goes; readers skip keys they do not know
# Largest difference of the two responses. That of physical states near a resonance is 1e-8 at worst, from rounding; an
# entry that was changed in one of them only makes more.
CONTRADICTION = 1e-4
# Poles below this share of the largest are those of rigid-body motions, moved by rounding.
RIGID = 1e-6
PORT_TEXTS = ("inputs", "input_units", "outputs", "output_units")
TEXTS = ("coordinates", "coordinate_units", *PORT_TEXTS, "bodies")
STATE_TEXTS = ("states", "state_units")
# The keys without which a record is incomplete, by its format, and the key that only some records have.
NEEDED = {
    FORMAT: ("name", "realization", *TEXTS, *STATE_TEXTS, *SECOND_ORDER, "body_motion",
             *(OF_SPACE + key for key in FIRST_ORDER)),
    SPACE_FORMAT: ("name", "realization", *PORT_TEXTS, *STATE_TEXTS, *(OF_SPACE + key for key in "ABCD")),
}  # fmt: skip
OPTIONAL = {FORMAT: OF_SPACE + THROUGH, SPACE_FORMAT: OF_SPACE + ERROR_BOUND}
# All that is read of a file.
KEYS = ("format", "version", *NEEDED[FORMAT], *OPTIONAL.values())


def check_version(name: Any, version: Any) -> None:
    """Refuse a file of another format, or of a version this release does not know."""
    if name not in (FORMAT, SPACE_FORMAT):
        raise ExportError(f"format = {name!r}; expected {FORMAT!r} or {SPACE_FORMAT!r}. This is not a system written "
                          f"by mbsvib.")  # fmt: skip
    if version != VERSION or isinstance(version, bool):
        raise ExportError(f"version = {version!r}; this release of mbsvib reads version {VERSION}. A later release "
                          f"wrote it: upgrade mbsvib (pip install -U mbsvib), or export it again.")  # fmt: skip


def record_of(data: SystemData | FirstOrder) -> dict[str, Any]:
    """Return all that a file keeps of a system: texts, tuples of texts and arrays; the inverse of ``data_from``."""
    form = FORMAT if isinstance(data, SystemData) else SPACE_FORMAT
    space = data.state_space if isinstance(data, SystemData) else data
    record: dict[str, Any] = {"format": form, "version": VERSION}
    for key in (*NEEDED[form], OPTIONAL[form]):
        of_space = key.startswith(OF_SPACE) or key in ("realization", *STATE_TEXTS)
        value = getattr(space if of_space else data, key.removeprefix(OF_SPACE))
        if value is not None:
            record[key] = value
    return record


def data_from(record: Mapping[str, Any]) -> SystemData | StateSpace:
    """Return the system, or the state space, that a record describes; refused if it contradicts itself."""
    of_space: dict[str, Any] = {key: record[key] for key in ("name", "realization", *PORT_TEXTS, *STATE_TEXTS)}
    of_space |= {key.removeprefix(OF_SPACE): value for key, value in record.items() if key.startswith(OF_SPACE)}
    if record["format"] == SPACE_FORMAT:
        return checked(StateSpace(transform=np.zeros((0, len(record["states"]))), **of_space))
    second: dict[str, Any] = {key: record[key] for key in ("name", *TEXTS, *SECOND_ORDER, "body_motion")}
    return _consistent(SystemData(state_space=StateSpace(**of_space), **second))


def _consistent(data: SystemData) -> SystemData:
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
