"""The same model with a share of its loads, for load steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.model import Model


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
    from mbsvib.model import ADDERS

    gravity = None if model.gravity is None else np.multiply(share, model.gravity)
    result = type(model)(model.name, gravity)
    for adder, group in model._groups():
        if adder != "add_load":
            for part in group.values():
                getattr(result, adder or ADDERS[type(part)])(**part.words())
    for load in model.loads.values() if share else ():
        words = load.words()
        result.add_load(**words | {key: np.multiply(share, words[key]) for key in ("force", "torque") if key in words})
    return result
