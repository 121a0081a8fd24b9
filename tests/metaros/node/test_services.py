"""Services and clients: plain and async, ready and missing, slow and failing."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh

import metaros
from metaros.cdr import codec
from metaros.errors import FieldError, PeerError, TimeoutError_, UnavailableError
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.node.service import query_bytes
from tests.support.waiting import wait_until


@contextmanager
def spinning(node: metaros.Node) -> Iterator[None]:
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


@pytest.fixture
def server(there):
    with metaros.Node("server", context=there) as node:
        yield node


@pytest.fixture
def client_node(here):
    with metaros.Node("client", context=here) as node:
        yield node


def test_a_request_that_another_thread_has_answered_weighs_nothing(here):
    """A thread sorts what arrives, and weighs what waits, while the executor's answers it."""
    queries: list[zenoh.Query] = []
    sink = zenoh.handlers.Callback(queries.append, indirect=False)
    with here.session.zenoh.declare_queryable("weighed", sink):
        here.session.zenoh.get("weighed", payload=b"0123456789")
        (query,) = queries
        assert query_bytes(query) == 512 + 10
        query.drop()
        assert query_bytes(query) == 0


def test_a_call_returns_the_response(server, client_node):
    @server.service(AddTwoInts, "~/add")
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    client = client_node.create_client(AddTwoInts, "/server/add")
    with spinning(server):
        assert client.wait_for_service(60)
        assert client.call(AddTwoInts.Request(a=3, b=4)).sum == 7
        assert asyncio.run(client.call_async(AddTwoInts.Request(a=-1, b=1))).sum == 0
        raw = client_node.create_raw_client("/server/add", AddTwoInts.__metaros_name__, AddTwoInts.__metaros_hash__)
        answer = raw.call(codec(AddTwoInts.Request).encode(AddTwoInts.Request(a=1, b=1)), timeout_s=60)
        assert codec(AddTwoInts.Response).decode(answer).sum == 2


def test_async_servers_serve_others_while_they_wait(server, client_node):
    gate = asyncio.Event()

    @server.service(Trigger, "~/wait")
    async def wait(request: Any, response: Any) -> Any:
        await gate.wait()
        return Trigger.Response(success=True, message="waited")

    @server.service(Trigger, "~/open")
    async def open_(request: Any, response: Any) -> None:
        gate.set()

    waiter = client_node.create_client(Trigger, "/server/wait")
    opener = client_node.create_client(Trigger, "/server/open")
    with spinning(server):
        assert waiter.wait_for_service(60)
        assert opener.wait_for_service(60)

        async def both() -> Any:
            waiting = asyncio.create_task(waiter.call_async(Trigger.Request()))
            await asyncio.sleep(0)
            await opener.call_async(Trigger.Request())
            return await waiting

        assert asyncio.run(both()).message == "waited"


def test_no_server_is_said_at_once(client_node):
    client = client_node.create_client(Trigger, "/nobody")
    assert not client.service_is_ready()
    assert not client.wait_for_service(0.01)
    with pytest.raises(UnavailableError, match="/nobody"):
        client.call(Trigger.Request(), timeout_s=60)


def test_a_server_that_does_not_answer_is_a_timeout(server, client_node):
    server.create_service(Trigger, "~/deaf", lambda request, response: None)
    client = client_node.create_client(Trigger, "/server/deaf")
    assert client.wait_for_service(60)
    with pytest.raises(TimeoutError_, match="deaf"):
        client.call(Trigger.Request(), timeout_s=0.1)
    with pytest.raises(TimeoutError_):
        asyncio.run(client.call_async(Trigger.Request(), timeout_s=0.1))


def test_a_failing_server_refuses(server, client_node, caplog):
    @server.service(Trigger, "~/fail")
    def fail(request: Any, response: Any) -> None:
        raise RuntimeError("broken arm")

    @server.service(Trigger, "~/wrong")
    def wrong(request: Any, response: Any) -> Any:
        return Trigger.Response(message=3)

    with spinning(server):
        for name, text in (("fail", "broken arm"), ("wrong", "message")):
            client = client_node.create_client(Trigger, f"/server/{name}")
            assert client.wait_for_service(60)
            with pytest.raises(PeerError, match=text):
                client.call(Trigger.Request())
    assert "RuntimeError: broken arm" in caplog.text


def test_malformed_requests_are_refused_and_counted(server, client_node, here):
    service = server.create_service(AddTwoInts, "~/add", lambda request, response: None)
    raw = client_node.create_raw_client("/server/add", service.type_name, service.type_hash)
    with spinning(server):
        assert raw.wait_for_service(60)
        with pytest.raises(PeerError, match="malformed_cdr"):
            raw.call(b"\x00\x01", timeout_s=60)
        replies = list(here.session.zenoh.get(service.key, payload=b"\x00\x01\x00\x00"))
        assert b"attachment" in replies[0].err.payload.to_bytes()
    assert service.malformed == 2


def test_waiting_requests_are_bounded_by_the_backlog(server, client_node):
    service = server.create_service(Trigger, "~/busy", lambda request, response: None, backlog=2)
    client = client_node.create_client(Trigger, "/server/busy")
    assert client.wait_for_service(60)

    async def flood() -> list[Any]:
        calls = [client.call_async(Trigger.Request(), timeout_s=0.5) for _ in range(5)]
        return await asyncio.gather(*calls, return_exceptions=True)

    outcomes = asyncio.run(flood())
    assert len(outcomes) == 5
    wait_until(lambda: service.dropped == 3)


def test_a_wrong_request_is_the_callers_fault(server, client_node):
    client = client_node.create_client(Trigger, "/server/x")
    with pytest.raises(FieldError, match="Trigger"):
        client.call(AddTwoInts.Request())
