"""Whether anybody is there at all."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Iterator

import pytest

from edge_agent.config.gateway_address import GatewayAddress, parse_address
from edge_agent.errors import LinkError
from edge_agent.uplink.reachability import wait_reachable
from tests.support.ports import free_port


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0), backlog=1) as listener:
        yield listener


def address_of(listener: socket.socket) -> GatewayAddress:
    """Where it listens."""
    return parse_address(f"127.0.0.1:{listener.getsockname()[1]}")


async def test_somebody_is_there(listener: socket.socket) -> None:
    await wait_reachable(address_of(listener))
    await wait_reachable(parse_address(f"localhost:{listener.getsockname()[1]}"))


async def test_a_refusal_says_so_at_once() -> None:
    with pytest.raises(LinkError, match="cannot reach"):
        await asyncio.wait_for(wait_reachable(parse_address(f"127.0.0.1:{free_port()}"), within_s=600), 60)


async def test_an_unknown_host_says_so() -> None:
    with pytest.raises(LinkError, match="no-such-host"):
        await wait_reachable(parse_address("no-such-host.invalid:80"), within_s=20)


async def test_silence_has_an_end_and_a_later_answer_counts(listener: socket.socket) -> None:
    with contextlib.ExitStack() as stack:
        waiting = []
        for _ in range(8):  # fill the backlog: the system drops further requests
            client = stack.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(listener.getsockname())
            waiting.append(client)
        with pytest.raises(LinkError, match="does not answer"):
            await wait_reachable(address_of(listener), within_s=0.3, every_s=0.1)
        reaching = asyncio.create_task(wait_reachable(address_of(listener), within_s=600, every_s=0.1))
        await asyncio.sleep(0.2)
        assert not reaching.done()
        for _ in range(2):
            stack.enter_context(listener.accept()[0])
        await asyncio.wait_for(reaching, 60)


async def test_a_forward_proxy_of_the_system_is_not_passed_by(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    await wait_reachable(parse_address("no-such-host.invalid:80"))
    with pytest.raises(LinkError):
        await wait_reachable(parse_address(f"127.0.0.1:{free_port()}"))
