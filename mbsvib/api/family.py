"""Families: one model in many poses, its matrices, frequencies and systems there, and the worst of these poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.batch import Batch
from mbsvib.api.pose import batch_of, columns_of, told
from mbsvib.api.system import System
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import reals
from mbsvib.errors import ModelError, counted
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.unit_warnings import with_angles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.api.lpv import LPVSystem
    from mbsvib.api.plant import Plant
    from mbsvib.plots._sheet import Given


@dataclass(frozen=True, repr=False)
class Worst(Columnar, Displayed):
    """The pose of a family with the largest, or smallest, value of a quantity.

    ``index`` counts from 0, as ``family[index]``; ``pose`` are the displacements of its coordinates [m, rad].
    """

    index: int
    pose: Mapping[str, float]
    value: float
    """Value of the quantity there."""

    def columns(self) -> dict[str, Any]:
        """Return one row: ``index``, ``value``, and the displacements of the coordinates by their names."""
        return {"index": np.array([self.index]), "value": np.array([self.value]),
                **{name: np.array([displacement]) for name, displacement in self.pose.items()}}  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Family(Batch):
    """Systems M_i q'' + C_i q' + K_i q = B_i u of a model in n poses, all in the same minimal coordinates.

    A ``Batch`` with poses as variants: arrays have an axis of poses in front, ``M``, ``C``, ``K`` (n, m, m), ``B``
    (n, m, inputs), ``Cq``, ``Cv``, ``Ca`` (n, outputs, m), ``D`` (n, outputs, inputs); ``family[i]`` is the system in
    pose i, ``nominal`` that of the described pose. ``parameters`` are the displacements (n,) of the coordinates by name
    [m, rad], ``shape`` is that of the grid, or (n,). ``plant`` returns the matrices in any other pose.
    """

    plant: Plant
    shape: tuple[int, ...]

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (n, m), ascending [Hz], NaN for overdamped motions; ``modes()`` has all else."""
        return self.modes().frequencies

    @property
    def models(self) -> tuple[Any, ...]:
        """The models in these poses."""
        if self.variant is None:  # those computed one by one have theirs
            return tuple([self[i].provenance.origin for i in range(len(self))])
        return tuple(map(self.variant, range(len(self))))

    def pose(self, i: int) -> dict[str, float]:
        """Return the displacements [m, rad] of the coordinates in pose i, from 0, as ``Model.moved`` takes them."""
        return {name: float(column[i]) for name, column in self.parameters.items()}

    def worst(self, quantity: Callable[[System], Any], largest: bool = True) -> Worst:
        """Return the pose in which a quantity is largest, or smallest.

        Parameters
        ----------
        quantity : Quantity or callable
            A quantity of ``studies``, such as ``studies.peak("z", "Fz")``, or a function of a system; of several
            numbers the largest (smallest) counts.
        largest : bool
            False: the smallest value is the worst, as of damping ratios.

        Returns
        -------
        Worst
            ``index``, ``pose`` and ``value``; of equal values the first.

        Raises
        ------
        ModelError
            If the quantity is no function, or no real number in some pose.
        ResponseError
            If the quantity refuses a system, by the number of the pose.
        """
        if not callable(quantity):
            raise check.refuse("worst", "quantity", quantity, "a quantity such as studies.peak('z', 'Fz'), or a "
                               "function of a system")  # fmt: skip
        extreme = np.max if largest else np.min

        def ask(system: System) -> float:
            numbers = reals(quantity(system), "worst", "quantity", "real numbers of each system", ModelError)
            return float(extreme(numbers)) if numbers.size else np.nan

        values = np.array(self._map(ask))
        if np.isnan(values).any():
            i = int(np.argmax(np.isnan(values)))
            raise ModelError(f"worst: the quantity is not a number in {self._told(i)}.", field="quantity")
        index = int(np.argmax(values) if largest else np.argmin(values))
        return Worst(index, self.pose(index), float(values[index]))

    def interpolated(self, error: float = 1e-6) -> LPVSystem:
        """Return the system as a function of the pose: polynomials through as many more poses as the error needs.

        The function holds in the box between the least and the largest displacement of each coordinate. Poses are
        added at nested points, in the directions in which they change the matrices, until matrices at further poses,
        random ones and corners, which the polynomials were not made of, are right to a third of the error. The bound
        is thus verified at these, not proven; see ``LPVSystem.error_bound``.

        Parameters
        ----------
        error : float
            Largest error of M, C, K, B, Cq, Cv, Ca and D, each relative to its largest entry in the same pose (but to
            no less than a hundredth of that in all poses); of outputs, to that of all with the same unit. Units do not
            matter: coordinates are scaled by the roots of their masses, inputs by the forces that they have along them.

        Returns
        -------
        LPVSystem
            ``lpv.at({"leg1.slide.z": 0.01})`` is a System.

        Raises
        ------
        ModelError
            If the error is not between 1e-11 and 1, all poses are one, some motions have no mass, or the error would
            take too many poses.
        SingularPoseError, EquilibriumError
            If the box has poses that loops do not reach, or that are off balance, by their displacements.
        """
        from mbsvib.api.lpv import interpolated

        return interpolated(self, self.plant, error)

    def plot(self, mode: int | None = None, *, ax: Given | None = None) -> Figure | Given:
        """Draw the natural frequencies over the poses.

        Parameters
        ----------
        mode : int, optional
            Number of the one mode that is drawn, from 1; default: all modes, in a map the lowest one that is no
            rigid-body mode in all poses.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            Lines over one coordinate; a map over a grid of two; else lines over the number of the pose, or histograms
            over a grid of more.

        Raises
        ------
        ModelError
            If there is no such mode.
        """
        from mbsvib.plots.studies import over_variables

        columns = self.parameters
        varied = {name: np.unique(column) for name, column in columns.items() if np.ptp(column)}
        grid = len(self.shape) > 1
        if len(varied) != 1 and not grid:
            columns = varied = {"pose": np.arange(float(len(self)))}
        shown = self._shown(mode, grid and len(varied) == 2)
        label = "natural frequency" + (f" of mode {shown[0] + 1}" if len(shown) == 1 < self.dof else "")
        units = dict(zip(self.plant.names, self.plant.units, strict=True)) | {label: "Hz"}
        return over_variables(self.frequencies[:, shown], label, columns, varied, grid=grid, units=units,
                              name=self.name, entries=[f"{k + 1}" for k in shown], ax=ax)  # fmt: skip

    def _shown(self, mode: int | None, single: bool) -> list[int]:
        """Numbers from 0 of the modes that are drawn; ``single``: of which the first one is."""
        if mode is not None:
            if check.count(mode, "Family.plot", "mode", 1) > self.dof:
                raise check.refuse("Family.plot", "mode", mode, f"the number of a mode, 1 to {self.dof}")
            return [mode - 1]
        moving = np.flatnonzero(self.frequencies.max(axis=0) > 0.0).tolist()
        return moving if single and moving else list(range(self.dof))

    def _told(self, i: int) -> str:
        return told(i, self.pose(i))

    def __repr__(self) -> str:
        return f"Family({self.name!r}: {counted(len(self), 'pose')}, {self.dof} DOF)"


def family(
    model: Mechanism, values: Mapping[str, ArrayLike], grid: bool, independent: Sequence[str] | None, relaxed: bool
) -> Family:  # fmt: skip
    """Return a model in many poses; see ``Model.family``."""
    from mbsvib.api.plant import compiled

    columns, shape = columns_of(model, values, grid)
    model = with_angles(model, columns)
    plant = compiled(model, [], independent=independent, pose=list(columns), relaxed=relaxed)
    if independent is None and len(plant.coordinates) == len(columns):
        plant = compiled(model, [], independent=list(columns), pose=list(columns), relaxed=relaxed)
    batch = batch_of(plant, np.stack(list(columns.values()), axis=1), "family")
    return Family(**{item.name: getattr(batch, item.name) for item in fields(batch)}, plant=plant, shape=shape)
