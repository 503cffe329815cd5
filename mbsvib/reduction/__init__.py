"""Reduced models: fewer coordinates or states, with a bound on the error of the frequency response."""
