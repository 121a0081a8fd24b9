"""Many callers, one transaction: what comes while one is under way goes into the next, all of it together.

So a caller waits for at most two commits, and a disk that takes a hundred commits a second still takes thousands of
callers.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import Generic, TypeVar

__all__ = ["GroupCommit"]

Item = TypeVar("Item")
Answer = TypeVar("Answer")


class GroupCommit(Generic[Item, Answer]):
    """`commit` gets some items and gives each its answer, or the exception that its caller gets.

    `waiting_bytes` is the size of those that wait; whoever submits for others bounds it.
    """

    def __init__(
        self,
        commit: Callable[[Sequence[Item]], Awaitable[Sequence[Answer | Exception]]],
        *,
        size_bytes: Callable[[Item], int],
        most_items: int,
        most_bytes: int,
    ) -> None:
        self._commit = commit
        self._size_bytes = size_bytes
        self._most_items = most_items
        self._most_bytes = most_bytes
        self._waiting: deque[tuple[Item, int, asyncio.Future[Answer]]] = deque()
        self.waiting_bytes = 0
        self._task: asyncio.Task[None] | None = None

    @property
    def waiting(self) -> int:
        """How many items wait for their transaction to begin."""
        return len(self._waiting)

    async def submit(self, item: Item) -> Answer:
        """Its answer, once it is committed; whoever is cancelled meanwhile does not know."""
        size_bytes = self._size_bytes(item)
        future: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        self._waiting.append((item, size_bytes, future))
        self.waiting_bytes += size_bytes
        if self._task is None:
            self._task = asyncio.create_task(self._commit_all())
        return await future

    async def close(self) -> None:
        """Wait for what was submitted."""
        while self._task is not None:
            await asyncio.wait({self._task})

    async def _commit_all(self) -> None:
        try:
            while self._waiting:
                await self._commit_some(self._take())
        finally:
            self._task = None

    def _take(self) -> list[tuple[Item, asyncio.Future[Answer]]]:
        taken: list[tuple[Item, asyncio.Future[Answer]]] = []
        size_bytes = 0
        while self._waiting and len(taken) < self._most_items:
            item, more_bytes, future = self._waiting[0]
            if taken and size_bytes + more_bytes > self._most_bytes:
                break
            self._waiting.popleft()
            self.waiting_bytes -= more_bytes
            size_bytes += more_bytes
            if not future.cancelled():
                taken.append((item, future))
        return taken

    async def _commit_some(self, taken: Sequence[tuple[Item, asyncio.Future[Answer]]]) -> None:
        if not taken:
            return
        answers: Sequence[Answer | Exception]
        try:
            answers = await self._commit([item for item, _ in taken])
        except Exception as error:  # every caller is told what became of its own
            answers = [error] * len(taken)
        for (_, future), answer in zip(taken, answers, strict=True):
            if future.done():
                continue
            if isinstance(answer, Exception):
                future.set_exception(answer)
            else:
                future.set_result(answer)
