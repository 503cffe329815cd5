"""Massless coordinates: where M is singular, motions without mass are condensed or become first-order states, exactly.

``separate`` splits the motions that move no mass. Those that no damper feels follow from statics and leave the
equations; the others stay, with one first-order state in place of two.
"""
