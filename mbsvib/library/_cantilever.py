"""A cantilever with a mass at its tip."""

from __future__ import annotations

from mbsvib.api.model import Model
from mbsvib.library._families import positive


def cantilever(
    *, length: float = 10.0, radius: float = 0.175, wall: float = 0.015, tip_mass: float = 1000.0, elements: int = 20,
    shear: bool = False, damping_ratio: float = 0.0,
) -> Model:  # fmt: skip
    """Build a steel tube that is clamped at one end and carries a mass at the other: 6 degrees of freedom an element.

    By default the lowest frequencies are 1.655433398 Hz, twice, 16.071161667 Hz, twice, and 50.023996028 Hz, twice;
    76.472717539 Hz along the tube and 80.468757907 Hz of torsion (consistent mass, 20 elements).

    Parameters
    ----------
    length : float
        Of the tube [m], along x.
    radius, wall : float
        Outer radius and thickness [m].
    tip_mass : float
        Mass at the tip [kg], a point.
    elements : int
        How many elements.
    shear : bool
        True: Timoshenko's beam, False: Euler's and Bernoulli's.
    damping_ratio : float
        Damping ratio of the tube's elastic modes.

    Returns
    -------
    Model
        Beam ``tube`` and body ``tip``; inputs ``Fy`` and ``Fz`` at the tip, outputs ``y`` and ``z`` there and
        ``root.shear``, the shear force along z in the first element.

    Raises
    ------
    ModelError
        If the length is not positive, or a value is refused by the part it is for.

    Source: Societe francaise des mecaniciens, "Guide de validation des progiciels de calcul de structures", case
    SDLL 15 without eccentricity, for the data.
    """
    end = (positive(length, "cantilever", "length", "m"), 0.0, 0.0)
    model = Model("cantilever")
    model.add_body("tip", tip_mass, (0.0, 0.0, 0.0), end)
    model.add_beam("tube", "ground", "tip", {"type": "tube", "radius": radius, "wall": wall},
                   {"E": 2.1e11, "nu": 0.3, "rho": 7800.0}, (0.0, 0.0, 0.0), end, elements=elements, shear=shear,
                   damping_ratio=damping_ratio)  # fmt: skip
    for direction in ("y", "z"):
        model.add_input(f"F{direction}", "tip", direction)
        model.add_output(direction, "tip", direction)
    model.add_force_output("root.shear", "tube.e1", "z")
    return model
