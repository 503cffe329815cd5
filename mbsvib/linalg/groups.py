"""Numbers of the items of groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mbsvib.common.arrays import Index


def items_of_groups(count: Index) -> tuple[Index, Index]:
    """Return the group and the number within it of every item, for groups of ``count`` items."""
    group = np.repeat(np.arange(len(count)), count)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(count) - count, count)
