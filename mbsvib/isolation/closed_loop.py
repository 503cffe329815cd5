"""Closed loops: the mechanism with its controllers, as accurate over frequency as the mechanism itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.errors import ResponseError, nearest
from mbsvib.isolation.figures import figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.isolation.actuated import Active
    from mbsvib.isolation.controller import Controller
    from mbsvib.isolation.figures import Isolation
    from mbsvib.isolation.margins import Margins
    from mbsvib.isolation.sampled import SampledLoop
    from mbsvib.kinematics import Array
    from mbsvib.state_space import StateSpace

    Complex = NDArray[np.complex128]

AT_REST = 1e-9  # poles below this share of the largest are integrators' at rest
OSCILLATES = 1e-6  # pairs of real poles that coincide come out with such imaginary parts
GROWS = 1e-10  # a real part beyond this share of the largest pole is no rounding


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

    def _ports(self) -> tuple[list[int], list[int]]:
        return [self.outputs.index(n) for n in self.sensors], [self.inputs.index(n) for n in self.actuators]

    def gains(self, omega: Array) -> Complex:
        """Return the controllers' gains over frequency.

        Parameters
        ----------
        omega : array, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (n, actuators, sensors)
            K(i w).
        """
        return self.law.at(1j * np.asarray(omega, dtype=float))

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the response of the closed loop, G + G_u K (1 - G_yu K)^-1 G_y.

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
        y, u = self._ports()
        try:
            k = self.gains(w)
        except np.linalg.LinAlgError as error:
            raise ResponseError("closed loop: a controller has a pole at one of the frequencies (a pure integrator at "
                                "0 Hz?); give it a leak, or leave this frequency out.") from error  # fmt: skip
        difference = np.eye(len(y)) - g[:, y][:, :, u] @ k
        whole: Complex = g + g[:, :, u] @ k @ np.linalg.solve(difference, g[:, y])
        return np.asarray(whole.transpose(1, 2, 0))

    @cached_property
    def _space(self) -> tuple[Array, Array, Array, Array, StateSpace]:
        space = self.plant._space
        law, (y, u) = self.law, self._ports()
        n, k = len(space.A), len(law.A)
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
        assert a.shape == (n + k, n + k)
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
        from mbsvib.state_space import StateSpace

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
    def _eigen(self) -> tuple[Complex, Complex]:
        from scipy.linalg import eig, matrix_balance

        a = self._space[0]
        balanced, (scale, _) = matrix_balance(a, permute=False, separate=True)
        values, vectors = eig(balanced)
        order = np.lexsort((-values.imag, np.abs(values)))
        return values[order], (vectors * scale[:, None])[:, order]

    def poles(self) -> Complex:
        """Return the poles of the closed loop [1/s], in ascending magnitude."""
        return self._eigen[0].copy()

    @cached_property
    def growing(self) -> tuple[str, ...]:
        """What grows, in words: the unstable modes, each with that of the mechanism it comes from."""
        values, vectors = self._eigen
        largest = np.abs(values).max(initial=0.0)
        found = []
        for i in np.flatnonzero((values.real > GROWS * largest) & (values.imag >= 0.0)):
            found.append(f"{self._origin(vectors[:, i])} at {abs(values[i]) / (2.0 * np.pi):.4g} Hz, damping ratio "
                         f"{-100.0 * values[i].real / abs(values[i]):.3g} %")  # fmt: skip
        return tuple(found)

    def _origin(self, vector: Complex) -> str:
        system = self.plant.system
        modes = system.modes()
        space = self._space[4]
        q = space.transform[: system.dof] @ vector[: len(space.A)]
        share = np.abs(modes.shapes.conj().T @ system.M @ q) * modes.frequencies
        if not share.any():
            return "a mode of the controller"
        mode = int(share.argmax())
        return f"mode {mode + 1} ({modes.frequencies[mode]:.4g} Hz, {' '.join(modes.strongest()[mode])})"

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

    @cached_property
    def vibrating(self) -> Complex:
        """Poles that vibrate, one of each pair, in ascending magnitude."""
        values = self._eigen[0]
        size = np.abs(values)
        return np.asarray(values[(values.imag > OSCILLATES * size) & (size > AT_REST * size.max(initial=0.0))])

    @property
    def damping_ratios(self) -> Array:
        """Damping ratios of the poles that vibrate."""
        return np.asarray(-self.vibrating.real / np.abs(self.vibrating))

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures of the closed loop.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz]; default: those of the mechanism with open loops.

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.

        Raises
        ------
        ResponseError
            If the loop is not stable.
        """
        if frequencies is None:
            frequencies = self.plant.isolation().frequencies
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

    def table(self) -> dict[str, Any]:
        """Return the table of the modes of the closed loop as arguments of ``mbsvib.tables.text`` and ``show``.

        Returns
        -------
        dict
            Title, columns, rows and notes.
        """
        values = self.vibrating
        rows = [(i + 1, f"{abs(s) / (2 * np.pi):.6g}", f"{-100 * s.real / abs(s):.4g}", self._origin(v))
                for i, (s, v) in enumerate(zip(values, self._vectors(values), strict=True))]  # fmt: skip
        notes = [f"Grows: {words}." for words in self.growing]
        return {"title": f"Closed loop of {self.plant.scene.model.name}: {self.law.name}",
                "columns": [("mode", "right"), ("natural [Hz]", "right"), ("damping ratio [%]", "right"),
                            ("comes from", "left")],
                "rows": rows, "notes": notes}  # fmt: skip

    def _vectors(self, values: Complex) -> list[Complex]:
        every, vectors = self._eigen
        return [vectors[:, int(np.flatnonzero(every == value)[0])] for value in values]

    def __str__(self) -> str:
        from mbsvib import tables

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
    if not controllers:
        raise ResponseError("closed loop: no controller is given; make one by force_feedback, skyhook, controller, ...")
    system = plant.system
    for each in controllers:
        for what, names, known in (("sensor", each.inputs, system.outputs), ("actuator", each.outputs, system.inputs)):
            for name in names:
                if name not in known:
                    raise ResponseError(f"closed loop: {each.name} names the {what} '{name}', which the plant has not."
                                        f"{nearest(name, known)} It has {', '.join(known)}.")  # fmt: skip
    return ClosedLoop(plant, controllers, _united([c.inputs for c in controllers]),
                      _united([c.outputs for c in controllers]))  # fmt: skip


def _united(groups: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for name in group))
