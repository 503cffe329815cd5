"""Robots from URDF files: links that a fixed joint holds together are one body, joints get stiffness and damping."""

from mbsvib.urdf.robot import load_urdf
from mbsvib.urdf.saving import save_urdf

__all__ = ["load_urdf", "save_urdf"]
