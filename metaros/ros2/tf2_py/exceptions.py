"""What cannot be looked up, by tf2's names."""

from __future__ import annotations

__all__ = [
    "ConnectivityException",
    "ExtrapolationException",
    "InvalidArgumentException",
    "LookupException",
    "TimeoutException",
    "TransformException",
]


class TransformException(Exception):
    """A transform cannot be given; the others say why."""


class ConnectivityException(TransformException):
    """Both frames are known, and no chain of transforms joins them."""


class LookupException(TransformException):
    """A frame that nobody has told of, or a tree that runs in a circle."""


class ExtrapolationException(TransformException):
    """The time asked for is before or after what is stored, or beside the only sample there is."""


class InvalidArgumentException(TransformException):
    """A frame's name is empty or begins with a slash."""


class TimeoutException(TransformException):
    """Whoever was asked did not answer in time."""
