"""What sensor_msgs_py has for numpy before 1.16, by the same names: numpy's own."""

from __future__ import annotations

from numpy.lib.recfunctions import structured_to_unstructured, unstructured_to_structured

__all__ = ["structured_to_unstructured", "unstructured_to_structured"]
