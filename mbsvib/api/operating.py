"""Operating deflection shapes, and what each mode contributes to a response."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular, real
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Complex
    from mbsvib.common.selection import Names
    from mbsvib.equations.equations import Provenance
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
        """Return the complex amplitudes of the bodies as columns by name.

        Returns
        -------
        dict of str to array, shape (bodies,)
            ``body``; ``x_re``, ``x_im`` [m] to ``rz_re``, ``rz_im`` [rad].
        """
        shapes = np.array([*self.body_shapes.values()]).reshape(-1, 6)
        return {"body": np.array([*self.body_shapes]),
                **{f"{axis}_{part}": getattr(shapes[:, i], name) for i, axis in enumerate(DIRECTIONS)
                   for part, name in (("re", "real"), ("im", "imag"))}}  # fmt: skip

    def animate(
        self, path: str | os.PathLike[str] | None = None, *, amplitude: float = 0.1, view: Any = "3-D",
        frames: int = 30, rate: float = 20.0,
    ) -> Animation:  # fmt: skip
        """Return an animation of the shape, and write it to a file if a path is given, as ``Modes.animate`` does.

        Parameters
        ----------
        path, amplitude, view, frames, rate : optional
            As of ``Modes.animate``.

        Returns
        -------
        Animation
            With ``figure`` for a single picture and ``save`` for a file.

        Raises
        ------
        ResponseError, ExportError
            As of ``Modes.animate``.
        """
        from mbsvib.plots.animation import in_motion

        title = f"{self.frequency:.5g} Hz, {', '.join(self.inputs)}"
        result = in_motion(self.name, self._provenance, np.array([*self.body_shapes.values()]), title, amplitude, view,
                           frames, rate)  # fmt: skip
        if path is not None:
            result.save(path)
        return result


class Operating:
    """Systems whose motion under harmonic inputs is asked for, as a whole and by mode."""

    def deflection_shape(
        self, frequency: float, inputs: Names | Mapping[str, complex] = None
    ) -> DeflectionShape:
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
        system = cast("Any", self)
        system.provenance.check_mechanism(system.name, "deflection_shape")
        hertz = real(frequency, "deflection_shape", "frequency", "a frequency [Hz]")
        given: dict[str, complex] = dict(inputs) if isinstance(inputs, Mapping) else {
            system.inputs[i]: 1.0 for i in selected(inputs, system.inputs, "input", system.name)}
        amplitudes = {system.inputs[i]: complex(value) for name, value in given.items()
                      for i in selected(name, system.inputs, "input", system.name)}  # fmt: skip
        response = _motions(system).frequency_response([2.0 * np.pi * hertz])[:, :, 0]
        q = response @ np.array([amplitudes.get(name, 0.0) for name in system.inputs])
        return DeflectionShape(system.name, hertz, amplitudes, dict(zip(system.coordinates, q.tolist(), strict=True)),
                               system.displacements(q), system.provenance)  # fmt: skip

    def mode_contributions(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
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
        system = cast("Any", self).with_ports(outputs, inputs)
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
