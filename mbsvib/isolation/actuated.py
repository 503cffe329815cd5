"""Active legs: actuators in parallel with the springs of a mechanism, and their sensors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mbsvib.common.expected import a_model, names
from mbsvib.elements import Bushing
from mbsvib.errors import ModelError, nearest
from mbsvib.isolation.closed_loop import close
from mbsvib.isolation.isolation_study import figures
from mbsvib.isolation.plant import Plant
from mbsvib.isolation.study_scene import scene
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.api.model import Model
    from mbsvib.isolation.closed_loop import ClosedLoop
    from mbsvib.isolation.controller import Controller
    from mbsvib.isolation.isolation_study import Isolation


@dataclass(frozen=True, repr=False, eq=False)
class Active(Plant):
    """A mechanism whose ``legs`` have actuators, ready for control: its figures, and its loops closed.

    ``system`` has, in addition to the ports of an isolation study, the inputs ``LEG.actuator`` [N], which push the ends
    of the leg apart, and the outputs ``LEG.tension`` [N], ``LEG.stroke`` [m], ``LEG.rate`` [m/s] and
    ``LEG.acceleration`` [m/s^2].
    """

    def with_gains(self, *controllers: Controller) -> ClosedLoop:
        """Return the closed loop; several controllers act together (HAC-LAC: an inner and an outer one).

        Parameters
        ----------
        *controllers : Controller
            Their outputs on the same actuator add up.

        Returns
        -------
        ClosedLoop
            The mechanism with all loops closed.
        """
        return close(self, *controllers)

    def isolation(self, frequencies: ArrayLike | None = None) -> Isolation:
        """Return the figures with open loops.

        Parameters
        ----------
        frequencies : array-like, shape (n,), optional
            Ascending frequencies [Hz].

        Returns
        -------
        Isolation
            Transmissibility, compliance and figures.
        """
        return figures(self.scene, self.system, frequencies)

    def __repr__(self) -> str:
        return f"Active({self.scene.model.name!r}: {len(self.legs)} actuators)"


def actuated(
    model: Model, body: str, legs: Sequence[str] | None = None, base: str = GROUND, *, point: ArrayLike | None = None,
    length: float | None = None, directions: Sequence[str] | None = None,
) -> Active:  # fmt: skip
    """Return a mechanism with an actuator in parallel with the spring of each leg, and sensors.

    Parameters
    ----------
    model : Model
        The mechanism, which is not changed.
    body : str
        The isolated body.
    legs : sequence of str, optional
        Line springs or Maxwell elements that get actuators; default: all of them.
    base : str
        What is shaken: the ground, or a body whose motion is prescribed.
    point : array-like, shape (3,), optional
        Reference point on base and body [m]; default: the body's centre of mass.
    length : float, optional
        Length [m] that makes rotations comparable.
    directions : sequence of str, optional
        In which the base is shaken.

    Returns
    -------
    Active
        The plant.

    Raises
    ------
    ModelError
        If a name is unknown, or a leg has no line.
    """
    lines = [name for name, part in a_model(model, "actuated").springs.items() if not isinstance(part, Bushing)]
    leg_names = tuple(lines if legs is None else names(legs, "actuated", "legs", ModelError))
    for name in leg_names:
        if name not in lines:
            raise ModelError(f"active: leg '{name}' is neither a line spring nor a Maxwell element of model "
                             f"'{model.name}'."
                             f"{nearest(str(name), lines)} It has {', '.join(lines) or 'none'}.", element=str(name),
                             field="legs")  # fmt: skip
    if not leg_names:
        raise ModelError(f"active: model '{model.name}' has no line spring to which an actuator could be parallel; add "
                         f"legs by add_spring.", field="legs")  # fmt: skip
    made = scene(model, body, base, point, length, directions)
    changed = made.model
    missing = [name for name in leg_names if name not in changed.springs]
    if missing:
        raise ModelError(f"active: leg '{missing[0]}' is below the base '{base}'; choose legs above it.",
                         element=missing[0], field="legs")  # fmt: skip
    attached = _attached_bodies(changed, body, leg_names)
    for name in leg_names:
        leg = changed.springs[name]
        assert not isinstance(leg, Bushing)
        changed.add_input(f"{name}.actuator", leg.second, leg.line, leg.start, leg.first)
        changed.add_output(f"{name}.rate", leg.second, leg.line, leg.start, leg.first, quantity="velocity")
        changed.add_force_output(f"{name}.tension", name)
        away = leg.first in attached and leg.second not in attached
        end, push = (leg.start, -np.array(leg.line)) if away else (leg.end, np.array(leg.line))
        changed.add_output(f"{name}.acceleration", body, push, end, quantity="acceleration")
    system = changed.linearize(method="dense")
    direct = system.D.copy()
    for name in leg_names:
        # the sensor in series measures the force of spring and actuator
        direct[system.outputs.index(f"{name}.tension"), system.inputs.index(f"{name}.actuator")] -= 1.0
    return Active(replace(made, system=replace(system, D=direct)), leg_names)


def _attached_bodies(model: Model, body: str, legs: Sequence[str]) -> set[str]:
    """The bodies that are connected to the isolated one by elements other than legs, not through the ground."""
    pairs = [(part.first, part.second) for group in (model.joints, model.springs) for part in group.values()
            if part.name not in legs]  # fmt: skip
    attached, last = {body}, 0
    while len(attached) > last:
        last = len(attached)
        for pair in pairs:
            if GROUND not in pair and not attached.isdisjoint(pair):
                attached.update(pair)
    return attached
