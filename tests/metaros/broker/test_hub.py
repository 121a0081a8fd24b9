"""The hub alone: opaque frames at libzmq's speed, by tcp and ipc; what it counts and what it refuses."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import zmq

from metaros.broker.hub import Hub, HubOptions, endpoint
from metaros.errors import ConfigError
from tests.support.ports import free_port
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until


@pytest.mark.skipif(sys.platform == "win32", reason="no ipc")
def test_several_endpoints_and_exact_copies(tmp_path: Path) -> None:
    before = threads_now()
    ipc_in, ipc_out = (f"ipc://{tmp_path}/{name}" for name in ("in", "out"))
    tcp_in, tcp_out = (f"tcp://127.0.0.1:{free_port()}" for _ in range(2))
    hub = Hub(HubOptions(xsub=(tcp_in, ipc_in), xpub=(tcp_out, ipc_out)))
    try:
        with zmq.Context() as context:
            with context.socket(zmq.PUB) as one, context.socket(zmq.PUB) as two, context.socket(zmq.SUB) as ears:
                for socket, where in ((one, tcp_in), (two, ipc_in), (ears, ipc_out)):
                    socket.linger = 0
                    socket.connect(where)
                ears.connect(tcp_out)
                ears.subscribe(b"")
                received: set[tuple[bytes, ...]] = set()

                def both() -> bool:
                    one.send(b"one \x00")
                    two.send_multipart([b"two", b"\xff" * 1000])
                    while ears.poll(0):
                        received.add(tuple(ears.recv_multipart()))
                    return len(received) == 2

                wait_until(both)
        assert received == {(b"one \x00",), (b"two", b"\xff" * 1000)}

        def counted() -> bool:
            hub.ask_totals()
            return hub.read_totals().frames >= 3

        wait_until(counted)
    finally:
        hub.close()
    assert left_behind(before) == []


def test_the_bridge_never_hears_itself_and_sees_who_subscribes() -> None:
    options = HubOptions(xsub=(f"tcp://127.0.0.1:{free_port()}",), xpub=(f"tcp://127.0.0.1:{free_port()}",))
    hub = Hub(options)
    try:
        with zmq.Context() as context, context.socket(zmq.SUB) as ears, context.socket(zmq.PUB) as mouth:
            mouth.linger = 0
            ears.connect(options.xpub[0])
            mouth.connect(options.xsub[0])
            ears.subscribe(b"/a")
            assert hub.outbound.poll(60_000)
            assert hub.outbound.recv() == b"\x01/a"
            hub.outbound.send(b"/a by the bridge")
            assert ears.poll(60_000)
            assert ears.recv() == b"/a by the bridge"

            heard: list[bytes] = []

            def listen(say: bytes) -> list[bytes]:
                mouth.send(say)
                while hub.received.poll(0):
                    heard.append(hub.received.recv())
                return heard

            wait_until(lambda: b"/a by a program" in listen(b"/a by a program"))
            ears.unsubscribe(b"/a")
            assert hub.outbound.poll(60_000)
            assert hub.outbound.recv() == b"\x00/a"
            wait_until(lambda: b"\x00/a" in listen(b"/a by a program"))
            assert set(heard) == {b"\x01/a", b"\x00/a", b"/a by a program"}, "and nothing of its own"
            hub.ignore(b"/a ")
            wait_until(lambda: listen(b"/a later") and listen(b"/b") and heard[-1] == heard[-2] == b"/b")
            hub.heed(b"/a ")
            wait_until(lambda: listen(b"/a again")[-1] == b"/a again")
    finally:
        hub.close()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("5555", "tcp://127.0.0.1:5555"),
        ("tcp://0.0.0.0:7000", "tcp://0.0.0.0:7000"),
        ("tcp://[::1]:7000", "tcp://[::1]:7000"),
    ],
)
def test_endpoints(text: str, expected: str) -> None:
    assert endpoint(text) == expected


@pytest.mark.parametrize(
    "text", ["", "http://x:1", "tcp://", "tcp://host", "tcp://host:0", "tcp://host:70000", "tcp://host:²", "ipc://"]
)
def test_what_is_no_endpoint(text: str) -> None:
    with pytest.raises(ConfigError):
        endpoint(text)
