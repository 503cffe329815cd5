"""Tests of models from MuJoCo's files."""
