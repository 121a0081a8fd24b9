"""Status queries: answers on `@metaros/<domain>/<zid>/agent` with JSON.

Nothing is published while nobody asks.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import zenoh

from edge_agent.config.settings import Settings
from edge_agent.state.state_dir import default_state_dir
from edge_agent.state.store_id import StoreId
from edge_agent.status.report import running_report
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.session import Identity
from edge_agent.uplink.statistics import LinkFacts
from metaros.node import Context

__all__ = ["REPORT_KEY", "answering"]

REPORT_KEY = "@metaros/{domain}/{zid}/agent"
_AT_ONCE = 16  # questions that wait; further ones get no answer


@contextmanager
def answering(
    context: Context, settings: Settings, who: Identity, queues: Queues, facts: LinkFacts, store_id: StoreId
) -> Iterator[None]:
    """While the block runs, whoever asks gets the agent's report."""
    directory = settings.state_dir or default_state_dir(settings.name)
    robot = {"name": who.robot_id, "namespace": who.namespace, "version": who.agent_version}

    def report() -> dict[str, Any]:
        return running_report(queues, facts, directory=directory, store_id=store_id.value, facts_of_robot=robot)

    with answers(context, report):
        yield


@contextmanager
def answers(context: Context, report: Callable[[], dict[str, Any]]) -> Iterator[None]:
    """While the block runs, the report is made on this event loop for each question."""
    loop = asyncio.get_running_loop()
    places = threading.BoundedSemaphore(_AT_ONCE)

    def answer(query: zenoh.Query) -> None:
        places.release()
        with suppress(zenoh.ZError):
            query.reply(key, json.dumps(report()))
        query.drop()  # type: ignore[no-untyped-call]

    def asked(query: zenoh.Query) -> None:
        if places.acquire(blocking=False):
            with suppress(RuntimeError):  # the loop is closed: the agent ends
                loop.call_soon_threadsafe(answer, query)

    session = context.session
    key = REPORT_KEY.format(domain=session.domain, zid=session.zid)
    queryable: Any = session.check_open().declare_queryable(
        key, zenoh.handlers.Callback(asked, indirect=False), complete=True
    )
    try:
        yield
    finally:
        with suppress(zenoh.ZError):
            queryable.undeclare()
