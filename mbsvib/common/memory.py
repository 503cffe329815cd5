"""Memory that is used again and again, without going through the operating system each time."""

import numpy as np

# Arrays of scenes with fewer coordinates are small enough to be reused anyhow.
MANY = 40
# The largest block that glibc lets the threshold grow to has 32 MB; twice that is kept.
_BLOCK = 4_000_000


def keep_freed_memory(size: int) -> None:
    """Have the allocator keep what is freed, for scenes of ``size`` coordinates with large matrices.

    glibc returns memory to the system beyond a threshold, and every page that is asked for again costs a fault: with
    some hundred coordinates as much time as the arithmetic. The threshold grows with the largest block freed so far;
    this one is never touched and costs nothing.

    Parameters
    ----------
    size : int
        Number of coordinates.
    """
    if size >= MANY:
        np.empty(_BLOCK)
