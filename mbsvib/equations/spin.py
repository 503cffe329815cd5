"""Spin of one model or of many variants: the step of the assembly, and variants that are to be checked alone."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.equations.spin_terms import check_spin, cross_couplings, momenta, with_antisymmetric_terms
from mbsvib.equations.steady_spin import NONE, spin_velocities
from mbsvib.equations.wrenches import has_antisymmetric_forces

if TYPE_CHECKING:
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.draft import Draft
    from mbsvib.equations.spin_terms import Spin
    from mbsvib.mechanism.mechanism import Mechanism


def with_spin(draft: Draft) -> Draft:
    """Return equations of motion with the antisymmetric terms of rotors and elements."""
    model, scene, fields = draft.model, draft.scene, draft.varied.fields
    rotors = {name: replace(part, speed=_largest(fields.get(name, NONE).get("speed", part.speed)))
              for name, part in model.rotors.items()}  # fmt: skip
    check_spin(model.with_parts(rotors=rotors) if fields else model, scene.bodies, scene.elements)
    return replace(draft, terms=with_antisymmetric_terms(scene, draft.reduction, draft.terms, *spin_of(draft),
                                                         model.expansion))  # fmt: skip


def _largest(speed: Any) -> float:
    values = np.ravel(np.real(speed))
    return float(values[np.abs(values).argmax()])


def spin_of(draft: Draft) -> Spin:
    """Return the angular momenta of rotors, and the cross-coupled elements."""
    if not draft.model.derived(has_antisymmetric_forces):
        return [], []
    bodies, fields = draft.scene.bodies, draft.varied.fields
    return momenta(draft.model, bodies, fields), cross_couplings(draft.model, bodies, draft.scene.elements, fields)


def spins_otherwise(model: Mechanism, values: Values) -> bool:
    """Return whether variants differ in more than speeds and momenta, so that each is to be checked by itself.

    Bodies that themselves spin must stay symmetric about their axis, and so must all that acts on them; they spin at
    one speed. Elements with cross-coupling stay as they are.
    """
    spinning = {rotor.body for rotor in model.rotors.values() if rotor.inertia is None}
    touched = spinning | {part.name for parts in (model.joints, model.springs) for part in parts.values()
                          if spinning & {part.first, part.second}}  # fmt: skip
    touched |= {part.name for part in model.springs.values() if part.cross_coupling is not None}
    if touched & values.index.keys():
        return True
    speeds = list(spin_velocities(model, values.fields).values())
    sizes = [np.linalg.norm(speed, axis=-1) for speed in speeds]
    return any(rotor in values.index for rotor in model.rotors) and any((size != sizes[0]).any() for size in sizes)
