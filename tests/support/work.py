"""The amount of work of a call, counted: the same on every machine, however busy it is."""

import gc
import sys


def calls(function):
    """Functions entered, of Python and of C, in a second run of ``function``: the first one imports and prepares."""
    function()
    count = 0

    def entered(frame, event, argument):
        nonlocal count
        count += event in ("call", "c_call")

    gc.collect()
    gc.disable()
    sys.setprofile(entered)
    try:
        function()
    finally:
        sys.setprofile(None)
        gc.enable()
    return count
