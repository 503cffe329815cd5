"""The equations: minimal matrices and factors with names, units and the way back to the bodies."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mbsvib.equations.terms import Matrices
from mbsvib.errors import ModelError, ResponseError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.elements.part import Part
    from mbsvib.equations.self_stress import Undetermined
    from mbsvib.equations.statics import Statics
    from mbsvib.kinematics.loops import Reduction
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.mechanism.parameters import Parameters
    from mbsvib.mechanism.topology import Topology


@dataclass(frozen=True, slots=True)
class Dropped:
    """What was left out: coordinates (or bodies, of a sparse system) that no asked input reaches, ``unreached``, and
    others that no asked output sees, ``unseen``. ``inputs`` and ``outputs`` are those asked for.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    unreached: tuple[str, ...]
    unseen: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All that was left out."""
        return self.unreached + self.unseen


@dataclass(frozen=True, slots=True)
class Separation:
    """What became of the motions without mass, for ``explain``.

    ``condensed`` names the coordinates that follow from statics, ``first_order`` those with one state in place of two;
    ``kept`` and ``dropped`` are the smallest pivot of W that counts as mass and the largest that does not.
    ``transform`` T (n, m) leads back to all coordinates before condensation, None where nothing is condensed;
    condensed motions that are ``mixed`` with the coordinates kept move these, too.
    """

    condensed: tuple[str, ...]
    first_order: tuple[str, ...]
    kept: float
    dropped: float
    transform: Array | None = None
    mixed: bool = False


@dataclass(frozen=True, slots=True)
class Truncation:
    """How a reduced model came about: the ``method``, the number of coordinates ``before``, and ``error_bound``, for
    the largest singular value of the error of the frequency response, output by input in SI units.
    """

    method: str
    before: int
    error_bound: float


@dataclass(frozen=True, slots=True)
class Provenance:
    """How a system came about, for ``explain``: topology, loops, all joint coordinates, all spring-dampers; ``parts``
    are the bodies, joints and spring-dampers themselves, for ``parameters``; ``massless`` tells what became of motions
    without mass, ``statics`` what the loads do at the pose, ``dropped`` what ``reachable`` left out; ``ports`` are the
    inputs, then the outputs themselves, ``origin`` the model as it was, which found its equilibrium elsewhere if
    ``settled``; ``planar`` says that loops are redundant as planar ones are, in every pose; ``undetermined`` is what
    redundant constraints leave open of forces in joints, as far as these were asked for; ``truncation`` says how a
    reduced model was made, ``closed`` that a controller acts on the mechanism, ``given`` that there is no mechanism, as
    the matrices came from elsewhere.
    """

    topology: Topology
    reduction: Reduction
    joint_coordinates: tuple[str, ...]
    springs: tuple[str, ...]
    parts: tuple[Part, ...] = ()
    massless: Separation | None = None
    statics: Statics | None = None
    dropped: Dropped | None = None
    ports: tuple[Part, ...] = ()
    origin: Mechanism | None = None
    planar: bool = False
    settled: bool = False
    undetermined: tuple[Undetermined, ...] = ()
    truncation: Truncation | None = None
    closed: bool = False
    given: bool = False

    def check_mechanism(self, name: str, what: str) -> None:
        """Refuse what only a mechanism has.

        Parameters
        ----------
        name, what : str
            Name of the system, and what was asked for.

        Raises
        ------
        ModelError
            If the matrices came from elsewhere.
        """
        if self.given:
            raise ModelError(f"{what}: '{name}' was made of matrices and has no bodies, joints and elements; this "
                             f"needs a mechanism: build a Model and linearize it.")  # fmt: skip

    def check_parameters(self, name: str, what: str) -> None:
        """Refuse what only a mechanism without controllers has.

        Parameters
        ----------
        name, what : str
            Name of the system, and what was asked for.

        Raises
        ------
        ModelError
            If the matrices came from elsewhere, or a controller acts on the mechanism.
        """
        self.check_mechanism(name, what)
        if self.closed:
            raise ModelError(f"{what}: a controller acts on '{name}', and derivatives with closed loops are not "
                             f"available. Ask the system with open loops, loop.open_loop.")  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Equations(Matrices):
    """M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u, in minimal coordinates q.

    ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs); SI
    units and radians. ``coordinates``, ``inputs`` and ``outputs`` are their names, ``..._units`` their units.
    ``mass``, ``damping`` and ``stiffness`` are other names of M, C and K. C is damping: the output matrix that
    python-control and MATLAB call C is ``state_space().C``.

    The factors are kept: M = W^T W with W = ``inertia_factor`` (6 bodies, m), K = D^T diag(k) D and C = D^T diag(c) D
    with D = ``elastic_rows`` (rows, m), k = ``row_stiffness`` and c = ``row_damping`` (rows,); ``row_owner`` (rows,)
    numbers the spring-damper of each row. ``body_motion`` (bodies, 6, m) gives the bodies' displacements. Arrays are
    read-only.

    What no such rows can be is None where the mechanism has none: ``gyroscopic`` G (m, m), antisymmetric, is part of C
    beside D^T diag(c) D, as spinning bodies add it; ``circulatory`` N (m, m), antisymmetric, is part of K beside
    D^T diag(k) D, as follower loads add it. M is singular if ``massless`` > 0: the motions ``null_inertia``
    (m, massless) move no mass but dampers (their damping is regular), each has one first-order state in place of two,
    and there are 2m - massless eigenvalues. Massless motions that no damper feels are not among the coordinates: they
    follow from statics, and what inputs do to them at once is in D (``explain()`` names them).
    """

    kind: ClassVar[str] = "system"

    name: str
    coordinates: tuple[str, ...]
    coordinate_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    bodies: tuple[str, ...]
    provenance: Provenance

    def __post_init__(self) -> None:
        for array in _arrays(self):
            if array is not None:
                array.setflags(write=False)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""
        return len(self.coordinates)

    @property
    def error_bound(self) -> float | None:
        """Bound on the error of the frequency response of a reduced model, output by input in SI units; None if it is
        not reduced.
        """
        made = self.provenance.truncation
        return None if made is None else made.error_bound

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
        """Every number that the system was made of by its name (``"leg1.k.stiffness"``), read-only; see ``units``."""
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

