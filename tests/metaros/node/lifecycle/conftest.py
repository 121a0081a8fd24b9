"""A lifecycle node on a real router, and a peer that asks for its services; clocks that move when told."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import metaros
from metaros.clock import ManualClock
from tests.support.nodes.contexts import SharedContexts

Serve = Callable[..., metaros.SingleThreadedExecutor]


@pytest.fixture
def manual() -> ManualClock:
    """The clock of the context `still`."""
    return ManualClock()


@pytest.fixture
def still(contexts: SharedContexts, zenoh_router: str, manual: ManualClock) -> Iterator[metaros.Context]:
    """A context whose timers run by the manual clock."""
    with contexts.lend("still", clock=manual) as context:
        yield context


@pytest.fixture
def spin() -> Iterator[Callable[[Any], None]]:
    """`spin(node)` runs a node on a thread until the test ends."""
    running: list[tuple[metaros.SingleThreadedExecutor, threading.Thread]] = []

    def start(node: metaros.Node) -> None:
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        running.append((executor, thread))

    yield start
    for executor, thread in running:
        executor.shutdown()
        thread.join()
