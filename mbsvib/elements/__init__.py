"""The parts of a model, checked and immutable, one file for each family.

Every part keeps the arguments of the call that made it (``constructor_kwargs()``), so that a model can be saved,
compared and changed part by part.
"""

from mbsvib.elements.body import Body
from mbsvib.elements.bushing import Bushing
from mbsvib.elements.joint import Joint
from mbsvib.elements.load import Load
from mbsvib.elements.maxwell import Maxwell
from mbsvib.elements.ports import BaseMotion, ForceOutput, Input, Output
from mbsvib.elements.spring import Spring

__all__ = ["BaseMotion", "Body", "Bushing", "ForceOutput", "Input", "Joint", "Load", "Maxwell", "Output", "Spring"]
