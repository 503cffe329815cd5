"""Plants as a search sees them: equations with inputs for noise and outputs for commands, and loops with gradients.

Which modes of a plant no controller can change, as no actuator reaches or no sensor sees them.

Source: Hautus' test, Zhou, Doyle & Glover, Robust and Optimal Control (1996), theorem 3.1: rank [A - s, B] at poles s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import a_linear, kind_of
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import Closure, Gathered, Matrices, regular, transfer
from mbsvib.linalg.spectrum import spectrum
from mbsvib.responses.first_order_solver import pole_slope
from mbsvib.responses.realizations import first_order
from mbsvib.responses.state_space import StateSpace
from mbsvib.sensitivities.states import States, changed, states
from mbsvib.studies.design import StudyVariables
from mbsvib.tuning.peaks import Eigen, Response, Weight, eigen
from mbsvib.tuning.realization import Realization
from mbsvib.tuning.structures import Signals

# A pole decays if its real part is below this share of the fastest pole: closed loops at the limit are not wanted.
DECAYS = 1e-10
# Responses between a sensor and an actuator below this share of the largest are none.
NONE = 1e-12
# Points s, in parts of the mean pole and beside undamped ones, at which sizes of signals are taken.
AROUND: Complex = np.asarray((0.01 + 1j) * np.geomspace(0.1, 10.0, 9), dtype=complex)


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

    @cached_property
    def ports(self) -> StateSpace:
        """Equations of which the names and units of the loop's outputs and inputs count alone."""
        law = np.zeros((len(self.actuators), len(self.sensors)))
        loop = self.system.feedback(law, self.sensors, self.actuators, noise=True)
        o, i = len(loop.outputs), len(loop.inputs)
        space = StateSpace.from_arrays(-np.eye(1), np.zeros((1, i)), np.zeros((o, 1)), np.zeros((o, i)), loop.inputs,
                                       loop.outputs, name=self.system.name)  # fmt: skip
        return replace(space, input_units=loop.input_units, output_units=loop.output_units)

    @cached_property
    def _numbers(self) -> tuple[list[int], list[int]]:
        """Those of the sensors among the outputs, and of the actuators among the inputs of the system."""
        system = self.system
        return [system.outputs.index(n) for n in self.sensors], [system.inputs.index(n) for n in self.actuators]

    @cached_property
    def _gathered(self) -> Gathered:
        (y, u), p, q = self._numbers, len(self.system.outputs), len(self.system.inputs)
        return Gathered([*range(p), *y, *[-1] * len(u)], [*range(q), *[-1] * len(y), *u],
                        ([*range(p, p + len(y)), *self.commands], [*range(q, q + len(y)), *u]))  # fmt: skip

    @property
    def commands(self) -> list[int]:
        """Numbers of the outputs that are what actuators apply."""
        start = len(self.system.outputs) + len(self.sensors)
        return list(range(start, start + len(self.actuators)))

    @property
    def driven(self) -> list[int]:
        """Numbers of the inputs at the actuators."""
        return self._numbers[1]

    def plant_at(self, values: Mapping[str, float]) -> tuple[Any, Any]:
        """Return the model, or what was given, and its system for values of the variables."""
        if self.variables is None:
            return self.model, self.system
        return in_equilibrium(self.model.with_values(self.variables.values(values)))

    @cached_property
    def _nominal(self) -> tuple[Matrices, Matrices, States | None]:
        return self._equations(self.system)

    def _equations(self, system: Any) -> tuple[Matrices, Matrices, States | None]:
        """Equations of a system, the same with all ports, and the former with their derivatives."""
        base = None
        if self.variables is not None:
            base = states(system.basis, list(range(len(system.inputs))), list(range(len(system.outputs))))
        space = base or first_order(system)
        plant = space.A / self.rate, space.B / self.rate, space.C, space.D
        return plant, self._gathered.of(plant), base

    def loop(self, law: Realization, slopes: Array, values: Mapping[str, float]) -> Loop | None:
        """Return the loop with a controller and its ``slopes``, None where it has no solution."""
        system = self.plant_at(values)[1]
        plant, whole, base = self._nominal if self.variables is None else self._equations(system)
        a, b, c, d = law.matrices
        y, u = self._numbers
        if not regular(plant[3][np.ix_(y, u)] @ d):
            return None
        seen = [len(system.outputs) + k for k in range(len(y))]
        closure = Closure(whole, (a / self.rate, b / self.rate, c, d), seen, u, list(range(len(whole[2]))),
                          list(range(whole[1].shape[1])))  # fmt: skip
        return Loop(self, system, plant, base, closure, slopes, values)

    def to_plant(self, gradient: Array, plant: Matrices) -> Array:
        """Return the gradient to [A B; C D] of the system, of one to those with all ports."""
        return self._gathered.back(gradient, plant)

    def signals(self) -> Signals:
        """Return sizes of actuators and sensors, so that responses between them are about 1 around the mean pole."""
        a, b, c, d = self._nominal[0]
        y, u = self._numbers
        g = np.abs(transfer((a, b[:, u], c[y], d[np.ix_(y, u)]), AROUND))
        g = np.median(g, axis=0)
        rows, columns = np.nonzero(g > NONE * g.max(initial=0.0))
        matrix = np.zeros((len(rows), len(y) + len(u)))
        matrix[np.arange(len(rows)), rows], matrix[np.arange(len(rows)), len(y) + columns] = 1.0, -1.0
        sizes = np.exp(np.linalg.lstsq(matrix, np.log(g[rows, columns]), rcond=None)[0])
        return Signals(dict(zip(self.actuators, sizes[len(y) :].tolist(), strict=True)),
                       dict(zip(self.sensors, sizes[: len(y)].tolist(), strict=True)))  # fmt: skip


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop of a search: ``plant`` with the derivatives of ``base`` to ``values`` of variables, and a
    controller with ``slopes`` to its own.
    """

    scene: Scene
    system: Any
    plant: Matrices
    base: States | None
    closure: Closure
    slopes: Array
    values: Mapping[str, float]

    @cached_property
    def closed(self) -> Matrices:
        """A, B, C, D of the loop, in the scene's unit of time."""
        return self.closure.closed

    @cached_property
    def eigen(self) -> Eigen:
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

    def pole_slope(self, number: Callable[[Complex], int]) -> tuple[complex, Complex]:
        """Return a pole and its derivatives to A."""
        return pole_slope(self.closed[0], number)

    def growth_slope(self) -> Array:
        """Return the gradient of the growth to [A B; C D]."""
        return self.within(self.pole_slope(lambda poles: int(poles.real.argmax()))[1].real, [], [])

    def part(self, outputs: list[int], inputs: list[int]) -> Matrices:
        """Return A, B, C, D of some outputs and inputs."""
        a, b, c, d = self.closed
        return a, b[:, inputs], c[outputs], d[outputs][:, inputs]

    def response(self, outputs: list[int], inputs: list[int], weight: Weight | None, less: bool) -> Response:
        """Return the weighted response from some inputs to some outputs, ``less`` 1."""
        a, b, c, d = self.part(outputs, inputs)
        return Response((a, b, c, d - np.eye(len(d)) if less else d), self.eigen, weight, self.scene.rate)

    def within(self, gradient: Array, outputs: list[int], inputs: list[int]) -> Array:
        """Return a gradient to [A B; C D] of some outputs and inputs as one of all."""
        a, b, c, _ = self.closed
        n = len(a)
        result = np.zeros((n + len(c), n + b.shape[1]))
        rows, columns = [*range(n), *[n + k for k in outputs]], [*range(n), *[n + k for k in inputs]]
        result[np.array(rows)[:, None], columns] = gradient
        return result

    def to_values(self, gradient: Array) -> tuple[Array, dict[str, float]]:
        """Return the derivatives to the values of the controller, and to the variables of the model.

        ``gradient``: to [A B; C D] of the loop.
        """
        to_law = self.closure.to_law(gradient)
        to_law[: len(self.closure.law[0])] /= self.scene.rate
        return np.tensordot(self.slopes, to_law, axes=2), self._to_variables(gradient)

    def _to_variables(self, gradient: Array) -> dict[str, float]:
        variables, base = self.scene.variables, self.base
        if variables is None or base is None:
            return {}
        whole = self.scene.to_plant(self.closure.to_plant(gradient), self.plant)
        n, p, q = len(base.A), len(self.system.outputs), len(self.system.inputs)
        whole[:n] /= self.scene.rate
        to = whole[base.first : n, :n], whole[base.first : n, n:], whole[n:, :n], whole[n:, n:]
        result: dict[str, float] = {}
        rates = variables.rates(self.values)
        for _, change in self.system.sensitivity_basis.matrix_derivatives_in_parts(rates, len(rates)):
            parts = changed(base, change, list(range(q)), list(range(p)))
            slope = np.asarray(sum(np.einsum("vij,ij->v", d, g) for d, g in zip(parts, to, strict=True)))
            result |= dict(zip(change.variables, slope.tolist(), strict=True))
        return result


def linearized(plant: Any) -> Any:
    """Return the equations of a model, or what was given if it is linear."""
    if kind_of(plant) == "model":
        plant = plant.linearize()
    linear = a_linear(plant, "tune", "plant")
    if getattr(linear, "period", None) is not None:
        raise ResponseError(f"tune: '{linear.name}' is sampled; expected continuous equations.")
    return linear


# A singular value of [A - s, B], states scaled, below this share of its largest is none: poles and shapes are known to
# some roundings times the condition of their eigenvectors.
UNREACHED = 1e-9


def unreached(scene: Scene) -> list[str]:
    """Return the modes, in words, that do not decay and that no actuator reaches or no sensor sees."""
    space = first_order(scene.system)
    y = [scene.system.outputs.index(name) for name in scene.sensors]
    u = [scene.system.inputs.index(name) for name in scene.actuators]
    a, b, c = space.A / scene.rate, _unit(space.B[:, u]), _unit(space.C[y].T).T
    of_a = spectrum(a)
    result = {}
    for value in of_a.values[~of_a.decaying]:
        if value.imag < 0.0:
            continue
        hertz = value.imag * scene.rate / (2.0 * np.pi)
        words = f"the mode at {hertz:.4g} Hz" if hertz > UNREACHED else "a rigid-body mode at 0 Hz"
        if _deficient(a, b, value):
            result[words] = f"no actuator reaches {words}"
        elif _deficient(a.T, c.T, value):
            result[words] = f"no sensor sees {words}"
    return list(result.values())


def _unit(matrix: Array) -> Array:
    """Columns of a matrix of unit size, those of nothing 0."""
    size = np.linalg.norm(matrix, axis=0)
    return np.asarray(matrix / np.where(size > 0.0, size, 1.0))


def _deficient(a: Array, b: Array, value: complex) -> bool:
    matrix: Complex = np.concatenate((a - value * np.eye(len(a)), b), axis=1)
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return bool(sizes[-1] <= UNREACHED * sizes[0])
