"""A peer of eclipse-zenoh alone, after the wire sheet: nothing of Meta-ROS is in it."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from queue import SimpleQueue
from typing import Any

import zenoh

from tests.ros2.participant import Fields, GoalRun, Seen
from tests.ros2.raw.actions import RawActionServer, run_goal
from tests.ros2.raw.cdr import decode, encode
from tests.ros2.raw.descriptions import ODD, ODD_HASH, TELL, tell
from tests.ros2.raw.layouts import HASHES, LAYOUTS, NO_HASH, dds_name
from tests.ros2.raw.services import RawParameters, RawStates
from tests.support.nodes.raw_peer import STAMP_NS, RawClient, RawPeer, gid_of, open_session, pack_attachment
from tests.support.waiting import wait_until

__all__ = ["RawNode"]

DEFAULT, LATCHED, ROSOUT = "::,10:,:,:,,", ":1:,1:,:,:,,", ":1:,1000:,:10,0:,,"
RELIABILITY = {"": "reliable", "1": "reliable", "2": "best_effort"}
DURABILITY = {"": "volatile", "1": "transient_local", "2": "volatile"}


class RawNode:
    """`humble` writes no type hashes, as ROS 2 Humble does, and tells no types."""

    def __init__(self, router: str, name: str = "raw", *, humble: bool = False) -> None:
        self.name, self._humble = name, humble
        self._session = open_session(router)
        self.peer = RawPeer(self._session, name)
        self._tokens: dict[bytes, str] = {}  # publishers by their GID
        self._clients: dict[str, RawClient] = {}
        self._log = self.peer.publisher("/rosout", *self.named("rcl_interfaces/msg/Log"), ROSOUT, now_ns=_now_ns)
        self.serve(f"/{name}/add", "example_interfaces/srv/AddTwoInts", self._add)
        self.serve(f"/{name}/now", "std_srvs/srv/Trigger", lambda _: {"success": True, "message": str(STAMP_NS)})
        if not humble:
            self.serve(f"/{name}/get_type_description", TELL, tell)
        self.states = RawStates(self, f"/{name}_managed")
        self.values = RawParameters(self, f"/{name}")
        self.actions = RawActionServer(self, f"/{name}/fibonacci")

    def named(self, type_name: str) -> tuple[str, str]:
        """The type and its hash as keys and tokens have them."""
        if self._humble:
            return dds_name(type_name), NO_HASH
        return dds_name(type_name), ODD_HASH if type_name == ODD else HASHES[type_name]

    # -- topics ----------------------------------------------------------------------------------------------------

    def lending(self) -> Any:
        """See `Participant`."""
        return self._lending()

    @contextmanager
    def _lending(self) -> Iterator[None]:
        with self.peer.lending():
            yield
            self._clients.clear()

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """Bytes by hand."""
        put = self.publisher(topic, type_name, LATCHED if latched else DEFAULT)
        return lambda: put(fields)

    def publisher(self, topic: str, type_name: str, qos: str) -> Callable[[Fields], None]:
        """The same for any fields."""
        put = self.peer.publisher(topic, *self.named(type_name), qos)
        return lambda fields: put(encode(LAYOUTS[type_name], fields))

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """What is heard has attachments as rmw_zenoh demands them, without a gap."""
        qos = LATCHED if latched else DEFAULT
        heard: list[Fields] = []
        last: dict[bytes, int] = {}
        arrived = self.peer.subscribe(topic, *self.named(type_name), ROSOUT if topic == "/rosout" else qos)

        def drain() -> list[Fields]:
            while not arrived.empty():
                sample = arrived.get()
                self._check(topic, sample, last)
                heard.append(decode(LAYOUTS[type_name], sample.payload.to_bytes()))
            return heard

        return drain

    def _check(self, topic: str, sample: zenoh.Sample, last: dict[bytes, int]) -> None:
        assert sample.attachment is not None, "rmw drops samples without an attachment"
        data = sample.attachment.to_bytes()
        assert len(data) == 33
        seq, stamp_ns, length = struct.unpack_from("<qqB", data)
        gid = data[17:]
        assert (length, seq >= 1, stamp_ns > 0) == (16, True, True), data.hex()
        assert str(sample.encoding) == "zenoh/bytes"
        assert gid not in last or seq == last[gid] + 1, f"{seq} follows {last[gid]}"
        last[gid] = seq
        if gid not in self._tokens:
            self._tokens |= {gid_of(token): token for token in self.peer.tokens() if "/MP/" in token}
        token = self._tokens[gid].split("/")  # the hash of the publisher's token, or `ros2 topic info -v` misleads
        assert token[9] == topic.replace("/", "%")

    # -- services and actions --------------------------------------------------------------------------------------

    def serve(self, name: str, type_name: str, answer: Callable[[Fields], Fields | None]) -> None:
        """A server whose answer is made at once; None refuses."""

        def handle(query: zenoh.Query) -> None:
            response = answer(self.request(query, type_name))
            if response is not None:
                self.reply(query, type_name, response)

        self.peer.serve(name, *self.named(type_name), handle)

    @staticmethod
    def request(query: zenoh.Query, type_name: str) -> Fields:
        """What is asked."""
        assert query.payload is not None
        return decode(LAYOUTS[type_name][0], query.payload.to_bytes())

    @staticmethod
    def reply(query: zenoh.Query, type_name: str, response: Fields) -> None:
        """The request's number and GID come back."""
        assert query.attachment is not None
        seq, _, length = struct.unpack_from("<qqB", query.attachment.to_bytes())
        gid = query.attachment.to_bytes()[17:]
        assert (length, len(gid), seq >= 1) == (16, 16, True)
        with query:
            data = encode(LAYOUTS[type_name][1], response)
            query.reply(str(query.key_expr), data, attachment=pack_attachment(seq, STAMP_NS, gid))

    def call(self, name: str, type_name: str, request: Fields) -> Fields:
        """Ask a server, once it is in the graph; its reply is checked as rmw takes it."""
        return decode(LAYOUTS[type_name][1], self.client(name, type_name).ask(encode(LAYOUTS[type_name][0], request)))

    def client(self, name: str, type_name: str) -> RawClient:
        """A client whose server is there."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.peer.client(name, *self.named(type_name))
            mark = f"/{name.replace('/', '%')}/"
            # A Humble client waits for a server by name and type, as `service_is_ready` of rmw does, not by hash.
            wait_until(lambda: any("/SS/" in token and mark in token for token in self.peer.tokens()))
            key = client.key
            wait_until(lambda: self._answers(key))
        return client

    def _answers(self, key: str) -> bool:
        """Whether somebody serves the very key: a mixed fleet's second key comes a moment after who needs it."""
        querier = self._session.declare_querier(key, target=zenoh.QueryTarget.ALL_COMPLETE)
        try:
            return bool(querier.matching_status.matching)
        finally:
            querier.undeclare()

    def _add(self, request: Fields) -> Fields:
        text = f"{request['a']} + {request['b']}"
        stamp = {"sec": _now_ns() // 10**9, "nanosec": 0}
        log = {"stamp": stamp, "level": 20, "name": self.name, "msg": text, "file": "", "function": "", "line": 0}
        self._log(encode(LAYOUTS["rcl_interfaces/msg/Log"], log))
        return {"sum": request["a"] + request["b"]}

    def add(self, server: str, a: int, b: int) -> int:
        """See `Participant`."""
        return int(self.call(f"/{server}/add", "example_interfaces/srv/AddTwoInts", {"a": a, "b": b})["sum"])

    def now(self, server: str) -> int:
        """See `Participant`."""
        return int(self.call(f"/{server}/now", "std_srvs/srv/Trigger", {})["message"])

    def run_goal(self, server: str, order: int, *, cancel: bool = False) -> GoalRun:
        """See `Participant`."""
        return run_goal(self, f"/{server}/fibonacci", order, cancel=cancel)

    # -- what every node of ROS 2 is asked ---------------------------------------------------------------------------

    def parameters(self, node: str) -> dict[str, Any]:
        """See `Participant`."""
        return self.values.read(f"/{node}")

    def set_parameter(self, node: str, name: str, value: object) -> str | None:
        """See `Participant`."""
        return self.values.write(f"/{node}", name, value)

    def state(self, node: str) -> str:
        """See `Participant`."""
        return str(self.call(f"/{node}/get_state", "lifecycle_msgs/srv/GetState", {})["current_state"]["label"])

    def change_state(self, node: str, transition: str) -> bool:
        """By its label: 0 is no transition of rcl's."""
        request = {"transition": {"id": 0, "label": transition}}
        return bool(self.call(f"/{node}/change_state", "lifecycle_msgs/srv/ChangeState", request)["success"])

    def describe(self, node: str, type_name: str, type_hash: str) -> list[Fields]:
        """See `Participant`."""
        request = {"type_name": type_name, "type_hash": type_hash, "include_type_sources": False}
        answer = self.call(f"/{node}/get_type_description", TELL, request)
        assert answer["successful"], answer["failure_reason"]
        told = answer["type_description"]
        return [told["type_description"], *told["referenced_type_descriptions"]]

    def nodes(self) -> set[str]:
        """See `Participant`."""
        rows = [token.split("/") for token in self.peer.tokens()]
        return {f"{row[7].replace('%', '/').rstrip('/')}/{row[8]}" for row in rows if row[5] == "NN"}

    def endpoints(self, topic: str) -> list[Seen]:
        """See `Participant`."""
        mark = topic.replace("/", "%")
        rows = [token.split("/") for token in self.peer.tokens()]
        return [_seen(row) for row in rows if row[5] in ("MP", "MS") and row[9] == mark]

    def qos_texts(self, topic: str) -> list[str]:
        """Of its publishers, as they are on the wire."""
        mark = topic.replace("/", "%")
        rows = [token.split("/") for token in self.peer.tokens()]
        return [row[12] for row in rows if row[5] == "MP" and row[9] == mark]

    def raw_subscription(self, topic: str, type_name: str) -> SimpleQueue[zenoh.Sample]:
        """What comes, as it comes."""
        return self.peer.subscribe(topic, *self.named(type_name), DEFAULT)

    def raw_publisher(self, topic: str, type_name: str) -> Callable[[bytes], None]:
        """CDR goes out as it is."""
        return self.peer.publisher(topic, *self.named(type_name), DEFAULT)

    def close(self) -> None:
        """See `Participant`."""
        self._session.close()  # type: ignore[no-untyped-call]


def _now_ns() -> int:
    """What is told of must be no older than its lifespan."""
    return int(datetime.now(tz=UTC).timestamp() * 1e9)


def _seen(row: list[str]) -> Seen:
    """A token, its QoS string by the sheet's table: what is left out is rmw_zenoh's own default."""
    reliability, durability, history = row[12].split(":")[:3]
    package, kind, _, name = row[10].split("::")
    depth = history.split(",")[1]
    return Seen(
        kind=row[5],
        node=f"{row[7].replace('%', '/').rstrip('/')}/{row[8]}",
        type_name=f"{package}/{kind}/{name.removesuffix('_')}",
        type_hash=row[11],
        reliability=RELIABILITY[reliability],
        durability=DURABILITY[durability],
        depth=int(depth or 42),
    )
