"""The command line: ``mbsvib demo``, ``mbsvib modes MODEL`` and so on. Heavy imports wait until a command runs."""

from __future__ import annotations


def main() -> None:
    """Run the command line with the arguments of the process, and end the process with its status.

    OpenBLAS gets one thread unless OPENBLAS_NUM_THREADS is set: more of them wait for each other on matrices of
    mechanisms, and take twice the time where other programs run too.
    """
    import os
    import sys

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from mbsvib.cli._app import run

    sys.exit(run(sys.argv[1:]))


__all__ = ["main"]
