"""Assembly: systems, models and measured responses, joined at ports.

A port P of a part is up to six collocated pairs: inputs and outputs P.x ... P.rz, displacements and forces along the
same directions at one point.

connections    which ports are joined, how, and how far apart they are
systems        equations of parts joined rigidly or by springs and dampers, of second order and minimal
responses      frequency responses of parts of which some are measured, with their noise

The verb is ``assemble`` in api.
"""
