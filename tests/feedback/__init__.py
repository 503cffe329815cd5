"""Tests of closed loops of systems and state spaces."""
