"""How much memory is used at once, and reuse of freed memory without calls of the operating system."""

import numpy as np

# Matrices with fewer rows are small enough to be reused in any case.
MANY = 40
# The largest block that glibc lets the threshold grow to has 32 MB; twice that is kept.
_BLOCK = 4_000_000
# Matrices of many frequencies or eigenvalues are made in batches of this many bytes.
BATCH_BYTES = 32 * 2**20


def keep_freed_memory(size: int) -> None:
    """Make the allocator keep freed memory, for matrices with ``size`` rows or more.

    glibc returns memory beyond a threshold to the system, and every page of new memory costs a page fault: with some
    hundred coordinates as much time as the arithmetic. The threshold grows with the largest block freed so far; the
    block that is freed here is never written to and costs nothing.
    """
    if size >= MANY:
        np.empty(_BLOCK)
