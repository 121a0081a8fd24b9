"""A ROS 2 node as the wire sheet describes it, made of eclipse-zenoh, xxhash and struct alone: no Meta-ROS in it."""

from __future__ import annotations

import itertools
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any

import xxhash
import zenoh
import zenoh.ext

CDR = bytes([0, 1, 0, 0])
STAMP_NS = 1_700_000_000_123_456_789


def pack_attachment(seq: int, stamp_ns: int, gid: bytes) -> bytes:
    return struct.pack("<qqB", seq, stamp_ns, 16) + gid


def unpack_attachment(data: bytes) -> tuple[int, int, bytes]:
    assert len(data) == 33
    seq, stamp_ns, length = struct.unpack_from("<qqB", data)
    assert length == 16
    return seq, stamp_ns, data[17:]


def gid_of(token: str) -> bytes:
    return xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")


def open_session(router: str) -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    return zenoh.open(config)


class RawPeer:
    """One node, `/raw` if not named otherwise, in domain 0."""

    def __init__(self, session: zenoh.Session, name: str = "raw") -> None:
        self.session, self.name = session, name
        self.zid = str(session.info.zid())
        self._ids = itertools.count()
        self.nid = next(self._ids)
        self._kept: list[Any] = [
            session.liveliness().declare_token(f"@ros2_lv/0/{self.zid}/{self.nid}/{self.nid}/NN/%/%/{name}")
        ]

    def token(self, kind: str, name: str, dds: str, type_hash: str, qos: str) -> str:
        """What `announce` says of an endpoint, once that is there: as rmw does, so who sees it can use it."""
        where = f"@ros2_lv/0/{self.zid}/{self.nid}/{next(self._ids)}/{kind}/%/%/{self.name}"
        return f"{where}/{name.replace('/', '%')}/{dds}/{type_hash}/{qos}"

    def announce(self, token: str) -> bytes:
        """Everybody sees the endpoint from now on; returns its GID."""
        self._kept.append(self.session.liveliness().declare_token(token))
        return gid_of(token)

    @contextmanager
    def lending(self) -> Iterator[None]:
        """What is made meanwhile goes at the end."""
        before = len(self._kept)
        yield
        for made in reversed(self._kept[before:]):
            made.undeclare()
        del self._kept[before:]

    def tokens(self) -> list[str]:
        """What everybody declares."""
        replies = self.session.liveliness().get("@ros2_lv/0/**")
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def serve(self, name: str, dds: str, type_hash: str, answer: Callable[[zenoh.Query], None]) -> bytes:
        """A service server; `answer` runs on a Zenoh thread of its own."""
        self._kept.append(self.session.declare_queryable(f"0{name}/{dds}/{type_hash}", answer, complete=True))
        return self.announce(self.token("SS", name, dds, type_hash, "::,10:,:,:,,"))

    def client(self, name: str, dds: str, type_hash: str) -> RawClient:
        """A service client."""
        gid = self.announce(self.token("SC", name, dds, type_hash, "::,10:,:,:,,"))
        return RawClient(self.session, f"0{name}/{dds}/{type_hash}", gid)

    def subscribe(self, name: str, dds: str, type_hash: str, qos: str) -> SimpleQueue[zenoh.Sample]:
        """A volatile subscription, or for a transient_local QoS string one that gets what was kept."""
        arrived: SimpleQueue[zenoh.Sample] = SimpleQueue()
        key, sink = f"0{name}/{dds}/{type_hash}", zenoh.handlers.Callback(arrived.put, indirect=False)
        subscriber: Any
        if not qos.startswith(":1:"):
            subscriber = self.session.declare_subscriber(key, sink)
        else:
            subscriber = zenoh.ext.declare_advanced_subscriber(
                self.session,
                key,
                sink,
                history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
                recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
                subscriber_detection=True,
            )
        self._kept.append(subscriber)
        self.announce(self.token("MS", name, dds, type_hash, qos))
        return arrived

    def publisher(
        self, name: str, dds: str, type_hash: str, qos: str, *, now_ns: Callable[[], int] = lambda: STAMP_NS
    ) -> Callable[[bytes], None]:
        """A publisher as a function of the payload; for a transient_local QoS string it keeps the last."""
        token = self.token("MP", name, dds, type_hash, qos)
        key, seq = f"0{name}/{dds}/{type_hash}", itertools.count(1)
        made: Any
        wait = zenoh.CongestionControl.BLOCK  # what is put arrives, on a busy machine too
        if qos.startswith(":1:"):
            made = zenoh.ext.declare_advanced_publisher(
                self.session,
                key,
                congestion_control=wait,
                cache=zenoh.ext.CacheConfig(max_samples=1),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
                publisher_detection=True,
            )
        else:
            made = self.session.declare_publisher(key, congestion_control=wait)
        self._kept.append(made)
        gid = self.announce(token)
        return lambda payload: made.put(payload, attachment=pack_attachment(next(seq), now_ns(), gid))


class RawClient:
    """Asks one service, once at a time."""

    def __init__(self, session: zenoh.Session, key: str, gid: bytes) -> None:
        self._session, self.key, self.gid = session, key, gid
        self._seq = itertools.count(1)

    def start(
        self, payload: bytes, *, timeout_s: float = 60.0
    ) -> tuple[int, SimpleQueue[zenoh.Reply], threading.Event]:
        """Send a request; its sequence number, its replies to come, and when no more will."""
        replies: SimpleQueue[zenoh.Reply] = SimpleQueue()
        ended, seq = threading.Event(), next(self._seq)
        self._session.get(
            self.key,
            zenoh.handlers.Callback(replies.put, ended.set, indirect=False),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout_s,
            payload=payload,
            attachment=pack_attachment(seq, STAMP_NS, self.gid),
        )
        return seq, replies, ended

    def ask(self, payload: bytes) -> bytes:
        """The payload of the one reply, whose key and attachment are checked."""
        seq, replies, ended = self.start(payload)
        assert ended.wait(60)
        assert replies.qsize() == 1
        return self.check(seq, replies.get())

    def check(self, seq: int, reply: zenoh.Reply) -> bytes:
        """The payload of a reply as rmw_zenoh takes it."""
        assert reply.ok is not None, reply.err and reply.err.payload.to_bytes()
        assert str(reply.ok.key_expr) == self.key
        assert str(reply.ok.encoding) == "zenoh/bytes"
        assert reply.ok.attachment is not None
        answered, stamp_ns, gid = unpack_attachment(reply.ok.attachment.to_bytes())
        assert (answered, gid) == (seq, self.gid)
        assert stamp_ns > STAMP_NS
        return reply.ok.payload.to_bytes()
