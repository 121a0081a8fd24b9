"""Typed publish and receive against raw eclipse-zenoh, between two processes over loopback, peer to peer.

    python -m load_tests.bench_pubsub [--rounds 5] [--seconds 1.0]

Raw is `put(bytes)` to `payload.to_bytes()` in eclipse-zenoh's default callback, without an attachment. Typed is
`publish(message)` (encode, 33-byte attachment) to a callback that gets the decoded message with its sequence checked,
on the default executor and on a dedicated thread. All publish flat out, with blocking congestion control, payloads of
the same size; counted is what reaches the callback. Rounds are interleaved; the figures are medians over the rounds.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

import metaros
from metaros.cdr import codec
from metaros.interfaces.sensor_msgs.msg import Imu
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import qos_reliable_all

__all__ = ["main", "run"]

MESSAGES: dict[str, Any] = {"String": String(data="x" * 55), "Imu": Imu()}
MODES = ("raw", "executor", "dedicated")
_WARM_UP_S = 0.4
_RAW_KEY = "bench/raw"


def run(*, rounds: int, seconds: float) -> dict[tuple[str, str], list[float]]:
    """Messages a second of every (message, mode), one figure a round."""
    rates: dict[tuple[str, str], list[float]] = {(name, mode): [] for name in MESSAGES for mode in MODES}
    for _ in range(rounds):
        for name, mode in rates:
            rates[name, mode].append(_once(name, mode, seconds))
    return rates


def _once(name: str, mode: str, seconds: float) -> float:
    """One subscriber process and one publisher process, linked directly."""
    command = [sys.executable, "-m", "load_tests.bench_pubsub", "--seconds", str(seconds), "--message", name]
    with subprocess.Popen([*command, "--role", f"sub-{mode}"], stdout=subprocess.PIPE, text=True) as subscriber:
        assert subscriber.stdout is not None
        endpoint = subscriber.stdout.readline().strip()
        role = "pub-raw" if mode == "raw" else "pub-typed"
        with subprocess.Popen([*command, "--role", role, "--endpoint", endpoint]) as publisher:
            rate = float(subscriber.stdout.readline())
            publisher.terminate()
    return rate


def _free_endpoint() -> str:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def _plain_session(**endpoints: str) -> zenoh.Session:
    """As any program opens one: eclipse-zenoh's own defaults, except that nobody else is looked for."""
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    for name, endpoint in endpoints.items():
        config.insert_json5(f"{name}/endpoints", f'["{endpoint}"]')
    return zenoh.open(config)


def _subscribe(mode: str, name: str, seconds: float) -> None:
    """Print where to connect, then the rate."""
    endpoint, count = _free_endpoint(), 0

    def on_message(_: Any) -> None:
        nonlocal count
        count += 1

    if mode == "raw":

        def on_sample(sample: zenoh.Sample) -> None:
            nonlocal count
            sample.payload.to_bytes()
            count += 1

        session = _plain_session(listen=endpoint)
        session.declare_subscriber(_RAW_KEY, on_sample)
    else:
        context = metaros.Context(domain_id=0, connect=[], listen=endpoint)
        node = metaros.Node("bench_subscriber", context=context, enable_rosout=False)
        node.create_subscription(
            type(MESSAGES[name]), "bench", on_message, qos_reliable_all, dedicated=mode == "dedicated"
        )
        threading.Thread(target=metaros.spin, args=(node,), daemon=True).start()
    print(endpoint, flush=True)
    while not count:
        time.sleep(0.01)
    time.sleep(_WARM_UP_S)
    before, start_s = count, time.perf_counter()
    time.sleep(seconds)
    print((count - before) / (time.perf_counter() - start_s), flush=True)
    os._exit(0)  # a flooded session need not be taken down tidily


def _publish(kind: str, name: str, endpoint: str) -> None:
    """Flat out until terminated."""
    message = MESSAGES[name]
    send: Callable[[Any], object]
    if kind == "raw":
        session = _plain_session(connect=endpoint)
        send = session.declare_publisher(_RAW_KEY, congestion_control=zenoh.CongestionControl.BLOCK).put
        message = codec(type(message)).encode(message)
    else:
        context = metaros.Context(domain_id=0, connect=endpoint, listen=[])
        node = metaros.Node("bench_publisher", context=context, enable_rosout=False)
        send = node.create_publisher(type(message), "bench", qos_reliable_all).publish
    parent = os.getppid()
    while os.getppid() == parent:
        for _ in range(1000):
            send(message)


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds, at least 5")
    parser.add_argument("--seconds", type=float, default=1.0, help="measured time a round and row")
    parser.add_argument("--role", help=argparse.SUPPRESS)
    parser.add_argument("--message", default="String", help=argparse.SUPPRESS)
    parser.add_argument("--endpoint", default="", help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.role:
        side, _, kind = options.role.partition("-")
        if side == "sub":
            _subscribe(kind, options.message, options.seconds)
        _publish(kind, options.message, options.endpoint)
    rounds = max(5, options.rounds)
    rates = run(rounds=rounds, seconds=options.seconds)
    print(f"{'message':<10}{'path':<12}{'bytes':>7}{'recv/s':>12}{'min..max':>22}{'ratio to raw':>14}")
    for (name, mode), figures in rates.items():
        size = len(codec(type(MESSAGES[name])).encode(MESSAGES[name]))
        ratio = statistics.median(figures) / statistics.median(rates[name, "raw"])
        spread = f"{min(figures):,.0f}..{max(figures):,.0f}"
        print(f"{name:<10}{mode:<12}{size:>7}{statistics.median(figures):>12,.0f}{spread:>22}{ratio:>14.2f}")
    print(f"medians of {rounds} interleaved rounds on {os.cpu_count()} cores")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
