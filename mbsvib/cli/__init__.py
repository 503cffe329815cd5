"""The command line: ``mbsvib demo``, ``mbsvib modes MODEL`` and so on. Heavy imports wait until a command runs."""

from __future__ import annotations


def main() -> None:
    """Run the command line with the arguments of the process."""
    from mbsvib.cli._app import app

    app(prog_name="mbsvib")


__all__ = ["main"]
