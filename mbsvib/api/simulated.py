"""The method of models for their nonlinear time response."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from mbsvib.errors import ModelError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.run import Run
    from mbsvib.common.progress import Progress


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
            Samples are joined by straight lines, what is not named is 0. Loads act as
            well, and weight.
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
        LargeDisplacementWarning
            If beams or superelements bend further than small displacements hold.

        Source: Shabana, Dynamics of Multibody Systems (2020), generalized coordinate partitioning; Hindmarsh et al.
        (2005), SUNDIALS.
        """
        if find_spec("casadi") is None:
            raise ModelError("simulate: needs CasADi, whose integrator it uses; pip install mbsvib[casadi]", field="t")
        from mbsvib.api.run import run_of
        from mbsvib.simulation.simulate import simulate

        trace, complete = simulate(self, t, inputs, initial, without, tolerance, until, progress,
                                   lambda partial: run_of(self.name, partial, False))  # fmt: skip
        return run_of(self.name, trace, complete)
