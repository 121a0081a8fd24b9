"""What `metaros broker` forwards and bridges, beside a plain `zmq.proxy` in the same run.

    python -m load_tests broker [--rounds 5] [--seconds 1.0]

Publisher, hub and reader are processes of their own on this host. The publisher says `/bench {"data": "…"}` as fast as
it can; counted is what the reader gets. `proxy` and `hub` are ZeroMQ to ZeroMQ, through a plain `zmq.proxy` and through
the broker, which meanwhile counts every message. `chain` is two plain proxies in a row, as the broker's hub has them to
keep what the bridge says from coming back to it: the hub's bound. `hub, heard` is the hub while a node listens, so that
the bridge converts as much as it can. `to ROS` and `to ZMQ` are the bridge: a ZeroMQ publisher and a node's
subscription, a node's publisher and a ZeroMQ subscriber. Rounds are interleaved; the figures are medians over them.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress

import zmq

import metaros
from load_tests.figures import note
from metaros.broker import Broker, BrokerOptions, HubOptions
from metaros.interfaces.std_msgs.msg import String
from tests.support.ports import free_port

__all__ = ["main", "run"]

MODES = ("proxy", "chain", "hub", "hub, heard", "to ROS", "to ZMQ")
SIZES = (64, 1024, 65536)
_TOPIC = "/bench"
_WARM_UP_S = 0.3
_START_S = 30.0


def run(*, rounds: int, seconds: float, sizes: tuple[int, ...] = SIZES) -> dict[tuple[str, int], list[float]]:
    """Messages a second by mode and payload size, one entry a round."""
    figures: dict[tuple[str, int], list[float]] = {(mode, size): [] for mode in MODES for size in sizes}
    for _ in range(rounds):
        for (mode, size), rates in figures.items():
            rates.append(_once(mode, size, seconds))
    return figures


def _once(mode: str, size: int, seconds: float) -> float:
    """One measurement; its processes are gone afterwards."""
    ports = [str(free_port()) for _ in range(3)]
    roles = {
        "proxy": ("proxy", "zmq-pub", "zmq-sub"),
        "chain": ("chain", "zmq-pub", "zmq-sub"),
        "hub": ("broker", "zmq-pub", "zmq-sub"),
        "hub, heard": ("broker", "ros-sub", "zmq-pub", "zmq-sub"),
        "to ROS": ("broker", "zmq-pub", "ros-sub"),
        "to ZMQ": ("broker", "ros-pub", "zmq-sub"),
    }[mode]
    running = []
    try:
        for role in roles:
            command = [sys.executable, "-m", "load_tests.benchmarks.library.broker", "--role", role, "--ports", *ports]
            command += ["--size", str(size), "--seconds", str(seconds)]
            running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
            if role in ("proxy", "chain", "broker"):
                assert running[-1].stdout is not None
                running[-1].stdout.readline()  # it listens
        out, _ = running[-1].communicate(timeout=_START_S + seconds)
        return float(out)
    finally:
        for process in running:
            process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()


def _proxy(ports: list[int]) -> None:
    context = zmq.Context()
    front, back = context.socket(zmq.XSUB), context.socket(zmq.XPUB)
    front.bind(f"tcp://127.0.0.1:{ports[0]}")
    back.bind(f"tcp://127.0.0.1:{ports[1]}")
    print("ready", flush=True)
    zmq.proxy(front, back)


def _chain(ports: list[int]) -> None:
    import threading

    context = zmq.Context()
    front, middle, merge, back = (context.socket(kind) for kind in (zmq.XSUB, zmq.XPUB, zmq.XSUB, zmq.XPUB))
    front.bind(f"tcp://127.0.0.1:{ports[0]}")
    middle.bind("inproc://middle")
    merge.connect("inproc://middle")
    back.bind(f"tcp://127.0.0.1:{ports[1]}")
    threading.Thread(target=lambda: zmq.proxy(front, middle), daemon=True).start()
    print("ready", flush=True)
    zmq.proxy(merge, back)


def _broker(ports: list[int]) -> None:
    from metaros.wire import open_router

    hub = HubOptions(xsub=(f"tcp://127.0.0.1:{ports[0]}",), xpub=(f"tcp://127.0.0.1:{ports[1]}",))
    router = open_router(ports[2])
    with router, metaros.Context(connect=router.endpoint) as context, Broker(context, BrokerOptions(hub=hub)):
        print("ready", flush=True)
        while True:
            time.sleep(1)


def _zmq_publisher(ports: list[int], size: int) -> None:
    socket = zmq.Context().socket(zmq.PUB)
    socket.setsockopt(zmq.XPUB_NODROP, 1)  # wait for the hub instead of losing here
    socket.connect(f"tcp://127.0.0.1:{ports[0]}")
    message = b'%b {"data": "%b"}' % (_TOPIC.encode(), b"x" * size)
    while True:
        socket.send(message)


def _ros_publisher(ports: list[int], size: int) -> None:
    with (
        metaros.Context(connect=f"tcp/127.0.0.1:{ports[2]}") as context,
        metaros.Node("bench_publisher", context=context) as node,
    ):
        publisher, message = node.create_publisher(String, _TOPIC), String(data="x" * size)
        while True:
            for _ in range(100):
                publisher.publish(message)
            time.sleep(0.0005)  # the reader of a subscription drops what it cannot take; this is flood enough


def _count(seconds: float, count: Callable[[], int]) -> None:
    """Print messages a second, over `seconds`, from a moment after the first one."""
    while not count():
        time.sleep(0.001)
    time.sleep(_WARM_UP_S)
    first, begin = count(), time.perf_counter()
    time.sleep(seconds)
    print((count() - first) / (time.perf_counter() - begin), flush=True)


def _zmq_subscriber(ports: list[int], seconds: float) -> None:
    import threading

    got = [0]

    def read() -> None:
        socket = zmq.Context().socket(zmq.SUB)
        socket.subscribe(_TOPIC.encode())
        socket.connect(f"tcp://127.0.0.1:{ports[1]}")
        while True:
            socket.recv()
            got[0] += 1

    threading.Thread(target=read, daemon=True).start()
    _count(seconds, lambda: got[0])


def _ros_subscriber(ports: list[int], seconds: float) -> None:
    import threading

    got = [0]

    def on_message(message: String) -> None:
        got[0] += 1

    with (
        metaros.Context(connect=f"tcp/127.0.0.1:{ports[2]}") as context,
        metaros.Node("bench_subscriber", context=context) as node,
    ):
        node.create_subscription(String, _TOPIC, on_message, 1000)
        threading.Thread(target=lambda: metaros.spin(node), daemon=True).start()
        _count(seconds, lambda: got[0])


def _play(role: str, ports: list[int], size: int, seconds: float) -> None:
    """One of the processes of a measurement."""
    parts: dict[str, Callable[[], None]] = {
        "proxy": lambda: _proxy(ports),
        "chain": lambda: _chain(ports),
        "broker": lambda: _broker(ports),
        "zmq-pub": lambda: _zmq_publisher(ports, size),
        "ros-pub": lambda: _ros_publisher(ports, size),
        "zmq-sub": lambda: _zmq_subscriber(ports, seconds),
        "ros-sub": lambda: _ros_subscriber(ports, seconds),
    }
    with suppress(KeyboardInterrupt):
        parts[role]()


def _print(figures: dict[tuple[str, int], list[float]], sizes: tuple[int, ...]) -> None:
    print("| messages a second | " + " | ".join(f"{size} B" for size in sizes) + " |")
    print("| --- |" + " ---: |" * len(sizes))
    for mode in MODES:
        cells = [f"{statistics.median(figures[mode, size]):,.0f}" for size in sizes]
        print(f"| {mode} | " + " | ".join(cells) + " |")
    plain = figures["proxy", sizes[0]]
    note("64 B through the hub", figures["hub", sizes[0]], peer=plain)
    for name, mode in (("hub", "hub"), ("hub, a node listening", "hub, heard"), ("bare chain", "chain")):
        note(
            f"64 B, {name} ÷ zmq.proxy", [ours / its for ours, its in zip(figures[mode, sizes[0]], plain, strict=True)]
        )
    shares = [statistics.median(figures["hub", size]) / statistics.median(figures["proxy", size]) for size in sizes]
    print("| hub ÷ proxy | " + " | ".join(f"{share:.2f}" for share in shares) + " |")


def main(argv: list[str] | None = None) -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description="the broker beside a plain zmq.proxy")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--role", default="")
    parser.add_argument("--ports", type=int, nargs=3, default=[0, 0, 0])
    parser.add_argument("--size", type=int, default=64)
    given = parser.parse_args([] if argv is None else argv)
    if given.role:
        _play(given.role, given.ports, given.size, given.seconds)
        return
    _print(run(rounds=given.rounds, seconds=given.seconds), SIZES)


if __name__ == "__main__":
    main(sys.argv[1:])
