"""Who is told of work: no item may wait for ever between the one that appends and the one that empties."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

from metaros.executor import ChannelMailbox, Ingress, Mailbox
from metaros.executor.ready_queue import ReadyQueue
from tests.support.waiting import wait_until


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


def burst(ingress: Ingress, mailbox: Mailbox, count: int) -> None:
    put = ingress.put_to(mailbox)
    for number in range(count):
        put(number)
    ingress.collect()


def test_only_before_an_executor_that_looks_a_burst_is_no_backlog() -> None:
    ingress, ready_queue, node = Ingress(), ReadyQueue(), object()
    ingress.claim(ready_queue, [node])
    stuck, looks = (Mailbox(print, owner=node, depth=3, limit_bytes=1 << 20, size_of=lambda _: 1) for _ in range(2))
    burst(ingress, stuck, 50)
    assert (list(stuck.pending), stuck.dropped) == ([47, 48, 49], 47)
    ready_queue.looked_s = time.monotonic() + 60  # not a moment ago at all
    burst(ingress, looks, 50)
    assert len(looks.pending) + looks.dropped == 50
    wait_until(lambda: list(looks.pending) == [47, 48, 49])  # it handles nothing: the relief thread keeps the bound
    assert (looks.dropped, looks.late_s) == (47, 0.0)
    ingress.close()


def test_a_bell_fills_from_the_channel_and_what_is_left_comes_as_items_are_handled() -> None:
    ingress, ready_queue, node = Ingress(), ReadyQueue(), object()
    ingress.claim(ready_queue, [node])
    box = ChannelMailbox(print, owner=node, depth=None, limit_bytes=1 << 20, size_of=lambda _: 1)
    channel = deque(range(600))
    ingress.attach(box, lambda: channel.popleft() if channel else None, lambda on: None)
    ingress.put_to(box)("rung")
    ingress.collect()
    handled: list[Any] = []
    while taken := ingress.take_ready(ready_queue):
        assert taken == [box]
        handled.extend(box.pending.popleft() for _ in range(min(64, len(box.pending))))
        ingress.requeue(box)
    assert handled == list(range(600))
    ingress.detach(box)
    channel.append(600)
    ingress.put_to(box)("rung")
    ingress.collect()
    assert (ingress.take_ready(ready_queue), list(channel)) == ([], [600])
    ingress.close()
