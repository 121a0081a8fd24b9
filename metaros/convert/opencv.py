"""OpenCV, if it is installed: only compressed images and a few colour conversions need it."""

from __future__ import annotations

import importlib
from typing import Any

from metaros.errors import ConfigError

__all__ = ["opencv"]


def opencv() -> Any:
    """The module `cv2`, or a `ConfigError` that says how to get it."""
    try:
        return importlib.import_module("cv2")
    except ImportError:
        raise ConfigError(
            "compressed images, Bayer and YUV need OpenCV: install metaros with its extra `drivers`, "
            "pip install 'metaros[drivers]'"
        ) from None
