"""Closed loops: the mechanism with its controllers, as accurate over frequency as the mechanism itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError, nearest
from mbsvib.isolation.figures import figures
from mbsvib.isolation.integrand import response
from mbsvib.isolation.mean_square import Resolution
from mbsvib.isolation.participation import eigen, sources
from mbsvib.isolation.pole_track import GROWS, vibrates

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.api.system import System
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.isolation.actuated import Active
    from mbsvib.isolation.controller import Controller
    from mbsvib.isolation.figures import Isolation
    from mbsvib.isolation.margins import Margins
    from mbsvib.isolation.sampled import SampledLoop
    from mbsvib.responses.state_space import StateSpace


RESTS = 3e-8  # poles at 0 that are double come out so far off, in parts of the largest


@dataclass(frozen=True, repr=False, eq=False)
class ClosedLoop:
    """A mechanism with controllers; has the inputs and outputs of ``plant.system``, actuators take further forces."""

    plant: Active
    controllers: tuple[Controller, ...]
    sensors: tuple[str, ...] = field(repr=False)
    actuators: tuple[str, ...] = field(repr=False)

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
        from mbsvib.isolation.controller import Controller

        sizes = [len(each.A) for each in self.controllers]
        n, start = sum(sizes), 0
        a, b = np.zeros((n, n)), np.zeros((n, len(self.sensors)))
        c, d = np.zeros((len(self.actuators), n)), np.zeros((len(self.actuators), len(self.sensors)))
        for each, size in zip(self.controllers, sizes, strict=True):
            part = slice(start, start + size)
            into = [self.sensors.index(name) for name in each.inputs]
            out = [self.actuators.index(name) for name in each.outputs]
            a[part, part] = each.A
            b[part, into] = each.B
            c[out, part] = each.C
            d[np.ix_(out, into)] += each.D
            start += size
        return Controller(" + ".join(each.name for each in self.controllers), a, b, c, d, self.sensors, self.actuators)

    @property
    def ports(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors among the outputs and of the actuators among the inputs."""
        return [self.outputs.index(n) for n in self.sensors], [self.inputs.index(n) for n in self.actuators]

    def _loop(self, omega: Array, own: Complex) -> tuple[Complex, Complex, Complex]:
        """K (n, actuators, sensors), what K G brings back of signals at the actuators (n, actuators, actuators), and
        what a hold makes of forces (n,); ``own`` (n, sensors, actuators) is the response of the mechanism.
        """
        s = np.asarray(1j * omega, dtype=complex)
        try:
            k = self.law.at(s)
        except np.linalg.LinAlgError as error:
            raise ResponseError("closed loop: a controller has a pole at one of the frequencies (a pure integrator at "
                                "0 Hz?); give it a leak, or leave this frequency out.") from error  # fmt: skip
        return k, k @ own, np.ones(len(omega), dtype=complex)

    @cached_property
    def _own(self) -> System:
        """The mechanism with the ports of the loops alone."""
        y, u = self.ports
        system = self.plant.system
        return replace(
            system, inputs=self.actuators, outputs=self.sensors, B=system.B[:, u], Cq=system.Cq[y], Cv=system.Cv[y],
            Ca=system.Ca[y], D=system.D[np.ix_(y, u)], input_units=tuple([system.input_units[i] for i in u]),
            output_units=tuple([system.output_units[i] for i in y]),
        )  # fmt: skip

    def returned(self, omega: ArrayLike) -> Complex:
        """Return what the loops bring back of a signal at the actuators, K G_yu, with nothing closed.

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
        whole: Complex = g + g[:, :, u] @ (hold[:, None, None] * forces)
        return np.asarray(whole.transpose(1, 2, 0))

    @cached_property
    def _space(self) -> tuple[Array, Array, Array, Array, StateSpace]:
        space = self.plant._space
        law, (y, u) = self.law, self.ports
        n = len(space.A)
        loop = np.eye(len(y)) - space.D[np.ix_(y, u)] @ law.D
        if np.linalg.cond(loop) > 1e12:
            raise ResponseError(f"closed loop: {law.name} feeds sensors that feel actuators at once with a gain of 1, "
                                f"so that signals are not defined; change the gain.")  # fmt: skip
        # y = seen (x, z) + direct w
        seen = np.linalg.solve(loop, np.concatenate((space.C[y], space.D[np.ix_(y, u)] @ law.C), axis=1))
        direct = np.linalg.solve(loop, space.D[y])
        push, push_w = law.D @ seen, law.D @ direct
        push[:, n:] += law.C
        a = np.concatenate((space.B[:, u] @ push, law.B @ seen))
        a[:n, :n] += space.A
        a[n:, n:] += law.A
        b = np.concatenate((space.B + space.B[:, u] @ push_w, law.B @ direct))
        c = space.D[:, u] @ push
        c[:, :n] += space.C
        d = space.D + space.D[:, u] @ push_w
        return a, b, c, d, space

    def state_space(self, realization: str = "modal") -> StateSpace:
        """Return first-order equations of the closed loop, ready for ``mbsvib_export.to_control``.

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
            If the realization is another one.
        """
        from mbsvib.responses.state_space import StateSpace

        if realization != "modal":
            raise ResponseError(f"state_space: realization = {realization!r}; a closed loop has only 'modal' states.")
        a, b, c, d, space = self._space
        k = len(a) - len(space.A)
        states = tuple([f"controller{i + 1}" for i in range(k)])
        return StateSpace(f"{space.name} with {self.law.name}", "modal", a.copy(), b.copy(), c.copy(), d.copy(),
                          np.concatenate((space.transform, np.zeros((len(space.transform), k))), axis=1),
                          (*space.states, *states), (*space.state_units, *("",) * k), space.inputs, space.input_units,
                          space.outputs, space.output_units, space.through)  # fmt: skip

    @cached_property
    def _eigen(self) -> tuple[Complex, Array]:
        """Poles [1/s] in ascending magnitude, and how far each state takes part in them, (states, poles)."""
        return eigen(self._space[0])

    def poles(self) -> Complex:
        """Return the poles of the closed loop [1/s], in ascending magnitude."""
        return self._eigen[0].copy()

    @property
    def resolution(self) -> Resolution:
        """What responses are made of."""
        return Resolution(self.poles())

    @property
    def far(self) -> System | ClosedLoop:
        """What the response is that of at high frequency."""
        return self

    @cached_property
    def growing(self) -> tuple[str, ...]:
        """What grows, in words: the unstable modes, each with that of the mechanism it comes from."""
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
            for mode in sources(*self._eigen, self.plant._space.states)
        ])  # fmt: skip

    @property
    def stable(self) -> bool:
        """Whether nothing grows; integrators of unlimited memory may leave poles at 0."""
        return not self.growing

    def check_stable(self) -> None:
        """Refuse a loop that is not stable.

        Raises
        ------
        ResponseError
            If something grows.
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
        from mbsvib.isolation.margins import margins

        return margins(self, frequencies)

    def sampled(self, rate: float, delay: float = 0.0) -> SampledLoop:
        """Return the loop with its controllers on a computer.

        Parameters
        ----------
        rate : float
            Samples a second [Hz].
        delay : float
            Between measuring and acting [s].

        Returns
        -------
        SampledLoop
            The same loop with discrete controllers and a zero-order hold.
        """
        from mbsvib.isolation.sampled import sampled

        return sampled(self, rate, delay)

    @property
    def title(self) -> str:
        """The law, and how it runs."""
        return self.law.name

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
                            ("comes from", "left")],
                "rows": rows, "notes": notes}  # fmt: skip

    def __str__(self) -> str:
        from mbsvib.common import tables

        return tables.text(**self.table())

    def __repr__(self) -> str:
        return f"ClosedLoop({self.plant.scene.model.name!r} with {self.law.name})"


def close(plant: Active, *controllers: Controller) -> ClosedLoop:
    """Return a mechanism with its loops closed.

    Parameters
    ----------
    plant : Active
        The mechanism with actuators and sensors.
    *controllers : Controller
        Laws that act together.

    Returns
    -------
    ClosedLoop
        Poles, responses, margins.

    Raises
    ------
    ResponseError
        If there is no controller, or one names an unknown sensor or actuator.
    """
    from mbsvib.isolation.controller import Controller

    if not controllers:
        raise ResponseError("closed loop: no controller is given; make one by force_feedback, skyhook, controller, ...")
    system = plant.system
    for each in controllers:
        if not isinstance(each, Controller):
            raise ResponseError(f"closed loop: {type(each).__name__} is no controller; expected what force_feedback, "
                                f"skyhook, controller, ... return.")  # fmt: skip
        for what, names, known in (("sensor", each.inputs, system.outputs), ("actuator", each.outputs, system.inputs)):
            for name in names:
                if name not in known:
                    raise ResponseError(f"closed loop: {each.name} names the {what} '{name}', which the plant has not."
                                        f"{nearest(name, known)} It has {', '.join(known)}.")  # fmt: skip
    return ClosedLoop(plant, controllers, _united([c.inputs for c in controllers]),
                      _united([c.outputs for c in controllers]))  # fmt: skip


def _united(groups: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for name in group))
