"""Used by all folders: checks of arguments, text tables, atomic writing of files, types of arrays."""
