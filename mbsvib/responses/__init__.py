"""Responses: what inputs do to outputs, in frequency and in time, and where they do nothing.

``frequency_response``  a sum over modes for all frequencies at once, checked by its residual
``time_response``       exact for inputs that are held or vary linearly between samples
``transmission_zeros``  without a polynomial, and ``frequency_grid``, which resolves every peak and dip
"""
