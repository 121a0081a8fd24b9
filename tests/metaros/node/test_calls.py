"""Calls under stress: many at once, cancelled, from callbacks, to servers that die or block."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

import pytest

import metaros
from metaros.errors import ClosedError, PeerError, TimeoutError_, UnavailableError, UsageError
from metaros.interfaces.example_interfaces.srv import AddTwoInts
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.node.pending_call import PendingCall
from tests.support.waiting import wait_until


@contextmanager
def spinning(*nodes: metaros.Node) -> Iterator[None]:
    executor = metaros.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


def add(request: Any, response: Any) -> None:
    response.sum = request.a + request.b


@pytest.fixture
def server(there):
    with metaros.Node("server", context=there) as node:
        yield node


@pytest.fixture
def client_node(here):
    with metaros.Node("client", context=here) as node:
        yield node


@pytest.fixture
def adder(server, client_node):
    """A client of a server that spins."""
    server.create_service(AddTwoInts, "/add", add)
    client = client_node.create_client(AddTwoInts, "/add")
    with spinning(server):
        assert client.wait_for_service(60)
        yield client


def test_a_thousand_calls_at_once_need_no_thread_each(adder):
    most = threading.active_count() + 5  # others' come and go: an answer to `metaros top`, one of Zenoh's own

    async def all_of_them() -> list[int]:
        calls = [adder.call_async(AddTwoInts.Request(a=n, b=1), timeout_s=60) for n in range(1000)]
        answers = asyncio.gather(*calls)
        await asyncio.sleep(0)
        assert threading.active_count() < most
        return [answer.sum for answer in await answers]

    assert asyncio.run(all_of_them()) == list(range(1, 1001))
    futures = [adder.call_future(AddTwoInts.Request(a=n, b=2), timeout_s=60) for n in range(1000)]
    assert threading.active_count() < most
    assert [future.result(60).sum for future in futures] == list(range(2, 1002))


def test_a_node_closes_while_one_of_its_calls_runs_out_of_time(server, client_node):
    """The end of /rosout once waited, with Python's lock, for Zenoh's thread of time-outs, which wanted that lock."""
    server.create_service(AddTwoInts, "/deaf", add)  # nobody spins it
    client = client_node.create_client(AddTwoInts, "/deaf")
    assert client.wait_for_service(60)
    out_of_time, never = threading.Event(), threading.Event()
    future = client.call_future(AddTwoInts.Request(a=1, b=2), timeout_s=0.05)
    future.call.when_finished(lambda: out_of_time.set() or never.wait(0.2))
    assert out_of_time.wait(60)
    began_s = time.monotonic()
    client_node.close()
    assert time.monotonic() - began_s < 8.0  # it was ten, for the whole program
    with pytest.raises(TimeoutError_, match=r"within 0\.05 s"):
        future.result(60)


def test_threads_may_share_a_client(adder):
    sums: list[list[int]] = [[] for _ in range(8)]

    def work(number: int) -> None:
        sums[number] = [adder.call(AddTwoInts.Request(a=number, b=n), timeout_s=60).sum for n in range(50)]

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sums == [list(range(number, number + 50)) for number in range(8)]


def test_futures_give_errors_and_run_callbacks_off_the_network(adder, server, client_node):
    where: list[str] = []
    future = adder.call_future(AddTwoInts.Request(a=1, b=2))
    future.add_done_callback(lambda _: where.append(threading.current_thread().name))
    assert future.result(60).sum == 3
    wait_until(lambda: where)
    assert where[0] in ("metaros/add-replies", "MainThread")
    server.create_service(Trigger, "/fail", lambda request, response: 1 / 0)
    client = client_node.create_client(Trigger, "/fail")
    assert client.wait_for_service(60)
    assert isinstance(client.call_future(Trigger.Request()).exception(10), PeerError)
    with pytest.raises(UnavailableError):
        client_node.create_client(Trigger, "/nobody").call_future(Trigger.Request())
    with pytest.raises(UsageError, match="timeout"):
        client.call(Trigger.Request(), timeout_s=0)


def test_a_call_can_be_cancelled_and_its_late_answer_is_ignored(server, client_node):
    gate = threading.Event()

    @server.service(Trigger, "/slow")
    def slow(request: Any, response: Any) -> None:
        gate.wait(60)

    client = client_node.create_client(Trigger, "/slow")
    with spinning(server):
        assert client.wait_for_service(60)
        future = client.call_future(Trigger.Request(), timeout_s=60)
        assert future.cancel()
        with pytest.raises(CancelledError):
            future.result(60)

        async def give_up() -> None:
            task = asyncio.create_task(client.call_async(Trigger.Request(), timeout_s=60))
            await asyncio.sleep(0.01)
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task

        asyncio.run(give_up())
        with pytest.raises(TimeoutError_):
            client.call(Trigger.Request(), timeout_s=0.05)
        gate.set()
        assert client.call(Trigger.Request(), timeout_s=60) == Trigger.Response()
        assert not client._calls


def test_a_server_that_closes_ends_calls_at_once(server, client_node):
    began = threading.Event()
    gate = asyncio.Event()

    @server.service(Trigger, "/never")
    async def never(request: Any, response: Any) -> None:
        began.set()
        await gate.wait()

    client = client_node.create_client(Trigger, "/never")
    with spinning(server):
        assert client.wait_for_service(60)
        future = client.call_future(Trigger.Request(), timeout_s=60)
        assert began.wait(60)
        server.close()
        with pytest.raises(UnavailableError):
            future.result(60)


def test_closing_the_client_ends_its_calls(server, client_node):
    server.create_service(Trigger, "/deaf", lambda request, response: None)  # nobody spins
    client = client_node.create_client(Trigger, "/deaf")
    assert client.wait_for_service(60)
    future = client.call_future(Trigger.Request(), timeout_s=60)
    client.close()
    with pytest.raises(ClosedError):
        future.result(60)
    with pytest.raises(ClosedError):
        client.call(Trigger.Request())


def test_a_plain_callback_may_call_another_process_and_is_reported_when_it_would_wait_for_itself(adder, client_node):
    own = client_node.create_client(AddTwoInts, "~/own")
    client_node.create_service(AddTwoInts, "~/own", add)
    sums: list[int] = []
    errors: list[UsageError] = []

    @client_node.timer(0.01)
    def tick() -> None:
        sums.append(adder.call(AddTwoInts.Request(a=20, b=1), timeout_s=60).sum)
        try:
            own.call(AddTwoInts.Request(), timeout_s=60)
        except UsageError as error:
            errors.append(error)

    with spinning(client_node):
        wait_until(lambda: errors)
        assert own.call(AddTwoInts.Request(a=1, b=1), timeout_s=60).sum == 2  # any other thread may
    assert sums[0] == 21
    assert "would wait for itself" in str(errors[0])


def test_an_async_callback_may_call_its_own_executor(client_node):
    client_node.create_service(AddTwoInts, "~/own", add)
    own = client_node.create_client(AddTwoInts, "~/own")
    sums: list[int] = []

    @client_node.timer(0.01)
    async def tick() -> None:
        sums.append((await own.call_async(AddTwoInts.Request(a=20, b=2), timeout_s=60)).sum)

    with spinning(client_node):
        wait_until(lambda: sums)
    assert sums[0] == 22


@pytest.mark.parametrize("held_s", [0.3, pytest.param(4.0, marks=pytest.mark.integration)])
def test_a_callback_that_blocks_delays_calls_and_loses_none(server, client_node, held_s):
    gate, blocked = threading.Event(), threading.Event()

    @server.timer(0.01)
    def block() -> None:
        blocked.set()
        gate.wait(2 * held_s)

    server.create_service(AddTwoInts, "/add", add)
    client = client_node.create_client(AddTwoInts, "/add")
    with spinning(server):
        assert client.wait_for_service(60)
        assert blocked.wait(60)
        futures = [client.call_future(AddTwoInts.Request(a=n), timeout_s=60) for n in range(100)]
        with pytest.raises(TimeoutError_):
            client.call(AddTwoInts.Request(), timeout_s=held_s)
        gate.set()
        assert [future.result(60).sum for future in futures] == list(range(100))


def test_who_asks_to_be_woken_after_the_end_is_woken_at_once():
    woken: list[str] = []
    call = PendingCall("/add", 1, bytes(16), 60.0)
    call.when_finished(lambda: woken.append("before"))
    assert woken == []
    call.cancel()
    assert woken == ["before"]
    call.when_finished(lambda: woken.append("after"))
    assert woken == ["before", "after"]
    with pytest.raises(PeerError, match="the call of /add was cancelled"):
        call.outcome()
