"""Plants as a search sees them: equations with inputs for noise and outputs for commands, and loops with gradients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.common.expected import a_linear, kind_of
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import regular
from mbsvib.feedback.loop_gradient import Closure
from mbsvib.feedback.noise import NOISE
from mbsvib.sensitivities.states import changed, states
from mbsvib.tuning.peaks import Response, eigen
from mbsvib.tuning.structures import Signals

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.feedback.closing import Matrices
    from mbsvib.sensitivities.states import States
    from mbsvib.studies.design import StudyVariables
    from mbsvib.tuning.realization import Realization

# A pole decays if its real part is below this share of the fastest pole: closed loops at the limit are not wanted.
DECAYS = 1e-10
# Responses between a sensor and an actuator below this share of the largest are none.
NONE = 1e-12
AROUND = np.geomspace(0.1, 10.0, 9)  # frequencies, in parts of the mean pole, at which sizes of signals are taken


@dataclass(frozen=True, eq=False)
class Scene:
    """A plant for a controller from ``sensors`` to ``actuators``: a ``model`` with ``variables``, or given equations.

    Its outputs are those of the ``system``, what the controller sees and what actuators apply; its inputs those of the
    system, the noise of the sensors and that of the actuators. Time is in units of 1 / ``rate`` [rad/s].
    """

    model: Any
    system: Any
    variables: StudyVariables | None
    sensors: tuple[str, ...]
    actuators: tuple[str, ...]
    rate: float

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, with those of noise."""
        return (*self.system.inputs, *[f"{name}{NOISE}" for name in (*self.sensors, *self.actuators)])

    @property
    def input_units(self) -> tuple[str, ...]:
        """Units of the inputs."""
        y, u = self._ports
        system = self.system
        return (*system.input_units, *[system.output_units[k] for k in y], *[system.input_units[k] for k in u])

    @property
    def _ports(self) -> tuple[list[int], list[int]]:
        system = self.system
        return [system.outputs.index(n) for n in self.sensors], [system.inputs.index(n) for n in self.actuators]

    @property
    def commands(self) -> list[int]:
        """Numbers of the outputs that are what actuators apply."""
        start = len(self.system.outputs) + len(self.sensors)
        return list(range(start, start + len(self.actuators)))

    @property
    def driven(self) -> list[int]:
        """Numbers of the inputs at the actuators."""
        return self._ports[1]

    def system_at(self, values: Mapping[str, float]) -> Any:
        """Return the system for values of the variables."""
        if self.variables is None:
            return self.system
        return in_equilibrium(self.model.with_values(self.variables.values(values)))[1]

    def model_at(self, values: Mapping[str, float]) -> Any:
        """Return the model, or the plant that was given, for values of the variables."""
        if self.variables is None:
            return self.model
        return in_equilibrium(self.model.with_values(self.variables.values(values)))[0]

    @cached_property
    def _nominal(self) -> tuple[Matrices, States | None]:
        return self._equations(self.system)

    def _equations(self, system: Any) -> tuple[Matrices, States | None]:
        base = None
        if self.variables is not None:
            base = states(system.basis, list(range(len(system.inputs))), list(range(len(system.outputs))))
        space = base or equations(system)
        return self._augmented((space.A / self.rate, space.B / self.rate, space.C, space.D)), base

    def _augmented(self, plant: Matrices) -> Matrices:
        a, b, c, d = plant
        y, u = self._ports
        b = np.concatenate((b, np.zeros((len(a), len(y))), b[:, u]), axis=1)
        rows = np.concatenate((d, np.zeros((len(d), len(y))), d[:, u]), axis=1)
        seen, applied = rows[y].copy(), np.zeros((len(u), b.shape[1]))
        seen[:, d.shape[1] : d.shape[1] + len(y)] = np.eye(len(y))
        applied[np.arange(len(u)), u] = 1.0
        return a, b, np.concatenate((c, c[y], np.zeros((len(u), len(a))))), np.concatenate((rows, seen, applied))

    def loop(self, realization: Realization, values: Mapping[str, float]) -> Loop | None:
        """Return the loop with a controller, None where it has no solution."""
        system = self.system_at(values)
        plant, base = self._nominal if self.variables is None else self._equations(system)
        a, b, c, d = realization.matrices
        law = a / self.rate, b / self.rate, c, d
        count, u = len(self.system.outputs), self.driven
        sensors = list(range(count, count + len(self.sensors)))
        if not regular(plant[3][np.ix_(sensors, u)] @ d):
            return None
        closure = Closure(plant, law, sensors, u, list(range(len(plant[2]))), list(range(plant[1].shape[1])))
        return Loop(self, system, base, closure, realization, values)

    def signals(self) -> Signals:
        """Return sizes of actuators and sensors, so that responses between them are about 1 around the mean pole."""
        (a, b, c, d), _ = self._nominal
        y, u = self._ports
        s = 1j * AROUND[:, None, None] * np.eye(len(a)) - a
        with np.errstate(all="ignore"):
            try:
                g = np.abs(c[y] @ np.linalg.solve(s, b[:, u].astype(complex)) + d[np.ix_(y, u)])
            except np.linalg.LinAlgError:
                s = s + 0.01 * AROUND[:, None, None] * np.eye(len(a))
                g = np.abs(c[y] @ np.linalg.solve(s, b[:, u].astype(complex)) + d[np.ix_(y, u)])
        g = np.median(g, axis=0)
        rows, columns = np.nonzero(g > NONE * g.max(initial=0.0))
        matrix = np.zeros((len(rows), len(y) + len(u)))
        matrix[np.arange(len(rows)), rows], matrix[np.arange(len(rows)), len(y) + columns] = 1.0, -1.0
        sizes = np.exp(np.linalg.lstsq(matrix, np.log(g[rows, columns]), rcond=None)[0])
        return Signals(dict(zip(self.actuators, sizes[len(y) :].tolist(), strict=True)),
                       dict(zip(self.sensors, sizes[: len(y)].tolist(), strict=True)))  # fmt: skip


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop of a search, ``base`` the equations of its plant with derivatives to ``values`` of variables."""

    scene: Scene
    system: Any
    base: States | None
    closure: Closure
    law: Realization
    values: Mapping[str, float]

    @cached_property
    def closed(self) -> Matrices:
        """A, B, C, D of the loop, in the scene's unit of time."""
        return self.closure.closed

    @cached_property
    def eigen(self) -> tuple[Complex, Complex, Complex | None]:
        """Eigenvalues, eigenvectors and their inverse, None where they are nearly dependent."""
        return eigen(self.closed[0])

    @property
    def growth(self) -> float:
        """The largest real part of the poles, in parts of the rate."""
        return float(self.eigen[0].real.max(initial=-np.inf))

    @property
    def decays(self) -> bool:
        """Whether all poles decay."""
        return self.growth < -DECAYS * float(np.abs(self.eigen[0]).max(initial=0.0))

    def pole_slope(self, k: int) -> Complex:
        """Return the derivative of a pole to the entries of A."""
        values, vectors, inverse = self.eigen
        if inverse is not None:
            return np.outer(inverse[k], vectors[:, k])
        from scipy.linalg import eig

        others, left, right = eig(self.closed[0], left=True)
        at = int(np.abs(others - values[k]).argmin())
        product = left[:, at].conj() @ right[:, at]
        return np.asarray(np.outer(left[:, at].conj(), right[:, at]) / (product or np.finfo(float).eps))

    def response(self, outputs: list[int], inputs: list[int]) -> Response:
        """Return the response from some inputs to some outputs."""
        a, b, c, d = self.closed
        return Response(a, (b[:, inputs], c[outputs], d[np.ix_(outputs, inputs)]), self.eigen)

    def within(self, gradient: Array, outputs: list[int], inputs: list[int]) -> Array:
        """Return a gradient to [A B; C D] of some outputs and inputs as one of all."""
        a, b, c, _ = self.closed
        n = len(a)
        result = np.zeros((n + len(c), n + b.shape[1]))
        result[np.ix_([*range(n), *[n + k for k in outputs]], [*range(n), *[n + k for k in inputs]])] = gradient
        return result

    def slopes(self, gradient: Array) -> tuple[Array, dict[str, float]]:
        """Return the derivatives to the values of the controller, and to the variables of the model.

        ``gradient``: to [A B; C D] of the loop.
        """
        to_law = self.closure.to_law(gradient)
        to_law[: self.law.order] /= self.scene.rate
        return np.tensordot(self.law.slopes, to_law, axes=2), self._to_variables(gradient)

    def _to_variables(self, gradient: Array) -> dict[str, float]:
        variables, base = self.scene.variables, self.base
        if variables is None or base is None:
            return {}
        y, u = self.scene._ports  # noqa: SLF001
        inside = self.closure.to_plant(gradient)
        n, p, q = len(base.A), len(self.system.outputs), len(self.system.inputs)
        inside[:n] /= self.scene.rate
        rows = inside[: n + p].copy()
        np.add.at(rows, n + np.array(y, dtype=np.intp), inside[n + p : n + p + len(y)])
        columns = rows[:, : n + q].copy()
        np.add.at(columns.T, n + np.array(u, dtype=np.intp), rows[:, n + q + len(y) :].T)
        to = columns[base.first : n, :n], columns[base.first : n, n:], columns[n:, :n], columns[n:, n:]
        result: dict[str, float] = {}
        rates = variables.rates(self.values)
        for _, change in self.system.sensitivity_basis.matrix_derivatives_in_parts(rates, len(rates)):
            parts = changed(base, change, list(range(q)), list(range(p)))
            slope = np.asarray(sum(np.einsum("vij,ij->v", d, g) for d, g in zip(parts, to, strict=True)))
            result |= dict(zip(change.variables, slope.tolist(), strict=True))
        return result


def equations(system: Any) -> Any:
    """Return first-order equations, in modal states where there are such."""
    if kind_of(system) == "state space":
        return system
    try:
        return system.state_space("modal")
    except ResponseError:
        return system.state_space("balanced")


def linearized(plant: Any) -> Any:
    """Return the equations of a model, or what was given if it is linear."""
    if kind_of(plant) == "model":
        plant = plant.linearize()
    linear = a_linear(plant, "tune", "plant")
    if getattr(linear, "period", None) is not None:
        raise ResponseError(f"tune: '{linear.name}' is sampled; expected continuous equations.")
    return linear


def mean_rate(poles: Complex) -> float:
    """Return the geometric mean of the magnitudes of poles [rad/s], 1 if none has one."""
    size = np.abs(poles)
    size = size[size > NONE * size.max(initial=0.0)]
    return float(np.exp(np.log(size).mean())) if len(size) else 1.0
