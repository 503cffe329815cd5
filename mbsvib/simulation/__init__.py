"""Nonlinear time response: equations of motion in minimal form, their integration, and what is told of a run."""
