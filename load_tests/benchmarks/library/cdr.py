"""Encode and decode times of our CDR codec beside rosbags, in one process and in alternating rounds.

    python -m load_tests cdr [--rounds 7]

Each figure is the median over the rounds of the mean time of a call, in microseconds. Both sides handle the same
message contents and the bytes are compared before anything is timed.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from load_tests.figures import note
from metaros.cdr import codec
from metaros.idl import message_class

__all__ = ["Result", "main", "run"]

Side = tuple[Callable[[Any], Any], Any]

_SECONDS_PER_ROUND = 0.05


@dataclass(frozen=True, slots=True)
class Result:
    """Median microseconds of one operation on one type, ours and theirs."""

    type_name: str
    operation: str
    size_bytes: int
    ours_us: float
    rosbags_us: float

    @property
    def ratio(self) -> float:
        """How many times faster ours is."""
        return self.rosbags_us / self.ours_us


def _samples() -> dict[str, Any]:
    """One message a row of the table, filled with numbers that are not all zero."""

    def make(name: str, /, **values: Any) -> Any:
        return message_class(f"{name.split('/')[0]}/msg/{name.split('/')[1]}")(**values)

    stamp = make("builtin_interfaces/Time", sec=1_700_000_000, nanosec=123_456_789)
    header = make("std_msgs/Header", stamp=stamp, frame_id="base_link")
    fields = [make("sensor_msgs/PointField", name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyzi")]
    vector = make("geometry_msgs/Vector3", x=0.1, y=0.2, z=9.8)
    return {
        "String": make("std_msgs/String", data="Hello World: 1"),
        "Imu": make("sensor_msgs/Imu", header=header, angular_velocity=vector, linear_acceleration=vector),
        "LaserScan(1080)": make(
            "sensor_msgs/LaserScan",
            header=header,
            ranges=np.linspace(0.1, 12.0, 1080, dtype=np.float32),
            intensities=np.linspace(0.0, 255.0, 1080, dtype=np.float32),
        ),
        "Image(1080p)": make(
            "sensor_msgs/Image",
            header=header,
            height=1080,
            width=1920,
            encoding="rgb8",
            step=5760,
            data=np.resize(np.arange(256, dtype=np.uint8), 1080 * 5760),
        ),
        "PointCloud2(64k)": make(
            "sensor_msgs/PointCloud2",
            header=header,
            height=1,
            width=65536,
            fields=fields,
            point_step=16,
            row_step=16 * 65536,
            data=np.resize(np.arange(256, dtype=np.uint8), 16 * 65536),
            is_dense=True,
        ),
    }


def _mean_us(call: Callable[[Any], Any], argument: Any, count: int) -> float:
    start = time.perf_counter()
    for _ in range(count):
        call(argument)
    return (time.perf_counter() - start) / count * 1e6


def run(*, rounds: int = 7) -> list[Result]:
    """Measure every row; rounds of the two sides alternate."""
    store = get_typestore(Stores.ROS2_JAZZY)
    results: list[Result] = []
    for label, message in _samples().items():
        name = message.__metaros_name__
        ours = codec(name)
        data = ours.encode(message)
        theirs = store.deserialize_cdr(data, name)
        if bytes(store.serialize_cdr(theirs, name)) != data:
            raise AssertionError(f"{name}: the two codecs disagree")
        sides: dict[str, tuple[Side, Side]] = {
            "encode": ((ours.encode, message), (partial(store.serialize_cdr, typename=name), theirs)),
            "decode": ((ours.decode, data), (partial(store.deserialize_cdr, typename=name), data)),
        }
        for operation, pair in sides.items():
            counts = [max(3, int(_SECONDS_PER_ROUND / (_mean_us(*side, 20) / 1e6))) for side in pair]
            times: list[list[float]] = [[], []]
            for _ in range(rounds):
                for index, side in enumerate(pair):
                    times[index].append(_mean_us(*side, counts[index]))
            medians = [statistics.median(values) for values in times]
            results.append(Result(label, operation, len(data), *medians))
    return results


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=7, help="alternating rounds a row, at least 5")
    rounds = max(5, parser.parse_args(list(argv)).rounds)
    print(f"{'message':<18}{'operation':<11}{'bytes':>9}{'metaros us':>12}{'rosbags us':>12}{'ratio':>8}")
    for result in run(rounds=rounds):
        note(f"{result.operation} {result.type_name}, rosbags ÷ ours", [result.ratio])
        print(
            f"{result.type_name:<18}{result.operation:<11}{result.size_bytes:>9}"
            f"{result.ours_us:>12.2f}{result.rosbags_us:>12.2f}{result.ratio:>7.1f}x"
        )
    print(f"median of {rounds} alternating rounds; ratio = rosbags / metaros, above 1 means metaros is faster")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
