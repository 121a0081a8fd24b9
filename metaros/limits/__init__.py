"""Every bound of the library and the link; `docs/reference/limits.md` lists them with their reasons."""

from metaros.limits.limits import LIMITS, Limits

__all__ = ["LIMITS", "Limits"]
