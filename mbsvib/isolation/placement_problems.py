"""What candidates for sensors and actuators tell about modes and parameters, and what control can reach with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import eig

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import a_linear
from mbsvib.common.selection import PATTERN, Names, selected
from mbsvib.errors import ResponseError
from mbsvib.isolation.placement_criteria import BestControl, Experiments, Gramians, Information, Weighted
from mbsvib.linalg.balancing import scaled
from mbsvib.linalg.rank import AT_NODE, LEAST_DAMPING, SAME_EIGENVALUE
from mbsvib.random.moments import in_rows
from mbsvib.random.sources import sources
from mbsvib.responses.feedthrough import direct
from mbsvib.responses.realizations import first_order

Evaluate = Callable[[Array, Array], tuple[float, dict[str, float]]]


def score_of(loss: float, larger: bool) -> float:
    """Return the score of a loss: a share of information, or the root of a cost."""
    return float(np.exp(-loss) if larger else np.sqrt(loss))


def evaluation(scene: Candidates, criterion: Any, targets: tuple[str, ...]) -> Evaluate:
    """The score and the values of a set."""
    if not isinstance(criterion, BestControl):
        return lambda s, a: (score_of(float(criterion.losses(s[None], a[None])[0, 0]), True), criterion.values(s, a))

    def evaluate(s: Array, a: Array) -> tuple[float, dict[str, float]]:
        loss = float(criterion.losses(s[None], a[None])[0, 0])
        if not loss < np.inf:
            return np.inf, dict.fromkeys(targets, np.inf)
        z, u = criterion.mean_squares(s, a)
        values = dict(zip(targets, np.sqrt(z) * scene.allowed, strict=True))
        if criterion.acting:
            values |= {scene.inputs[k]: float(np.sqrt(u[k]) * scene.ranges[k]) for k in np.flatnonzero(a)}
        return score_of(loss, False), {name: float(value) for name, value in values.items()}

    return evaluate


@dataclass(eq=False)
class Candidates:
    """Candidates, how many are ``chosen``, densities of noise and ranges; all ports of a side that is not chosen."""

    system: Any
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    chosen: tuple[int, int]
    noise: Array
    ranges: Array
    stated: tuple[bool, bool]
    allowed: Array = field(default_factory=lambda: np.zeros(0))

    @staticmethod
    def of(system: Any, candidates: Names, chosen: tuple[int, int], noise: Any, ranges: Any) -> Candidates:
        """Check candidates and the numbers of those that are chosen."""
        a_linear(system, "placement")
        if getattr(system, "period", None) is not None:
            raise ResponseError(f"placement: '{system.name}' is sampled; expected a plant in continuous time.")
        names = check.names_in([candidates] if isinstance(candidates, str) else candidates)
        if names is None:
            raise ResponseError(f"placement: candidates = {check.shown(candidates)}; expected names or patterns of "
                                f"outputs and inputs.")  # fmt: skip
        sides, amounts = [], []
        for side, (count, given) in enumerate(zip(chosen, (noise, ranges), strict=True)):
            (word, kind, *_), known = SIDES[side], _ports(system, side)[0]
            picked = _picked(names, system, side)
            if check.count(count, "placement", word, 0) > len(picked):
                raise ResponseError(f"placement: {word} = {count}, yet the candidates have {len(picked)} {kind}s of "
                                    f"'{system.name}': {', '.join(picked) or 'none'}.")  # fmt: skip
            sides.append(picked if count else tuple(known))
            amounts.append(_amounts(system, sides[side], side, given))
        if not any(chosen):
            raise ResponseError("placement: sensors = 0 and actuators = 0; expected how many of each are chosen.")
        return Candidates(system, sides[0], sides[1], (int(chosen[0]), int(chosen[1])), amounts[0], amounts[1],
                          (noise is not None, ranges is not None))  # fmt: skip

    def comparable(self, side: int, always: bool = False) -> None:
        """Refuse candidates of several units without their noise or ranges, or without them at all."""
        (word, _, field, expected), names = SIDES[side], (self.outputs, self.inputs)[side]
        units = dict(zip(*_ports(self.system, side), strict=True))
        kinds = list(dict.fromkeys(units[name] for name in names))
        if not self.stated[side] and (always or len(kinds) > 1):
            reason = "" if len(kinds) == 1 else f" the {word} have the units {', '.join(kinds)}, and"
            raise ResponseError(f"placement:{reason} {field} is not given; expected the {expected.format('unit')} of "
                                f"each {word[:-1]}, such as {field}={{'{names[0]}': 1e-6}}.")  # fmt: skip


# Of sensors and actuators: their ports, what is stated of these, and in which unit.
SIDES = (("sensors", "output", "noise", "density [({})^2/Hz]"), ("actuators", "input", "ranges", "range [{}]"))


def _ports(system: Any, side: int) -> tuple[Sequence[str], Sequence[str]]:
    """Names and units of the outputs or inputs."""
    return ((system.outputs, system.output_units), (system.inputs, system.input_units))[side]


def _picked(names: list[str], system: Any, side: int) -> tuple[str, ...]:
    """The outputs or inputs that candidates name; refused where a candidate names neither."""
    picked: list[str] = []
    for name in names:
        try:
            known = _ports(system, side)[0]
            picked += [known[k] for k in selected(name, known, SIDES[side][1], system.name)]
        except ResponseError:
            try:
                selected(name, _ports(system, 1 - side)[0], SIDES[side][1], system.name)
            except ResponseError:
                raise ResponseError(f"placement: the candidate {name!r} is neither an output nor an input of "
                                    f"'{system.name}'. Outputs: {', '.join(system.outputs) or 'none'}. "
                                    f"Inputs: {', '.join(system.inputs) or 'none'}.") from None  # fmt: skip
    return tuple(dict.fromkeys(picked))


def _amounts(system: Any, names: tuple[str, ...], side: int, given: Any, word: str | None = None) -> Array:
    """Positive numbers of some ports by name or pattern, a name before patterns; ones if none are given."""
    (_, kind, field, expected), (known, units) = SIDES[side], _ports(system, side)
    word = word or field
    if given is None:
        return np.ones(len(names))
    if not isinstance(given, Mapping):
        raise ResponseError(f"placement: {word} = {check.shown(given)}; expected {{name or pattern: number}}.")
    result: dict[str, float] = {}
    for pattern in sorted(given, key=lambda key: not PATTERN.intersection(str(key))):
        value = check.number(given[pattern], "placement", f"{word} of '{pattern}'")
        if not value > 0.0:
            raise ResponseError(f"placement: {word} of '{pattern}' = {value:g}; expected a positive number.")
        result |= {known[k]: value for k in selected(pattern, known, kind, system.name)}
    for name in names:
        if name not in result:
            what = expected.format(units[list(known).index(name)])
            raise ResponseError(f"placement: {word} has nothing for '{name}'; expected its {what}.")
    return np.array([result[name] for name in names])


def by_modes(scene: Candidates, modes: Any) -> tuple[Gramians, str]:
    """The Gramians of modes, W_ij = -v_i^* v_j / (lambda_i^* + lambda_j), with states of one decay each."""
    system = scene.system
    values, labels = _eigenvalues(system, modes)
    space = first_order(system)
    rate = float(np.abs(values).max())
    a, b, c = scaled(space.A / rate, space.B, space.C)
    found, left, right = eig(a, left=True, right=True)
    numbers: list[int] = []
    for value in values:
        distance = np.abs(found - value / rate)
        distance[numbers] = np.inf
        numbers.append(int(distance.argmin()))
    values = values / rate
    decay = np.maximum(-values.real, LEAST_DAMPING * np.abs(values))
    poles = -decay + 1j * values.imag
    factor = 2.0 * np.sqrt(decay[:, None] * decay) / -(poles.conj()[:, None] + poles)

    def side(chosen: int, kind: str, vectors: Complex, ports: Array, weights: Array) -> Information | None:
        if not chosen:
            return None
        scene.comparable(0 if kind == "seen" else 1)
        shown = ports @ vectors
        terms = np.abs(ports) @ np.abs(vectors)
        shown[np.abs(shown) <= AT_NODE * terms] = 0.0
        shown = shown * weights[:, None]
        turned = factor if kind == "seen" else factor.conj()
        return Information(shown.conj()[:, :, None] * shown[:, None, :] * turned, labels).scaled(kind)

    rows = [system.outputs.index(name) for name in scene.outputs]
    columns = [system.inputs.index(name) for name in scene.inputs]
    sensors = side(scene.chosen[0], "seen", right[:, numbers], c[rows], 1.0 / np.sqrt(scene.noise))
    actuators = side(scene.chosen[1], "driven", left[:, numbers], b[:, columns].T, scene.ranges)
    words = "observability and controllability" if sensors and actuators else (
        "observability" if sensors else "controllability")  # fmt: skip
    return Gramians(sensors, actuators), f"{words} of {len(labels)} mode{'s' * (len(labels) > 1)}"


def _eigenvalues(system: Any, modes: Any) -> tuple[Complex, dict[str, list[int]]]:
    """The eigenvalues of some modes, and the places of each mode, of one frequency together."""
    known = system.modes()
    chosen = _numbers(known, modes)
    starts, values = known.starts, known.eigenvalues
    groups: list[list[int]] = []
    for k in range(len(known)):
        own = values[starts[k]]
        if groups and abs(own - values[starts[groups[-1][-1]]]) <= SAME_EIGENVALUE * abs(own):
            groups[-1].append(k)
        else:
            groups.append([k])
    picked: list[int] = []
    labels = {}
    for group in groups:
        named = [k for k in group if k in chosen]
        if named and named != group:
            raise ResponseError(f"placement: modes {', '.join(str(k + 1) for k in group)} have one frequency, and any "
                                f"combination of them is a mode; expected all of them.")  # fmt: skip
        if named:
            places = [n for k in group for n in range(starts[k], starts[k + 1])]
            label = f"mode{'s' * (len(group) > 1)} {', '.join(str(k + 1) for k in group)}"
            labels[label] = list(range(len(picked), len(picked) + len(places)))
            picked += places
    return np.asarray(values[picked]), labels


def _numbers(known: Any, modes: Any) -> list[int]:
    """Numbers from 0 of the modes that are named, which decay or vibrate."""
    vibrating = [k for k in range(len(known)) if known.frequencies[k] > 0.0]
    if isinstance(modes, str):
        if modes != "*":
            raise ResponseError(f"placement: modes = {modes!r}; expected numbers from 1 to {len(known)}, or '*' for "
                                f"all.")  # fmt: skip
        chosen = vibrating
    else:
        several = [modes] if isinstance(modes, (int, np.integer)) else modes
        chosen = [check.count(one, "placement", "modes", 1) - 1
                  for one in check.listed(several, "placement", "modes", "numbers of modes")]  # fmt: skip
    if not chosen:
        raise ResponseError("placement: no mode is named; expected numbers from 1 on.")
    for k in chosen:
        if k >= len(known):
            raise ResponseError(f"placement: mode {k + 1}: '{known.name}' has {len(known)} modes.")
        if k not in vibrating or known.growing[k]:
            word = "is unstable" if known.growing[k] else "is a rigid motion"
            raise ResponseError(f"placement: mode {k + 1} {word}, which has no Gramian; expected modes that decay or "
                                f"vibrate. Close a loop that stabilises it first.")  # fmt: skip
    return chosen


def by_parameters(scene: Candidates, parameters: Any, f: Array) -> tuple[Experiments, str]:
    """Information about parameters, in any units of theirs, of each sensor while each actuator excites."""
    system = scene.system
    if not hasattr(system, "frequency_response_sensitivities"):
        raise ResponseError(f"placement: parameters: '{system.name}' has no parameters of a mechanism; expected a "
                            f"system, model.linearize().")  # fmt: skip
    scene.comparable(0)
    scene.comparable(1)
    names = [list(system.parameters)[k] for k in selected(parameters, list(system.parameters), "parameter",
                                                          system.name)]  # fmt: skip
    slopes = system.frequency_response_sensitivities(2.0 * np.pi * f, names, list(scene.outputs), list(scene.inputs))
    slopes = slopes * scene.ranges[:, None] / np.sqrt(scene.noise)[:, None, None]
    matrices = np.einsum("psaf,qsaf->sapq", slopes.conj(), slopes).real
    flat = Information(matrices.reshape(-1, *matrices.shape[2:]), {name: [k] for k, name in enumerate(names)})
    flat = flat.scaled("seen")
    return Experiments(flat.matrices.reshape(matrices.shape), flat.parts, flat.reference), \
        f"identifiability of {len(names)} parameter{'s' * (len(names) > 1)}"  # fmt: skip


def by_rms(scene: Candidates, rms: Any, floor: Any) -> tuple[BestControl, tuple[str, ...], str]:
    """The plant with the filters of its noise, balanced, in time units of its fastest pole."""
    system, (sensing, acting) = scene.system, scene.chosen
    if not isinstance(rms, Mapping) or not rms:
        raise ResponseError(f"placement: rms = {check.shown(rms)}; expected {{output: allowed root mean square}}.")
    targets = tuple(dict.fromkeys(system.outputs[k] for name in rms
                                  for k in selected(name, system.outputs, "output", system.name)))  # fmt: skip
    scene.allowed = _amounts(system, targets, 0, rms, "rms")
    for side, count in enumerate((sensing, acting)):
        if count:
            scene.comparable(side, always=True)
    under = sources(floor, system.inputs, system.input_units, system.name)
    for name, part in zip(under.names, under.densities, strict=True):
        if part.filter is None:
            raise ResponseError(f"placement: the noise at '{name}' is not filtered white noise, which best control "
                                f"needs; expected a number (white) or isolation.shaped.")  # fmt: skip
        if acting and name in scene.inputs:
            raise ResponseError(f"placement: '{name}' is a candidate and has noise; expected noise at other inputs, "
                                f"which acts whatever is chosen.")  # fmt: skip
    space, through = first_order(system), direct(system)
    w, u = ([system.inputs.index(name) for name in names] for names in (under.names, scene.inputs))
    y, z = ([system.outputs.index(name) for name in names] for names in (scene.outputs, targets))
    drive = in_rows(tuple([part.filter for part in under.densities]), levels=True)
    n, k = len(space.A), len(drive.a)
    a = np.block([[space.A, space.B[:, w] @ drive.c], [np.zeros((k, n)), drive.a]])
    b1 = np.concatenate((space.B[:, w] @ drive.d, drive.b))
    b2 = np.concatenate((space.B[:, u], np.zeros((k, len(u)))))
    white = through[:, w] @ drive.d
    for row, name in zip(z, targets, strict=True):
        if white[row].any():
            source = under.names[int(np.flatnonzero(white[row])[0])]
            raise ResponseError(f"placement: white noise at '{source}' acts directly on '{name}', whose root mean "
                                f"square is infinite; give it a filter, isolation.shaped.")  # fmt: skip
    c = np.concatenate((space.C, through[:, w] @ drive.c), axis=1)
    rate = float(np.abs(np.linalg.eigvals(a)).max(initial=0.0)) or 1.0
    a, b, c = scaled(a / rate, np.concatenate((b1 / np.sqrt(rate), b2 / rate), axis=1), c)
    size = 1.0 / scene.allowed[:, None]
    plant = Weighted(
        a, b[:, : b1.shape[1]], b[:, b1.shape[1] :] * scene.ranges, size * c[z], size * through[np.ix_(z, u)] *
        scene.ranges, c[y], white[y] * np.sqrt(rate), 0.5 * rate * scene.noise, np.ones(len(u)),
    )  # fmt: skip
    words = "reached" if acting else "of the error of estimates"
    return BestControl(plant, bool(sensing), bool(acting)), targets, f"root mean squares {words}"
