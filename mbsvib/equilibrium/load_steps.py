"""The same model with a share of its loads, for load steps."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.elements import Load
from mbsvib.mechanism.rebuilding import remade

if TYPE_CHECKING:
    from mbsvib.api.model import Model


def with_share(model: Model, share: float) -> Model:
    """Return a model with a share of its gravity and of its loads; preloads of springs stay.

    Parameters
    ----------
    model : Model
        The model.
    share : float
        1 for the model as it is, 0 for one on which neither gravity nor a load acts.

    Returns
    -------
    Model
        The model with these loads.
    """
    if share == 1.0:
        return model

    def words(part: Any) -> dict[str, Any]:
        given: dict[str, Any] = part.words()
        if isinstance(part, Load):
            given |= {key: np.multiply(share, given[key]) for key in ("force", "torque") if key in given}
        return given

    plain: Any = copy(model)
    plain.gravity = None if model.gravity is None else np.multiply(share, model.gravity)
    plain._loads = model._loads if share else {}
    return remade(plain, words)
