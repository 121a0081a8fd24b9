"""What a callback may learn about a message besides its fields."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

from metaros.errors import UsageError

__all__ = ["MessageInfo", "takes"]


class MessageInfo(NamedTuple):
    """Where and when a message came from. Times are nanoseconds since the epoch."""

    source_stamp_ns: int
    received_stamp_ns: int
    seq: int
    gid: bytes


def takes(callback: Callable[..., Any], *counts: int) -> int:
    """The first of `counts` that is a number of positional arguments `callback` accepts; UsageError if none is."""
    try:
        signature = inspect.signature(callback)
    except ValueError:  # some builtins tell no signature
        return counts[0]
    for count in counts:
        try:
            signature.bind(*(None,) * count)
        except TypeError:
            continue
        return count
    wanted = " or ".join(str(count) for count in counts)
    raise UsageError(f"the callback {callback!r} must accept {wanted} positional arguments")
