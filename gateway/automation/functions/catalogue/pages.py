"""Pages of a list: AWS's Marker and MaxItems, or Marker and Limit, whichever an operation has."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from gateway.automation.functions.errors import FunctionInvalidError

__all__ = ["page"]

Item = TypeVar("Item")
MOST = 50  # of one page, whatever is asked


def page(
    items: Sequence[Item],
    asked: Mapping[str, Any],
    name: str,
    shown: Callable[[Item], Any],
    *,
    key: Callable[[Item], Any],
) -> dict[str, Any]:
    """One page under `name`, with NextMarker where there is more. `items` are in the order of `key`, which is text."""
    after = _read(asked.get("Marker") or "")
    rest = [item for item in items if not after or key(item) > after]
    most = min(int(asked.get("MaxItems") or MOST), MOST)
    answer: dict[str, Any] = {name: [shown(item) for item in rest[:most]]}
    if len(rest) > most:
        answer["NextMarker"] = base64.urlsafe_b64encode(key(rest[most - 1]).encode()).decode()
    return answer


def _read(marker: str) -> str:
    try:
        return base64.urlsafe_b64decode(marker.encode()).decode()
    except (binascii.Error, ValueError) as error:
        raise FunctionInvalidError("Marker is none that a page ended with") from error
