"""Co-simulation of plants and controllers: units from files, run through fmpy, and the equations that they obey."""
