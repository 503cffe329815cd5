"""The system: the equations of a mechanism, with methods for all results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.connecting import Connecting
from mbsvib.api.elsewhere import FUNCTIONS, tell_functions, tell_where
from mbsvib.api.of_mechanism import OfMechanism
from mbsvib.api.reducing import ReducibleSystem
from mbsvib.api.sensitivities import Sensitive
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import upper
from mbsvib.common.fast_init import fast_init
from mbsvib.common.selection import Names
from mbsvib.equations.selection import reachable
from mbsvib.errors import counted
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.random.verbs import RandomVerbs

if TYPE_CHECKING:
    from mbsvib.api.modes import Modes
    from mbsvib.api.state_space import StateSpace
    from mbsvib.fitting.result import Fit


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class System(OfMechanism, Connecting, ReducibleSystem, RandomVerbs, Sensitive):
    """M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u, in minimal coordinates q.

    Matrices, factors and names are those of ``Equations``; modes are computed once, and results are
    cached.
    """

    _engine = "basis sensitivity_basis"

    large: ClassVar[type[Any] | None] = None
    """The class for sparse matrices, which its module sets."""

    @classmethod
    def from_matrices(
        cls, M: Any, C: Any, K: Any, B: Any = None, Cq: Any = None, Cv: Any = None, Ca: Any = None, D: Any = None,
        inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
        coordinates: Sequence[str] | None = None, name: str = "system",
    ) -> Any:  # fmt: skip
        """Return a system of matrices that come from elsewhere, such as a finite element program.

        M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u

        Parameters
        ----------
        M : array-like or scipy.sparse, shape (m, m)
            Mass matrix, symmetric and positive definite. A sparse one may have rows of zeros, of coordinates without
            mass, which follow from statics.
        C : array-like or scipy.sparse, shape (m, m), or None
            Damping matrix; its antisymmetric part counts as gyroscopic.
        K : array-like or scipy.sparse, shape (m, m)
            Stiffness matrix; its antisymmetric part counts as circulatory. Eigenvalues that are rounding of the matrix,
            scaled to a diagonal of ones, are 0: rigid-body modes.
            If one of these three is a matrix of scipy.sparse, all stay sparse; then they must be symmetric.
        B : array-like, shape (m, inputs), optional
            Input matrix; default: no inputs.
        Cq, Cv, Ca : array-like, shape (outputs, m), optional
            Output matrices of displacements, velocities and accelerations. If these and D are left out, outputs are the
            coordinates.
        D : array-like, shape (outputs, inputs), optional
            Feedthrough.
        inputs, outputs, coordinates : sequence of str, optional
            Names; default: u1, u2, ...; y1, y2, ...; q1, q2, ....
        name : str
            Name for tables and figures.

        Returns
        -------
        System, or SparseSystem of sparse matrices
            With modes, responses, norms and exports of any system; a SparseSystem has some modes, responses and reduced
            models, which have all of these. There are no bodies and parameters: shapes of bodies, sensitivities,
            reactions and the mechanism's pictures are refused.

        Raises
        ------
        ModelError
            If shapes do not match, M is not symmetric positive definite, or numbers are not finite; if sparse matrices
            are not symmetric, or have dampers at coordinates without mass.
        """
        from mbsvib.equations.from_matrices import from_matrices

        matrices, ports, names = (M, C, K), (B, Cq, Cv, Ca, D), (inputs, outputs, coordinates)
        if any(hasattr(matrix, "tocsc") for matrix in matrices):
            from mbsvib.sparse.from_matrices import sparse_from_matrices

            import_module("mbsvib.api.sparse_system")  # it sets ``large``, whatever was imported before
            assert cls.large is not None
            return sparse_from_matrices(matrices, ports, names, name, cls.large)
        return from_matrices(matrices, ports, names, name, cls)

    def modes(
        self, count: int | None = None, *, near: float = 0.0, rtol: float | None = None, confidence: Fit | None = None
    ) -> Modes:
        """Return modes: eigenvalues, frequencies, damping ratios, shapes and error estimates.

        Parameters
        ----------
        count : int, optional
            How many; default: all.
        near : float
            The frequency [Hz] whose ``count`` nearest modes are wanted; default: the lowest.
        rtol : float, optional
            Required relative accuracy of every eigenvalue, default 1e-12; more accurate and slower methods are taken
            as far as needed. A warning (AccuracyWarning) states the numbers of modes whose error estimate is larger.
        confidence : Fit, optional
            The fit that the system is of: natural frequencies then have ``frequency_intervals`` (n, 2) [Hz] of 95 %.

        Returns
        -------
        Modes
            In ascending natural frequency. Modes at the default accuracy are cached.

        Raises
        ------
        ResponseError
            If ``count`` is no positive whole number, or ``near`` or ``rtol`` no number.
        """
        result = self.basis.modes if rtol is None else self.basis.modes_within(rtol)
        if confidence is not None:
            half = confidence.half_width(self.mode_sensitivities(confidence.rates).frequencies)
            ends = np.stack((result.frequencies - half, result.frequencies + half), axis=1)
            result = replace(result, frequency_intervals=ends)
        if count is not None:
            result = result.nearest(count, near)
        if rtol is not None:
            result.check_accuracy(rtol)
        return cast("Modes", result)

    def _response(self, part: System, w: Array) -> Complex:
        from mbsvib.responses.frequency_response import frequency_response

        return frequency_response(part.basis, w)

    def _over_time(self, part: System, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
        from mbsvib.responses.time_response import time_response

        return time_response(part.basis, *record)

    def poles(self) -> Complex:
        """Return the poles: all 2m eigenvalues, (lambda^2 M + lambda C + K) phi = 0, as accurate as responses need.

        Returns
        -------
        array, shape (2m - massless,)
            Poles [1/s] in pairs but for those of massless motions, in ascending natural frequency; 0 for rigid-body
            modes.
        """
        return self.basis.poles.copy()

    def _zeros(self, outputs: Names, inputs: Names) -> Complex:
        from mbsvib.responses.transmission_zeros import transmission_zeros

        return transmission_zeros(self.basis, outputs, inputs)

    def reachable(self, outputs: Names = None, inputs: Names = None) -> System:
        """Return the controllable and observable part for the given inputs and outputs, with these ports only.

        Coordinates that no entry of M, C or K couples to the others move independently. Such a part is left out if no
        given input acts on it, or no given output depends on it; the transfer function stays exactly the same.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names of ports; default: all.

        Returns
        -------
        System
            The same equations without the other coordinates; ``explain`` names them.

        Raises
        ------
        ResponseError
            If a name is unknown, or there is none.
        """
        return reachable(self, outputs, inputs)

    def state_space(self, realization: str = "physical", reachable: bool = False) -> StateSpace:
        """Return first-order equations x' = A x + B u, y = C x + D u.

        Parameters
        ----------
        realization : str
            "physical": x = (q, q'); "modal": one 2x2 block for each mode; "balanced": physical times powers of two.
        reachable : bool
            Whether to keep the controllable and observable part only, see ``System.reachable``.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is unknown, or modes all but meet, so that they have no modal states of their own.
        """
        from mbsvib.api.state_space import StateSpace
        from mbsvib.responses.realizations import state_space

        return state_space((self.reachable() if reachable else self).basis, realization, StateSpace)

    def explain(self) -> str:
        """Return in words how the equations came about: topology, loops, rank decisions, and what was skipped.

        Of systems with few degrees of freedom it also names outputs whose ``linear_range`` is small.
        """
        from mbsvib.api.linear_range import explained
        from mbsvib.explain.dense import explain

        return "\n".join((explain(self, self.basis), *explained(self)))

    def _repr_html_(self) -> str:
        from mbsvib.plots import notebook

        return notebook.of_system(self)

    def __repr__(self) -> str:
        ports = f"{counted(len(self.inputs), 'input')}, {counted(len(self.outputs), 'output')}"
        bound = "" if self.error_bound is None else f", error at most {upper(self.error_bound)}"
        return f"System({self.name!r}: {self.dof} DOF, {ports}{bound})"


tell_functions(System, FUNCTIONS)
tell_where(System, Mechanism, "models have it: change the model by model.{name}, and linearize.")
