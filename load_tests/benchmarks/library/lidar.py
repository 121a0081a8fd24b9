"""A VLP-16 at full rate: 754 packets a second, 289,000 points, from the wire to a subscriber of the same machine.

    python -m load_tests lidar [--rounds 5] [--seconds 10] [--quick]

First the parsing alone: packets of so many seconds through the cutter and the decoder of the driver, their CPU time as
a share of a core at full rate; in the same rounds a loop of `struct.unpack_from` over every return, as one writes at
first, and PyPI's velodyne-decoder (C++) where it is installed. Then all of it: one process sends by the clock over the
loopback, one is the driver with `delivery=all`, one subscribes and decodes every cloud. What the driver counted as lost
or dropped, and what it published and the subscriber did not get, is the loss. Figures are medians over the rounds.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import socket
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

from load_tests.benchmarks.library.lidar_processes import PACKETS_A_S, POINTS_A_S
from load_tests.figures import note
from metaros.drivers.vlp16.packets import ELEVATIONS_DEG
from metaros.drivers.vlp16.revolutions import RevolutionSplitter, decode
from tests.support.devices.vlp16_emulator import Vlp16Emulator

__all__ = ["main"]

OURS, LOOP, PEER = "driver", "struct loop", "velodyne-decoder"
PATIENCE_S = 60.0
_PARSED_S = 2.0  # of lidar in a round
Parser = Callable[[Sequence[bytes]], int]


def by_the_driver(packets: Sequence[bytes]) -> int:
    """As the driver does it; how many points."""
    cutter, points = RevolutionSplitter(), 0
    for number, packet in enumerate(packets):
        turn = cutter.add(packet, number * 1_327_104)
        if turn is not None:
            points += len(decode(turn))
    return points


def by_a_loop(packets: Sequence[bytes]) -> int:
    """One return after the other."""
    cosines = [(math.cos(math.radians(angle)), math.sin(math.radians(angle))) for angle in ELEVATIONS_DEG]
    points = []
    for packet in packets:
        for block in range(0, 1200, 100):
            azimuth = math.radians(struct.unpack_from("<H", packet, block + 2)[0] / 100)
            cos, sin = math.cos(azimuth), math.sin(azimuth)
            for channel in range(32):
                distance, strength = struct.unpack_from("<HB", packet, block + 4 + 3 * channel)
                if distance:
                    flat, steep = cosines[channel % 16]
                    range_m = distance * 0.002
                    points.append(
                        (range_m * flat * cos, -range_m * flat * sin, range_m * steep, strength, channel % 16)
                    )
    return len(points)


def by_the_peer() -> Parser | None:
    """velodyne-decoder, with structs of points as we have them; None where it is not installed."""
    try:
        velodyne_decoder = importlib.import_module("velodyne_decoder")
    except ImportError:
        return None

    def parse(packets: Sequence[bytes]) -> int:
        config = velodyne_decoder.Config()
        config.model = velodyne_decoder.Model.VLP16
        decoder, points = velodyne_decoder.StreamDecoder(config), 0
        for number, packet in enumerate(packets):
            found = decoder.decode(number / PACKETS_A_S, packet, True)
            if found is not None:
                points += len(found[1])
        return points

    return parse


def _share(parse: Parser, packets: Sequence[bytes]) -> float:
    """CPU time for the lidar's time, in percent."""
    begin_s = time.process_time()
    points = parse(packets)
    spent_s = time.process_time() - begin_s
    if points < 0.8 * len(packets) * 384:
        raise SystemExit(f"only {points} points of {len(packets)} packets")
    return 100 * spent_s / (len(packets) / PACKETS_A_S)


def _parse(rounds: int) -> dict[str, list[float]]:
    emulator = Vlp16Emulator(azimuth_deg=175)
    packets = [emulator.packet() for _ in range(round(_PARSED_S * PACKETS_A_S))]
    parsers: dict[str, Parser] = {OURS: by_the_driver, LOOP: by_a_loop}
    if (peer := by_the_peer()) is not None:
        parsers[PEER] = peer
    shares: dict[str, list[float]] = {name: [] for name in parsers}
    for _ in range(rounds):
        for name, parse in parsers.items():
            shares[name].append(_share(parse, packets))
    return shares


class _End:
    """One of the processes."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "load_tests.benchmarks.library.lidar_processes", *arguments]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.ready = self.line()

    def line(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        return dict(json.loads(self.process.stdout.readline()))

    def finish(self) -> dict[str, Any]:
        """Tell it to end; its figures."""
        reported, _ = self.process.communicate("stop\n", timeout=PATIENCE_S)
        return dict(json.loads(reported.splitlines()[-1]))

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def _whole(seconds: float) -> dict[str, float]:
    """One round of lidar, driver and subscriber."""
    with ExitStack() as stack:
        counter = _End("count", "--endpoint", endpoint := _free_endpoint())
        stack.callback(counter.kill)
        driver = _End("drive", "--endpoint", endpoint)
        stack.callback(driver.kill)
        sender = _End("send", "--port", str(driver.ready["port"]), "--seconds", str(seconds))
        stack.callback(sender.kill)
        sent = sender.finish()
        time.sleep(1.0)  # what is on its way arrives
        drove, counted = driver.finish(), counter.finish()
    counters = drove["counters"]
    lost = counters.get("lost_packets", 0) + counters.get("dropped_turns", 0) * 75
    unheard = counters.get("readings", 0) - counted["clouds"]
    return {
        "cpu": 100 * drove["cpu_s"] / sent["seconds"],
        "lost": lost + unheard * 75,
        "clouds": counted["clouds"],
        "points_s": counted["points"] / max(1, counted["clouds"]) * 10,
        "rate": sent["packets"] / sent["seconds"],
        "late_ms": sent["latest_ms"],
    }


def _free_endpoint() -> str:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def _print_parse(shares: dict[str, list[float]]) -> None:
    print(f"{'parsing alone':<20}{'% of a core':>12}{'min..max':>16}{'÷ driver':>10}")
    ours = statistics.median(shares[OURS])
    for name, values in shares.items():
        middle = statistics.median(values)
        print(f"{name:<20}{middle:>12.2f}{f'{min(values):.2f}..{max(values):.2f}':>16}{middle / ours:>10.1f}")
    if PEER not in shares:
        print(f"{PEER}: not installed (pip install velodyne-decoder)")


def _print_whole(rounds: Sequence[dict[str, float]]) -> None:
    print(
        f"\n{'whole path':<12}{'driver %':>10}{'packets/s':>11}{'clouds':>8}{'points/s':>11}{'lost':>6}{'late ms':>9}"
    )
    for number, one in enumerate(rounds, 1):
        left = f"round {number:<6}{one['cpu']:>10.1f}{one['rate']:>11.1f}{one['clouds']:>8.0f}"
        print(f"{left}{one['points_s']:>11,.0f}{one['lost']:>6.0f}{one['late_ms']:>9.1f}")
    print(f"full rate is {PACKETS_A_S:.1f} packets and {POINTS_A_S:,.0f} points a second; lost: in packets, anywhere")


def main(argv: Sequence[str] = ()) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds")
    parser.add_argument("--seconds", type=float, default=10.0, help="of lidar a round of the whole path")
    parser.add_argument("--quick", action="store_true", help="one short round, to see that it runs")
    options = parser.parse_args(list(argv))
    if options.quick:
        options.rounds, options.seconds = 1, 2.0
    shares = _parse(options.rounds)
    _print_parse(shares)
    whole = [_whole(options.seconds) for _ in range(options.rounds)]
    _print_whole(whole)
    note("parsing at full rate", shares[OURS], peer=shares.get(PEER, ()))
    note(f"parsing, {LOOP} ÷ ours", [b / a for a, b in zip(shares[OURS], shares[LOOP], strict=True)])
    note("driver at full rate", [one["cpu"] for one in whole])
    note("packets lost on the way to a subscriber", [one["lost"] for one in whole])
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
