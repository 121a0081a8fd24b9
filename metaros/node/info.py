"""What a callback may learn about a message besides its fields."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import BuiltinFunctionType
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
    told = _of_builtin(callback)
    if told in counts:
        return told
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


def _of_builtin(callback: Callable[..., Any]) -> int:
    """How many arguments a builtin such as `heard.append` takes; -1 where that is no plain number.

    `inspect` would parse the very text of its signature as Python, with modules that take 5 ms the first time.
    """
    text = getattr(callback, "__text_signature__", None) if isinstance(callback, BuiltinFunctionType) else None
    if not text or set(text) & set("=*[<"):
        return -1
    names = text.strip("()").split(", ")
    return len([name for name in names if name != "/" and not name.startswith("$")])
