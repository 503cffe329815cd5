"""The parts of a model: what the user said, checked and immutable, one file a family.

Every part keeps the words of the call that made it (``words()`` gives them back), so that a model can be saved,
compared and changed part by part.
"""

from mbsvib.parts.body import Body
from mbsvib.parts.bushing import Bushing
from mbsvib.parts.joint import Joint
from mbsvib.parts.load import Load
from mbsvib.parts.maxwell import Maxwell
from mbsvib.parts.ports import BaseMotion, ForceOutput, Input, Output
from mbsvib.parts.spring import Spring

__all__ = ["BaseMotion", "Body", "Bushing", "ForceOutput", "Input", "Joint", "Load", "Maxwell", "Output", "Spring"]
