"""Modules that are imported when first used: a node that sends texts must not wait for numpy when it starts.

    if TYPE_CHECKING:
        import numpy as np
    else:
        np = LazyModule("numpy")

Thread-safe, as imports are. A name that was used once is an ordinary attribute from then on.
"""

from __future__ import annotations

import importlib
from typing import Any

__all__ = ["LazyModule"]


class LazyModule:
    """Stands for the module `name`."""

    def __init__(self, name: str) -> None:
        self.__name__ = name

    def __getattr__(self, attribute: str) -> Any:
        value = getattr(importlib.import_module(self.__name__), attribute)
        setattr(self, attribute, value)
        return value

    def __repr__(self) -> str:
        return f"<module {self.__name__}, when needed>"
