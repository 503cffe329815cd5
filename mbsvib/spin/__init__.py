"""Spin: rotors, what they add to the equations, and when a steady spin is steady."""
