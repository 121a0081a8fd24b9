"""Contexts that tests share: one router and its contexts for a worker, left by each test as it found them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import metaros
from metaros.clock import Clock
from tests.support.waiting import wait_until

__all__ = ["SharedContexts"]


class SharedContexts:
    """`lend` a context to a test; it is opened anew only where a test has closed it."""

    def __init__(self, router: str) -> None:
        self.router = router
        self._contexts: dict[str, metaros.Context] = {}

    @contextmanager
    def lend(self, name: str, *, clock: Clock | None = None) -> Iterator[metaros.Context]:
        """The context of that name, without nodes; when the test is over, its nodes have left every graph."""
        context = self._contexts.get(name)
        if context is None or context.closed:
            context = self._contexts[name] = metaros.Context(domain_id=0, connect=self.router, environ={})
        own_clock = context.clock
        context.clock = clock or own_clock
        try:
            yield context
        finally:
            context.clock = own_clock
            for node in list(context._nodes):
                node.close()

    def settle(self) -> None:
        """Nobody is seen any more, by anybody: what comes next meets nothing of what was."""
        for context in self._contexts.values():
            if not context.closed:
                wait_until(lambda graph=context.graph: not graph.nodes() and not graph.endpoints())  # type: ignore[misc]

    def close(self) -> None:
        """End all of them."""
        for context in self._contexts.values():
            context.close()

    def __enter__(self) -> SharedContexts:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()
