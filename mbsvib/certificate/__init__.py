"""The certificate of a model: which checks its linear equations pass, as a table and as JSON for CI."""

from mbsvib.certificate.certifying import certify
from mbsvib.certificate.result import Certificate

__all__ = ["Certificate", "certify"]
