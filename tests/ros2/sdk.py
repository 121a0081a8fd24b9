"""A witness: PyPI's zenoh-ros2-sdk, which others wrote. It is given each definition, or it would clone repositories."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from dataclasses import fields as fields_of
from typing import Any

import pytest
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2ServiceServer, ROS2Subscriber, ZenohSession
from zenoh_ros2_sdk.discovery import get_topic_info
from zenoh_ros2_sdk.qos import QosProfile

from tests.ros2.participant import Fields, Seen
from tests.ros2.raw.layouts import HASHES
from tests.support.waiting import wait_until

__all__ = ["SdkPeer"]

LINE = "=" * 80
TIME = f"{LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
HEADER = f"{LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{TIME}"
VECTOR = f"{LINE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
FLOATS = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
SCAN = "".join(f"float32 {name}\n" for name in FLOATS)
DEFINITIONS = {
    "std_msgs/msg/String": "string data\n",
    "geometry_msgs/msg/Twist": f"geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n{VECTOR}",
    "sensor_msgs/msg/LaserScan": f"std_msgs/Header header\n{SCAN}float32[] ranges\nfloat32[] intensities\n{HEADER}",
    "rosgraph_msgs/msg/Clock": f"builtin_interfaces/Time clock\n{TIME}",
    "rcl_interfaces/msg/Log": "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
    f"string function\nuint32 line\n{TIME}",
}
ADD = {"request_definition": "int64 a\nint64 b\n", "response_definition": "int64 sum\n"}
ADD_TYPE = "example_interfaces/srv/AddTwoInts"
DEFAULT, LATCHED = "::,10:,:,:,,", ":1:,1:,:,:,,"  # it leaves a depth of 10 out, where rmw_zenoh leaves out 42


class SdkPeer:
    """Each of its endpoints is a node of its own in the graph, all named `/sdk`."""

    def __init__(self, router: str, name: str = "sdk") -> None:
        self.name = name
        host, _, port = router.removeprefix("tcp/").rpartition(":")
        self._at: dict[str, Any] = {"router_ip": host, "router_port": int(port), "domain_id": 0}
        with pytest.MonkeyPatch.context() as patch:  # as a peer that gossips, its looks at the graph miss some
            patch.setenv("ZENOH_CONFIG_OVERRIDE", 'mode="client"')
            self._session = ZenohSession.get_instance(host, int(port))
        self._made: list[Any] = []
        self._server = ROS2ServiceServer(f"/{name}/add", ADD_TYPE, self._add, node_name=name, **ADD, **self._at)

    def _add(self, request: Any) -> Any:
        return self._server.response_msg_class(sum=request.a + request.b)

    @contextmanager
    def lending(self) -> Iterator[None]:
        """See `Participant`."""
        yield
        while self._made:
            self._made.pop().close()

    def _options(self, type_name: str) -> dict[str, Any]:
        """It computes the hash where it can do so from the definition alone."""
        known = {} if type_name == "std_msgs/msg/String" else {"type_hash": HASHES[type_name]}
        return {"msg_definition": DEFINITIONS[type_name], "node_name": self.name, **known, **self._at}

    def speak(self, topic: str, type_name: str, fields: Fields, *, latched: bool = False) -> Callable[[], object]:
        """It keeps nothing for who comes later, whatever it says in the graph."""
        publisher = ROS2Publisher(topic, type_name, qos=LATCHED if latched else DEFAULT, **self._options(type_name))
        self._made.append(publisher)
        message = self._build(publisher.msg_class, fields)
        return lambda: publisher.publish(**message)

    def _build(self, message_type: Any, fields: Fields) -> Fields:
        import numpy as np

        built = {}
        for field in fields_of(message_type):
            if field.name == "__msgtype__":
                continue
            value = fields[field.name]
            if isinstance(value, dict):
                kind = self._session.store.types[field.type.strip("'").replace("__", "/")]
                value = kind(**self._build(kind, value))
            built[field.name] = np.array(value, dtype=np.float32) if isinstance(value, list) else value
        return built

    def listen(self, topic: str, type_name: str, *, latched: bool = False) -> Callable[[], list[Fields]]:
        """It asks once for what is kept, so the publisher must be there."""
        heard: list[Fields] = []
        if latched:
            wait_until(lambda: any(seen.kind == "MP" for seen in self.endpoints(topic)))
        options = self._options(type_name)
        self._made.append(
            ROS2Subscriber(
                topic, type_name, lambda m: heard.append(_plain(m)), qos=LATCHED if latched else DEFAULT, **options
            )
        )
        return lambda: heard

    def add(self, server: str, a: int, b: int) -> int:
        """See `Participant`. It has no word for waiting until a server is there."""
        client = ROS2ServiceClient(f"/{server}/add", ADD_TYPE, node_name=self.name, timeout=60.0, **ADD, **self._at)
        self._made.append(client)
        wait_until(lambda: client.querier.matching_status.matching)
        return int(client.call(a=a, b=b).sum)

    def nodes(self) -> set[str]:
        """Those with a /rosout: it does not list others."""
        return {seen.node for topic in ("/rosout", *self._topics()) for seen in self.endpoints(topic)}

    def _topics(self) -> list[str]:
        from zenoh_ros2_sdk.discovery import get_topic_names_and_types

        return [name for name, _ in get_topic_names_and_types(**self._at)]

    def endpoints(self, topic: str) -> list[Seen]:
        """What it reads in tokens, by its own parser."""
        info = get_topic_info(topic, verbose=True, **self._at)
        if info is None:
            return []
        ends = [*(("MP", one) for one in info.publishers), *(("MS", one) for one in info.subscribers)]
        return [_seen(kind, one) for kind, one in ends]

    def close(self) -> None:
        """See `Participant`."""
        self._server.close()
        self._session.close()


def _plain(message: Any) -> Fields:
    """A message of rosbags, which has its type's name among its attributes."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: clean(inner) for key, inner in value.items() if key != "__msgtype__"}
        return value.tolist() if hasattr(value, "tolist") else value

    return dict(clean(asdict(message)))


def _seen(kind: str, one: Any) -> Seen:
    qos = QosProfile.decode(one.qos)
    return Seen(
        kind=kind,
        node=f"{one.node_namespace.rstrip('/')}/{one.node_name}",
        type_name=one.topic_type,
        type_hash=one.type_hash,
        reliability=qos.reliability.name.lower(),
        durability=qos.durability.name.lower(),
        depth=qos.history_depth,
    )
