"""Runs: nonlinear time responses of models, and all that can be asked of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import real
from mbsvib.errors import ModelError, ResponseError, counted
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.unit_warnings import angle_warnings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mbsvib.common.progress import Progress
    from mbsvib.plots._sheet import Given
    from mbsvib.plots.animation import Animation
    from mbsvib.simulation.trace import Trace


@dataclass(frozen=True, repr=False, eq=False)
class Energy(Displayed):
    """Energies of a run over time [J].

    The kinetic and the potential energy by part; springs, elastic parts and weights are potential energy, a weight
    being 0 in the pose as described. ``dissipated`` is what dampers have taken since the start, ``supplied`` the work
    of loads, inputs and cross-coupled bushings. So total + dissipated - supplied stays what it was: ``balance`` is its
    change.
    """

    parts: tuple[str, ...]
    """Names of the bodies and elements that have energy."""
    kinetic_by_part: Array = field(repr=False)
    """Kinetic energy of each (parts, n) [J]."""
    potential_by_part: Array = field(repr=False)
    """Potential energy of each (parts, n) [J]."""
    dissipated: Array = field(repr=False)
    supplied: Array = field(repr=False)

    def __repr__(self) -> str:
        return (f"Energy({counted(len(self.parts), 'part')}, {len(self.supplied)} times, off by "
                f"{np.abs(self.balance).max(initial=0.0):.1e} J of {np.abs(self.total).max(initial=0.0):.4g} J)")

    @property
    def kinetic(self) -> Array:
        """Kinetic energy (n,) [J]."""
        return np.asarray(self.kinetic_by_part.sum(axis=0))

    @property
    def potential(self) -> Array:
        """Potential energy (n,) [J]."""
        return np.asarray(self.potential_by_part.sum(axis=0))

    @property
    def total(self) -> Array:
        """Kinetic and potential energy (n,) [J]."""
        return self.kinetic + self.potential

    @property
    def balance(self) -> Array:
        """Energy that has come from nowhere (n,) [J]: the error of the integration, as the energy shows it."""
        balance = self.total + self.dissipated - self.supplied
        return np.asarray(balance - balance[0])

    def of(self, part: str) -> Array:
        """Return the kinetic and potential energy (n,) [J] of one body, beam, superelement or connection."""
        check.known(part, self.parts, f"energy: '{part}' is not a part with energy", error=ResponseError)
        k = self.parts.index(part)
        return np.asarray(self.kinetic_by_part[k] + self.potential_by_part[k])


@dataclass(frozen=True, repr=False, eq=False)
class Run(Columnar, Displayed):
    """A nonlinear time response.

    ``run["w"]`` is an output over ``time`` (n,) [s]; ``coordinates`` and ``rates`` are those of the joints by
    name, displacements from the pose as described [m, rad]: of the spanning tree, then of joints at which loops are cut
    (but for rods, and rotation vectors of the latter). ``"NAME.fixed_mode1"`` of a beam or superelement is the lowest
    mode with its nodes held at which something is attached, scaled to a modal mass of 1 [kg^(1/2) m].
    ``energy`` has the energies. ``complete`` is false if it was interrupted before the last time and before an event.
    """

    name: str
    """Name of the model."""
    time: Array
    outputs: Mapping[str, Array]
    """Outputs (n,) by name, in ``output_units``."""
    output_units: Mapping[str, str]
    coordinates: Mapping[str, Array]
    rates: Mapping[str, Array]
    energy: Energy
    complete: bool
    trace: Trace = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        # a pickle holds no read-only mappings
        return {key: dict(value) if isinstance(value, MappingProxyType) else value for key, value in vars(self).items()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update({key: MappingProxyType(value) if isinstance(value, dict) else value
                           for key, value in state.items()})  # fmt: skip

    def __getitem__(self, name: str) -> Array:
        """Return an output (n,) by name; displacements and forces count from the pose as described."""
        if name in self.outputs:
            return self.outputs[name]
        if name in self.trace.measured.refused:
            raise ResponseError(f"{self.trace.measured.refused[name]}; linearize() has it for small motions.")
        raise check.unknown(name, self.outputs, f"run of '{self.name}': '{name}' is not an output", error=ResponseError)

    def __len__(self) -> int:
        """Return the number of times."""
        return len(self.time)

    def __repr__(self) -> str:
        stop = "" if self.complete else ", interrupted"
        stop += "" if self.ended_by is None else f", ended by '{self.ended_by}'"
        contents = f"{counted(len(self.coordinates), 'coordinate')}, {counted(len(self.outputs), 'output')}"
        return f"Run({self.name!r}: {len(self.time)} times to {self.time[-1]:g} s, {contents}{stop})"

    def __str__(self) -> str:
        doubts = angle_warnings({name: values[:1] for name, values in self.coordinates.items()})
        return "\n".join([repr(self), *(f"Doubtful: {text}" for text in doubts)])

    @property
    def model(self) -> Mechanism:
        """The model that ran."""
        return self.trace.session.model

    @property
    def ended_by(self) -> str | None:
        """The coordinate or output that ended the run by passing its value in ``until``, if one did."""
        return self.trace.ended_by

    def crossings(self, name: str, value: float = 0.0) -> Array:
        """Return the times at which a coordinate or output passes a value.

        Between two samples the cubic through values and rates is compared with the run at two times, and parts of the
        interval likewise, until the number of passes is certain; each is refined by integrating up to it, so that
        it is as exact as the run itself. So passes do not depend on how close samples are.

        Parameters
        ----------
        name : str
            Name of a coordinate (``"elbow.rz"``) or of an output; forces and accelerations are checked once an
            interval.
        value : float
            The value [m, rad, or the unit of the output].

        Returns
        -------
        array, shape (k,)
            Times [s], ascending.

        Raises
        ------
        ResponseError
            If there is no such coordinate or output, or the value is not a finite number.
        """
        if name not in self.coordinates:
            self[name]
        return self.trace.crossings(name, real(value, "crossings", "value", "a finite number"))

    _index = "time"

    def columns(self) -> dict[str, Array]:
        """Return what ``table`` returns, as files and DataFrames have it."""
        return self.table()

    def table(self) -> dict[str, Array]:
        """Return time, outputs, coordinates and energies as columns (n,) by name."""
        columns = {"time": self.time} | dict(self.outputs)
        columns |= {name: values for name, values in self.coordinates.items() if name not in columns}
        energy = {"kinetic": self.energy.kinetic, "potential": self.energy.potential,
                  "dissipated": self.energy.dissipated, "supplied": self.energy.supplied}  # fmt: skip
        return columns | {f"energy.{name}": values for name, values in energy.items()}

    def plot(self, names: Sequence[str] | str | None = None, *, ax: Given | None = None) -> Figure | Given:
        """Return a figure of outputs or coordinates, and of the energies, over time.

        Parameters
        ----------
        names : str or sequence of str, optional
            Outputs and coordinates; default: the outputs, or the coordinates where there are none.
        ax : Axes or sequence of Axes, optional
            Where to draw, a panel each, row by row; default: a new figure.

        Returns
        -------
        matplotlib.figure.Figure, or ``ax``
            One panel for each unit, and one for the energies.

        Raises
        ------
        ResponseError
            If a name is unknown.
        """
        from mbsvib.plots.animation import run_figure

        return run_figure(self, names, ax)

    def animate(self, *, view: Any = "3-D", frames: int = 120, rate: float = 25.0) -> Animation:
        """Return the motion as it was, true to scale, for Jupyter or to ``save``.

        Parameters
        ----------
        view : str or sequence of 2 float
            From where: "3-D", "x", "y", "z", or azimuth and elevation [deg].
        frames : int
            Pictures, at the samples nearest to equal times.
        rate : float
            Pictures in a second [Hz].

        Returns
        -------
        Animation
            The motion; ``.save("run.gif")``.

        Raises
        ------
        ResponseError
            If a number is refused or there is no such view.
        """
        from mbsvib.plots.animation import run_animation

        return run_animation(self, view, frames, rate)

    def frames(self) -> dict[str, tuple[Array, Array]]:
        """Return where all bodies and nodes are over time.

        Returns
        -------
        dict of str to (array, array)
            By body, ground among them: rotation R (n, 3, 3) and shift s (n, 3) [m], so that what was at p in the pose
            as described is at R p + s.
        """
        from mbsvib.simulation.trace import frames

        return frames(self.trace)


def run_of(name: str, trace: Trace, complete: bool) -> Run:
    """Return a run by the trace of its states."""
    at = trace.values()
    arrays = [trace.time, at.coordinates, at.rates, at.kinetic, at.potential, at.work, *at.outputs.values()]
    for array in arrays:
        array.setflags(write=False)
    names = trace.names
    energy = Energy(trace.parts, at.kinetic, at.potential, at.work[0], at.work[1] + at.work[2])
    return Run(
        name, arrays[0], MappingProxyType(at.outputs), MappingProxyType(units(trace)),
        MappingProxyType({name: at.coordinates[i] for i, name in enumerate(names)}),
        MappingProxyType({name: at.rates[i] for i, name in enumerate(names)}), energy, complete, trace,
    )  # fmt: skip


def units(trace: Trace) -> dict[str, str]:
    """Return the units of the outputs that a run tells."""
    outputs = trace.session.model.outputs
    return {name: outputs[name].unit for name in trace.measured.all_names}


class Simulated(Mechanism):
    """The method of ``Model`` that follows its finite motion over time."""

    def simulate(
        self, t: ArrayLike, inputs: Mapping[str, ArrayLike | Callable[[float], float]] | None = None,
        initial: Mapping[str, float | tuple[float, float]] | None = None, without: Sequence[str] | str = (),
        tolerance: float = 1e-8, *, until: Mapping[str, float] | None = None, progress: Progress = False,
    ) -> Run:  # fmt: skip
        """Return the nonlinear time response, from the pose as described or displaced from it.

        Lagrange's equations in minimal coordinates, with exact finite motion of joints, loops, springs and loads:
        T^T M T v' = T^T (f - M c), q' = T v. Which joint coordinates v are independent is decided by pivots, and
        decided anew where loops have moved on. CasADi's CVODES integrates (extra ``casadi``): by Adams' method, whose
        steps are as short as the highest frequency of the model asks for, or by BDF where dampers are very strong.

        Parameters
        ----------
        t : array-like, shape (n,)
            Times [s] in ascending order; the run starts at the first.
        inputs : mapping of str to number, array-like of shape (n,), or function of t, optional
            Forces and translations of the ground by name [N, N m, m/s^2]; coordinates are relative to the ground.
            Samples are joined by straight lines, functions are resolved between the times (pulses shorter than 1/4000
            of the run may be missed), what is not named is 0. Loads act as well, and weight.
        initial : mapping of str to number or (number, number), optional
            Displacements of coordinates of joints (``"elbow.rz"``) from the pose as described [m, rad], or
            displacements and rates. Others are 0, or as near to it as loops allow.
        without : sequence of str
            Names of loads that are dropped at t[0].
        tolerance : float
            Error of results that is asked for, between 1e-11 and 1e-2: relative to the size of coordinates and rates;
            below 1e-4 rad, or 1e-4 of the mechanism's size, as an error of that size, and likewise for rates below 1e-4
            of the largest and modes of a beam without 1e-8 of its energy.
        until : mapping of str to number, optional
            Coordinates or outputs by name, and values [m, rad, or the unit of the output]: the run ends where one
            passes its value after the start, exactly there. Default: at the last time.
        progress : bool or callable
            True: a bar on standard error; a function is called with how many times are reached, and how many there are.

        Returns
        -------
        Run
            Outputs, coordinates and energies over time; one that is interrupted from the keyboard holds what was
            reached.

        Raises
        ------
        ModelError
            If what was given is refused, CasADi is not installed, or a part has no statement in finite motion, by its
            name.
        SingularPoseError
            If the run starts in a singular pose of rigid loops, or at a dead centre of what is displaced.
        SimulationError
            If a step cannot be taken; it states time, coordinate and reason, and its ``run`` holds what was reached.

        Warns
        -----
        AccuracyWarning
            If an input changes too fast to be resolved.
        LargeDisplacementWarning
            If beams or superelements bend further than small displacements hold.

        Source: Shabana, Dynamics of Multibody Systems (2020), generalized coordinate partitioning; Hindmarsh et al.
        (2005), SUNDIALS.
        """
        if find_spec("casadi") is None:
            raise ModelError('simulate: needs CasADi, whose integrator it uses; pip install "mbsvib[casadi]"',
                             field="t")  # fmt: skip
        from mbsvib.simulation.simulate import simulate

        trace, complete = simulate(self, t, inputs, initial, without, tolerance, until, progress,
                                   lambda partial: run_of(self.name, partial, False))  # fmt: skip
        return run_of(self.name, trace, complete)
