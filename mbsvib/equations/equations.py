"""The equations: minimal matrices and factors with names, units, displacements of bodies and provenance."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array
from mbsvib.common.fast_init import fast_init
from mbsvib.elements.dynamic import Dynamic
from mbsvib.elements.part import Part
from mbsvib.equations.matrices import Matrices
from mbsvib.errors import ModelError, ResponseError
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import Topology

if TYPE_CHECKING:
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.statics import Statics
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.parameters import Parameters


@dataclass(frozen=True, slots=True)
class Removed:
    """Coordinates (or bodies, of a sparse system) outside the controllable and observable part for some ``inputs`` and
    ``outputs``: those ``uncontrollable`` from the inputs, and others ``unobservable`` from the outputs.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    uncontrollable: tuple[str, ...]
    unobservable: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All removed coordinates."""
        return self.uncontrollable + self.unobservable

    def after(self, earlier: Removed | None) -> Removed:
        """Return all removed coordinates where the same was done ``earlier`` with other ports."""
        if earlier is None:
            return self
        return replace(self, uncontrollable=earlier.uncontrollable + self.uncontrollable,
                       unobservable=earlier.unobservable + self.unobservable)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Separation:
    """The separation of motions without mass, for ``explain``.

    ``condensed`` are the coordinates that follow from statics, ``first_order`` those with one state in place of two;
    ``smallest_kept`` and ``largest_dropped`` are the smallest pivot of W that counts as mass and the largest that
    counts as zero. ``transform`` T (n, m) maps to all coordinates before condensation, None where none is condensed;
    if ``mixed``, condensed motions have components along the remaining coordinates. ``inputs`` load condensed motions
    and ``outputs`` see them: their rows depend on the stiffness that holds these. ``motions`` (n, k) are the condensed
    motions themselves.
    """

    condensed: tuple[str, ...]
    first_order: tuple[str, ...]
    smallest_kept: float
    largest_dropped: float
    transform: Array | None = None
    mixed: bool = False
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    motions: Array | None = None


@dataclass(frozen=True, slots=True)
class Truncation:
    """The reduction of a model: the ``method``, the number of coordinates ``before``, and ``error_bound``, for
    the largest singular value of the error of the frequency response, output by input in SI units.
    """

    method: str
    before: int
    error_bound: float


@dataclass(frozen=True, slots=True, eq=False)
class Connection:
    """Two ports ``first`` and ``second`` of assembled parts, joined along ``directions`` (d,).

    ``stiffness`` and ``damping`` (d, d) [N/m, N m/rad, ...] are None where they are joined rigidly; the stiffness is
    multiplied by the factor of ``dynamic`` where it depends on frequency. ``distance`` [m] is that of their places,
    None where these are not known.
    """

    first: str
    second: str
    directions: tuple[str, ...]
    stiffness: Array | None
    damping: Array | None
    dynamic: Dynamic | None
    distance: float | None

    @property
    def explained(self) -> str:
        """What was joined, how, and how far apart it is."""
        how = "rigidly" if self.stiffness is None else "by a spring-damper" if self.dynamic is None else \
            f"by a stiffness with {self.dynamic!r}"
        apart = "" if self.distance is None else f", {1e3 * self.distance:.3g} mm apart"
        return f"{self.first} and {self.second}: joined {how} along {' '.join(self.directions)}{apart}"


@fast_init
@dataclass(frozen=True, slots=True)
class Provenance:
    """The origin of a system, for ``explain`` and ``parameters``.

    ``topology``, ``reduction``, ``joint_coordinates`` and the names of ``springs`` describe the mechanism; ``parts``
    are its bodies, joints and elements, ``ports`` its inputs, then its outputs. ``separation`` describes motions
    without mass, ``statics`` the forces at the pose, ``removed`` the coordinates that ``reachable`` removed,
    ``undetermined`` the forces in joints that redundant constraints do not determine, ``truncation`` the reduction of
    the order. ``origin`` is the model; its pose was not in equilibrium, and the system is that of another pose, if
    ``moved_to_equilibrium``. If ``planar``, loops are redundant in every pose, as planar ones are. If ``closed_loop``,
    a controller acts on the mechanism. If ``from_matrices``, there is no mechanism; ``connections`` joined the parts of
    an assembly.
    """

    topology: Topology
    reduction: Reduction
    joint_coordinates: tuple[str, ...]
    springs: tuple[str, ...]
    parts: tuple[Part, ...] = ()
    separation: Separation | None = None
    statics: Statics | None = None
    removed: Removed | None = None
    ports: tuple[Part, ...] = ()
    origin: Mechanism | None = None
    planar: bool = False
    moved_to_equilibrium: bool = False
    undetermined: tuple[Undetermined, ...] = ()
    truncation: Truncation | None = None
    closed_loop: bool = False
    from_matrices: bool = False
    connections: tuple[Connection, ...] = ()

    @property
    def rest(self) -> str:
        """Why a system without coordinates has no motion."""
        if self.removed is not None:
            return "No part is controllable and observable with the given inputs and outputs: y = D u."
        if self.separation is not None:
            return "No motion has mass or damping: outputs follow inputs without dynamics."
        return "The mechanism is fully locked: its joints leave no motion."

    def check_mechanism(self, name: str, request: str) -> None:
        """Refuse a request that needs a mechanism."""
        if self.from_matrices:
            origin = "assembled of parts" if self.connections else "made of matrices"
            raise ModelError(f"{request}: '{name}' was {origin} and has no bodies, joints and elements of its own; "
                             f"this needs a mechanism: build a Model and linearize it.")  # fmt: skip

    def check_parameters(self, name: str, request: str) -> None:
        """Refuse a request that needs a mechanism without controllers."""
        self.check_mechanism(name, request)
        if self.closed_loop:
            raise ModelError(f"{request}: a controller acts on '{name}', and derivatives with closed loops are not "
                             f"available. Use the system with open loops, loop.open_loop.")  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Equations(Matrices):
    """M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u, in minimal coordinates q.

    ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs); SI
    units and radians. ``coordinates``, ``inputs`` and ``outputs`` are their names, ``..._units`` their units.
    ``mass``, ``damping`` and ``stiffness`` are other names of M, C and K. C is damping: the output matrix that
    python-control and MATLAB call C is ``state_space().C``.

    Factors are part of the equations: M = W^T W with W = ``inertia_factor`` (6 bodies, m), K = D^T diag(k) D and C =
    D^T diag(c) D with D = ``elastic_rows`` (rows, m), k = ``row_stiffness`` and c = ``row_damping`` (rows,);
    ``row_owner`` (rows,) numbers the spring-damper of each row. ``body_motion`` (bodies, 6, m) gives the bodies'
    displacements. Arrays are read-only.

    Antisymmetric parts are None where the mechanism has none: C = D^T diag(c) D + G with ``gyroscopic`` G (m, m) of
    spinning bodies, K = D^T diag(k) D + N with ``circulatory`` N (m, m) of follower loads, and G and N of
    cross-coupled bushings. M is singular if
    ``massless`` > 0: the motions ``null_inertia`` (m, massless) move no mass but dampers (their damping is regular),
    each has one first-order state in place of two, and there are 2m - massless eigenvalues. Massless motions without
    damping are not among the coordinates: they follow from statics, and their direct response to inputs is in D
    (``explain()`` names them).
    """

    _engine = "kind large provenance"

    kind: ClassVar[str] = "system"
    """Tells second-order equations from other linear systems."""

    name: str
    """Name of the model."""
    coordinates: tuple[str, ...]
    """Names of the minimal coordinates, such as ``hinge.rz``."""
    coordinate_units: tuple[str, ...]
    """Their units."""
    inputs: tuple[str, ...]
    """Names of the inputs, columns of B and D."""
    input_units: tuple[str, ...]
    """Units of the inputs."""
    outputs: tuple[str, ...]
    """Names of the outputs, rows of Cq, Cv, Ca and D."""
    output_units: tuple[str, ...]
    """Units of the outputs."""
    bodies: tuple[str, ...]
    """Names of the bodies, in the order of ``body_motion``."""
    provenance: Provenance
    """Where the equations come from: parts, spanning tree, decisions on rank."""

    def __post_init__(self) -> None:
        for array in _arrays(self):
            if array is not None:
                array.setflags(False)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""
        return len(self.coordinates)

    @property
    def error_bound(self) -> float | None:
        """Bound on the error of a reduced model's frequency response, output by input in SI units; None of others."""
        truncation = self.provenance.truncation
        return None if truncation is None else truncation.error_bound

    @property
    def tree(self) -> tuple[str, ...]:
        """Names of the joints of the spanning tree, from ground outwards."""
        return self.provenance.topology.tree

    @property
    def cut_joints(self) -> tuple[str, ...]:
        """Names of the joints at which loops are cut."""
        return self.provenance.topology.cut_joints

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of the constraint rows of cut joints that the others imply (``"pin4.rx"``)."""
        return tuple(name for group in self.provenance.reduction.groups for name in group.redundant)

    @cached_property
    def parameters(self) -> Parameters:
        """The values of all parameters of the model by name (``"leg1.k.stiffness"``), read-only; see ``units``."""
        self.provenance.check_parameters(self.name, "parameters")
        from mbsvib.mechanism.parameters import Parameters

        return Parameters(self.provenance.parts)

    def displacements(self, q: ArrayLike) -> dict[str, Array]:
        """Return the displacements of the bodies, x = B' B'' q.

        Parameters
        ----------
        q : array-like, shape (m,) or (m, n)
            Minimal coordinates [m, rad].

        Returns
        -------
        dict of str to array, shape (6,) or (6, n)
            Translation of each body's centre of mass [m] and its rotation [rad], world axes.

        Raises
        ------
        ResponseError
            If ``q`` does not have one entry for each coordinate.
        """
        self.provenance.check_mechanism(self.name, "displacements")
        vector = np.asarray(q)
        if vector.ndim not in (1, 2) or len(vector) != self.dof:
            raise ResponseError(
                f"displacements: q has shape {vector.shape}; expected ({self.dof},) or ({self.dof}, n), one entry for "
                f"each of the coordinates {', '.join(self.coordinates[:6])}{', ...' if self.dof > 6 else ''}."
            )
        return dict(zip(self.bodies, self.body_motion @ vector, strict=True))


_arrays = attrgetter(*(item.name for item in fields(Equations) if "Array" in str(item.type)))


def joint_wrenches(system: Equations) -> dict[str, Array]:
    """Return the wrench (6,) [N, N m] in each joint at the pose, at its point on the second body, world axes."""
    system.provenance.check_mechanism(system.name, "reactions")
    joints, statics = system.provenance.topology.joints, system.provenance.statics
    if statics is None:
        return {joint.name: np.zeros(6) for joint in joints}
    return {joint.name: statics.joints[:, k].copy() for k, joint in enumerate(joints)}
