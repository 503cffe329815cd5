"""Which further sensor or exciter tells most about the values of a fit.

With the information F = J^T J + 1 of x, of which prior knowledge is taken as 100 % each, a candidate with the rows j
adds log det(1 + j F^-1 j^T): what is not told counts before what is told well. Its noise is the median of that of the
measured channels of its kind.

Source: Atkinson, Donev & Tobias, Optimum Experimental Designs, with SAS (2007), section 10 (D-optimality).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np

from mbsvib.common.display import Displayed
from mbsvib.common.selection import selected
from mbsvib.errors import ResponseError
from mbsvib.fitting.problem import Problem
from mbsvib.fitting.response_data import ResponseData
from mbsvib.fitting.responses import responses
from mbsvib.linalg.rank import TIE_BREAK

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array


@dataclass(frozen=True, slots=True, repr=False)
class Candidate(Displayed):
    """A further channel: its ``name``, its ``gain`` of information log det, and the factor by which the widest interval
    would become narrower, ``narrower``, of the value ``widest``.
    """

    name: str
    gain: float
    narrower: float
    widest: str


def ranked(problem: Problem, x: Array, candidates: Any = None) -> tuple[Candidate, ...]:
    """Return candidates in the order of what they tell, the best first.

    ``candidates``: names or patterns of outputs and inputs of the model; None: all without data.
    """
    data = [part for part in problem.data if isinstance(part, ResponseData)]
    if not data:
        raise ResponseError("next_sensor: no frequency responses were fitted, at whose lines a sensor could be added.")
    information = np.eye(len(x)) + problem.sums(x, far=False).normal
    before = np.linalg.inv(information)
    variances = before.diagonal()
    widest = int((variances >= (1.0 - TIE_BREAK) * variances.max()).argmax())
    equations = problem.scenes[data[0].scene](problem.variables.map @ problem.variables.values(x), None)[0]
    bare = replace(problem.variables, prior=np.full_like(problem.variables.prior, np.nan))
    result = []
    for kind, known in (("output", equations.outputs), ("input", equations.inputs)):
        for number in _chosen(candidates, kind, known, equations):
            parts = tuple([part for one in data if (part := _with(one, kind, number, equations)) is not None])
            if not parts:
                continue
            more = information + replace(problem, data=parts, variables=bare).sums(x, far=False).normal
            gain = float(np.linalg.slogdet(more)[1] - np.linalg.slogdet(information)[1])
            after = np.linalg.inv(more)
            result.append(Candidate(known[number], gain, float(np.sqrt(before[widest, widest] / after[widest, widest])),
                                    problem.variables.names[widest]))  # fmt: skip
    if not result:
        raise ResponseError("next_sensor: no candidate is left; expected outputs or inputs of the model without data.")
    return tuple(sorted(result, key=lambda one: -float(f"{one.gain:.6g}")))  # equal gains: in the order of the model


def _chosen(candidates: Any, kind: str, known: tuple[str, ...], equations: Any) -> list[int]:
    first = 0 if kind == "output" else len(equations.outputs)
    ports = selected(candidates, equations.outputs + equations.inputs, "output or input", equations.name)
    return [number - first for number in ports if 0 <= number - first < len(known)]


def _with(data: ResponseData, kind: str, number: int, equations: Any) -> ResponseData | None:
    """The data that a further output or input would give; None where it has data.

    Its noise, and the factor to what would be measured, are those of measured channels of its unit; where there are
    none, its noise is as large against its responses as that of the others.
    """
    axis, units = (1, equations.output_units) if kind == "output" else (2, equations.input_units)
    measured = (data.rows if kind == "output" else data.columns).tolist()
    if number in measured:
        return None
    alike = [k for k, other in enumerate(measured) if units[other] == units[number]]
    weight, sign = (np.moveaxis(array, axis, 0) for array in (data.weight, data.sign))
    chosen = np.where(weight > 0.0, weight, np.nan)[alike or slice(None)]
    if not alike:
        chosen = chosen * np.moveaxis(np.abs(data.measured), axis, 0)
    with np.errstate(all="ignore"), catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # lines without data
        typical = np.nan_to_num(np.nanmedian(chosen, axis=0))[None]
    end: dict[str, Any] = {"rows": np.array([number])} if kind == "output" else {"columns": np.array([number])}
    channels = data.channels.of_new_output() if kind == "output" else data.channels.of_new_input()
    factor = sign[alike[0]][None] if alike else np.ones(sign[:1].shape)
    weight, sign = np.moveaxis(typical, 0, axis), np.moveaxis(factor, 0, axis)
    result: ResponseData = replace(data, weight=weight, sign=sign.astype(complex), whitening=None, channels=channels,
                                   measured=np.zeros(weight.shape, dtype=complex), **end)  # fmt: skip
    if alike:
        return result
    size = np.abs(responses(equations, data.omega, result.rows, result.columns))
    return replace(result, weight=np.where(size > 0.0, result.weight / np.where(size > 0.0, size, 1.0), 0.0))
