"""Models from MuJoCo's files (MJCF): bodies, joints, springs, tendons, actuators and closed loops, in any pose."""

from mbsvib.mjcf.loading import load_mjcf

__all__ = ["load_mjcf"]
