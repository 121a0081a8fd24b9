"""The one error of twins: what the document says wrong, where, and what would be right.

UsageError
└── TwinError    twin_invalid
"""

from __future__ import annotations

from metaros.errors import UsageError

__all__ = ["TwinError"]


class TwinError(UsageError):
    """A twin's document is refused; the message is `path: what is wrong`, the path as in `nodes.lidar.nice`."""

    code = "twin_invalid"

    def __init__(self, path: str, text: str) -> None:
        """`path` is "" where the document as a whole is meant."""
        super().__init__(f"{path}: {text}" if path else text)
        self.path = path
        self.text = text
