"""Drains the gateway: not ready, robots notified, sockets closed, requests finished, within a time limit.

1  /readyz says 503; everything goes on for `drain_notice_s`, so that a load balancer notices and sends nobody
2  commands that are under way, for people here and at other gateways, get their results within `drain_s`
3  robots get a Goodbye, and are back soon: at another gateway, or at the next one here
4  nobody is let in any more; WebSockets are closed with 1001; requests and calls finish within `drain_s`
5  what is not finished by then is cut
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable

import grpc

from gateway.wiring.gateway import Gateway

__all__ = ["drain"]

log = logging.getLogger(__name__)

ROBOTS_S = 0.5  # in which a Goodbye reaches its robot
LOOK_S = 0.02


async def drain(
    gateway: Gateway,
    *,
    robots: grpc.aio.Server,
    programs: grpc.aio.Server,
    end_http: Callable[[], Awaitable[object]],
) -> None:
    """End the servers; `end_http` returns when the HTTP server is done, which has its own bound of `drain_s`."""
    settings = gateway.settings
    gateway.operations.draining = True
    log.info("ending: not ready any more")
    await asyncio.sleep(settings.drain_notice_s)
    await _results(gateway)
    gateway.links.close()
    await robots.stop(ROBOTS_S)
    gateway.events.journal.end()  # streams that would never finish
    await asyncio.gather(programs.stop(settings.drain_s), end_http())
    log.info("ended: nobody is connected")


async def _results(gateway: Gateway) -> None:
    """Return when no command waits for its result, or when its time is over."""
    for _ in range(math.ceil(gateway.settings.drain_s / LOOK_S)):
        if not gateway.commands.under_way and not gateway.cluster.owed:
            return
        await asyncio.sleep(LOOK_S)
