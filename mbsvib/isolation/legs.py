"""Legs with bodies of their own: those that are asked for, and springs side by side as one."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from mbsvib.errors import ModelError, nearest
from mbsvib.isolation.chains import chains_between, same

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from mbsvib.api.model import Model
    from mbsvib.isolation.chains import Chain, Leg


def legs_between(model: Model, body: str, base: str, asked: Sequence[str] | None) -> tuple[Leg, ...]:
    """Return the legs between two bodies.

    Parameters
    ----------
    model : Model
        The mechanism.
    body, base : str
        What the legs carry, and what they stand on.
    asked : sequence of str, optional
        Names or patterns of parts, one or more of each leg. Default: every chain between both.

    Returns
    -------
    tuple of Leg
        In the order in which the model has their parts.

    Raises
    ------
    ModelError
        If there are none, or what is asked for is no chain from base to body with ends to be moved.
    """
    chains = chains_between(model, body, base)
    if asked is None:
        chosen = [chain for chain in chains if chain.whole]
    else:
        chosen = _picked(model, chains, [asked] if isinstance(asked, str) else asked)
    if not chosen:
        raise ModelError(f"platform: no leg leads from '{base}' to '{body}': expected line springs or chains of rigid "
                         f"bodies and joints between both.", element=body, field="body")  # fmt: skip
    result: list[Leg] = []
    for leg in (chain.leg(model) for chain in chosen):
        if not _joined(result, leg):
            result.append(leg)
    for chain in chains:
        if chain.whole and chain not in chosen:
            with suppress(ModelError):  # what is no leg is none that lies beside another
                _joined(result, chain.leg(model))
    return tuple(result)


def _picked(model: Model, chains: list[Chain], asked: Iterable[str]) -> list[Chain]:
    found: list[Chain] = []
    for pattern in asked:
        these = [chain for chain in chains if any(fnmatchcase(name, pattern) for name in chain.parts)]
        if not these:
            known = [name for chain in chains for name in chain.parts]
            raise ModelError(f"platform: legs: no part of a leg is named '{pattern}'.{nearest(str(pattern), known)}",
                             element=str(pattern), field="legs")  # fmt: skip
        for chain in these:
            for end in chain.missing():
                raise ModelError(f"platform: leg '{chain.name}': it does not reach '{end}'; expected a chain of bodies "
                                 f"and joints from '{chain.base}' to '{chain.platform}'.",
                                 element=chain.name, field="legs")  # fmt: skip
            if not chain.whole:
                raise ModelError(f"platform: leg '{chain.name}': it is held by the ground too; expected a chain from "
                                 f"'{chain.base}' to '{chain.platform}' alone.", element=chain.name,
                                 field="legs")  # fmt: skip
        found += [chain for chain in these if chain not in found]
    return [chain for chain in chains if chain in found]


def _joined(legs: list[Leg], other: Leg) -> bool:
    """Whether a leg lies beside one of several, as parts of relaxation elements do, which it then belongs to."""
    for i, one in enumerate(legs):
        if same(one.start, other.start) and same(one.end, other.end):
            legs[i] = replace(one, bodies=one.bodies + other.bodies, points={**one.points, **other.points},
                              shares={**one.shares, **other.shares}, turned=one.turned + other.turned)  # fmt: skip
            return True
    return False
