"""Many callers, one transaction."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from gateway.automation.queue.group_commit import GroupCommit
from tests.support.waiting import wait_until_async


class Slow:
    """Commits when told; keeps what came together."""

    def __init__(self) -> None:
        self.groups: list[list[int]] = []
        self.go = asyncio.Event()

    async def commit(self, items: Sequence[int]) -> Sequence[str | Exception]:
        """A wrong item is refused, a bad one spoils all."""
        self.groups.append(list(items))
        await self.go.wait()
        if 606 in items:
            raise OSError("spoilt")
        return [ValueError("wrong") if item < 0 else str(item) for item in items]


def grouped(slow: Slow) -> GroupCommit[int, str]:
    """Four items or ten bytes at a time."""
    return GroupCommit[int, str](slow.commit, size_bytes=lambda item: item % 100, most_items=4, most_bytes=10)


async def test_what_comes_during_a_commit_goes_into_the_next() -> None:
    slow = Slow()
    group = grouped(slow)
    callers = [asyncio.create_task(group.submit(item)) for item in (1, 2)]
    await asyncio.sleep(0)
    callers += [asyncio.create_task(group.submit(item)) for item in (100, 101, 102, 103, 104, 9)]
    await wait_until_async(lambda: slow.groups and group.waiting == 6)
    assert group.waiting_bytes == 0 + 1 + 2 + 3 + 4 + 9
    slow.go.set()
    assert await asyncio.gather(*callers) == ["1", "2", "100", "101", "102", "103", "104", "9"]
    assert slow.groups == [[1, 2], [100, 101, 102, 103], [104], [9]]
    assert (group.waiting, group.waiting_bytes) == (0, 0)


async def test_each_caller_gets_its_own_answer_and_a_failed_commit_is_everybodys() -> None:
    slow = Slow()
    slow.go.set()
    group = grouped(slow)
    assert await group.submit(3) == "3"
    good, wrong = await asyncio.gather(group.submit(1), group.submit(-100), return_exceptions=True)
    assert (good, str(wrong)) == ("1", "wrong")
    for item in await asyncio.gather(group.submit(200), group.submit(606), return_exceptions=True):
        assert isinstance(item, OSError)
    assert await group.submit(5) == "5"


async def test_a_caller_that_gave_up_holds_nobody_up_and_is_not_committed_if_it_still_waited() -> None:
    slow = Slow()
    group = grouped(slow)
    first = asyncio.create_task(group.submit(1))
    await asyncio.sleep(0)
    gone, last = asyncio.create_task(group.submit(2)), asyncio.create_task(group.submit(3))
    await asyncio.sleep(0)
    gone.cancel()
    first.cancel()
    slow.go.set()
    assert await last == "3"
    assert slow.groups == [[1], [3]]
    with pytest.raises(asyncio.CancelledError):
        await gone
    await group.close()
