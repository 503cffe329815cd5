"""Feedback: controllers, closed loops of systems, margins."""
