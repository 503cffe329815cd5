"""Scenes with massless bodies."""

import mbsvib as mv


def along_z(masses, springs, relative=False):
    """Bodies on rails along z, each on one to ground or to the one before; springs: (first, second, k, c)."""
    model = mv.Model("line")
    positions = {"ground": 0.0}
    before = "ground"
    for i, (name, mass) in enumerate(masses.items()):
        positions[name] = i + 1.0
        model.add_body(name, mass, (mass, mass, mass), position=(0, 0, i + 1))
        model.add_joint(f"{name}.rail", "prismatic", before, name)
        before = name if relative else "ground"
    for name, (first, second, k, c) in springs.items():
        model.add_spring(name, first, second, start=(0, 0, positions[first]), end=(0, 0, positions[second] + 0.25),
                         stiffness=k, damping=c)  # fmt: skip
    return model
