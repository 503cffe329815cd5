"""Uncertain plants: parameters within limits as blocks of a linear fractional map, and what is certain of these."""
