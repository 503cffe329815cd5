"""Controllable and observable part of many bodies: machines coupled only through ground move independently.

A sparse system only knows the graph of joints and springs. So entire bodies are removed, and not single directions as
in ``equations.controllable_part``. Ports on removed bodies are moved to ground: an input has no effect there,
and an output is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csr_matrix

from mbsvib.common.arrays import Index
from mbsvib.elements.shared_rows import carriers
from mbsvib.equations.equations import Removed
from mbsvib.equations.selection import selected_ports
from mbsvib.errors import ResponseError
from mbsvib.linalg.groups import part_numbers
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.sparse.assembly import linearized
from mbsvib.sparse.equations import SparseEquations

S = TypeVar("S", bound=SparseEquations)


def reachable(
    system: S, outputs: str | Sequence[str] | None = None, inputs: str | Sequence[str] | None = None
) -> S:
    """Return the equations of the bodies controllable and observable for some inputs and outputs, with these ports."""
    model = system.model
    i = {system.inputs[k] for k in selected_ports(system.inputs, inputs, "inputs", system.name, system.outputs)}
    o = {system.outputs[k] for k in selected_ports(system.outputs, outputs, "outputs", system.name, system.inputs)}
    part_of = _parts(model)
    actuated = np.concatenate([_parts_with(model, part, part_of) for name, part in model.inputs.items() if name in i])
    measured = np.concatenate([_parts_with(model, part, part_of) for name, part in model.outputs.items() if name in o])
    controllable, observable = ({name for name, part in part_of.items() if part in parts}
                                for parts in (set(actuated), set(measured)))
    removed = Removed(
        tuple(name for name in system.inputs if name in i), tuple(name for name in system.outputs if name in o),
        tuple(name for name in model.bodies if name not in controllable),
        tuple(name for name in model.bodies if name in controllable and name not in observable),
    )  # fmt: skip
    if not controllable & observable:
        raise ResponseError(f"reachable: '{system.name}' has no part that is controllable and observable with the "
                            f"given inputs and outputs: y = D u.")  # fmt: skip
    remaining = _without(model, set(removed.names), i, o)
    removed = removed.after(system.removed)
    cut = [name for name in system.cut_joints if name in remaining.joints]
    return replace(linearized(remaining, cut or None, frozenset(removed.names), type(system)), removed=removed)


def _parts(model: Mechanism) -> dict[str, int]:
    """Number of the part of every body: bodies connected by joints and springs other than through ground."""
    number = {name: k for k, name in enumerate(model.bodies)}
    links = [(number[part.first], number[part.second]) for part in (*model.joints.values(), *model.springs.values())
             if part.first in number and part.second in number]  # fmt: skip
    for coupler in model.couplers.values():
        joints = [model.joints[name.rpartition(".")[0]] for name, _ in coupler.terms]
        measured = [number[body] for joint in joints for body in (joint.first, joint.second) if body in number]
        links += [(measured[0], body_number) for body_number in measured[1:]]
    row, column = np.array(links, dtype=np.intp).reshape(-1, 2).T
    n = len(number)
    part = part_numbers(csr_matrix((np.ones(len(links), dtype=bool), (row, column)), shape=(n, n)))
    return dict(zip(number, part.tolist(), strict=True))


def _parts_with(model: Mechanism, part: Any, part_of: dict[str, int]) -> Index:
    """Numbers of the parts with a port; base motion and the force on the ground have all."""
    if part.element is not None:
        element = model.springs.get(carriers(model.expansion, part.element)[0]) or model.joints.get(part.element)
        ends = (part.element,) if element is None else (element.first, element.second)
    else:
        ends = ("ground",) if part.moves_ground else (part.body, part.relative_to)
    if ends == ("ground",):
        return np.array(sorted(set(part_of.values())), dtype=np.intp)
    return np.array([part_of[name] for name in ends if name in part_of], dtype=np.intp)


def _without(model: Mechanism, removed: set[str], inputs: set[str], outputs: set[str]) -> Mechanism:
    """The model without some bodies and their joints; other elements on these bodies are attached to ground."""
    bodies = {name: body for name, body in model.bodies.items() if name not in removed}
    joints = {name: joint for name, joint in model.joints.items() if not {joint.first, joint.second} & removed}
    couplers = {name: coupler for name, coupler in model.couplers.items()
                if all(term.rpartition(".")[0] in joints for term, _ in coupler.terms)}  # fmt: skip
    loads = {name: load for name, load in model.loads.items() if load.body not in removed}
    # a spring to a removed body has no effect, but one with a node would keep it
    springs = {name: spring for name, spring in model.springs.items()
               if not (spring.body_positions and {spring.first, spring.second} & removed)}  # fmt: skip

    def with_position(part: Any) -> Any:
        if part.element is not None or part.position is not None:
            return part
        body = part.body if part.body in model.bodies else part.relative_to
        return replace(part, position=model.bodies[body].position)

    selected_inputs = {name: with_position(part) for name, part in model.inputs.items() if name in inputs}
    selected_outputs = {name: with_position(part) for name, part in model.outputs.items() if name in outputs}
    return model.with_parts(bodies=bodies, joints=joints, springs=springs, couplers=couplers, loads=loads,
                            inputs=selected_inputs, outputs=selected_outputs)  # fmt: skip
