"""Feedback loops: common base of continuous-time and discrete-time controllers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common import tables
from mbsvib.errors import ResponseError
from mbsvib.isolation.asymptote import direct, without_rounding
from mbsvib.isolation.controller import Controller
from mbsvib.isolation.integrand import response
from mbsvib.isolation.isolation_study import figures
from mbsvib.isolation.margins import margins
from mbsvib.isolation.participation import sources
from mbsvib.isolation.pole_track import GROWS, vibrates

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.isolation_study import Isolation
    from mbsvib.isolation.linear import Linear, Resolution
    from mbsvib.isolation.margins import Margins
    from mbsvib.isolation.plant import Plant
    from mbsvib.responses.state_space import StateSpace

RESTS = 3e-8  # error of double poles at 0, in parts of the largest


@dataclass(frozen=True, repr=False, eq=False)
class FeedbackLoop(ABC):
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces.

    Subclasses define whether controllers run in continuous or discrete time.
    """

    plant: Plant
    controllers: tuple[Controller, ...]
    sensors: tuple[str, ...] = field(repr=False)
    actuators: tuple[str, ...] = field(repr=False)

    @property
    def open_loop(self) -> System:
        """The mechanism with open loops."""
        return self.plant.system

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.plant.system.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.plant.system.outputs

    @cached_property
    def law(self) -> Controller:
        """All controllers as one."""
        sizes = [len(controller.A) for controller in self.controllers]
        n, start = sum(sizes), 0
        a, b = np.zeros((n, n)), np.zeros((n, len(self.sensors)))
        c, d = np.zeros((len(self.actuators), n)), np.zeros((len(self.actuators), len(self.sensors)))
        for controller, size in zip(self.controllers, sizes, strict=True):
            part = slice(start, start + size)
            into = [self.sensors.index(name) for name in controller.inputs]
            out = [self.actuators.index(name) for name in controller.outputs]
            a[part, part] = controller.A
            b[part, into] = controller.B
            c[out, part] = controller.C
            d[np.ix_(out, into)] += controller.D
            start += size
        name = " + ".join(controller.name for controller in self.controllers)
        return Controller(name, a, b, c, d, self.sensors, self.actuators)

    @property
    def ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors among the outputs and of the actuators among the inputs."""
        return [self.outputs.index(n) for n in self.sensors], [self.inputs.index(n) for n in self.actuators]

    @abstractmethod
    def _loop(self, omega: Array, own: Complex) -> tuple[Complex, Complex, Complex]:
        """K (n, actuators, sensors), the loop gain K G at the actuators (n, actuators, actuators), and the response of
        the hold (n,); ``own`` (n, sensors, actuators) is the response of the mechanism.
        """

    @property
    @abstractmethod
    def _eigen(self) -> tuple[Complex, Array]:
        """Poles [1/s] in ascending magnitude, and the participation of each state in them, (states, poles)."""

    @property
    @abstractmethod
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""

    @property
    @abstractmethod
    def far(self) -> Linear:
        """The loop or system with the same response at high frequency."""

    @abstractmethod
    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations of the closed loop.

        Parameters
        ----------
        realization : str
            "modal": the mechanism's states are modal, the controllers' their own.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is another one, or there are no such equations.
        """

    @property
    @abstractmethod
    def title(self) -> str:
        """The controllers, and how they run."""

    @cached_property
    def _own(self) -> System:
        """The mechanism with only the ports of the loops."""
        y, u = self.ports
        system = self.plant.system
        return replace(
            system, inputs=self.actuators, outputs=self.sensors, B=system.B[:, u], Cq=system.Cq[y], Cv=system.Cv[y],
            Ca=system.Ca[y], D=system.D[np.ix_(y, u)], input_units=tuple([system.input_units[i] for i in u]),
            output_units=tuple([system.output_units[i] for i in y]),
        )  # fmt: skip

    def returned(self, omega: ArrayLike) -> Complex:
        """Return the loop gain at the actuators, K G_yu, with open loops.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (n, actuators, actuators)
            Gains; a loop is unstable where they encircle 1.
        """
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        return self._loop(w, response(self._own, w, self.sensors, self.actuators).transpose(2, 0, 1))[1]

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the response of the closed loop, G + G_u (1 - K G_yu)^-1 K G_y.

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (outputs, inputs, n)
            Complex responses, from the accurate ones of the mechanism.

        Raises
        ------
        ResponseError
            If the loop is not stable, or a frequency is a pole of a controller or of the undamped mechanism.
        """
        self.check_stable()
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        g = self.plant.system.frequency_response(w).transpose(2, 0, 1)
        y, u = self.ports
        k, returned, hold = self._loop(w, g[:, y][:, :, u])
        forces = np.linalg.solve(np.eye(len(u)) - returned, k @ g[:, y])
        closed: Complex = g + g[:, :, u] @ (hold[:, None, None] * forces)
        return np.asarray(closed.transpose(1, 2, 0))

    def direct(self) -> Array:
        """Return the feedthrough (outputs, inputs), with zeros where it is rounding."""
        plant, (y, u) = direct(self.open_loop), self.ports
        back = np.linalg.inv(np.eye(len(u)) - self.law.D @ plant[np.ix_(y, u)]) @ self.law.D
        value = plant + plant[:, u] @ back @ plant[y]
        terms = np.abs(plant) + np.abs(plant[:, u]) @ np.abs(back) @ np.abs(plant[y])
        return without_rounding(value, terms)

    def poles(self) -> Complex:
        """Return the poles of the closed loop [1/s], in ascending magnitude."""
        return self._eigen[0].copy()

    @cached_property
    def growing(self) -> tuple[str, ...]:
        """The unstable modes in words, each with the mode of the mechanism it comes from."""
        values = self._eigen[0]
        largest = np.abs(values).max(initial=0.0)
        grows = (values.real > GROWS * largest) & (values.imag >= 0.0) & (np.abs(values) > RESTS * largest)
        return tuple([
            f"{self.sources[i]} at {abs(values[i]) / (2.0 * np.pi):.4g} Hz, damping ratio "
            f"{-100.0 * values[i].real / abs(values[i]):.3g} %" for i in np.flatnonzero(grows).tolist()
        ])  # fmt: skip

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """Where each pole comes from, in words: a mode of the mechanism, or the controller."""
        modes = self.plant.system.modes()
        strongest = modes.strongest()
        return tuple([
            "controller" if mode is None
            else f"mode {mode + 1} ({modes.frequencies[mode]:.4g} Hz, {' '.join(strongest[mode])})"
            for mode in sources(*self._eigen, self.plant.space.states)
        ])  # fmt: skip

    @property
    def stable(self) -> bool:
        """Whether the loop is stable; integrators without leak may leave poles at 0."""
        return not self.growing

    def check_stable(self) -> None:
        """Refuse a loop that is not stable.

        Raises
        ------
        ResponseError
            If a pole is unstable.
        """
        if self.growing:
            raise ResponseError(f"closed loop: not stable with {self.law.name}: {'; '.join(self.growing)}. Lower the "
                                f"gain, or look at collocation() for the pairs that do not damp.")  # fmt: skip

    @property
    def vibrating(self) -> Complex:
        """Poles that vibrate, one of each pair, in ascending magnitude."""
        return np.asarray(self._eigen[0][self._vibrating])

    @cached_property
    def _vibrating(self) -> NDArray[np.intp]:
        values = self._eigen[0]
        return np.flatnonzero(vibrates(values) & (values.imag > 0.0))

    @property
    def damping_ratios(self) -> Array:
        """Damping ratios of the poles that vibrate."""
        return np.asarray(-self.vibrating.real / np.abs(self.vibrating))

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures of the closed loop.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: the band of the mechanism with open loops, resolving every resonance of
            open and closed ones.

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.

        Raises
        ------
        ResponseError
            If the loop is not stable.
        """
        return figures(self.plant.scene, self, frequencies)

    def margins(self, frequencies: ArrayLike | None = None) -> Margins:
        """Return stability margins: of all loops together, and of each with the others closed.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Where to look [Hz]; default: around all poles.

        Returns
        -------
        Margins
            Printed as a table.
        """
        return margins(self, frequencies)

    def table(self) -> dict[str, Any]:
        """Return the table of the modes of the closed loop as arguments of ``mbsvib.common.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        rows = [(i + 1, f"{abs(s) / (2 * np.pi):.6g}", f"{-100 * s.real / abs(s):.4g}", self.sources[at])
                for i, (s, at) in enumerate(zip(self.vibrating, self._vibrating.tolist(), strict=True))]  # fmt: skip
        notes = [f"Unstable: {words}." for words in self.growing]
        return {"title": f"Closed loop of {self.plant.scene.model.name}: {self.title}",
                "columns": [("mode", "right"), ("natural [Hz]", "right"), ("damping ratio [%]", "right"),
                            ("origin", "left")],
                "rows": rows, "notes": notes}  # fmt: skip

    def __str__(self) -> str:
        return tables.text(**self.table())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.plant.scene.model.name!r} with {self.law.name})"
