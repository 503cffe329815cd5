"""Tests of robots from URDF files."""
