"""What figures draw, by name: these classes are above ``plots``, which takes them as they are."""

from __future__ import annotations

from typing import Any, TypeAlias

# mbsvib.System
System: TypeAlias = Any
# A System, ClosedLoop, StateSpace or Controller: named inputs and outputs, modes, poles, zeros and responses.
Linear: TypeAlias = Any
