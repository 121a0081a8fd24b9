"""The recorder: what its writer takes beside others, and what a recording process takes from the wire without a drop.

    python -m load_tests record [--rounds 5] [--seconds 1.0] [--folder DIR]

Writers: the same payloads into a new file each round, flushed to the operating system, not to the disk: a plain
buffered file (the payloads alone), ours, PyPI's `mcap`, and rosbags' writer, with and without compression; medians of
interleaved rounds, ratios to the plain file. Payloads are half noise, half zeros, as images with some texture are.

Recorder: a publisher process, reliable and keep-all (so that it is slowed down rather than losing samples), flat out,
and one that is paced: 1080p images at 30 Hz. Counted are samples in the file and those reported as missing.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

import metaros
from load_tests.figures import note
from metaros.idl import schema_text, type_hash
from metaros.mcap import McapFile
from metaros.record import Recorder, open_bag
from metaros.wire import qos_reliable_all

__all__ = ["main", "writers"]

IMAGE_BYTES = 1920 * 1080 * 3
SIZES = {"64 B": (64, 20_000), "1 KiB": (1024, 20_000), "64 KiB": (65_536, 1000), "1080p": (IMAGE_BYTES, 12)}
TYPE = "std_msgs/msg/UInt8MultiArray"
HASH, SCHEMA = type_hash(TYPE), schema_text(TYPE).encode()
Write = Callable[[Path, list[bytes], int], None]


def plain(path: Path, payloads: list[bytes], count: int) -> None:
    """The payloads one after the other."""
    with path.open("wb") as file:
        for number in range(count):
            file.write(payloads[number % len(payloads)])


def ours(compression: str) -> Write:
    """As the recorder writes, with its notes."""

    def write(path: Path, payloads: list[bytes], count: int) -> None:
        with path.open("xb", buffering=0) as stream:
            file: McapFile[tuple[None, int]] = McapFile(stream, compression=compression)
            channel = file.add_channel("/b", file.add_schema(TYPE, SCHEMA), {})
            for number in range(count):
                file.write(channel, number, number, number, payloads[number % len(payloads)], (None, number))
            file.finish(list, lambda _: None)

    return write


def pypi_mcap(compression: CompressionType) -> Write:
    """PyPI's `mcap`, with its defaults."""

    def write(path: Path, payloads: list[bytes], count: int) -> None:
        with path.open("wb") as stream:
            writer = Writer(stream, compression=compression)
            writer.start("ros2")
            channel = writer.register_channel("/b", "cdr", writer.register_schema(TYPE, "ros2msg", SCHEMA))
            for number in range(count):
                writer.add_message(channel, number, payloads[number % len(payloads)], number, number)
            writer.finish()

    return write


def rosbags(mode: CompressionMode) -> Write:
    """rosbags' MCAP writer; `storage` compresses chunks by zstd."""

    def write(path: Path, payloads: list[bytes], count: int) -> None:
        writer = RosbagsWriter(path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            connection = writer.add_connection("/b", TYPE, msgdef=SCHEMA.decode(), rihs01=HASH)
            for number in range(count):
                writer.write(connection, number, payloads[number % len(payloads)])

    return write


WRITERS: dict[str, Write] = {
    "plain file": plain,
    "ours, none": ours("none"),
    "ours, zstd": ours("zstd"),
    "ours, lz4": ours("lz4"),
    "mcap, none": pypi_mcap(CompressionType.NONE),
    "mcap, zstd": pypi_mcap(CompressionType.ZSTD),
    "rosbags, none": rosbags(CompressionMode.NONE),
    "rosbags, zstd": rosbags(CompressionMode.STORAGE),
}


def half_noise(size: int, *, count: int = 1) -> list[bytes]:
    """Different payloads, each compressible to about a half."""
    rng = np.random.default_rng(1)
    noises = [rng.integers(0, 256, size // 2, dtype=np.uint8).tobytes() for _ in range(count)]
    return [noise + bytes(size - len(noise)) for noise in noises]


def writers(folder: Path, *, rounds: int, scale: float) -> dict[tuple[str, str], list[float]]:
    """Messages a second of every (size, writer), one figure a round."""
    rates: dict[tuple[str, str], list[float]] = {(size, name): [] for size in SIZES for name in WRITERS}
    for _ in range(rounds):
        for size, name in rates:
            count = max(2, round(SIZES[size][1] * scale))
            payloads = half_noise(SIZES[size][0], count=min(count, 1 + 20_000_000 // SIZES[size][0], 5000))
            path = folder / "bench.mcap"
            begin_s = time.perf_counter()
            WRITERS[name](path, payloads, count)
            rates[size, name].append(count / (time.perf_counter() - begin_s))
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    return rates


# -- the whole recorder -------------------------------------------------------------------------------------------


def record(folder: Path, size: int, rate_hz: float, seconds: float) -> dict[str, float]:
    """A publisher process and a recorder in this one, linked directly; 0 Hz is flat out."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    context = metaros.Context(domain_id=0, connect=[], listen=endpoint)
    command = [
        sys.executable,
        "-m",
        "load_tests.benchmarks.library.record",
        "--role",
        "publish",
        "--endpoint",
        endpoint,
    ]
    target = folder / "run.mcap"
    with context:
        recorder = Recorder(context, target, topics=["/bench"])
        with subprocess.Popen([*command, "--size", str(size), "--rate", str(rate_hz)]) as publisher:
            while not recorder.report().received:
                time.sleep(0.01)
            time.sleep(0.3)
            before, begin_s, cpu_s = recorder.report(), time.perf_counter(), time.process_time()
            time.sleep(seconds)
            after, elapsed_s = recorder.report(), time.perf_counter() - begin_s
            cpu_s = time.process_time() - cpu_s
            publisher.terminate()
        final = recorder.close()
    accounts = [account for *_place, account in open_bag(target).gaps()]
    assert sum(account["received"] for account in accounts) == final.written
    target.unlink()
    count = after.written - before.written
    return {
        "rate": count / elapsed_s,
        "mb_s": count * size / elapsed_s / 1e6,
        "missing": sum(sum(reasons.values()) for reasons in final.missing.values()),
        "cpu_us": cpu_s / max(count, 1) * 1e6,
    }


def publish(endpoint: str, size: int, rate_hz: float) -> None:
    """Until terminated."""
    context = metaros.Context(domain_id=0, connect=endpoint, listen=[])
    node = metaros.Node("bench_publisher", context=context, enable_rosout=False)
    send = node.create_raw_publisher("/bench", TYPE, HASH, qos_reliable_all).publish
    payload = b"\x00\x01\x00\x00" + half_noise(size - 4)[0]
    parent, pause = os.getppid(), threading.Event()
    due_s = time.perf_counter()
    while os.getppid() == parent:
        send(payload)
        if rate_hz:
            due_s += 1 / rate_hz
            pause.wait(max(0.0, due_s - time.perf_counter()))


def main(argv: Sequence[str] = ()) -> int:
    """Print both tables; 1 when a paced image was missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="interleaved rounds")
    parser.add_argument("--seconds", type=float, default=2.0, help="measured time of a recording")
    parser.add_argument("--scale", type=float, default=1.0, help="of the number of messages the writers get")
    parser.add_argument("--folder", default="", help="where to write; default the system's temporary folder")
    parser.add_argument("--role", help=argparse.SUPPRESS)
    parser.add_argument("--endpoint", default="", help=argparse.SUPPRESS)
    parser.add_argument("--size", type=int, default=64, help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=float, default=0.0, help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.role:
        publish(options.endpoint, options.size, options.rate)
        return 0
    with tempfile.TemporaryDirectory(dir=options.folder or None) as folder:
        rates = writers(Path(folder), rounds=options.rounds, scale=options.scale)
        _print_writers(rates)
        print()
        missing = _print_recorder(Path(folder), rounds=options.rounds, seconds=options.seconds)
    print(f"medians of {options.rounds} interleaved rounds on {os.cpu_count()} cores")
    note("1080p at 30 Hz, missing", [missing])
    return int(missing > 0)


def _print_writers(rates: dict[tuple[str, str], list[float]]) -> None:
    note("1080p written", rates["1080p", "ours, none"], peer=rates["1080p", "mcap, none"])
    print(f"{'payload':<9}{'writer':<16}{'msg/s':>12}{'min..max':>24}{'MB/s':>9}{'ratio to plain':>16}")
    for (size, name), figures in rates.items():
        middle = statistics.median(figures)
        ratio = middle / statistics.median(rates[size, "plain file"])
        spread = f"{min(figures):,.0f}..{max(figures):,.0f}"
        megabytes = middle * SIZES[size][0] / 1e6
        print(f"{size:<9}{name:<16}{middle:>12,.0f}{spread:>24}{megabytes:>9,.0f}{ratio:>16.3f}")


def _print_recorder(folder: Path, *, rounds: int, seconds: float) -> float:
    """The table; how many paced samples were missing."""
    loads = {"64 B flat out": (64, 0.0), "64 KiB flat out": (65_536, 0.0), "1080p at 30 Hz": (IMAGE_BYTES, 30.0)}
    found: dict[str, list[dict[str, float]]] = {name: [] for name in loads}
    for _ in range(rounds):
        for name, (size, rate_hz) in loads.items():
            found[name].append(record(folder, size, rate_hz, seconds))
    print(f"{'recorder, from the wire':<26}{'msg/s':>10}{'MB/s':>9}{'us CPU/msg':>13}{'missing, all rounds':>21}")
    for name, rows in found.items():
        rate, megabytes, cpu = (statistics.median(row[key] for row in rows) for key in ("rate", "mb_s", "cpu_us"))
        print(f"{name:<26}{rate:>10,.0f}{megabytes:>9,.0f}{cpu:>13.1f}{sum(row['missing'] for row in rows):>21,.0f}")
    return sum(row["missing"] for row in found["1080p at 30 Hz"])


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
