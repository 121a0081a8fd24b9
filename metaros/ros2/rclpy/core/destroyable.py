"""Handles that are destroyed once, and not while somebody uses them: `with handle:` keeps one for so long."""

from __future__ import annotations

from typing import Any, Protocol

from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle

__all__ = ["Destroyable", "DestroyableType"]


class DestroyableType(Protocol):
    """What rclpy calls the type of every handle."""

    def __enter__(self) -> Any:
        """Keep it while the block runs."""

    def __exit__(self, *_: object) -> None:
        """Let it go."""

    def destroy_when_not_in_use(self) -> None:
        """Destroy it, at once or when the last user lets it go."""


class Destroyable:
    """Put it first among the bases of a class that has `close()`: `with` no longer closes, it keeps.

    Attributes are of the class until they are needed, so that the class's constructor may stay as it is.
    """

    _uses: int = 0
    _destroyed: bool = False

    def close(self) -> None:
        """End it; the class that this is mixed into says how."""
        close = getattr(super(), "close", None)
        if close is not None:
            close()

    def __enter__(self) -> Any:
        """InvalidHandle when it was destroyed."""
        if self._destroyed and not self._uses:
            raise InvalidHandle(f"cannot use {type(self).__name__}: it was destroyed")
        self._uses += 1
        return self

    def __exit__(self, *_: object) -> None:
        self._uses -= 1
        if self._destroyed and not self._uses:
            self.close()

    @property
    def pointer(self) -> int:
        """A number that no other living handle has."""
        return id(self)

    def destroy_when_not_in_use(self) -> None:
        """Destroy it now, or once nobody is within `with handle:`. Nothing the second time."""
        if self._destroyed:
            return
        self._destroyed = True
        if not self._uses:
            self.close()
