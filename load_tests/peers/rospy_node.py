"""rospy, as Debian packages it: synchronous publish (`queue_size=None`), which waits for the socket and is its fastest.

std_msgs/String below 16 KiB, sensor_msgs/Image from there on; a rosmaster is the broker.
"""

from __future__ import annotations

import functools
import os
import warnings
from collections.abc import Callable
from typing import Any

__all__ = ["broker", "receiver", "sender"]

_IMAGE_FROM = 16384


def _address(job: dict[str, Any]) -> None:
    """Before rospy is imported."""
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{job['ports'][0]}"
    os.environ["ROS_IP"] = "127.0.0.1"
    os.environ.setdefault("ROS_HOME", os.path.join(job["scratch"], "ros"))


def broker(job: dict[str, Any]) -> None:
    """The master, in this process."""
    _address(job)
    from rosmaster.master import Master

    Master(job["ports"][0], 3).start()


@functools.cache
def _start(role: str) -> None:
    import rospy

    rospy.init_node(f"bench_{role}", disable_signals=True, disable_rosout=True)


def _message(job: dict[str, Any]) -> Any:
    from sensor_msgs.msg import Image
    from std_msgs.msg import String

    size = job["size"]
    if size < _IMAGE_FROM:
        return String(data="x" * size)
    return Image(height=1, width=size // 3, encoding="rgb8", step=size, data=b"x" * size)


def sender(job: dict[str, Any], topic: str) -> Callable[[], object]:
    """`publish` without a queue."""
    _address(job)
    import rospy

    _start(job["role"])
    message = _message(job)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        publisher = rospy.Publisher(f"/{topic}", type(message), queue_size=None)
    return functools.partial(publisher.publish, message)


def receiver(job: dict[str, Any], topic: str, callback: Callable[[], object]) -> None:
    """A callback on the connection's own thread; a buffer that takes a whole message."""
    _address(job)
    import rospy

    _start(job["role"])
    options = {"tcp_nodelay": True, "buff_size": max(65536, 2 * job["size"])}
    rospy.Subscriber(f"/{topic}", type(_message(job)), lambda _: callback(), **options)
