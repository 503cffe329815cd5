"""Responses: outputs due to inputs, in frequency and in time, and transmission zeros.

``frequency_response``  a sum over modes for all frequencies at once, checked by its residual
``time_response``       exact for inputs that are constant or linear between samples
``transmission_zeros``  without a polynomial, and ``frequency_grid``, which resolves every peak and dip
"""
