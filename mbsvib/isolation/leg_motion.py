"""Parts of legs that follow their ends: positions and orientations, and their exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array, Index
    from mbsvib.isolation.chains import Leg


SHORT = 1e-9  # length, in parts of the original one, that counts as zero
FLIPPED = 1e-9  # 1 + cosine of a leg's rotation angle, below which the smallest rotation is not unique
SMALL = 1e-3  # sine below which two terms of a series are accurate enough


@dataclass(frozen=True, slots=True)
class Lines:
    """Displaced legs: ``length`` (..., l), direction ``along`` (..., l, 3), ``cross`` product of the old direction with
    it, their ``cosine``, and ``factor`` = angle / sine.
    """

    length: Array
    along: Array
    cross: Array
    cosine: Array
    factor: Array


@dataclass(frozen=True, slots=True)
class Following:
    """Legs (l) by their ``names``, from ``start`` along ``line`` (l, 3); their ``points`` (p, 3) with the leg that is
    the ``owner`` of each (p,) and their ``shares`` (p,), and the leg ``turns`` (t,) that each orientation goes with.
    ``parameters`` are the names of all coordinates of points and of all components of orientations.
    """

    names: tuple[str, ...]
    start: Array
    line: Array
    points: Array
    owner: Index
    shares: Array
    turns: Index
    parameters: tuple[str, ...]

    @classmethod
    def of(cls, legs: Sequence[Leg]) -> Following:
        """Return the parts that follow the ends of some legs."""
        points = [(name, i, point, leg.shares[name]) for i, leg in enumerate(legs)
                  for name, point in leg.points.items()]  # fmt: skip
        oriented = [(name, i) for i, leg in enumerate(legs) for name in leg.orientations]
        names = [f"{name}.{axis}" for name, *_ in points for axis in "xyz"]
        names += [f"{name}.{axis}" for name, _ in oriented for axis in ("rx", "ry", "rz")]
        start = np.array([leg.start for leg in legs])
        return cls(
            tuple([leg.name for leg in legs]), start, np.array([leg.end for leg in legs]) - start,
            np.array([point for _, _, point, _ in points]), np.array([i for _, i, _, _ in points], dtype=np.intp),
            np.array([share for _, _, _, share in points]), np.array([i for _, i in oriented], dtype=np.intp),
            tuple(names),
        )  # fmt: skip

    def values(self, low: Array, high: Array, variables: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters (...) for shifted ends: positions [m] and rotation vectors [rad].

        ``low``, ``high`` (..., l, 3): displacements of the starts and ends of the legs [m].
        """
        lines, leg = self._lines(low, high, variables), self.owner
        arm = self.points - self.start[leg]
        cross, cosine = lines.cross[..., leg, :], lines.cosine[..., leg, None]
        once = np.cross(cross, arm)
        longer = self.shares * (lines.length - np.linalg.norm(self.line, axis=-1))[..., leg]
        points = (self.points + low[..., leg, :] + once + np.cross(cross, once) / (1.0 + cosine)
                  + longer[..., None] * lines.along[..., leg, :])  # fmt: skip
        turns = (lines.factor[..., None] * lines.cross)[..., self.turns, :]
        lead = low.shape[:-2]
        coordinates = np.concatenate([points.reshape(*lead, -1), turns.reshape(*lead, -1)], axis=-1)
        columns = np.moveaxis(coordinates, -1, 0) if lead else coordinates.tolist()
        return dict(zip(self.parameters, columns, strict=True))

    def rates(self, low: Array, high: Array, slopes: Array, variables: Mapping[str, Any]) -> list[dict[str, float]]:
        """Return the derivatives of these parameters.

        ``low``, ``high`` (l, 3): displacements of the starts and ends of the legs [m]. ``slopes`` (k, 2, l, 3):
        derivatives of both to each variable.
        """
        lines, leg = self._lines(low, high, variables), self.owner
        u, k, c = lines.along, lines.cross, lines.cosine[..., None]
        direction = self.line / np.linalg.norm(self.line, axis=-1)[:, None]
        d_low, d_line = slopes[:, 0], slopes[:, 1] - slopes[:, 0]
        d_length = (d_line * u).sum(axis=-1, keepdims=True)
        d_u = (d_line - d_length * u) / lines.length[:, None]
        d_k, d_c = np.cross(direction, d_u), (direction * d_u).sum(axis=-1, keepdims=True)
        square = (k * k).sum(axis=-1, keepdims=True)
        close = square < SMALL**2
        safe = np.where(close, 1.0, square)
        factor = lines.factor[:, None]
        d_factor = np.where(close, -1.0 / 3.0 - 2.0 / 15.0 * square, (c * factor - 1.0) / safe)
        d_turns = (factor * d_k + d_factor * d_c * k)[:, self.turns]
        arm, k, c, d_k, d_c = self.points - self.start[leg], k[leg], 1.0 + c[leg], d_k[:, leg], d_c[:, leg]
        once, d_once = np.cross(k, arm), np.cross(d_k, arm)
        d_points = (d_low[:, leg] + d_once + (np.cross(d_k, once) + np.cross(k, d_once)) / c
                    - np.cross(k, once) * d_c / c**2)  # fmt: skip
        longer = (lines.length - np.linalg.norm(self.line, axis=-1))[leg, None]
        d_points += self.shares[:, None] * (d_length[:, leg] * u[leg] + longer * d_u[:, leg])
        rows = np.concatenate([d_points.reshape(len(slopes), -1), d_turns.reshape(len(slopes), -1)], axis=-1)
        return [{name: rate for name, rate in zip(self.parameters, row, strict=True) if rate} for row in rows.tolist()]

    def _lines(self, low: Array, high: Array, variables: Mapping[str, Any]) -> Lines:
        before = np.linalg.norm(self.line, axis=-1)
        line = self.line + high - low
        length = np.linalg.norm(line, axis=-1)
        self._refuse(~(length > SHORT * before), "no length", variables)
        direction, along = self.line / before[:, None], line / length[..., None]
        cosine = (direction * along).sum(axis=-1)
        self._refuse(1.0 + cosine <= FLIPPED, "been turned end for end", variables)
        cross = np.cross(direction, along)
        sine = np.linalg.norm(cross, axis=-1)
        angle = np.arctan2(sine, cosine)
        factor = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
        return Lines(length, along, cross, cosine, factor)

    def _refuse(self, bad: NDArray[np.bool_], fault: str, variables: Mapping[str, Any]) -> None:
        if not bad.any():
            return
        *point, leg = np.argwhere(bad)[0].tolist()
        values = {name: np.asarray(value) for name, value in variables.items()}
        shown = ", ".join(f"{name} = {float(value[tuple(point)] if value.ndim else value):.6g}"
                          for name, value in values.items())  # fmt: skip
        raise ModelError(f"platform: leg '{self.names[leg]}' has {fault} where {shown}; give bounds that keep away "
                         f"from there.", element=self.names[leg], field="variables")  # fmt: skip
