"""The errors of mbsvib: one root, and messages that say what was given, what was expected and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = [
    "AccuracyWarning",
    "EquilibriumError",
    "ExportError",
    "LargeDisplacementWarning",
    "LeftOutWarning",
    "MbsvibError",
    "ModelError",
    "NearSingularWarning",
    "OutsideTableWarning",
    "ResponseError",
    "SimulationError",
    "SingularPoseError",
    "UndeterminedForceWarning",
    "UnstableWarning",
]
__dir__ = __all__.copy


# Characters of a message, and how many of them are its beginning, which says where; the end says what to do.
LONGEST_MESSAGE, BEGINNING = 4000, 3000


# What other programs call the ground.
GROUND_ELSEWHERE = {"world", "base", "earth", "inertial", "fixed", "origin", "global"}


def _without_middle(text: str) -> str:
    if len(text) <= LONGEST_MESSAGE:
        return text
    return f"{text[:BEGINNING]} ... {text[BEGINNING - LONGEST_MESSAGE :]}"


class MbsvibError(Exception):
    """Root of every error that mbsvib raises on purpose.

    Messages repeat names, which in a file of unknown origin can have any length: long ones lose their middle.
    """

    def __init__(self, *arguments: object) -> None:
        super().__init__(*(_without_middle(item) if isinstance(item, str) else item for item in arguments))


class ModelError(MbsvibError, ValueError):
    """A description that no mechanism can have, or that mbsvib cannot take.

    ``element`` is the name of the element at fault and ``field`` the argument, so that a reader of model files
    can point at the line; either is None where the error has no single place.
    """

    def __init__(self, message: str, *, element: str | None = None, field: str | None = None) -> None:
        super().__init__(message)
        self.element = element
        self.field = field


class NoWordsError(ModelError):
    """A part that its own words cannot describe in another pose, wherever that is."""


class UnreachableError(ModelError):
    """A pose in which loops cannot be closed: the displacements towards it end at a singular pose."""


class SingularPoseError(MbsvibError):
    """A pose in which the number of degrees of freedom, or the choice of coordinates, is not defined."""


class EquilibriumError(MbsvibError):
    """A pose that is not in balance with the loads, or none that can be found.

    ``body`` is the body with the unbalanced force, ``coordinate`` the motion along which it acts, ``missing`` the force
    that balance needs there and ``unit`` N or N m; all None where the error has no single place.
    """

    def __init__(
        self, message: str, *, body: str | None = None, coordinate: str | None = None, missing: float | None = None,
        unit: str | None = None,
    ) -> None:  # fmt: skip
        super().__init__(message)
        self.body = body
        self.coordinate = coordinate
        self.missing = missing
        self.unit = unit


class SimulationError(MbsvibError):
    """A nonlinear time response that could not be carried to its end.

    ``time`` [s] is where it stopped and ``coordinate`` the joint coordinate that moves fastest there; ``run`` is what
    was reached until then.
    """

    def __init__(
        self, message: str, *, time: float | None = None, coordinate: str | None = None, run: object = None
    ) -> None:
        super().__init__(message)
        self.time = time
        self.coordinate = coordinate
        self.run = run


class NearSingularWarning(UserWarning):
    """A pose so near a singular one that the minimal coordinates lose digits."""


class AccuracyWarning(UserWarning):
    """A result whose estimated error is larger than what was asked for, axes that were given with few digits, or a
    step between samples of many periods of all poles.
    """


class UndeterminedForceWarning(UserWarning):
    """Outputs that are joint forces which the model does not determine, because constraints are redundant."""


class UnstableWarning(UserWarning):
    """A frequency response of a loop that is not stable, which no steady vibration shows, though Nyquist plots need it;
    or modes of sparse matrices that grow and may not be among those asked for; or frequencies of a sweep where modes
    grow; or an isolation study or an optimum of a mechanism that is not stable.
    """


class LargeDisplacementWarning(UserWarning):
    """Beams or superelements that bend further than the linear theory of small displacements holds."""


class LeftOutWarning(UserWarning):
    """Elements of a file that was read for which a model has no place, and that it does without."""


class OutsideTableWarning(UserWarning):
    """Frequencies at which noise is asked for, and that lie outside the table that gives it."""


class ResponseError(MbsvibError, ValueError):
    """A response asked for where it does not exist, or with data of the wrong shape."""


class ExportError(MbsvibError):
    """A system that a target format cannot hold."""


def counted(number: int, noun: str) -> str:
    """Return "1 body", "2 bodies" for a number and a noun in the singular."""
    plural = f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"


def an(noun: str) -> str:
    """Return "an input", "a body" for a noun."""
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ``" Did you mean 'x'?"`` for the known word nearest to ``word``, or an empty string."""
    by_lower = {name.lower(): name for name in reversed(list(known))}
    if word.lower() in GROUND_ELSEWHERE and "ground" in by_lower:
        return " Did you mean 'ground'?"
    match = get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f" Did you mean '{by_lower[match[0]]}'?" if match else ""
