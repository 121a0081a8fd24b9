"""What waits to be bridged stays within its bounds, and what does not is counted."""

from __future__ import annotations

import threading
from collections import deque

from metaros.concurrency.backlog import Backlog


def test_oldest_go_first() -> None:
    backlog: Backlog[int] = Backlog(depth=3, limit_bytes=1000)
    for number in range(5):
        backlog.put(number, 10)
    assert (len(backlog), backlog.dropped, backlog.size_bytes) == (3, 2, 30)
    assert [backlog.take() for _ in range(4)] == [2, 3, 4, None]
    assert backlog.size_bytes == 0


def test_bytes_are_bounded_and_the_newest_is_kept() -> None:
    backlog: Backlog[str] = Backlog(depth=100, limit_bytes=100)
    for name, size in (("a", 60), ("b", 30), ("c", 30), ("huge", 500)):
        backlog.put(name, size)
    assert backlog.take() == "huge"
    assert backlog.dropped == 3


def test_what_the_reader_takes_while_the_writer_makes_room_is_not_dropped() -> None:
    taken: list[int | None] = []

    class Overtaken(deque[tuple[int, int]]):
        """The reader takes everything, once, between the writer's look at the length and its own taking."""

        def popleft(self) -> tuple[int, int]:
            if not taken:
                taken.append(None)
                taken.extend(iter(backlog.take, None))
            return super().popleft()

    backlog: Backlog[int] = Backlog(depth=1)
    backlog._items = Overtaken()
    backlog.put(1, 10)
    backlog.put(2, 10)
    assert taken[1:] == [1, 2]
    assert (len(backlog), backlog.dropped, backlog.size_bytes) == (0, 0, 0)


def test_two_threads_lose_nothing_uncounted() -> None:
    backlog: Backlog[int] = Backlog(depth=50, limit_bytes=10_000)
    total, taken, done = 20_000, [], threading.Event()

    def read() -> None:
        while not (done.is_set() and not len(backlog)):
            item = backlog.take()
            if item is not None:
                taken.append(item)

    reader = threading.Thread(target=read)
    reader.start()
    for number in range(total):
        backlog.put(number, 1)
    done.set()
    reader.join()
    assert taken == sorted(taken)
    assert len(taken) + backlog.dropped == total
    assert backlog.size_bytes == 0
    backlog.put(1, 1)
    backlog.clear()
    assert len(backlog) == 0
