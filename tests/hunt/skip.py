"""What a comparison raises that has nothing to compare."""


class Skip(Exception):
    """A comparison that a scene has nothing for."""
