"""Relaxation legs as their parts, whose derivatives are known: springs, dampers and massless nodes between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.elements import Maxwell
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.api.model import Model
    from mbsvib.elements import Bushing, Spring


def unfolded(model: Model) -> Model:
    """Return a model whose Maxwell elements are springs and dampers with a massless node between them.

    Its motion is the same. A Maxwell element NAME becomes the springs ``NAME.static`` (if it has such a stiffness) and
    ``NAME.spring``, the damper ``NAME.damper``, and the body ``NAME.node`` that slides along the line on
    ``NAME.guide``; stiffness and damping of these are variables of a passive design.

    Parameters
    ----------
    model : Model
        The mechanism, which is not changed.

    Returns
    -------
    Model
        A copy.

    Raises
    ------
    ModelError
        If an input, output or other part names a Maxwell element.
    """
    springs: Mapping[str, Bushing | Spring | Maxwell] = model.springs
    result = model.with_parts(springs={name: part for name, part in springs.items() if not isinstance(part, Maxwell)})
    for part in [part for part in springs.values() if isinstance(part, Maxwell)]:
        ports = [port.name for port in (*model.inputs.values(), *model.outputs.values())
                 if part.name in port.constructor_kwargs().values()]  # fmt: skip
        if ports:
            raise ModelError(f"unfolded: '{ports[0]}' names the Maxwell element '{part.name}', which becomes several "
                             f"parts; leave this port out.", element=ports[0])  # fmt: skip
        start, end = np.array(part.start), np.array(part.end)
        middle = 0.5 * (start + end)
        node = f"{part.name}.node"
        if part.static_stiffness:
            result.add_spring(f"{part.name}.static", part.first, part.second, start, end, part.static_stiffness)
        result.add_body(node, 0.0, (0.0, 0.0, 0.0), middle)
        result.add_joint(f"{part.name}.guide", "prismatic", part.first, node, middle, axis=part.line)
        result.add_spring(f"{part.name}.spring", part.first, node, start, middle, part.stiffness)
        result.add_spring(f"{part.name}.damper", node, part.second, middle, end, damping=part.damping)
    return result
