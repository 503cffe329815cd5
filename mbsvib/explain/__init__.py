"""Explanations in words: how a system came about, and which elements carry a mode."""
