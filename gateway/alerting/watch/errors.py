"""The errors of the watch; their codes are rows of the gateway's table.

RequestError
└── UnknownCheckError      there is no such check                      unknown_check
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = ["UnknownCheckError"]


class UnknownCheckError(RequestError):
    """The table of checks has none of that id."""

    code = "unknown_check"

    @classmethod
    def of(cls, check_id: str) -> UnknownCheckError:
        """It names the id, as far as it is short."""
        return cls(f"there is no check {check_id[:40]!r}")
