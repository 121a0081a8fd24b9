"""A remote robot's topic: its samples over the gateway's stream, byte for byte as the robot's node published them."""

from __future__ import annotations

import json
import struct
from collections import deque
from collections.abc import Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from metaros.cli.remote.robot import RemoteRobot
from metaros.clock import SystemClock
from metaros.errors import PeerError, SealedError, UnavailableError, UnknownTypeError, UsageError
from metaros.limits import LIMITS

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

    from metaros.cli.shared.topic_lookup import FoundTopic
    from metaros.idl import Catalogue

__all__ = ["RemoteTopicSource"]

# record_bytes, subscription, channel, payload_bytes, seq, stamp_ns, gateway_receive_ns: docs/reference/stream.md
_HEADER = struct.Struct("<IIIIQqq")
_OPEN_S = 10.0
_QUEUE_BYTES = 8 * 1024 * 1024


class RemoteTopicSource:
    """One socket with one subscription; what the gateway dropped because we were slow is counted."""

    def __init__(self, robot: RemoteRobot, topic: str, type_name: str, *, raw: bool) -> None:
        self._robot = robot
        self._ask = (topic, type_name)
        self._raw = raw
        self._clock = SystemClock()
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._socket: ClientConnection
        self.dropped = 0

    def open(self, stack: ExitStack) -> FoundTopic:
        """See `metaros.cli.graph_target.listener.TopicSource`."""
        found = self._find()
        self._socket = stack.enter_context(self._connect())
        asked = {
            "op": "subscribe",
            "id": 1,
            "robots": self._robot.robot,
            "topics": found.name,
            "mode": "queue",
            "queue_bytes": _QUEUE_BYTES,
        }
        self._socket.send(json.dumps(asked))
        return found

    def next(self, timeout_s: float) -> tuple[float, bytes] | None:
        """See `metaros.cli.graph_target.listener.TopicSource`."""
        if not self._waiting:
            self._read(timeout_s)
        return self._waiting.popleft() if self._waiting else None

    def _read(self, timeout_s: float) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            said = self._socket.recv(timeout=timeout_s)
        except TimeoutError:
            return
        except ConnectionClosed as error:
            raise PeerError(f"the gateway ended the stream: {error}") from error
        if isinstance(said, str):
            self._on_text(json.loads(said))
            return
        now_s, at = self._clock.monotonic_s(), 0
        while at < len(said):
            record_bytes, _, _, payload_bytes, *_ = _HEADER.unpack_from(said, at)
            start = at + _HEADER.size
            self._waiting.append((now_s, said[start : start + payload_bytes]))
            at += record_bytes

    def _on_text(self, said: Mapping[str, Any]) -> None:
        if said["op"] == "error":
            raise UsageError(str(said["message"]))
        if said["op"] == "dropped":
            self.dropped = int(said["total"])
        if said["op"] == "channel" and str(said["encoding"]).startswith("sealed/") and not self._raw:
            raise SealedError(
                f"{said['topic']} is sealed: the gateway cannot read it, and this command has no key\n"
                "`metaros seal open` opens what is stored of it"
            )

    def _connect(self) -> ClientConnection:
        from websockets.exceptions import InvalidHandshake
        from websockets.sync.client import connect

        from metaros.access.trust import distrust, tls_context

        url = self._robot.http.url
        address = f"ws{url.removeprefix('http')}/api/v1/stream"
        try:
            return connect(
                address,
                additional_headers=dict(self._robot.http.identity),
                ssl=tls_context(url),
                open_timeout=_OPEN_S,
                close_timeout=1.0,
                max_size=LIMITS.frame_bytes,
                compression=None,
                proxy=None,
                server_hostname=urlsplit(url).hostname if url.startswith("https") else None,
            )
        except InvalidHandshake as error:
            raise PeerError(f"the gateway refused the stream: {error}") from error
        except (OSError, TimeoutError) as error:
            raise UnavailableError(distrust(url, error) or f"no gateway answers at {url}: {error}") from error

    def _find(self) -> FoundTopic:
        """The topic as the robot's agent announced it."""
        from metaros.cli.shared.names import no_such
        from metaros.cli.shared.topic_lookup import FoundTopic
        from metaros.wire.matching import reading_qos

        name, wanted = self._robot.absolute(self._ask[0]), self._ask[1]
        topics = {item["topic"]: item for item in self._robot.http.get(self._robot.path("topics"))["topics"]}
        if name not in topics:
            raise no_such("topic", name, topics)
        item = topics[name]
        kind, type_hash = str(item["type"]), str(item.get("type_hash") or "")
        if wanted and wanted not in (kind, kind.replace("/msg/", "/")):
            raise UsageError(f"{name} is a {kind}, not a {wanted}")
        catalogue = None if self._raw else self._catalogue(kind, type_hash)
        return FoundTopic(name, kind, type_hash, reading_qos([]), catalogue)

    def _catalogue(self, kind: str, type_hash: str) -> Catalogue:
        """Ours where it has that very type, else what the robot announced of it."""
        from metaros.cli.remote.interfaces import find_remote_interface

        try:
            return find_remote_interface(self._robot, kind, type_hash)[0]
        except UnknownTypeError as error:
            raise UnknownTypeError(f"{error}\nuse --raw to see the bytes") from None
