"""Linear parameter-varying systems: the matrices of a family as polynomials in the pose."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mbsvib.api.batch import Batch
from mbsvib.api.pose import batch_of, check_mapping
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Index
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.common.mat_file import cells, variable_names
from mbsvib.equations.entry_scales import EntryScales
from mbsvib.equations.matrices import MATRICES
from mbsvib.errors import ModelError, counted
from mbsvib.linalg.sparse_interpolation import SparseInterpolant, points_of

if TYPE_CHECKING:
    from mbsvib.api.plant import Plant

# The bound is so many times the largest error that was found: errors of polynomials are largest at corners, which are
# among the checks, and near them.
SAFETY = 3.0
# Random poses of each check: all over the box, and on its faces, edges and corners; and corners beyond these.
INSIDE, BORDER, CORNERS = 1000, 1000, 256
# Poses by different paths of Newton's method have matrices that agree to this.
ROUNDING = 1e-12
# An error is relative to no less than this share of the largest entry in all poses, so that matrices may vanish.
SMALLEST = 1e-2
# Surpluses of this share of the error are followed up at first; of a quarter each time that a check fails.
FOLLOWED = 0.3
# Poses that are taken at most, and poses that are computed at a time.
MOST, CHUNK = 20_000, 4096
# Numbers in the arrays of a file.
LARGEST_FILE = 50_000_000


@dataclass(frozen=True, repr=False, eq=False)
class LPVSystem(Displayed):
    """A linear system M(x) q'' + C(x) q' + K(x) q = B(x) u whose matrices are polynomials in the pose x.

    ``names`` are the p coordinates that vary, ``units`` theirs; ``low``, ``high`` (p,) the box [m, rad] in which the
    polynomials hold. ``poses`` were taken for them. ``error_bound`` is the largest relative error, in
    coordinates scaled by the roots of their masses and among outputs of one unit: three times the largest that was
    found at further poses, 1000 random ones, 1000 random ones on faces and edges, and up to 256 corners. It is
    verified, not proven. What holds for any function with a confidence of 95 %: errors are larger than those found, a
    third of the bound, in less than half a percent of the box.
    ``nominal`` is the system in the middle of the box.
    """

    kind: ClassVar[str] = "lpv system"

    names: tuple[str, ...]
    units: tuple[str, ...]
    low: Array
    high: Array
    error_bound: float
    poses: int
    nominal: System
    polynomial: SparseInterpolant
    """Polynomials of the entries of M, C, K, B, Cq, Cv, Ca, D."""
    fixed: Mapping[str, float]
    """Values of the other coordinates of the poses [m, rad]."""

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.nominal.name

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the minimal coordinates (m,), the same in all poses."""
        return self.nominal.coordinates

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.nominal.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.nominal.outputs

    def at(self, pose: Mapping[str, float]) -> System:
        """Return the system in a pose.

        Parameters
        ----------
        pose : dict of str to float
            Displacements of ``names`` from the described pose [m, rad].

        Returns
        -------
        System
            With names, units and all that matrices tell; it knows no bodies and parameters.

        Raises
        ------
        ModelError
            If a coordinate is missing or unknown, or the pose is outside the box.
        """
        x = self._point(pose)
        arrays = {key: array[0] for key, array in self.matrices(x[None]).items()}
        nominal = self.nominal
        result: System = System.from_matrices(**arrays, inputs=nominal.inputs, outputs=nominal.outputs,
                                              coordinates=nominal.coordinates, name=nominal.name)  # fmt: skip
        return replace(result, **{f"{kind}_units": getattr(nominal, f"{kind}_units")
                                  for kind in ("coordinate", "input", "output")})  # fmt: skip

    def matrices(self, poses: Array) -> dict[str, Array]:
        """Return the matrices in poses, also outside the box, where no bound holds.

        Parameters
        ----------
        poses : array, shape (n, p)
            Displacements in the order of ``names`` [m, rad].

        Returns
        -------
        dict of str to array
            M, C, K (n, m, m), B (n, m, inputs), Cq, Cv, Ca (n, outputs, m), D (n, outputs, inputs).
        """
        values = self.polynomial(self.scaled(np.asarray(poses, dtype=float)))
        arrays = _split(values, self.nominal)
        return arrays | {"M": 0.5 * (arrays["M"] + arrays["M"].swapaxes(1, 2))}

    def scaled(self, poses: Any) -> Any:
        """Return poses (n, p) [m, rad] as points of the cube from -1 to 1, in which the polynomial is stated."""
        return (2.0 * poses - self.low - self.high) / (self.high - self.low)

    def to_mat(self, path: str | PathLike[str], points: int = 5) -> Path:
        """Write state spaces over a grid of poses for MATLAB: arrays of ``ss`` with a ``SamplingGrid``.

        x' = A x + B u, y = C x + D u,  x = (q, q')

        In MATLAB::

            s = load('lpv.mat');
            sys = ss(s.A, s.B, s.C, s.D);
            sys.InputName = s.InputName; sys.OutputName = s.OutputName; sys.StateName = s.StateName;
            sys.SamplingGrid = s.SamplingGrid;
            gains = zeros([1 size(sys, 3:ndims(sys))]);          % then design at sys(:, :, k), or lpvss, ssInterpolant

        Parameters
        ----------
        path : str or path
            File to write.
        points : int
            Poses along each coordinate, even from the lower to the upper end.

        Returns
        -------
        Path
            The path. ``A`` (2m, 2m, points, points, ...) and so on; ``SamplingGrid`` has an array over the grid for
            each coordinate, under its name with ``_`` for what MATLAB does not take; ``Coordinate`` and ``Unit`` list
            the names themselves; ``mech`` has M, C, K, B. ``ErrorBound`` is that of the matrices.

        Raises
        ------
        ModelError
            If points is no whole number from 2 on, or the file would be too large.
        ExportError
            If the file cannot be written.
        """
        if isinstance(points, bool) or not isinstance(points, int) or points < 2:
            raise check.refuse("to_mat", "points", points, "a whole number of poses along each coordinate, at least 2")
        m, p = len(self.coordinates), len(self.names)
        size = (2 * m + len(self.inputs)) * (2 * m + len(self.outputs))
        if points**p * size > LARGEST_FILE:
            raise ModelError(f"to_mat: {points} points along each of {counted(p, 'coordinate')} make {points**p} state "
                             f"spaces; expected no more than {LARGEST_FILE // size}. Give fewer points, or interpolate "
                             f"a family of fewer coordinates.", field="points")  # fmt: skip
        axes = np.meshgrid(*np.linspace(self.low, self.high, points).T, indexing="ij")
        arrays = self.matrices(np.stack([axis.ravel() for axis in axes], axis=1))
        shape = (points,) * p if p > 1 else (points, 1)

        def over_grid(array: Array) -> Array:
            return np.moveaxis(array, 0, -1).reshape(*array.shape[1:], *(shape if p > 1 else (points,)))

        solved = np.linalg.solve(arrays["M"], np.concatenate((-arrays["K"], -arrays["C"], arrays["B"]), axis=2))
        unit = np.broadcast_to(np.eye(2 * m)[m:], (len(solved), m, 2 * m))
        through = np.concatenate((arrays["Cq"], arrays["Cv"], arrays["D"]), axis=2) + arrays["Ca"] @ solved
        content: dict[str, Any] = {
            "A": over_grid(np.concatenate((unit, solved[..., : 2 * m]), axis=1)),
            "B": over_grid(np.concatenate((np.zeros_like(solved[..., 2 * m :]), solved[..., 2 * m :]), axis=1)),
            "C": over_grid(through[..., : 2 * m]), "D": over_grid(through[..., 2 * m :]),
            "SamplingGrid": dict(zip(variable_names(self.names), [axis.reshape(shape) for axis in axes], strict=True)),
            "mech": {key: over_grid(arrays[key]) for key in ("M", "C", "K", "B")},
            "Coordinate": cells(self.names), "Unit": cells(self.units), "InputName": cells(self.inputs),
            "OutputName": cells(self.outputs), "ErrorBound": self.error_bound,
            "StateName": cells((*self.coordinates, *(f"d({name})/dt" for name in self.coordinates))),
        }  # fmt: skip
        from scipy.io import savemat

        stream = BytesIO()
        savemat(stream, content, oned_as="column", long_field_names=True)
        return write_atomic(path, lambda file: file.write(stream.getvalue()))

    def _point(self, pose: Mapping[str, float]) -> Array:
        check_mapping(pose, "at")
        known = [*self.names, *self.fixed]
        for name in pose:
            check.known(name, known, f"at: '{name}' is not a coordinate of the family", "pose")
        limits = dict(zip(self.names, zip(self.low.tolist(), self.high.tolist(), strict=True), strict=True))
        limits |= {name: (value, value) for name, value in self.fixed.items() if name in pose}
        for name, (low, high) in limits.items():
            if name not in pose:
                raise ModelError(f"at: there is no value of '{name}'; expected one from {low:.6g} to {high:.6g}.",
                                 element=name, field="pose")  # fmt: skip
            value = check.number(pose[name], "at", name)
            if not low <= value <= high:
                raise ModelError(f"at: {name} = {value:.6g} is outside the box of the family; expected a value from "
                                 f"{low:.6g} to {high:.6g}. Make the family of a larger range.", element=name,
                                 field="pose")  # fmt: skip
        return np.array([float(pose[name]) for name in self.names])

    def __repr__(self) -> str:
        return (f"LPVSystem({self.name!r}: {counted(len(self.names), 'coordinate')}, {len(self.coordinates)} DOF, "
                f"error below {self.error_bound:.1e})")  # fmt: skip


@dataclass(frozen=True)
class _Measure:
    """Errors of values in rows, which units do not change.

    ``scales`` (values,) are factors of the values, ``groups`` the places of those that are compared with each other,
    and ``sizes`` (groups,) the largest scaled values in all poses.
    """

    scales: Array
    groups: tuple[Index, ...]
    sizes: Array

    @staticmethod
    def of(family: Batch) -> _Measure:
        """Return the measure of a family of poses."""
        entries = EntryScales.of(family.nominal, np.einsum("nii->ni", family.M), family.B)
        groups, sizes, start = [], [], 0
        for key, factor in entries.factors.items():
            places = start + np.arange(factor.size).reshape(factor.shape)
            for rows in entries.rows[key]:
                groups.append(places[rows].ravel())
                sizes.append(np.abs(getattr(family, key)[:, rows] * factor[rows]).max(initial=0.0))
            start += factor.size
        return _Measure(np.concatenate([factor.ravel() for factor in entries.factors.values()]), tuple(groups),
                        np.array(sizes))  # fmt: skip

    def largest(self, values: Array) -> Array:
        """Return the largest scaled values (groups, n) of values (n, values) in each group."""
        scaled = np.abs(values) * self.scales
        return np.array([scaled[:, group].max(axis=1, initial=0.0) for group in self.groups])

    def of_surpluses(self, surpluses: Array) -> Array:
        """Return the largest change (n,) by surpluses (n, values), relative to the largest value of its group."""
        return np.asarray((self.largest(surpluses) / np.where(self.sizes, self.sizes, 1.0)[:, None]).max(axis=0))

    def of_errors(self, found: Array, exact: Array) -> Array:
        """Return the relative errors (n,) of values (n, values)."""
        least = np.where(self.sizes, SMALLEST * self.sizes, 1.0)[:, None]
        return np.asarray((self.largest(found - exact) / np.maximum(self.largest(exact), least)).max(axis=0))


def interpolated(family: Batch, plant: Plant, error: float) -> LPVSystem:
    """Return a family of poses, with its ``plant``, as a function of the pose; see ``Family.interpolated``."""
    limit = check.number(error, "interpolated", "error")
    if not 10.0 * ROUNDING <= limit < 1.0:
        raise check.refuse("interpolated", "error", error, f"a number from {10 * ROUNDING:g} to 1")
    nominal, columns = family.nominal, family.parameters
    if family.massless:
        raise ModelError(f"interpolated: {counted(family.massless, 'motion')} of '{family.name}' moves no mass but "
                         f"dampers; give the bodies mass, or take family[i].", field="family")  # fmt: skip
    names = [name for name, column in columns.items() if np.ptp(column)]
    if not names:
        raise ModelError("interpolated: all poses of the family are the same; expected a coordinate with several "
                         "values.", field="family")  # fmt: skip
    low, high = (np.array([edge(columns[name]) for name in names]) for edge in (np.min, np.max))
    fixed = {name: float(column[0]) for name, column in columns.items() if name not in names}

    def exact(points: Array) -> Array:
        """The matrices (n, values) at points (n, p) of the cube, in rows."""
        poses = np.tile([float(columns[name][0]) for name in columns], (len(points), 1))
        inner = 0.5 * (low + high) + 0.5 * (high - low) * points
        poses[:, [list(columns).index(name) for name in names]] = np.clip(inner, low, high)
        parts = [batch_of(plant, poses[i : i + CHUNK], "interpolated") for i in range(0, len(poses), CHUNK)]
        return np.concatenate([np.concatenate([getattr(part, key).reshape(len(part), -1) for key in MATRICES], axis=1)
                               for part in parts])  # fmt: skip

    measure = _Measure.of(family)
    polynomial, found = SparseInterpolant.none(len(names), sum(getattr(nominal, key).size for key in MATRICES)), np.inf
    followed, new, round_number = FOLLOWED * limit, np.zeros((1, len(names)), dtype=np.intp), 0
    while SAFETY * found + ROUNDING > limit:
        while True:
            # no new ones are left where all have the highest degree, as near a singular pose
            if not len(new) or len(polynomial.indices) + len(new) > MOST:
                reached = f"; the last check found a bound of {SAFETY * found:.1e}" if np.isfinite(found) else ""
                raise ModelError(
                    f"interpolated: {len(polynomial.indices)} poses do not reach error = {limit:g} in the box of "
                    f"{', '.join(names)}{reached}. Give a larger error, or make the family of a smaller range or fewer "
                    f"coordinates.", field="error")  # fmt: skip
            polynomial = polynomial.with_values(new, exact(points_of(new)))
            new = polynomial.following(measure.of_surpluses(polynomial.surpluses) > followed)
            if not len(new):
                break
        checks = _checks(len(names), round_number)
        found = float(measure.of_errors(polynomial(checks), exact(checks)).max())
        round_number, followed = round_number + 1, 0.25 * followed
        new = polynomial.following(measure.of_surpluses(polynomial.surpluses) > followed)
        if not len(new):
            new = polynomial.following(np.ones(len(polynomial.indices), dtype=bool))
    middle = plant.system([float(0.5 * (columns[name].min() + columns[name].max())) for name in columns])
    units = dict(zip(plant.names, plant.units, strict=True))
    for array in (low, high, polynomial.indices, polynomial.surpluses):
        array.setflags(write=False)
    return LPVSystem(tuple(names), tuple([units[name] for name in names]), low, high, SAFETY * found + ROUNDING,
                     len(polynomial.indices), middle, polynomial, fixed)  # fmt: skip


def _checks(variables: int, seed: int) -> Array:
    """Points (n, variables) of the cube at which errors are looked for: random ones, also on faces, and corners."""
    rng = np.random.default_rng(seed)
    inside, border = rng.uniform(-1.0, 1.0, (2, max(INSIDE, BORDER), variables))
    ends = np.sign(border)
    border = np.where(rng.uniform(size=border.shape) < 0.5, ends, rng.uniform(-1.0, 1.0, border.shape))
    corners = np.sign(rng.uniform(-1.0, 1.0, (CORNERS, variables)))
    if 2**variables <= CORNERS:
        corners = 2.0 * (np.arange(2**variables)[:, None] >> np.arange(variables) & 1) - 1.0
    return np.concatenate((inside[:INSIDE], border[:BORDER], corners))


def _split(values: Array, nominal: System) -> dict[str, Array]:
    """Matrices (n, rows, columns) by name, of rows of values (n, values)."""
    shapes = {key: getattr(nominal, key).shape for key in MATRICES}
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    parts = np.split(values, ends[:-1], axis=1)
    return {key: part.reshape(len(values), *shapes[key]) for key, part in zip(shapes, parts, strict=True)}
