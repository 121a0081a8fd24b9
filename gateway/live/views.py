"""Decoded views of samples, made in time for those who need them and never at the loop's expense.

What is quick is made on the loop, up to `BUDGET_S` a tick; the rest in one thread, whose blocks keep their order and
are bounded in bytes. How long a view of a channel takes is learned from the ones before.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from time import thread_time
from typing import Any

from gateway.live.encoding import Block, Encoding, View, view_of
from gateway.live.selection import Selection
from metaros.limits import LIMITS

__all__ = ["Views"]

BUDGET_S = 0.002
UNKNOWN_S_PER_BYTE = 0.5e-6
MAX_COSTS = 4096
LEARNING = 0.25

Deliver = Callable[[Selection, Block, Encoding], None]


@dataclass(slots=True)
class _Lane:
    """Blocks of one selection that wait for one view, oldest first; the first is being made."""

    blocks: deque[tuple[Block, list[Encoding]]] = field(default_factory=deque)
    size_bytes: int = 0


class Views:
    """Lives on the event loop. `deliver` is called when a block's view is there."""

    def __init__(self, deliver: Deliver) -> None:
        self._deliver = deliver
        self._lanes: dict[tuple[Selection, View[Any]], _Lane] = {}
        self._costs: dict[tuple[View[Any], str], float] = {}  # seconds a byte, by view and type
        self._spent_s = 0.0
        self._thread: ThreadPoolExecutor | None = None

    def begin(self) -> None:
        """A tick begins: it may spend its time."""
        self._spent_s = 0.0

    def make(self, selection: Selection, block: Block, encoding: Encoding) -> None:
        """Deliver the block when the view that `encoding` needs is there: now, or after the ones before it."""
        view = view_of(encoding)
        if view is None:
            self._deliver(selection, block, encoding)
            return
        lane = self._lanes.get((selection, view))
        if lane is None and (block.has(view) or self._is_quick(view, block)):
            self._spent_s += self._measure(view, block)
            self._deliver(selection, block, encoding)
            return
        if lane is None:
            lane = self._lanes[selection, view] = _Lane()
        if lane.blocks and lane.blocks[-1][0] is block:
            lane.blocks[-1][1].append(encoding)
            return
        lane.blocks.append((block, [encoding]))
        lane.size_bytes += block.size_bytes
        self._bound(selection, lane)
        if len(lane.blocks) == 1:
            self._start(selection, view, lane)

    def close(self) -> None:
        """Stop the thread; what it was making is not delivered."""
        self._lanes.clear()
        if self._thread is not None:
            self._thread.shutdown(cancel_futures=True)

    def _is_quick(self, view: View[Any], block: Block) -> bool:
        cost = self._costs.get((view, block.channel.schema_name), UNKNOWN_S_PER_BYTE)
        return self._spent_s + cost * block.size_bytes <= BUDGET_S

    def _measure(self, view: View[Any], block: Block) -> float:
        """Make the view; how long that took."""
        if block.has(view):
            return 0.0
        began_s = thread_time()  # of work: a thread that had to wait for its CPU says nothing about the view
        block.views(view)
        took_s = thread_time() - began_s
        key, cost = (view, block.channel.schema_name), took_s / max(1, block.size_bytes)
        if len(self._costs) >= MAX_COSTS:
            self._costs.clear()
        before = self._costs.get(key, cost)
        self._costs[key] = before + LEARNING * (cost - before)
        return took_s

    def _start(self, selection: Selection, view: View[Any], lane: _Lane) -> None:
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, thread_name_prefix="views")
        loop = asyncio.get_running_loop()
        block = lane.blocks[0][0]

        def work() -> None:
            self._measure(view, block)
            try:
                loop.call_soon_threadsafe(self._done, selection, view, lane)
            except RuntimeError:
                return  # the loop is over, and so are its viewers

        self._thread.submit(work)

    def _done(self, selection: Selection, view: View[Any], lane: _Lane) -> None:
        if self._lanes.get((selection, view)) is not lane:
            return
        block, encodings = lane.blocks.popleft()
        lane.size_bytes -= block.size_bytes
        for encoding in encodings:
            self._deliver(selection, block, encoding)
        if lane.blocks:
            self._start(selection, view, lane)
        else:
            del self._lanes[selection, view]

    @staticmethod
    def _bound(selection: Selection, lane: _Lane) -> None:
        """Of what waits for the thread, the oldest goes: in mode "latest" all but the newest, else what is too much."""
        while len(lane.blocks) > 2 and (selection.latest or lane.size_bytes > LIMITS.view_queue_bytes):
            block, encodings = lane.blocks[1]
            del lane.blocks[1]
            lane.size_bytes -= block.size_bytes
            if selection.latest:
                continue
            for encoding in encodings:
                for viewer, subscription in selection.groups.get(encoding, ()):
                    viewer.lost(subscription, len(block.records))
