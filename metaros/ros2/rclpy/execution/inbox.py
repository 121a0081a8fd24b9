"""Inboxes: from any thread to the executor that spins a node, as for answers that complete futures there."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Final

from metaros.executor import CallbackGroup, Mailbox
from metaros.limits import LIMITS
from metaros.node.core import NodeCore

__all__ = ["Inbox", "InboxMail"]

_ITEM_BYTES: Final = 512  # what a waiting item is taken to weigh where nobody says


class InboxMail(Mailbox):
    """The mailbox of an inbox: it knows on whose behalf it is there."""

    __slots__ = ("entity",)

    entity: weakref.ref[Any] | None


class Inbox:
    """`put(item)` from any thread; the executor that spins the node runs `callback(item)`, plain or `async def`.

    `entity` is what callback groups and custom executors see for it, such as a client. What waits is bounded by the
    bytes that `size_of` finds; beyond that the oldest goes, counted in `dropped`. What the callback raises comes out
    of `spin`. `put` is a C function: Zenoh's threads may call it.
    """

    def __init__(
        self,
        node_handle: NodeCore,
        callback: Callable[[Any], Any],
        group: CallbackGroup | None = None,
        *,
        entity: object | None = None,
        size_of: Callable[[Any], int] | None = None,
    ) -> None:
        self._mailbox = InboxMail(
            callback,
            owner=node_handle,
            depth=None,
            limit_bytes=LIMITS.ingress_bytes,
            size_of=_item_bytes if size_of is None else size_of,
            group=group,
        )
        self._mailbox.entity = None if entity is None else weakref.ref(entity)
        self.put: Callable[[Any], None] = node_handle.ingress.put_to(self._mailbox)

    @property
    def dropped(self) -> int:
        """Items that were pushed out by newer ones."""
        return self._mailbox.dropped

    def close(self) -> None:
        """Forget what waits; what is put later is handled still, where the node is spun."""
        self._mailbox.clear()


def _item_bytes(item: Any) -> int:
    return _ITEM_BYTES
