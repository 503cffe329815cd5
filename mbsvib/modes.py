"""Modes: eigenvalues, frequencies, damping ratios and shapes of a system, with an estimate of their accuracy."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.damped import Damped, damped
from mbsvib.errors import AccuracyWarning, count
from mbsvib.undamped import undamped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from mbsvib.system import System

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]


# Accuracy that a caller who does not ask for one gets, at least: ten digits.
RTOL = 1e-10


@dataclass(frozen=True, repr=False, eq=False)
class Modes:
    """The modes of a system, one for each degree of freedom, in ascending natural frequency.

    ``eigenvalues`` (2m,) [1/s] come in pairs, two for each mode: conjugate where the mode oscillates, real where it
    creeps or diverges, exactly 0 for rigid-body modes. ``errors`` (2m,) estimates the relative error of each.
    ``shapes`` (m, m) are the displacements of the minimal coordinates, one column a mode, real where damping is
    classical (``classical`` says why, and is empty elsewhere); shapes^T M shapes = 1 for these, and a unit vector in
    the undamped modes for the others. ``rigid`` counts the rigid-body modes.
    """

    name: str
    coordinates: tuple[str, ...]
    bodies: tuple[str, ...]
    eigenvalues: Complex
    errors: Array
    shapes: Array | Complex
    classical: str
    rigid: int
    _body_motion: Array = field(repr=False)
    damped: Damped = field(repr=False)

    @cached_property
    def natural(self) -> Array:
        """Natural angular frequencies [rad/s], shape (m,): |lambda|, of a real pair the geometric mean."""
        return np.sqrt(np.abs(self.eigenvalues[0::2] * self.eigenvalues[1::2]))

    @cached_property
    def frequencies(self) -> Array:
        """Natural (undamped) frequencies [Hz], shape (m,)."""
        return self.natural / (2.0 * np.pi)

    @cached_property
    def damped_frequencies(self) -> Array:
        """Frequencies of the decaying oscillation [Hz], shape (m,): Im(lambda)/2 pi, 0 where nothing oscillates."""
        return np.abs(self.eigenvalues[0::2].imag) / (2.0 * np.pi)

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios, shape (m,): -Re(lambda)/|lambda|; above 1 for a creeping mode, -1 for a diverging one.

        A rigid-body mode has 0, or infinity where a damper brakes it.
        """
        first, second = self.eigenvalues[0::2], self.eigenvalues[1::2]
        total = 0.0 - (first + second).real
        ratio = np.divide(total, 2.0 * self.natural, out=np.where(total > 0.0, np.inf, 0.0), where=self.natural > 0.0)
        return np.where((first * second).real < 0.0, -1.0, ratio)

    @cached_property
    def body_shapes(self) -> dict[str, Array | Complex]:
        """Displacements of the bodies, {name: (6, m)}: translation of the centre of mass and rotation, world axes."""
        return dict(zip(self.bodies, self._body_motion @ self.shapes, strict=True))

    @cached_property
    def stable(self) -> bool:
        """Whether no eigenvalue has a positive real part."""
        return bool((self.eigenvalues.real <= 0.0).all())

    def check_accuracy(self, rtol: float) -> None:
        """Warn of every mode whose estimated relative error is larger than ``rtol``, by number.

        Parameters
        ----------
        rtol : float
            Relative accuracy asked for.
        """
        late = np.nonzero(self.errors.reshape(-1, 2).max(axis=1, initial=0.0) > rtol)[0]
        if len(late):
            numbers = ", ".join(str(i + 1) for i in late[:8]) + (", ..." if len(late) > 8 else "")
            warnings.warn(
                f"modes of '{self.name}': estimated relative error up to {self.errors.max():.1e} exceeds "
                f"rtol = {rtol:g} in modes {numbers}.", AccuracyWarning, stacklevel=3,
            )  # fmt: skip

    def __len__(self) -> int:
        return len(self.eigenvalues) // 2

    def __str__(self) -> str:
        from mbsvib import tables

        columns: list[tuple[str, tables.Justify]] = [
            ("mode", "right"), ("natural [Hz]", "right"), ("damped [Hz]", "right"), ("damping ratio [%]", "right"),
            ("moves most", "left"),
        ]  # fmt: skip
        rows = [
            (str(i + 1), f"{f:.6f}", f"{d:.6f}", f"{100.0 * z:.6f}", name)
            for i, (f, d, z, name) in enumerate(
                zip(self.frequencies, self.damped_frequencies, self.damping_ratios, self.strongest(), strict=True)
            )
        ]
        return tables.text(f"Modes of {self.name}: {len(self)} DOF", columns, rows, self.remarks())

    def __repr__(self) -> str:
        low, high = (self.frequencies[0], self.frequencies[-1]) if len(self) else (0.0, 0.0)
        return f"Modes({self.name!r}: {len(self)} modes, {low:.6g} to {high:.6g} Hz)"

    def strongest(self) -> tuple[str, ...]:
        """Return for each mode the body that moves most and how (``"platform x"``).

        A rotation counts as the translation that it makes at the distance of the mechanism's radius of gyration.

        Returns
        -------
        tuple of str
            One entry a mode.
        """
        motion = np.abs(self._body_motion @ self.shapes)
        rotation, translation = motion[:, 3:].max(initial=0.0), motion[:, :3].max(initial=0.0)
        length = translation / rotation if rotation > 0.0 and translation > 0.0 else 1.0
        motion[:, 3:] *= length
        best = motion.reshape(-1, len(self)).argmax(axis=0) if motion.size else []
        names = ("x", "y", "z", "rx", "ry", "rz")
        return tuple(f"{self.bodies[i // 6]} {names[i % 6]}" for i in best)

    def remarks(self) -> tuple[str, ...]:
        """Return what a reader of the table should know: rigid-body, creeping and diverging modes, accuracy.

        Returns
        -------
        tuple of str
            One sentence each.
        """
        if not len(self):
            return ("The mechanism is fully locked: it has no degree of freedom.",)
        result = []
        if self.rigid:
            result.append(f"{count(self.rigid, 'rigid-body mode')}, exactly 0 Hz.")
        diverging = np.nonzero(self.eigenvalues.reshape(-1, 2).real.max(axis=1) > 0.0)[0]
        if len(diverging):
            result.append(f"Unstable: mode{'s' if len(diverging) > 1 else ''} "
                          f"{', '.join(str(i + 1) for i in diverging)} grow with time.")  # fmt: skip
        result.append(f"Estimated relative error of the eigenvalues: {self.errors.max():.1e} at most.")
        return tuple(result)


def modes(system: System, rtol: float = RTOL) -> Modes:
    """Return all modes of a system, (lambda^2 M + lambda C + K) phi = 0.

    Parameters
    ----------
    system : System
        The equations of motion.
    rtol : float
        Relative accuracy asked of every eigenvalue.

    Returns
    -------
    Modes
        Eigenvalues, shapes and error estimates.
    """
    basis = undamped(system, rtol)
    result = damped(system, basis)
    shapes = result.shapes if result.vectors is None else result.shapes @ result.vectors[:, :, 0]
    if result.vectors is not None:
        largest = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(system.dof)]
        shapes = shapes * (np.abs(largest) / largest)
    return Modes(system.name, system.coordinates, system.bodies, result.pairs.reshape(-1), result.errors.reshape(-1),
                 shapes, result.classical, basis.rigid, system.body_motion, result)  # fmt: skip
