"""Tables of cases that are one test, which shows every case that is not as it should be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["refusal"]


def refusal(error: type[Exception], call: Callable[..., object], *args: Any, **options: Any) -> str:
    """What a call is refused with by that error; empty where it is not refused."""
    try:
        call(*args, **options)
    except error as refused:
        return str(refused) or repr(refused)
    return ""
