"""What systems of a mechanism state beyond their matrices: deflection shapes, contributions of modes, forces in joints,
energies, and how far they hold.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular, real
from mbsvib.common.selection import Names, selected
from mbsvib.equations.equations import Provenance, joint_wrenches
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from mbsvib.api.linear_range import LinearRange
    from mbsvib.explain.energy_shares import StiffnessShares
    from mbsvib.modes.result import Modes
    from mbsvib.plots.animation import Animation

# Share of the largest response by which contributions of modes may miss it: sums that cancel are refused.
ACCURATE = 1e-6


def _motions(system: Any) -> Any:
    """The system whose outputs are its coordinates."""
    m, nothing = system.dof, np.zeros((system.dof, system.dof))
    return replace(system, outputs=system.coordinates, output_units=system.coordinate_units, Cq=np.eye(m), Cv=nothing,
                   Ca=nothing, D=np.zeros((m, len(system.inputs))))  # fmt: skip


@dataclass(frozen=True, repr=False, eq=False)
class DeflectionShape(Columnar, Displayed):
    """Steady motion under harmonic inputs of one ``frequency`` [Hz]: Re(shape e^(i w t)).

    ``inputs`` {name: complex amplitude}; ``coordinates`` {name: complex amplitude} of the minimal coordinates [m, rad];
    ``body_shapes`` {body: (6,)}: translation of its centre of mass and its rotation, world axes.
    """

    name: str
    frequency: float
    inputs: Mapping[str, complex]
    coordinates: Mapping[str, complex]
    body_shapes: Mapping[str, Complex]
    _provenance: Provenance = field(repr=False)

    def __repr__(self) -> str:
        return f"DeflectionShape({self.name!r} at {self.frequency:.5g} Hz: {', '.join(self.inputs)})"

    def columns(self) -> dict[str, Any]:
        """Return the complex amplitudes of the bodies by name: ``body``; ``x_re``, ``x_im`` [m] to ``rz_re``, ``rz_im``
        [rad].
        """
        shapes = np.array([*self.body_shapes.values()]).reshape(-1, 6)
        return {"body": np.array([*self.body_shapes]),
                **{f"{axis}_{part}": getattr(shapes[:, i], name) for i, axis in enumerate(DIRECTIONS)
                   for part, name in (("re", "real"), ("im", "imag"))}}  # fmt: skip

    def animate(
        self, path: str | os.PathLike[str] | None = None, *, amplitude: float = 0.1, view: Any = "3-D",
        frames: int = 30, rate: float = 20.0,
    ) -> Animation:  # fmt: skip
        """Return an animation of the shape, and write it to a file if a path is given, as ``Modes.animate`` does."""
        from mbsvib.plots.animation import in_motion

        title = f"{self.frequency:.5g} Hz, {', '.join(self.inputs)}"
        result = in_motion(self.name, self._provenance, np.array([*self.body_shapes.values()]), title, amplitude, view,
                           frames, rate)  # fmt: skip
        if path is not None:
            result.save(path)
        return result


class OfMechanism:
    """Equations of motion that were made of a mechanism."""

    def deflection_shape(self: Any, frequency: float, inputs: Names | Mapping[str, complex] = None) -> DeflectionShape:
        """Return the operating deflection shape: the steady motion under harmonic inputs of one frequency.

        q(w) = (K + i w C - w^2 M)^-1 B u

        Parameters
        ----------
        frequency : float
            Of all inputs [Hz].
        inputs : str, sequence of str, or mapping of str to complex, optional
            Names or patterns of inputs, with amplitude 1 and in phase; or complex amplitudes by name. Default: all.

        Returns
        -------
        DeflectionShape
            ``body_shapes`` by name; ``animate`` shows the motion. Under a motion of the ground, relative to it.

        Raises
        ------
        ResponseError
            If the frequency is not finite or is an undamped pole, or a name is unknown.
        """
        self.provenance.check_mechanism(self.name, "deflection_shape")
        hertz = real(frequency, "deflection_shape", "frequency", "a frequency [Hz]")
        given: dict[str, complex] = dict(inputs) if isinstance(inputs, Mapping) else {
            self.inputs[i]: 1.0 for i in selected(inputs, self.inputs, "input", self.name)}
        amplitudes = {self.inputs[i]: complex(value) for name, value in given.items()
                      for i in selected(name, self.inputs, "input", self.name)}  # fmt: skip
        response = _motions(self).frequency_response([2.0 * np.pi * hertz])[:, :, 0]
        q = response @ np.array([amplitudes.get(name, 0.0) for name in self.inputs])
        return DeflectionShape(self.name, hertz, amplitudes, dict(zip(self.coordinates, q.tolist(), strict=True)),
                               self.displacements(q), self.provenance)  # fmt: skip

    def mode_contributions(self: Any, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return what each mode contributes to the frequency response.

        G(i w) = D + sum over modes of G_k,  G_k = sum over the eigenvalues of mode k of (i w)^n R / (i w - lambda)

        with n = 0, 1, 2 for displacements, velocities and accelerations. The share of a mode in a response is
        Re(G_k / G): shares add up to 1 where D = 0. Of modes with equal eigenvalues only the sum has a meaning.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s], above 0 where the system has rigid-body modes.
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (modes, outputs, inputs, n)
            Complex responses [output unit / input unit], in the order of ``modes()``.

        Raises
        ------
        ResponseError
            If a frequency is not finite or is a pole, a name is unknown, or the modes do not add up to the response.
        """
        from scipy.optimize import linear_sum_assignment

        w = angular(omega)
        system = self.with_ports(outputs, inputs)
        s, total, space = 1j * w, system.frequency_response(w), _motions(system).state_space()
        values, right = np.linalg.eig(space.A)
        modes = system.modes()
        poles = modes.eigenvalues
        known = np.flatnonzero(np.isfinite(poles))
        _, pole = linear_sum_assignment(np.abs(values[:, None] - poles[known]))
        moved = np.linalg.solve(right, space.B)[:, :, None] / (s - values[:, None])[:, None]
        seen = [matrix @ space.C @ right for matrix in (system.Cq, system.Cv, system.Ca)]
        terms = sum(np.einsum("ok,kin->koin", row, moved * s**order) for order, row in enumerate(seen))
        result = np.zeros((len(modes), *total.shape), dtype=complex)
        np.add.at(result, np.searchsorted(modes.starts, known[pole], side="right") - 1, terms)
        missed = np.abs(result.sum(axis=0) + system.D[:, :, None] - total).max(initial=0.0)
        size = np.abs(total).max(initial=0.0)
        if not missed <= ACCURATE * size:
            raise ResponseError(f"mode_contributions of '{system.name}': the modes add up to the response but for "
                                f"{missed / size if size else np.inf:.1e} of it, as their sum cancels; ask at other "
                                f"frequencies, or for frequency_response, which is accurate.")  # fmt: skip
        return cast("Complex", result)

    @property
    def reactions(self: Any) -> dict[str, Array]:
        """Wrench in each joint at the pose, {joint: (6,)}: force [N] and moment [N m] on its second body at its point.

        World axes; its first body takes the opposite. A rod (distance joint) has its point at its end, a joint without
        position at the centre of mass of its second body (on ground: its first). Zeros where nothing loads the
        mechanism.

        Where constraints are redundant many such wrenches would hold the bodies; of all these it is the one of least
        norm, the least sum over the joints of |force|^2 + |moment / L|^2, with L the root mean square distance of the
        joints' points from their mean. Joints of loops that have joints or couplers in common count together.
        ``explain()`` names them. Frame, order, names, cut and units make no difference, and flexible joints, all with
        stiffness k along and k L^2 about what they lock, would carry the same.
        """
        return joint_wrenches(self)

    def stiffness_shares(self: Any, modes: Modes | None = None) -> StiffnessShares:
        """Return the strain energy by element: shares of springs, preloads, loads and joint reactions in each mode.

        Parameters
        ----------
        modes : Modes, optional
            Some of this system's modes, ``system.modes(6)``; default: all.

        Returns
        -------
        StiffnessShares
            Signed shares, 1 in sum for each mode; printed as a table.
        """
        from mbsvib.explain.energy_shares import stiffness_shares

        return stiffness_shares(self.basis, modes)

    def linear_range(self: Any, share: float = 0.1, *, conservative: bool = False) -> LinearRange:
        """Estimate the amplitudes of outputs up to which the linear equations hold, for each mode (extra ``casadi``).

        In free vibration in one mode, q = a Re(q1 e^(lambda t)) + a^2 (Re(q22 e^(2 lambda t)) + q20), an output has the
        amplitude a |Y1|, a mean a^2 |Y20| and a second harmonic a^2 |Y22|. The second-order part is the largest of
        these two, and of a^2 |y''| / 2 along the motion of the mode in minimal coordinates:

        values = share |Y1|^2 / max(|Y20|, |Y22|, |y''| / 2)

        Second derivatives are exact; terms of third and higher order are left out. This is an estimate and no bound: in
        nonlinear runs of 100 random chains at a share of 0.1, the larger of mean and second harmonic was 0.100 of the
        first in the median and 0.138 at most, and the largest deviation in time from the linear motion 0.34 at most.

        Parameters
        ----------
        share : float
            The second-order part over the first-order part.
        conservative : bool
            True: share / (1 + 5 share) in place of the share, which leaves room for terms of higher order: of the same
            100 chains, none reached the share. It is no proof for other mechanisms.

        Returns
        -------
        LinearRange
            ``values`` (modes, outputs), with a table. Rigid-body modes count with the motion alone. 0 where an output
            has no first-order part, or the second-order part grows without limit.

        Raises
        ------
        ResponseError
            If the share is not positive.
        ModelError
            If the system is not that of a mechanism as described, has beams, superelements, Maxwell elements or
            massless motions, or CasADi is not installed.

        Source: Nayfeh & Mook, Nonlinear Oscillations (1979), section 2.3.
        """
        from mbsvib.api.linear_range import linear_range

        return linear_range(self, self.modes(), share, conservative)
