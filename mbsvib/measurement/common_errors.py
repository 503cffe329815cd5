"""Errors of responses with common causes, as those of sensors from which several channels were computed.

n = A e B^T with independent e, E|e|^2 = v, so that E|n|^2 = |A|^2 v |B^T|^2

Virtual points: six displacements and six forces at one point, of sensors and impacts around it on a rigid part.

u = R q,  q = (R^T R)^-1 R^T u,  with a row e, (r - p) x e of R for a channel at r along e; forces alike

Source: van der Seijs, van den Bosch, Rixen & de Klerk, COMPDYN 2013, for the transformation and the consistency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError, counted
from mbsvib.linalg.rank import DEPENDENT_ROWS
from mbsvib.measurement.matching import ORDERS, is_si
from mbsvib.measurement.points import Place, model_places


@dataclass(frozen=True, slots=True, eq=False)
class CommonErrors:
    """``rows`` A (outputs, a, n), ``variance`` v (a, b, n) and ``columns`` B (inputs, b, n), of n lines each."""

    rows: Array | Complex
    variance: Array
    columns: Array | Complex

    def of(self, outputs: Any, inputs: Any) -> CommonErrors:
        """Return the errors of some outputs and inputs."""
        return CommonErrors(self.rows[outputs], self.variance, self.columns[inputs])

    def at(self, lines: Any) -> CommonErrors:
        """Return the errors at some lines."""
        return CommonErrors(self.rows[..., lines], self.variance[..., lines], self.columns[..., lines])

    def power(self) -> Array:
        """Return E|n|^2 (outputs, inputs, n)."""
        rows, variance, columns = (np.moveaxis(one, -1, 0) for one in (self.rows, self.variance, self.columns))
        left, right = (np.nan_to_num(np.abs(one) ** 2) for one in (rows, columns))
        return np.moveaxis(left @ variance @ right.swapaxes(1, 2), 0, -1)

    def matrices(self) -> Complex:
        """Return the covariances (n, pairs, pairs) of all pairs of outputs and inputs, inputs within outputs."""
        rows, variance, columns = (np.nan_to_num(np.moveaxis(one, -1, 0))
                                   for one in (self.rows, self.variance, self.columns))  # fmt: skip
        shared = np.einsum("nib,njb,nab->naij", columns, columns.conj(), variance, optimize=True)
        result = np.einsum("noa,npa,naij->noipj", rows, rows.conj(), shared, optimize=True)
        pairs = rows.shape[1] * columns.shape[1]
        return np.asarray(result.reshape(-1, pairs, pairs)) + 0j

    def combined(self, outputs: Array, inputs: Array) -> CommonErrors:
        """Return the errors of T_o G T_i^T, of real matrices (new outputs, outputs) and (new inputs, inputs)."""
        return CommonErrors(np.tensordot(outputs, self.rows, 1), self.variance, np.tensordot(inputs, self.columns, 1))


def errors_of(data: Any) -> CommonErrors | None:
    """Return the errors of a measurement; None where no variance is known."""
    if data.common_errors is not None or data.variance is None:
        return data.common_errors  # type: ignore[no-any-return]
    if data.covariance is None:
        return independent_errors(np.nan_to_num(data.variance))
    power, axes = np.linalg.eigh(np.moveaxis(data.covariance, -1, 0))
    rows = np.moveaxis(axes * np.sqrt(np.maximum(power, 0.0))[:, None], 0, -1)
    return replace(independent_errors(np.ones(data.responses.shape)), rows=rows)


def independent_errors(variance: Array) -> CommonErrors:
    """Return independent errors of responses with a variance (outputs, inputs, n)."""
    outputs, inputs, lines = variance.shape
    return CommonErrors(_same(outputs, lines), variance, _same(inputs, lines))


def no_errors(outputs: int, inputs: int, lines: int) -> CommonErrors:
    """Return errors of responses that are exact."""
    return CommonErrors(np.zeros((outputs, 0, lines)), np.zeros((0, 0, lines)), np.zeros((inputs, 0, lines)))


def side_by_side(errors: Sequence[CommonErrors]) -> CommonErrors:
    """Return the errors of the responses of parts side by side."""
    return CommonErrors(*(_blocks([getattr(one, side) for one in errors]) for side in ("rows", "variance", "columns")))


def joined(first: CommonErrors, second: CommonErrors) -> CommonErrors:
    """Return the sum of two independent errors of the same responses."""
    rows, columns = (np.concatenate((getattr(first, side), getattr(second, side)), axis=1)
                     for side in ("rows", "columns"))  # fmt: skip
    return CommonErrors(rows, _blocks([first.variance, second.variance]), columns)


def _blocks(arrays: Sequence[Any]) -> Any:
    """A block diagonal array (m, n, lines) for each line."""
    ends = np.cumsum([array.shape[:2] for array in arrays], axis=0)
    result = np.zeros((*ends[-1], arrays[0].shape[2]), dtype=np.result_type(*arrays))
    for array, (row, column) in zip(arrays, ends, strict=True):
        result[row - array.shape[0] : row, column - array.shape[1] : column] = array
    return result


def _same(size: int, lines: int) -> Array:
    return np.broadcast_to(np.eye(size)[:, :, None], (size, size, lines))


WHO = "virtual_point"
# A direction is told if what the channels do not tell of it is below this share.
TOLD = 1e-8


def with_virtual_point(data: Any, name: str, position: Any, outputs: Any, inputs: Any) -> Any:
    """Return a measurement with a virtual point in the place of some channels, see ``Measurement.virtual_point``."""
    point = np.array(check.vector(position, WHO, "position"))
    places = model_places(data)
    sides = [_side(data, name, point, places, kind, given) for kind, given in (("output", outputs), ("input", inputs))]
    (rows, t_out, _), (columns, t_in, _) = sides
    responses, consistency = data.responses, dict(data.consistency)
    for axis, (numbers, _, rigid) in enumerate(sides):
        names = (data.outputs, data.inputs)[axis]
        shares = _consistency(np.moveaxis(responses, axis, 0)[numbers], rigid)
        consistency |= dict(zip([names[k] for k in numbers], shares, strict=True))
    arrays: dict[str, Any] = {"responses": _moved(_moved(responses, rows, t_out, 0), columns, t_in, 1)}
    if data.noise_variance is not None:
        arrays["noise_variance"] = _moved(_moved(data.noise_variance, rows, t_out**2, 0), columns, t_in**2, 1)
    if data.covariance is not None:  # of new inputs it is another one for each
        arrays["covariance"] = None if columns else _moved(_moved(data.covariance, rows, t_out, 0), rows, t_out, 1)
    errors = errors_of(data)
    if errors is not None:
        arrays["common_errors"] = errors.combined(*(
            _moved(np.eye(len(names)), numbers, transform, 0)
            for names, (numbers, transform, _) in zip((data.outputs, data.inputs), sides, strict=True)))  # fmt: skip
    for kind, (numbers, transform, _) in zip(("output", "input"), sides, strict=True):
        arrays |= _channels(data, name, point, kind, numbers, transform)
    if t_out.size:
        kept = [k for k in range(len(data.outputs)) if k not in rows]
        told = np.count_nonzero(t_out.any(axis=1))
        arrays["quantity"] = (*(data.quantity[k] for k in kept), *([data.quantity[rows[0]]] * told))
    return replace(data, **arrays, variance=None, coherence=None, averages=None, consistency=consistency)


def _side(
    data: Any, name: str, point: Array, places: dict[tuple[str, str], Place], kind: str, given: Any
) -> tuple[list[int], Array, Array]:
    """Channels by number, T (6, k) with q = T u, zero in directions that they do not tell, and R R^+ (k, k)."""
    if given is None:
        return [], np.zeros((6, 0)), np.zeros((0, 0))
    names = getattr(data, f"{kind}s")
    listed = [given] if isinstance(given, str) else list(given)
    numbers = list(dict.fromkeys(k for one in listed for k in selected(one, names, kind, WHO)))
    if not numbers:
        raise ResponseError(f"{WHO}: {kind}s = {shown(given)}; expected some on the rigid part, or None for none.")
    rows = []
    for k in numbers:
        place = places.get((kind, names[k]))
        if place is None:
            raise ResponseError(f"{WHO}: the place of {kind} '{names[k]}' is not known; give the measurement "
                                f"{kind}_points, or nodes and labels such as '101X+'.")  # fmt: skip
        force, moment = place.direction[:3], place.direction[3:]
        rows.append(np.concatenate((force, np.cross(place.position - point, force) + moment)))
    if kind == "output":
        quantities = {data.quantity[k] or "of unknown quantity" for k in numbers}
        if len(quantities) > 1:
            raise ResponseError(f"{WHO}: outputs of '{name}' are {' and '.join(sorted(quantities))}; expected one "
                                f"quantity.")  # fmt: skip
    geometry = np.array(rows)
    arm = np.sqrt(np.square(geometry[:, 3:]).sum(axis=1).mean()) or 1.0
    scaled = geometry / np.repeat([1.0, arm], 3)
    u, values, vh = np.linalg.svd(scaled)
    rank = int(np.count_nonzero(values > DEPENDENT_ROWS * values[0]))
    transform = (vh[:rank].T / values[:rank]) @ u[:, :rank].T / np.repeat([1.0, arm], 3)[:, None]
    untold = np.square(vh[rank:]).sum(axis=0) > TOLD**2
    if untold.all():
        raise ResponseError(f"{WHO}: {counted(len(numbers), kind)} tell no displacement of '{name}' alone; expected "
                            f"six independent directions on a rigid part, better nine.")  # fmt: skip
    transform[untold] = 0.0
    return numbers, transform, u[:, :rank] @ u[:, :rank].T


def _moved(array: Any, numbers: Sequence[int], transform: Array, axis: int) -> Any:
    """An array with channels along an axis replaced by those of the point, behind the others."""
    if not len(numbers):
        return array
    first = np.moveaxis(array, axis, 0)
    others = np.delete(first, numbers, axis=0)
    told = transform.any(axis=1)
    point = np.tensordot(transform[told], first[numbers], axes=1)
    return np.moveaxis(np.concatenate((others, point)), 0, axis)


def _channels(
    data: Any, name: str, point: Array, kind: str, numbers: Sequence[int], transform: Array
) -> dict[str, Any]:  # fmt: skip
    """Names, units and points of all channels of a kind, those of the point last."""
    if not len(numbers):
        return {}
    told = [direction for direction, row in zip(check.DIRECTIONS, transform, strict=True) if row.any()]
    rest = [k for k in range(len(getattr(data, f"{kind}s"))) if k not in numbers]
    names, units, points = (getattr(data, field) for field in (f"{kind}s", f"{kind}_units", f"{kind}_points"))
    unit, turned = _units({units[k] for k in numbers}, kind)
    return {
        f"{kind}s": (*(names[k] for k in rest), *(f"{name}.{direction}" for direction in told)),
        f"{kind}_units": (*(units[k] for k in rest), *(turned if d[0] == "r" else unit for d in told)),
        f"{kind}_points": (*(points[k] for k in rest), *((point, direction) for direction in told)),
    }


def _units(known: set[str], kind: str) -> tuple[str, str]:
    """Units of displacements or forces along and about a direction; volts and alike, of unknown scale, stay."""
    other = sorted(unit for unit in known if unit and not is_si(unit))
    if other and (len(known) > 1 or is_si(other[0]) is False):
        raise ResponseError(f"virtual_point: {kind}s are in {', '.join(sorted(known))}; expected data in SI units.")
    if other:
        return other[0], other[0]
    if kind == "input":
        return ("N", "N m") if known <= {"N", "N m"} else ("", "")
    orders = {ORDERS[unit][1] if unit in ORDERS else -1 for unit in known}
    tail = {0: "", 1: "/s", 2: "/s^2"}.get(orders.pop()) if len(orders) == 1 else None
    return ("", "") if tail is None else (f"m{tail}", f"rad{tail}")


def _consistency(known: Complex, rigid: Array) -> list[float]:
    """How much of each channel the motion of a rigid part explains, 1 for all: 1 - |u - R q|^2 / |u|^2, from 0."""
    if not len(rigid):
        return []
    values = known.reshape(len(known), -1)
    values = values[:, np.isfinite(values).all(axis=0)]
    rest = np.square(np.abs(values - rigid @ values)).sum(axis=1)
    power = np.square(np.abs(values)).sum(axis=1)
    return [float(share) for share in np.maximum(0.0, 1.0 - rest / np.where(power > 0.0, power, 1.0))]
