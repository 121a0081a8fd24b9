"""A program on the same Zenoh routers that is no gateway of the store can neither read, forge nor replay."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from gateway.cluster.keys import BOOT_BYTES
from gateway.identity.master import MasterKey, make_key_file
from tests.gateway.cluster.meshes import STORE, all_met, made, running
from tests.support.ports import free_port
from tests.support.servers.zenoh_router import inner_router
from tests.support.waiting import wait_until_async

SECRET = b"where the robot is, and who drives it"
LIVE = f"metaros/gateways/{STORE}/live"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A router's port."""
    port = free_port()
    with inner_router(port):
        yield port


class Stranger:
    """Hears everything on the router, and may put anything there."""

    def __init__(self, port: int) -> None:
        config = zenoh.Config()
        for key, value in {"mode": "client", "connect/endpoints": [f"tcp/127.0.0.1:{port}"]}.items():
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self.heard: list[tuple[str, bytes]] = []
        self.tokens: list[str] = []
        self.session.declare_subscriber("**", zenoh.handlers.Callback(self._hear, indirect=False))
        tokens = zenoh.handlers.Callback(lambda sample: self.tokens.append(str(sample.key_expr)), indirect=False)
        self.session.liveliness().declare_subscriber("**", tokens, history=True)

    def _hear(self, sample: zenoh.Sample) -> None:
        self.heard.append((str(sample.key_expr), sample.payload.to_bytes()))


@contextmanager
def stranger(port: int) -> Iterator[Stranger]:
    """One, for a while."""
    made = Stranger(port)
    try:
        yield made
    finally:
        made.session.close()


async def test_what_crosses_cannot_be_read_forged_or_sent_again(port: int) -> None:
    a, b = made("a", port), made("b", port)
    got: list[bytes] = []
    b.on_message("t", lambda _sender, payload: got.append(payload))
    with stranger(port) as listener:
        async with running(a, b):
            assert a.send("b", "t", SECRET)
            await wait_until_async(lambda: got == [SECRET] and len(listener.heard) >= 3)
            received = list(listener.heard)
            assert not any(SECRET[:8] in frame for _, frame in received)
            before = b.counts.refused + a.counts.refused
            tried = 0
            for key, frame in received:
                for forged in (frame, frame[:-1] + bytes([frame[-1] ^ 1]), frame[:25], b"", frame[:17] + bytes(200)):
                    listener.session.put(key, forged)
                    tried += 1
            await wait_until_async(lambda: b.counts.refused + a.counts.refused >= before + tried)
            assert got == [SECRET]
            assert a.peers() == {"b"}, "nobody lost anybody by it"
            assert (a.counts.lost, b.counts.lost) == (0, 0)
            assert a.send("b", "t", b"still")
            await wait_until_async(lambda: got == [SECRET, b"still"])


async def test_what_an_earlier_gateway_sent_brings_it_not_back(port: int) -> None:
    a, b = made("a", port), made("b", port)
    received: list[tuple[str, bool]] = []
    a.on_peer(lambda gateway, there: received.append((gateway, there)))
    with stranger(port) as listener:
        async with running(a):
            async with running(b, met=False):
                await all_met([a, b])
                await wait_until_async(lambda: any(key.startswith(f"{LIVE}/b/") for key in listener.tokens))
            await wait_until_async(lambda: received == [("b", True), ("b", False)])
            token = next(key for key in listener.tokens if key.startswith(f"{LIVE}/b/"))
            declared = listener.session.liveliness().declare_token(token)
            refused = a.counts.refused
            for key, frame in list(listener.heard):
                listener.session.put(key, frame)
            await wait_until_async(lambda: a.counts.refused > refused)
            a.tick()
            c = made("c", port)
            async with running(c, met=False):
                await wait_until_async(lambda: "c" in a.peers() and "a" in c.peers())
                assert a.peers() == {"c"}
                assert c.peers() == {"a"}
            declared.undeclare()


async def test_who_has_another_master_key_is_no_peer_and_is_reported_once(
    port: int, caplog: pytest.LogCaptureFixture
) -> None:
    a, b, other = made("a", port), made("b", port), made("other", port, master=MasterKey(b"o" * 32))
    async with running(a, b):
        async with running(other, met=False):
            await wait_until_async(lambda: "gateway other" in caplog.text and "gateway a" in caplog.text)
            for _ in range(3):
                a.tick()
            await asyncio.sleep(0)
            assert a.peers() == {"b"}
            assert other.peers() == frozenset()
        said = [record.getMessage() for record in caplog.records if "gateway other" in record.getMessage()]
        assert len(said) == 2, "once by a, once by b"
        assert "--master-key" in said[0]


async def test_names_that_are_none_bring_nobody(port: int) -> None:
    a, b = made("a", port), made("b", port)
    boot, proof = "ab" * BOOT_BYTES, "0" * 32
    with stranger(port) as liar:
        tokens = [
            liar.session.liveliness().declare_token(f"{LIVE}/{name}")
            for name in (f"c/{boot}/{proof}", f"c/xy/{proof}", f"c/ab/{proof}", f"c c/{boot}/{proof}")
        ]
        async with running(a, b):
            assert a.peers() == {"b"}
        for token in tokens:
            token.undeclare()


async def test_a_token_that_somebody_else_takes_back_ends_no_peer(port: int, caplog: pytest.LogCaptureFixture) -> None:
    a, b = made("a", port), made("b", port)
    received: list[tuple[str, bool]] = []
    a.on_peer(lambda gateway, there: received.append((gateway, there)))
    with stranger(port) as liar:
        async with running(a, b):
            await wait_until_async(lambda: {key.split("/")[-3] for key in liar.tokens} >= {"a", "b"})
            own = {key.split("/")[-3]: key for key in liar.tokens}
            like = [key.rsplit("/", 1)[0] + "/" + "0" * 32 for key in own.values()]
            for key in (*like, *own.values()):
                liar.session.liveliness().declare_token(key).undeclare()
            last = liar.session.liveliness().declare_token(f"{LIVE}/last/{'ab' * BOOT_BYTES}/{'0' * 32}")
            await wait_until_async(lambda: caplog.text.count("gateway last") == 2)  # each has seen all of it
            assert a.peers() == {"b"}
            assert b.peers() == {"a"}
            assert received == [("b", True)]
            assert a.linked
            last.undeclare()


async def test_who_starts_after_a_change_of_the_master_key_meets_those_that_run(port: int, tmp_path: Path) -> None:
    file = tmp_path / "master.key"
    running_ones = [made(name, port, master=MasterKey.load_or_make(tmp_path, file)) for name in ("a", "b")]
    async with running(*running_ones):
        file.unlink()
        make_key_file(file)
        running_ones[0].tick()  # the other one hears of it first by the new proof
        late = made("c", port, master=MasterKey.load_or_make(tmp_path, file))
        async with running(late, met=False):
            await all_met([*running_ones, late])


async def test_gateways_of_other_stores_do_not_meet(port: int) -> None:
    a, b, remote = made("a", port), made("b", port), made("c", port, store="store2")
    async with running(a, b), running(remote, met=False):
        await wait_until_async(lambda: remote.linked)
        assert a.peers() == {"b"}
        assert remote.peers() == frozenset()
