"""Campbell diagrams: the public name of ``mbsvib.studies.campbell``."""

from mbsvib.studies.campbell import Campbell, campbell

__all__ = ["Campbell", "campbell"]
