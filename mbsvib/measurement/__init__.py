"""Measured data: frequency responses and modes with their noise, and their channels matched with a model's."""
