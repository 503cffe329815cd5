"""Read damaged files of one kind in a process of its own, with little memory: python -m tests.export.fuzz.worker.

Its arguments are the kind, a seed, the number of files, and a folder, in which the file at fault is left.
"""

import resource
import sys
import traceback
import warnings
from pathlib import Path

import numpy as np

import mbsvib as mv
from tests.export.fuzz.kinds import KINDS, content

MEMORY = 600_000_000  # more than the readers need for files of some kilobytes, less than a header could ask for
SECONDS = 400  # of work
LONGEST = 1200  # characters of a message


def main(name, seed, count, folder):
    """Try so many damaged files; tell how many were refused and how many were read."""
    kind, folder = KINDS[name], Path(folder)
    valid = [(path, path.read_bytes(), content(kind.read(path), kind.holes)) for path in kind.write(folder)]
    limit(MEMORY, SECONDS)
    refused = 0
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        path, raw, truth = valid[rng.integers(len(valid))]
        path.write_bytes(kind.damage(raw, rng))
        try:
            result = kind.read(path)
        except mv.MbsvibError as error:
            refused += 1
            if len(str(error)) < LONGEST:
                continue
            print(f"{name}, file {k}: a message of {len(str(error))} characters: {str(error)[:LONGEST]}")
            return 1
        except BaseException:
            print(f"{name}, file {k}: {path}")
            traceback.print_exc()
            return 1
        if kind.checked and content(result, kind.holes) != truth:
            print(f"{name}, file {k}: {path}: another object than was written")
            return 1
        content(result, kind.holes)
    for path, raw, truth in valid:  # there is still memory enough
        path.write_bytes(raw)
        assert content(kind.read(path), kind.holes) == truth
    print(refused, count - refused)
    return 0


def limit(memory, seconds):
    """Allow this process some more memory than it has now, and some time of the processor."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + memory
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


if __name__ == "__main__":
    warnings.simplefilter("error", RuntimeWarning)
    warnings.simplefilter("ignore", UserWarning)
    sys.exit(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]))
