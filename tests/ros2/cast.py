"""Who there is: our two faces and the peers, what each cannot do and why, and how each is started."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tests.ros2.participant import Participant

__all__ = ["HASHLESS", "OURS", "PEERS", "ROS", "Cast", "Part"]

ROS = os.environ.get("METAROS_ROS", "")  # the folder of a real installation, which has a setup.bash
OLD_ROS = bool(ROS) and not (Path(ROS) / "share" / "type_description_interfaces").is_dir()
HASHLESS = {"humble", *(["ros"] if OLD_ROS else [])}  # who writes no hashes of types


@dataclass(frozen=True)
class Part:
    """`cannot` has what it cannot do that scenarios need, and why; `desk` whom of ours it meets in `make test`."""

    name: str
    make: Callable[[str], Participant]
    cannot: Mapping[str, str] = field(default_factory=dict)
    desk: tuple[str, ...] = ()


def _native(router: str) -> Participant:
    from tests.ros2.native_side import NativeSide

    return NativeSide(router)


def _rclpy(router: str) -> Participant:
    """A program that imports rclpy by name: the names lead to ours while it is read."""
    from metaros.ros2 import install, uninstall

    install(shadow=True)
    try:
        from tests.ros2.programs.rclpy_side import RclpySide, open_context
    finally:
        uninstall()
    side: Participant = RclpySide(open_context(router))
    return side


def _raw(router: str) -> Participant:
    from tests.ros2.raw.node import RawNode

    return RawNode(router)


def _humble(router: str) -> Participant:
    from tests.ros2.raw.node import RawNode

    return RawNode(router, "humble", humble=True)


def _sdk(router: str) -> Participant:
    from tests.ros2.sdk import SdkPeer

    peer: Any = SdkPeer(router)
    return peer


def _dds(router: str) -> Participant:
    from tests.ros2.dds.peer import DdsPeer

    peer: Any = DdsPeer(router)
    return peer


def _ros(router: str) -> Participant:
    from tests.ros2.installation.peer import RosPeer

    return RosPeer(ROS, router)


NO_CLOCK = "it has no clock that could follow another"
NO_LEARNING = "it has its types by hand, as ROS 2 nodes have theirs by building: we alone learn them"
NO_TYPES = "Humble has no type descriptions"
TYPES = ("tell types", "ask for types", "have a type of its own", "learn types")
ACTIONS = ("serve goals", "send goals", "cancel goals")
NODES = ("have parameters", "use parameters", "have states", "change states", "log", "keep time", "listen to nodes")
SDK_LACKS = DDS_LACKS = (*TYPES, *ACTIONS, *NODES)

OURS = [Part("native", _native), Part("rclpy", _rclpy, {"learn types": "rclpy programs import their types"})]
PEERS = [
    Part("raw", _raw, {"keep time": NO_CLOCK, "learn types": NO_LEARNING}, desk=("native", "rclpy")),
    Part(
        "sdk",
        _sdk,
        {
            "latch": "it keeps nothing for who comes later (a defect of 0.1.8)",
            **dict.fromkeys(SDK_LACKS, "zenoh-ros2-sdk has topics, services and the graph alone"),
        },
        desk=("native",),
    ),
    Part(
        "dds",
        _dds,
        {
            "appear": "in the graph its endpoints are those of /dds_bridge",
            "look": "the graph of Zenoh is not that of DDS",
            **dict.fromkeys(DDS_LACKS, "this peer has topics and services alone; the rest would be those rows again"),
        },
    ),
    Part("humble", _humble, {"keep time": NO_CLOCK, **dict.fromkeys(TYPES, NO_TYPES)}, desk=("native",)),
]

if ROS:  # else it is not even in the table
    cannot = {"have a type of its own": "no package of its own is installed there", "learn types": NO_LEARNING}
    if "ros" in HASHLESS:
        cannot |= dict.fromkeys(TYPES, NO_TYPES)
    PEERS.append(Part("ros", _ros, cannot, desk=("native", "rclpy")))


class Cast:
    """The participants on one router, each made when it is first asked for."""

    def __init__(self, router: str) -> None:
        self._router = router
        self._made: dict[str, Participant] = {}
        self._ends = ExitStack()

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            (part,) = [part for part in (*OURS, *PEERS) if part.name == name]
            self._made[name] = part.make(self._router)
            self._ends.callback(self._made[name].close)
        return self._made[name]

    def close(self) -> None:
        """All of them leave."""
        self._ends.close()
