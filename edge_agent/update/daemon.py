"""Long blocking work beside an event loop, on a thread that nobody waits for at the end of the program."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["in_daemon"]

T = TypeVar("T")


async def in_daemon(work: Callable[[], T]) -> T:
    """What `work()` returns or raises. It goes on when this is cancelled, and ends with the program, wherever it is."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[T] = loop.create_future()

    def tell(set_it: Callable[[Any], None], value: Any) -> None:
        if not done.done():
            set_it(value)

    def run() -> None:
        try:
            found, set_it = work(), done.set_result
        except BaseException as error:
            found, set_it = error, done.set_exception  # type: ignore[assignment]
        if not loop.is_closed():
            loop.call_soon_threadsafe(tell, set_it, found)

    threading.Thread(target=run, name="update", daemon=True).start()
    return await done
