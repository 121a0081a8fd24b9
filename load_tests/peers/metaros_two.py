"""Meta-ROS itself: typed on the default executor or on a dedicated thread, raw bytes, shared memory.

A message is a std_msgs/String below 16 KiB and a sensor_msgs/Image from there on, its text or data as long as the
payload of the others. Publishers are reliable and keep-all, so that they wait rather than lose. Modes: `executor` (the
subscription as anyone creates it), `executor-all` (a keep-all one), `dedicated`, `bytes` (dedicated, nothing decoded;
the publisher gets bytes); `+shm` adds shared memory.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

import metaros
from metaros.cdr import codec

__all__ = ["receiver", "sender", "spin"]

_IMAGE_FROM = 16384


@functools.cache
def _node(role: str, port: int, shared_memory: bool) -> metaros.Node:
    """One node; the first process to start listens."""
    endpoint = f"tcp/127.0.0.1:{port}"
    options: dict[str, Any] = {"listen": endpoint, "connect": []}
    if role not in {"subscriber", "echo"}:
        options = {"listen": [], "connect": endpoint}
    if shared_memory:
        if "shared_memory" not in inspect.signature(metaros.Context).parameters:
            raise RuntimeError("this Meta-ROS has no shared memory")
        options["shared_memory"] = "auto"
    return metaros.Node(f"bench_{role}", context=metaros.Context(domain_id=0, **options), enable_rosout=False)


def _node_of(job: dict[str, Any]) -> metaros.Node:
    return _node(job["role"], job["ports"][0], job["mode"].endswith("+shm"))


def _message_type(job: dict[str, Any]) -> type[Any]:
    """Imported when needed: a node without arrays does without numpy."""
    if job["size"] < _IMAGE_FROM:
        from metaros.interfaces.std_msgs.msg import String

        return String
    from metaros.interfaces.sensor_msgs.msg import Image

    return Image


def _message(job: dict[str, Any]) -> Any:
    """One that carries `size` bytes."""
    kind, size = _message_type(job), job["size"]
    if size < _IMAGE_FROM:
        return kind(data="x" * size)
    return kind(height=1, width=size // 3, encoding="rgb8", step=size, data=b"x" * size)


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`publish` of a keep-all publisher, with a message or with bytes."""
    node, kind = _node_of(job), _message_type(job)
    if job["mode"].startswith("bytes"):
        code = codec(kind)
        raw = node.create_raw_publisher(topic, code.name, code.hash, metaros.qos_reliable_all)
        return functools.partial(raw.publish, b"x" * job["size"])
    return functools.partial(node.create_publisher(kind, topic, metaros.qos_reliable_all).publish, _message(job))


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """A subscription as the mode says."""

    def on_message(_: Any) -> None:
        callback()

    mode = job["mode"].removesuffix("+shm")
    qos = metaros.qos_default if mode == "executor" else metaros.qos_reliable_all
    _node_of(job).create_subscription(
        _message_type(job), topic, on_message, qos, raw=mode == "bytes", dedicated=mode in {"bytes", "dedicated"}
    )


def spin(job: dict[str, Any]) -> None:
    """Run the callbacks."""
    metaros.spin(_node_of(job))
