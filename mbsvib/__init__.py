"""mbsvib: from a multibody description to named, minimal state-space systems."""

from mbsvib.errors import MbsvibError, ModelError, ResponseError, SingularPoseError
from mbsvib.model import Model

__version__ = "0.1.0"

__all__ = ["MbsvibError", "Model", "ModelError", "ResponseError", "SingularPoseError", "__version__"]
