"""Explanations in words: the derivation of a system, and the elements with most energy of a mode."""
