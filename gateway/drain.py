"""The gateway's end in its order: not ready, robots told, sockets closed, what is under way finished, within a bound.

1  /readyz says 503; everything goes on for `drain_notice_s`, so that a load balancer notices and sends nobody
2  robots get a Goodbye, and are back soon: at another gateway, or at the next one here
3  nobody is let in any more; WebSockets are closed with 1001; requests and calls finish within `drain_s`
4  what is not finished by then is cut
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

import grpc

from gateway.app import Gateway

__all__ = ["drain"]

log = logging.getLogger(__name__)

ROBOTS_S = 0.5  # in which a Goodbye reaches its robot


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
    gateway.links.close()
    await robots.stop(ROBOTS_S)
    gateway.events.journal.end()  # streams that would never finish
    await asyncio.gather(programs.stop(settings.drain_s), end_http())
    log.info("ended: nobody is connected")
