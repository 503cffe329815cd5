"""The command line: ``mbsvib demo``, ``mbsvib modes MODEL`` and so on. Heavy imports wait until a command runs."""

from __future__ import annotations


def main() -> None:
    """Run the command line with the arguments of the process, and end the process with its status."""
    import sys

    from mbsvib.cli._app import run

    sys.exit(run(sys.argv[1:]))


__all__ = ["main"]
