"""Derivatives through the equilibrium of loaded scenes."""
