"""Constructors of frozen dataclasses: faster, and in all that users can tell the same."""

import pickle
from copy import copy
from dataclasses import FrozenInstanceError, dataclass, replace
from inspect import signature

import pytest

from mbsvib.common.fast_init import fast_init


@dataclass(frozen=True, slots=True)
class Named:
    name: str


@fast_init
@dataclass(frozen=True, slots=True)
class Slotted(Named):
    mass: float
    unit: str = "kg"


@fast_init
@dataclass(frozen=True)
class InDictionary:
    first: int
    second: int = 2


@fast_init
@dataclass(frozen=True, kw_only=True)
class ByName(InDictionary):
    third: int
    fourth: int = 4

    def __post_init__(self):
        assert type(self) is ByName
        if self.third < 0:
            raise ValueError("third")


@dataclass(frozen=True, slots=True)
class Derived(Slotted):
    size: float = 1.0


class Plain(InDictionary):
    pass


OBJECTS = (Slotted("a", 2.0), InDictionary(1), ByName(first=1, third=3), Derived("b", 3.0, size=4.0), Plain(1, 3))


@pytest.mark.parametrize("item", OBJECTS, ids=lambda item: type(item).__name__)
def test_objects_are_frozen_values_of_their_class(item):
    kind = type(item)
    assert kind in (Slotted, InDictionary, ByName, Derived, Plain)
    field = next(iter(signature(kind).parameters))
    for change in (lambda: setattr(item, field, 7), lambda: delattr(item, field)):
        with pytest.raises(FrozenInstanceError):
            change()
    for same in (copy(item), pickle.loads(pickle.dumps(item)), replace(item)):
        assert type(same) is kind
        assert (same, hash(same), repr(same)) == (item, hash(item), repr(item))
    assert replace(item, **{field: 7}) != item


def test_fields_defaults_and_order_are_those_of_the_dataclass():
    assert (OBJECTS[0].name, OBJECTS[0].mass, OBJECTS[0].unit) == ("a", 2.0, "kg")
    assert Slotted("a", unit="g", mass=1.0) == Slotted("a", 1.0, "g")
    assert vars(OBJECTS[2]) == {"first": 1, "second": 2, "third": 3, "fourth": 4}
    assert (OBJECTS[3].mass, OBJECTS[3].unit, OBJECTS[3].size) == (3.0, "kg", 4.0)
    assert list(signature(ByName).parameters) == ["first", "second", "third", "fourth"]
    assert not hasattr(OBJECTS[0], "__dict__")


def test_wrong_arguments_and_checks_after_construction_are_refused():
    for wrong in (lambda: Slotted("a"), lambda: Slotted("a", 1.0, "kg", 3), lambda: InDictionary(1, third=3)):
        with pytest.raises(TypeError):
            wrong()
    with pytest.raises(ValueError, match="third"):
        ByName(first=1, third=-1)
