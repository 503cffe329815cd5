"""Spin in batches: angular momenta and cross-coupled elements of all variants at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.equations.spin_terms import check_spin, cross_couplings

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array
    from mbsvib.elements.rotor import Rotor
    from mbsvib.equations.batch_values import Values
    from mbsvib.equations.scene import Scene
    from mbsvib.equations.spin_terms import CrossCoupling
    from mbsvib.mechanism.mechanism import Mechanism


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
    rotors = [rotor for rotor in model.rotors.values() if rotor.inertia is None]
    if len(rotors) < 2 or not any(rotor.name in values.index for rotor in rotors):
        return False
    speeds = np.array([_field(rotor, "speed", values) for rotor in rotors])
    return bool((speeds != speeds[:1]).any())


def spin_of_variants(
    model: Mechanism, scene: Scene, values: Values
) -> tuple[list[tuple[int, Array]], list[CrossCoupling]]:
    """Return the angular momenta of rotors and the cross-coupled elements of some variants."""
    number = {body.name: i for i, body in enumerate(scene.bodies)}
    rotors, speed = list(model.rotors.values()), np.zeros(values.count)
    momenta = []
    for rotor in rotors:
        axis, i = np.array(rotor.axis), number[rotor.body]
        own = _field(rotor, "speed", values)
        if rotor.inertia is None:
            speed = own
            factor = scene.inertia.angular[..., i, :, :] @ axis
            moment = np.square(factor).sum(axis=-1)
        else:
            moment = _field(rotor, "inertia", values)
        momenta.append((i, (moment * own)[..., None] * axis))
    at_rest = cross_couplings(model.with_parts(rotors={}), scene.bodies, scene.elements)
    units = {rotor.name: replace(rotor, speed=1.0) for rotor in rotors}
    per_speed = model.with_parts(rotors=units)
    if speed.any():
        check_spin(per_speed, scene.bodies, scene.elements)
    still = {part.name: part.stiffness for part in at_rest}
    couplings = []
    for part in cross_couplings(per_speed, scene.bodies, scene.elements):
        none = still.get(part.name, np.zeros((6, 6)))
        couplings.append(replace(part, stiffness=none + speed[:, None, None] * (part.stiffness - none)))
    return momenta, couplings


def _field(rotor: Rotor, name: str, values: Values) -> Array:
    return np.broadcast_to(values.fields.get(rotor.name, {}).get(name, getattr(rotor, name)), (values.count,))
