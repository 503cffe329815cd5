"""Legs with bodies: selection of legs, and parallel springs as one leg."""

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


def legs_between(model: Model, body: str, base: str, patterns: Sequence[str] | None) -> tuple[Leg, ...]:
    """Return the legs between two bodies.

    ``body``, ``base``: the supported body, and the body that carries the legs. ``patterns``: names or patterns of
    parts, one or more of each leg. Default: every chain between both.
    """
    chains = chains_between(model, body, base)
    if patterns is None:
        selected = [chain for chain in chains if chain.complete]
    else:
        selected = _picked(chains, [patterns] if isinstance(patterns, str) else patterns)
    if not selected:
        raise ModelError(f"platform: no leg leads from '{base}' to '{body}': expected line springs or chains of rigid "
                         f"bodies and joints between both.", element=body, field="body")  # fmt: skip
    result: list[Leg] = []
    for leg in (chain.leg(model) for chain in selected):
        if not _joined(result, leg):
            result.append(leg)
    for chain in chains:
        if chain.complete and chain not in selected:
            with suppress(ModelError):  # chains that are not legs are ignored
                _joined(result, chain.leg(model))
    return tuple(result)


def _picked(chains: list[Chain], patterns: Iterable[str]) -> list[Chain]:
    picked: list[Chain] = []
    for pattern in patterns:
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
            if not chain.complete:
                raise ModelError(f"platform: leg '{chain.name}': it is held by the ground too; expected a chain from "
                                 f"'{chain.base}' to '{chain.platform}' alone.", element=chain.name,
                                 field="legs")  # fmt: skip
        picked += [chain for chain in these if chain not in picked]
    return [chain for chain in chains if chain in picked]


def _joined(legs: list[Leg], added: Leg) -> bool:
    """Merge a leg with one of several that has the same ends, such as parts of relaxation elements; tell if done."""
    for i, leg in enumerate(legs):
        if same(leg.start, added.start) and same(leg.end, added.end):
            legs[i] = replace(leg, bodies=leg.bodies + added.bodies, points={**leg.points, **added.points},
                              shares={**leg.shares, **added.shares},
                              orientations=leg.orientations + added.orientations)  # fmt: skip
            return True
    return False
