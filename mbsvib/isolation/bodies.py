"""Bodies that studies name: the isolated one and its base."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from mbsvib.errors import ModelError, nearest
from mbsvib.mechanism.mechanism import GROUND

if TYPE_CHECKING:
    from mbsvib.api.model import Model
    from mbsvib.elements import Body


def check_body(model: Model, name: str, who: str, field: str) -> None:
    """Refuse what is no body of a model; as a ``base`` the ground is one."""
    known = [*model.bodies, *([GROUND] if field == "base" else [])]
    if name not in known:
        raise ModelError(f"{who}: {field} = {name!r}; expected a body of model '{model.name}'."
                         f"{nearest(str(name), known)} It has {', '.join(known)}.",
                         element=str(name), field=field)  # fmt: skip


def radius_of_gyration(body: Body) -> float:
    """Return the root mean square distance [m] of a body's mass from its centre, 0 without mass."""
    return sqrt(0.5 * sum(body.inertia[:3]) / body.mass) if body.mass > 0.0 else 0.0
