"""The processes of the benchmark `pubsub`: one publishes flat out or echoes, the other counts or times round trips.

Each prints one JSON line at its end; the process that started them reads it.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import struct
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import zenoh

import metaros
from metaros.cdr import codec
from metaros.interfaces.sensor_msgs.msg import Image
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import QoSProfile, qos_default, qos_reliable_all

__all__ = ["main"]

_WARM_UP_S = 0.4
_ROUND_TRIPS_S = 5.0  # at most
_SMALL = 4096
_NEW = struct.Struct("<qq17p")


def message_of(size: int) -> Any:
    """A message whose CDR has about so many bytes: text when small, an image when large."""
    if size <= _SMALL:
        return String(data="x" * (size - 9))
    return Image(height=1, width=size, encoding="mono8", step=size, data=bytes(size))


class RawEnd:
    """As any program uses eclipse-zenoh: its own defaults, its default callback, an attachment of 33 bytes."""

    def __init__(self, *, shared_memory: bool, **endpoints: str) -> None:
        config = zenoh.Config()
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("transport/shared_memory/enabled", json.dumps(shared_memory))
        for name, endpoint in endpoints.items():
            config.insert_json5(f"{name}/endpoints", f'["{endpoint}"]')
        self._session = zenoh.open(config)

    def sender(self, key: str, size: int) -> Callable[[], None]:
        """A function that sends once."""
        data, attachment = codec(type(message_of(size))).encode(message_of(size)), _NEW.pack(1, 1, bytes(16))
        put = self._session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK).put
        return lambda: put(data, attachment=attachment)

    def listen(self, key: str, _size: int, heard: Callable[[], None]) -> None:
        """Call `heard` for each sample, with its bytes taken out."""

        def on_sample(sample: zenoh.Sample) -> None:
            sample.payload.to_bytes()
            heard()

        self._session.declare_subscriber(key, on_sample)


class OurEnd:
    """A node."""

    def __init__(self, path: str, *, shared_memory: bool, qos: QoSProfile, **endpoints: str) -> None:
        mode = "auto" if shared_memory else "off"
        endpoints = {"connect": [], "listen": []} | endpoints  # type: ignore[dict-item]
        context = metaros.Context(domain_id=0, shared_memory=mode, **endpoints)
        self._node = metaros.Node(f"bench_{os.getpid()}", context=context, enable_rosout=False, enable_parameters=False)
        self._qos = qos
        self._bytes, self._dedicated = path == "bytes", path in ("bytes", "dedicated")
        self._spinning = False

    def sender(self, key: str, size: int) -> Callable[[], None]:
        """A function that sends once."""
        message = message_of(size)
        publish = self._node.create_publisher(type(message), key, self._qos).publish
        if self._bytes:
            message = codec(type(message)).encode(message)
        return lambda: publish(message)

    def listen(self, key: str, size: int, heard: Callable[[], None]) -> None:
        """Call `heard` for each message."""
        self._node.create_subscription(
            type(message_of(size)),
            key,
            lambda _message: heard(),
            self._qos,
            raw=self._bytes,
            dedicated=self._dedicated,
        )
        if not self._spinning:
            threading.Thread(target=metaros.spin, args=(self._node,), daemon=True).start()
            self._spinning = True


class RclpyEnd:
    """A node as programs written for rclpy have it."""

    def __init__(self, *, keep_all: bool, **endpoints: str) -> None:
        import metaros.ros2

        metaros.ros2.install()
        import rclpy
        import rclpy.qos

        given = {"connect": "", "listen": "", **endpoints}
        told = ";".join(f"{name}/endpoints={json.dumps([where] if where else [])}" for name, where in given.items())
        os.environ["ZENOH_CONFIG_OVERRIDE"] = told
        rclpy.init(domain_id=0)
        self._rclpy = rclpy
        self._node = rclpy.create_node(f"bench_{os.getpid()}", enable_rosout=False, start_parameter_services=False)
        history = rclpy.qos.HistoryPolicy.KEEP_ALL if keep_all else rclpy.qos.HistoryPolicy.KEEP_LAST
        self._qos = rclpy.qos.QoSProfile(history=history, depth=10)
        self._spinning = False

    def _message(self, size: int) -> Any:
        from sensor_msgs.msg import Image as RosImage
        from std_msgs.msg import String as RosString

        if size <= _SMALL:
            return RosString(data="x" * (size - 9))
        return RosImage(height=1, width=size, encoding="mono8", step=size, data=bytes(size))

    def sender(self, key: str, size: int) -> Callable[[], None]:
        """A function that sends once."""
        message = self._message(size)
        publish = self._node.create_publisher(type(message), key, self._qos).publish
        return lambda: publish(message)

    def listen(self, key: str, size: int, heard: Callable[[], None]) -> None:
        """Call `heard` for each message."""
        self._node.create_subscription(type(self._message(size)), key, lambda _message: heard(), self._qos)
        if not self._spinning:
            threading.Thread(target=self._rclpy.spin, args=(self._node,), daemon=True).start()
            self._spinning = True


def _end(options: Any) -> RawEnd | OurEnd | RclpyEnd:
    """What the path names."""
    where = {"listen" if options.role in ("count", "echo") else "connect": options.endpoint}
    flat_out = options.role in ("count", "flood")
    if options.path == "raw":
        return RawEnd(shared_memory=options.shm, **where)
    if options.path == "rclpy":
        return RclpyEnd(keep_all=flat_out, **where)
    return OurEnd(options.path, shared_memory=options.shm, qos=qos_reliable_all if flat_out else qos_default, **where)


def _report(**figures: object) -> None:
    print(json.dumps(figures), flush=True)
    os._exit(0)  # a flooded session need not be taken down tidily


def _count(end: RawEnd | OurEnd | RclpyEnd, size: int, seconds: float) -> None:
    count = 0

    def heard() -> None:
        nonlocal count
        count += 1

    end.listen("bench/there", size, heard)
    print("ready", flush=True)
    while not count:
        time.sleep(0.01)
    time.sleep(_WARM_UP_S)
    before, start_s, cpu_s = count, time.perf_counter(), time.process_time()
    time.sleep(seconds)
    done, used_s = count - before, time.process_time() - cpu_s
    _report(
        rate=done / (time.perf_counter() - start_s),
        cpu_us=used_s / max(1, done) * 1e6,
        threads=len(list(Path("/proc/self/task").iterdir())) if sys.platform == "linux" else threading.active_count(),
    )


def _flood(end: RawEnd | OurEnd | RclpyEnd, size: int) -> None:
    """Until told to stop."""
    send, count, reported = end.sender("bench/there", size), 0, threading.Event()
    threading.Thread(target=lambda: (sys.stdin.readline(), reported.set()), daemon=True).start()
    cpu_s = time.process_time()
    while not reported.is_set():
        for _ in range(100 if size <= _SMALL else 1):
            send()
            count += 1
    _report(cpu_us=(time.process_time() - cpu_s) / count * 1e6)


def _echo(end: RawEnd | OurEnd | RclpyEnd, size: int) -> None:
    end.listen("bench/there", size, end.sender("bench/back", size))
    print("ready", flush=True)
    sys.stdin.readline()
    os._exit(0)


def _ping(end: RawEnd | OurEnd | RclpyEnd, size: int, seconds: float) -> None:
    """Round trips one after another."""
    back = threading.Event()
    trips: list[float] = []
    start_s = 0.0

    def heard() -> None:
        trips.append(time.perf_counter() - start_s)
        back.set()

    end.listen("bench/back", size, heard)
    send, until_s = end.sender("bench/there", size), time.perf_counter() + min(seconds, _ROUND_TRIPS_S)
    back.wait(_WARM_UP_S)
    while time.perf_counter() < until_s or len(trips) < 3:
        back.clear()
        start_s = time.perf_counter()
        send()
        back.wait(1.0)
    figures = statistics.quantiles(trips[len(trips) // 10 :], n=100)
    _report(p50_us=figures[49] * 1e6, p99_us=figures[98] * 1e6)


def main(argv: Sequence[str] = ()) -> int:
    """Be one end."""
    parser = argparse.ArgumentParser()
    for option in ("--role", "--path", "--endpoint"):
        parser.add_argument(option, required=True)
    parser.add_argument("--size", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--shm", action="store_true")
    options = parser.parse_args(list(argv))
    end = _end(options)
    if options.role == "count":
        _count(end, options.size, options.seconds)
    elif options.role == "flood":
        _flood(end, options.size)
    elif options.role == "echo":
        _echo(end, options.size)
    else:
        _ping(end, options.size, options.seconds)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
