"""Couplers: gears, worms, racks and other linear relations between joint coordinates, and the rows they add to Phi."""
