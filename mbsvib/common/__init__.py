"""Shared by all: checks of arguments, text tables, files that are written whole or not at all."""
