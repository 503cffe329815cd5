"""Model files, .yaml or .json: the words of ``Model(...)`` and of the ``add_...`` calls, one entry a part.

A file holds the sections bodies, beams, superelements, joints, springs, loads, inputs, outputs and more, by need; each
maps names to the words of the call that adds such a part, with the same units (SI, radians), axes and defaults. The
order inside a section is the order of the parts, the order of the sections does not matter. ``type`` names the call
where a section has two::

    mbsvib: 1                       # format version; 1 if left out
    name: isolator                  # the file's name if left out
    bodies:
      platform:
        mass: 12
        inertia: [0.3, 0.3, 0.5]
        position: [0, 0, 0.25]
    beams:
      mast: {a: platform, start: [0, 0, 0.3], end: [0, 0, 1.3], elements: 6,
             section: {type: tube, radius: 0.02, wall: 0.002}, material: {E: 2.1e11, nu: 0.3, rho: 7800}}
    joints:
      guide: {kind: prismatic, first: ground, second: platform, axis: [0, 0, 1]}
    springs:
      leg: {first: ground, second: platform, start: [0, 0, 0], end: [0, 0, 0.2], stiffness: 2e7, damping: 20}
      mount: {type: bushing, first: ground, second: platform, position: [0, 0, 0], stiffness: [1e6, 0, 0, 0, 0, 0]}
      relief: {type: maxwell, first: ground, second: platform, start: [0, 0, 0], end: [0, 0, 0.2], stiffness: 1e6,
               damping: 100}
    inputs:
      Fz: {body: platform, direction: z}
      shaker: {type: base_motion, direction: z}
    outputs:
      z: {body: platform, direction: z, quantity: acceleration}
      leg.force: {type: force_output, element: leg}

A joint of free directions needs no kind: ``free: [x, rz]`` will do. Parts that share words can share them by an anchor
and a merge key (``leg1: &leg {...}``, ``leg2: {<<: *leg, position: [...]}``). Editors check a file against
``schema()``.

What is several parts has sections as well: ``models`` has copies of other models, each from a file or with its sections
in place, and ``drives`` has ball screws, belts and gear pairs. Paths are relative to the folder of the file. ``save``
writes their parts in full: ``models: {left: {other: wheel.yaml, ground: chassis, mirror: y}}``.
"""

from mbsvib.files.loading import load
from mbsvib.files.saving import save
from mbsvib.files.schema_ import schema

__all__ = ["load", "save", "schema"]
