"""TCP reachability of a gateway, checked before a transport is blamed.

TCP asks for a lost connection again after 1, 3, 7 … s. Here a new request leaves every quarter second, so that an agent
is back soon after its network.
"""

from __future__ import annotations

import asyncio
import contextlib
import urllib.request

from edge_agent.config.gateway_address import GatewayAddress
from edge_agent.errors import LinkError

__all__ = ["wait_reachable"]

WITHIN_S = 3.0
EVERY_S = 0.25
MOST_HOSTS = 4


async def wait_reachable(address: GatewayAddress, *, within_s: float = WITHIN_S, every_s: float = EVERY_S) -> None:
    """Return once a TCP connection came about; where the system has a forward proxy for it, at once.

    Raises:
        LinkError: it was refused, or not answered.
    """
    if proxied(address.host):
        return
    tries: set[asyncio.Task[None]] = set()
    try:
        async with asyncio.timeout(within_s):
            await first_connection(await resolve(address), address.port, tries, every_s)
    except TimeoutError:
        raise LinkError(f"{address.authority} does not answer") from None
    except OSError as error:
        raise LinkError(f"cannot reach {address.authority}: {error.strerror or error}") from error
    finally:
        for task in tries:
            task.cancel()
        await asyncio.gather(*tries, return_exceptions=True)


async def first_connection(hosts: set[str], port: int, tries: set[asyncio.Task[None]], every_s: float) -> None:
    """Try all hosts every so often until one connects; OSError once all of them have failed."""
    last: BaseException = OSError("no such host")
    while hosts:
        now = {host: asyncio.create_task(try_connect(host, port)) for host in hosts}
        tries.update(now.values())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(every_s):
                while pending := [task for task in tries if not task.done()]:
                    await asyncio.wait(pending, return_when=asyncio.FIRST_COMPLETED)
                    if any(task.done() and task.exception() is None for task in tries):
                        return
        for host, task in now.items():
            if task.done() and (failed := task.exception()) is not None:
                last = failed
                hosts.discard(host)
    raise last


async def try_connect(host: str, port: int) -> None:
    """Open a TCP connection, and close it."""
    _reader, writer = await asyncio.open_connection(host, port)
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


async def resolve(address: GatewayAddress) -> set[str]:
    """The host's numbers."""
    found = await asyncio.get_running_loop().getaddrinfo(address.host, address.port, type=1)
    return {str(info[4][0]) for info in found[:MOST_HOSTS]}


def proxied(host: str) -> bool:
    """Whether this system sends connections to a host through a forward proxy (http_proxy and the like)."""
    return bool(urllib.request.getproxies().keys() - {"no"}) and not urllib.request.proxy_bypass(host)
