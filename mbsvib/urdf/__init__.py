"""Robots from URDF files: links that a fixed joint holds together are one body, joints get stiffness and damping."""

from mbsvib.urdf.robot import load_urdf

__all__ = ["load_urdf"]
