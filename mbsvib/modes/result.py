"""Modes: eigenvalues, frequencies, damping ratios and shapes of a system, with an estimate of their accuracy."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from mbsvib.common.arrays import AnyArray, Array, Bools, Complex, Index
from mbsvib.common.columnar import Columnar
from mbsvib.common.display import Displayed
from mbsvib.common.expected import near_frequency, real
from mbsvib.common.fast_init import fast_init
from mbsvib.equations.equations import Equations, Provenance
from mbsvib.errors import AccuracyWarning, ResponseError, counted
from mbsvib.linalg.products import real_product
from mbsvib.modes.classical import NO_DAMPER, proportional
from mbsvib.modes.damped import Damped, damped
from mbsvib.modes.general import General, general, is_general
from mbsvib.modes.pairs import damping_ratios, growing, natural_frequencies, of_all
from mbsvib.modes.undamped import undamped

# Default accuracy: twelve digits, which cost no more than ten.
RTOL = 1e-12
# Near critical damping the undamped modes must be more accurate than the damped ones by this factor.
TIGHTER = 1e-2
# Errors that no more accurate solver reduces.
ROUNDING = 1e-15
# A shape of a massless system whose bodies move less than this is not normalised by their motion.
MOVES = 1e-8
# Radius [m] at which rotations of nodes count as motions: small, so that they do where nothing shifts.
SHARED_RADIUS = 1e-3


@fast_init
@dataclass(frozen=True, repr=False, eq=False)
class Modes(Columnar, Displayed):
    """The modes of a system, one for each degree of freedom or a choice of them, in ascending natural frequency.

    ``eigenvalues`` (2n,) [1/s] of n modes come in pairs, two for each mode: conjugate where the mode oscillates, real
    where it creeps or diverges, exactly 0 for rigid-body modes. ``errors`` (2n,) estimates the relative error of each.
    ``shapes`` (m, n) are the displacements of the minimal coordinates, one column a mode, real where damping is
    classical (``classical`` is the reason, else empty); shapes^T M shapes = 1 for these, and a unit vector in
    the undamped modes for the others (phi^H M phi = 1 where C or K has no symmetry), whose largest entry is real and
    positive. ``rigid`` counts the rigid-body modes.

    A massless motion with damping has a mode of ``first_order``: one real eigenvalue in place of two, with natural
    frequency |lambda|, damped frequency 0 and damping ratio 1 (-1 if unstable). ``first_order`` (n,) marks these
    modes, and is None where there is none.

    ``frequency_intervals`` (n, 2) [Hz] hold the natural frequencies with a probability of 95 %, by the confidence of a
    fit; None without one. The shapes are the exact modes of a system whose frequencies differ by ``mixed``, relative,
    at most. ``solver`` is the name of the solver of undamped modes that was accurate enough.
    """

    _engine = "MOST body_motion check_accuracy damped inertia_factor mixed natural solver starts strongest"

    MOST: ClassVar[str] = "largest motion"

    name: str
    """Name of the model."""
    coordinates: tuple[str, ...]
    """Names of the minimal coordinates (m,)."""
    bodies: tuple[str, ...]
    """Names of the bodies."""
    eigenvalues: Complex
    errors: Array
    shapes: Array | Complex
    classical: str
    rigid: int
    body_motion: Array = field(repr=False)
    inertia_factor: Array = field(repr=False)
    damped: Damped | General = field(repr=False)
    first_order: Bools | None = None
    mixed: float = field(default=0.0, repr=False)
    solver: str = field(default="", repr=False)
    frequency_intervals: Array | None = field(default=None, repr=False)
    _provenance: Provenance | None = field(default=None, repr=False)

    @cached_property
    def starts(self) -> Index:
        """Where each mode's eigenvalues start, and where they end."""
        size = np.full(len(self), 2) if self.first_order is None else 2 - self.first_order
        return np.concatenate(([0], np.cumsum(size)))

    @cached_property
    def pairs(self) -> Complex:
        """Eigenvalues mode by mode, (n, 2); that of a mode of first order appears twice."""
        return np.asarray(self._paired(self.eigenvalues))

    @cached_property
    def pair_errors(self) -> Array:
        """Estimated relative errors mode by mode, (n, 2)."""
        return np.asarray(self._paired(self.errors))

    def _paired(self, values: Any) -> Any:
        if self.first_order is None:
            return values.reshape(-1, 2)
        return np.stack((values[self.starts[:-1]], values[self.starts[1:] - 1]), axis=1)

    @cached_property
    def natural(self) -> Array:
        """Natural angular frequencies [rad/s], shape (m,): |lambda|, of a real pair the geometric mean."""
        return natural_frequencies(self.pairs)

    @cached_property
    def frequencies(self) -> Array:
        """Natural (undamped) frequencies [Hz], shape (m,)."""
        return self.natural / (2.0 * np.pi)

    @cached_property
    def damped_frequencies(self) -> Array:
        """Damped frequencies [Hz], shape (m,): Im(lambda)/2 pi, 0 for modes that do not oscillate."""
        return np.abs(self.pairs[:, 0].imag) / (2.0 * np.pi)

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratios, shape (m,): -Re(lambda)/|lambda|; above 1 for an overdamped mode, -1 for a diverging one.

        A rigid-body mode has 0, or infinity if a damper acts on it.
        """
        return damping_ratios(self.pairs)

    @cached_property
    def body_shapes(self) -> dict[str, Array | Complex]:
        """Displacements of the bodies, {name: (6, m)}: translation of the centre of mass and rotation, world axes."""
        self._check_mechanism("body_shapes")
        return dict(zip(self.bodies, self.body_motion @ self.shapes, strict=True))

    def _check_mechanism(self, caller: str) -> None:
        if self._provenance is not None:
            self._provenance.check_mechanism(self.name, caller)

    @property
    def _none(self) -> str:
        return "It is locked, or no motion has mass." if self._provenance is None else self._provenance.rest

    def check_any(self, task: str) -> None:
        """Refuse a task where there are no modes.

        Parameters
        ----------
        task : str
            What needs modes, such as "draw".

        Raises
        ------
        ResponseError
            If there are none.
        """
        if not len(self):
            raise ResponseError(f"system '{self.name}' has no modes to {task}. {self._none}")

    @cached_property
    def stable(self) -> bool:
        """Whether no mode is unstable."""
        return not self.growing.any()

    @cached_property
    def growing(self) -> Bools:
        """Whether each mode is unstable, shape (n,): its real part is positive by more than rounding."""
        return np.asarray(growing(self.pairs, self.pair_errors).any(axis=1))

    def nearest(self, count: int, frequency: float = 0.0) -> Modes:
        """Return the ``count`` modes whose natural frequencies are nearest to a frequency.

        Parameters
        ----------
        count : int
            Number of modes; all if there are fewer.
        frequency : float
            The frequency [Hz].

        Returns
        -------
        Modes
            In ascending natural frequency.

        Raises
        ------
        ResponseError
            If ``count`` is not a positive whole number, or the frequency is not a number.
        """
        if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or count < 1:
            raise ResponseError(f"modes: count = {count!r}; expected how many modes are wanted, 1 or more.")
        distance = np.abs(self.frequencies - near_frequency(frequency))
        return self._selected(np.sort(np.argsort(distance, kind="stable")[:count]))

    def _selected(self, modes: Index) -> Self:
        which = np.concatenate([np.arange(0), *(np.arange(*self.starts[i : i + 2]) for i in modes)])
        return replace(
            self, eigenvalues=self.eigenvalues[which], errors=self.errors[which], shapes=self.shapes[:, modes],
            rigid=int(np.count_nonzero(modes < self.rigid)),
            first_order=None if self.first_order is None else self.first_order[modes],
            frequency_intervals=None if self.frequency_intervals is None else self.frequency_intervals[modes],
        )  # fmt: skip

    def check_accuracy(self, rtol: float) -> None:
        """Warn of every mode whose estimated relative error is larger than ``rtol``, by number.

        Parameters
        ----------
        rtol : float
            Required relative accuracy.

        Raises
        ------
        ResponseError
            If it is not a number, or negative.
        """
        rtol = real(rtol, "modes", "rtol", "a relative accuracy such as 1e-12", least=0.0)
        inaccurate = np.nonzero(self._paired(self.errors).max(axis=1, initial=0.0) > rtol)[0]
        if len(inaccurate):
            numbers = ", ".join(str(i + 1) for i in inaccurate[:8]) + (", ..." if len(inaccurate) > 8 else "")
            warnings.warn(
                f"modes of '{self.name}': estimated relative error up to {self.errors.max():.1e} exceeds "
                f"rtol = {rtol:g} in modes {numbers}.", AccuracyWarning, stacklevel=3,
            )  # fmt: skip

    def __len__(self) -> int:
        return int(self.shapes.shape[1])

    _index = "mode"

    def columns(self) -> dict[str, AnyArray]:
        """Return number, frequencies [Hz], damping ratio, error and largest motion of each mode as columns by name.

        Returns
        -------
        dict of str to array, shape (m,)
            ``mode``, ``frequency_hz``, ``damped_frequency_hz``, ``damping_ratio``, ``error``, ``largest_motion``.
        """
        return {"mode": np.arange(1, len(self) + 1), "frequency_hz": self.frequencies,
                "damped_frequency_hz": self.damped_frequencies, "damping_ratio": self.damping_ratios,
                "error": self._paired(self.errors).max(axis=1, initial=0.0),
                "largest_motion": np.array([" ".join(most) for most in self.strongest()])}  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Return the table of modes as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        headers = ("mode", "natural [Hz]", "damped [Hz]", "damping ratio [%]")
        columns = [*((header, "right") for header in headers), (self.MOST, "left")]
        damping = damping_ratios(self.pairs, self.pair_errors)
        values = zip(self.frequencies, self.damped_frequencies, damping, self.strongest(), strict=True)
        rows = [(str(i + 1), digits(f), digits(d), digits(100.0 * z), " ".join(most))
                for i, (f, d, z, most) in enumerate(values)]  # fmt: skip
        return {"title": f"Modes of {self.name}: {self._shown()}", "columns": columns, "rows": rows,
                "notes": self.remarks()}  # fmt: skip

    def _shown(self) -> str:
        dof = len(self.coordinates)
        return f"{dof} DOF" if len(self) == dof else f"{len(self)} of {dof} DOF"

    def __repr__(self) -> str:
        ends = [f"{f:.6g}" for f in self.frequencies[[0, -1] if len(self) > 1 else slice(None)]]
        reach = f", {' to '.join(ends)} Hz" if ends else ""
        return f"Modes({self.name!r}: {counted(len(self), 'mode')}{reach})"

    @cached_property
    def kinetic_energy(self) -> dict[str, Array]:
        """Share of each body in the kinetic energy of each mode, {name: (m,)}; over all bodies they add up to 1.

        Zeros for a mode in which nothing moves that has mass.
        """
        self._check_mechanism("kinetic_energy")
        energy = self._energy().sum(axis=1)
        total = energy.sum(axis=0)
        return dict(zip(self.bodies, energy / np.where(total > 0.0, total, 1.0), strict=True))

    def strongest(self) -> tuple[tuple[str, ...], ...]:
        """Return for each mode the body with most kinetic energy, and the direction of its largest motion.

        Where nothing that moves has mass, it is the body that moves furthest. Without bodies it is the coordinate
        with the largest kinetic energy.

        Returns
        -------
        tuple of (str, str) or (str,)
            Body, and out of x y z rx ry rz, or a coordinate; one entry a mode.
        """
        if not len(self):
            return ()
        if not self.bodies:
            inertia = np.sum(self.inertia_factor**2, axis=0)[:, None]
            return tuple([(self.coordinates[i],) for i in (inertia * np.abs(self.shapes) ** 2).argmax(axis=0)])
        energy = self._energy()
        massless = ~energy.any(axis=(0, 1))  # nodes without mass: by how far they move
        energy[..., massless] = np.abs(self.body_motion @ self.shapes[:, massless])
        body = energy.sum(axis=1).argmax(axis=0)
        mode = np.arange(len(self))
        translates = energy[body, :3, mode].sum(axis=1) >= energy[body, 3:, mode].sum(axis=1)
        motion = np.abs((self.body_motion @ self.shapes)[body, :, mode])
        direction = np.where(translates, motion[:, :3].argmax(axis=1), 3 + motion[:, 3:].argmax(axis=1))
        names = ("x", "y", "z", "rx", "ry", "rz")
        return tuple((self.bodies[b], names[d]) for b, d in zip(body, direction, strict=True))

    def _energy(self) -> Array:
        """Twice the kinetic energy of the bodies' translations and rotations at unit speed, (bodies, 6, m).

        Inertia shared by several bodies, such as nodes of a beam, is distributed over those without inertia of their
        own, by the squares of their motions; rotations are multiplied by ``SHARED_RADIUS``.
        """
        rows, count = np.abs(self.inertia_factor @ self.shapes) ** 2, len(self.bodies)
        energy = rows[: 6 * count].reshape(count, 6, len(self)).copy()
        if len(rows) > 6 * count:
            motion = np.abs(self.body_motion @ self.shapes) ** 2
            motion[:, 3:] *= SHARED_RADIUS**2
            motion[energy.any(axis=(1, 2))] = 0.0
            size = motion.sum(axis=(0, 1))
            share = np.divide(motion, size, out=np.zeros_like(motion), where=size > 0.0)
            energy += share * rows[6 * count :].sum(axis=0)
        return energy

    def remarks(self) -> tuple[str, ...]:
        """Return notes on the table: rigid-body, overdamped and diverging modes, accuracy."""
        if not len(self):
            return (f"No modes. {self._none}",)
        result = []
        if self.rigid:
            result.append(f"{counted(self.rigid, 'rigid-body mode')}, exactly 0 Hz.")
        diverging = np.nonzero(self.growing)[0]
        if len(diverging):
            result.append(f"Unstable: mode{'s' if len(diverging) > 1 else ''} {', '.join(map(str, diverging + 1))}.")
        if self.first_order is not None and self.first_order.any():
            result.append(f"{counted(int(self.first_order.sum()), 'mode')} of first order: motions without mass "
                          f"but with dampers, one eigenvalue each.")  # fmt: skip
        if self.classical:
            kind = "No damping" if self.classical == NO_DAMPER else "Proportional (classical) damping"
            result.append(f"{kind}: real modes.")
        result.append(f"Estimated relative error of the eigenvalues: {self.errors.max():.1e} at most.")
        return tuple(result)


Form = TypeVar("Form", bound=Modes)


def modes(system: Equations, rtol: float = RTOL, clean: bool = True, form: type[Form] = Modes) -> Form:  # type: ignore[assignment]
    """Return all modes of a system, (lambda^2 M + lambda C + K) phi = 0.

    Parameters
    ----------
    system : Equations
        The equations of motion.
    rtol : float
        Required relative accuracy of every eigenvalue.
    clean : bool
        Whether the shapes must be as accurate as the eigenvalues, as responses require.
    form : type
        The class of the modes.

    Returns
    -------
    Modes
        Eigenvalues, shapes and error estimates.
    """
    if is_general(system):
        return _without_symmetry(system, rtol, form)
    follows_stiffness = proportional(system.row_damping, system.row_stiffness)
    basis = undamped(system, rtol, clean, coupled=not follows_stiffness)
    result = damped(system, basis, rtol, follows_stiffness)
    if result is None:
        basis = undamped(system, rtol)
        result = damped(system, basis, rtol, follows_stiffness)
    assert result is not None  # clean shapes always give a result
    if basis.uncertainty > max(TIGHTER * rtol, ROUNDING) and float(result.errors.max(initial=0.0)) > rtol:
        basis = undamped(system, TIGHTER * rtol)
        result = damped(system, basis, rtol, follows_stiffness) or result
    shapes = result.shapes if result.vectors is None else real_product(result.shapes, result.vectors[:, :, 0])
    if result.vectors is not None:
        largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(system.dof)]
        shapes = shapes * (np.abs(largest) / largest)
    return form(system.name, system.coordinates, system.bodies, result.pairs.reshape(-1), result.errors.reshape(-1),
                 shapes, result.classical, basis.rigid, system.body_motion, system.inertia_factor, result,
                 mixed=basis.mixed, solver=basis.method, _provenance=system.provenance)  # fmt: skip


def _without_symmetry(system: Equations, rtol: float, form: type[Form]) -> Form:
    solution = general(system, rtol)
    columns = np.arange(solution.shapes.shape[1])
    largest = solution.shapes[np.argmax(np.abs(solution.shapes), axis=0), columns] if system.dof else np.ones(0)
    moving = np.linalg.norm(system.inertia_factor @ solution.shapes, axis=0)
    size = np.where(moving > MOVES * np.abs(largest) * np.linalg.norm(system.inertia_factor), moving, np.abs(largest))
    turn = np.divide(np.abs(largest), largest, out=np.ones_like(largest), where=largest != 0.0)
    shapes = solution.shapes * (turn / np.where(size > 0.0, size, 1.0))
    return form(system.name, system.coordinates, system.bodies, solution.values,
                of_all(solution.errors, solution.single), shapes, "", solution.rigid, system.body_motion,
                system.inertia_factor, solution,
                solution.single if solution.single.any() else None, _provenance=system.provenance)  # fmt: skip


def digits(value: float) -> str:
    """Return a number with six decimals, or with an exponent where six decimals show too few digits."""
    return f"{value:.6f}" if value == 0.0 or 1e-3 <= abs(value) < 1e7 else f"{value:.6e}"
