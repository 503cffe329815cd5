"""The mechanism as data: all parts, their parameters, and the spanning tree."""
