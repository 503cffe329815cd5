"""The quarter car: body, wheel, suspension and tyre on one vertical line."""

from __future__ import annotations

from mbsvib.api.model import Model


def quarter_car(
    *, body_mass: float = 317.5, wheel_mass: float = 45.4, suspension_stiffness: float = 22e3,
    suspension_damping: float = 0.0, tyre_stiffness: float = 192e3, tyre_damping: float = 0.0,
) -> Model:  # fmt: skip
    """Build a quarter car with an actuator in its suspension, on a road that moves: 2 degrees of freedom.

    The wheel slides along z against the ground (joint ``hub``), the body along z against the wheel (joint ``strut``);
    the ground is the road. Inputs: ``road``, the road's vertical acceleration; ``actuator``, a force that pushes
    body and wheel apart; ``load``, a force on the body. Outputs: displacement of the body ``body.z`` and of the wheel
    ``wheel.z`` relative to the road, ``travel`` of the suspension, absolute accelerations ``body.az`` and
    ``wheel.az``, and the force in the tyre ``tyre.force``.

    Without dampers, as is the default, the eigenfrequencies are the roots of a biquadratic equation, 7.87863 and
    68.70862 rad/s; a passenger car has 1 to 2 kN s/m in its suspension.

    Parameters
    ----------
    body_mass, wheel_mass : float
        Sprung and unsprung mass [kg].
    suspension_stiffness, suspension_damping : float
        Between wheel and body [N/m, N s/m].
    tyre_stiffness, tyre_damping : float
        Between road and wheel [N/m, N s/m].

    Returns
    -------
    Model
        The quarter car: bodies ``body`` and ``wheel``, springs ``suspension`` and ``tyre``.

    Raises
    ------
    ModelError
        If a value is refused by the part it is for.
    """
    model = Model("quarter_car")
    # bodies do not rotate: the moments of inertia are plausible for a car but have no effect
    model.add_body("wheel", wheel_mass, (1.0, 1.7, 1.0), (0.0, 0.0, 0.3))
    model.add_body("body", body_mass, (100.0, 100.0, 100.0), (0.0, 0.0, 0.8))
    model.add_joint("hub", "prismatic", "ground", "wheel", (0.0, 0.0, 0.3))
    model.add_joint("strut", "prismatic", "wheel", "body", (0.0, 0.0, 0.5))
    model.add_spring("tyre", "ground", "wheel", (0.0, 0.0, 0.0), (0.0, 0.0, 0.3), tyre_stiffness, tyre_damping)
    model.add_spring("suspension", "wheel", "body", (0.0, 0.0, 0.3), (0.0, 0.0, 0.7),
                     suspension_stiffness, suspension_damping)  # fmt: skip
    model.add_base_motion("road", "z")
    model.add_input("actuator", "body", "z", relative_to="wheel")
    model.add_input("load", "body", "z")
    model.add_output("body.z", "body", "z")
    model.add_output("wheel.z", "wheel", "z")
    model.add_output("travel", "body", "z", relative_to="wheel")
    model.add_output("body.az", "body", "z", quantity="acceleration")
    model.add_output("wheel.az", "wheel", "z", quantity="acceleration")
    model.add_force_output("tyre.force", "tyre")
    return model
