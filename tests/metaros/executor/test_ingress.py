"""Who is told of work: no item may wait for ever between the one that appends and the one that empties."""

from __future__ import annotations

from collections import deque
from typing import Any

from metaros.executor import Ingress, Mailbox
from metaros.executor.ready_queue import ReadyQueue


class Interrupted(deque[Any]):
    """A backlog during whose emptiness check another thread appends: the worst moment for it."""

    def __init__(self, ingress: Ingress) -> None:
        super().__init__()
        self.ingress = ingress
        self.mailbox: Mailbox | None = None

    def __bool__(self) -> bool:
        empty = len(self) == 0
        mailbox, self.mailbox = self.mailbox, None
        if mailbox is not None:
            self.append("late")
            self.told = not mailbox.queued  # what the appending thread decides by
        return not empty


def test_an_item_appended_while_the_mailbox_is_given_back_is_not_forgotten() -> None:
    ingress, ready_queue, node = Ingress(), ReadyQueue(), object()
    ingress.claim(ready_queue, [node])
    mailbox = Mailbox(print, owner=node, depth=None, limit_bytes=1 << 20, size_of=lambda _: 1)
    pending = mailbox.pending = Interrupted(ingress)
    ingress.offer(mailbox)
    assert ingress.take_ready(ready_queue) == [mailbox]
    pending.mailbox = mailbox
    ingress.requeue(mailbox)
    if pending.told:
        ingress.offer(mailbox)
    assert ingress.take_ready(ready_queue) == [mailbox]
    ingress.close()
