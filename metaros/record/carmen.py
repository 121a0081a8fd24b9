"""CARMEN logs of real robots: text lines of laser scans and odometry, read as a stream.

A line is `NAME fields… ipc_timestamp hostname logger_timestamp`. Known are FLASER (front laser), ODOM and PARAM; other
messages are counted and skipped; a line that breaks the format is counted and the first few are kept by number and
reason. Loggers wrote lines slightly out of order, so `in_ipc_order` sorts them within a window.
"""

from __future__ import annotations

import bz2
import gzip
import heapq
import io
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from metaros.errors import ConfigError

__all__ = ["LaserLine", "LogCount", "OdometryLine", "Record", "in_ipc_order", "open_log", "read_log"]

LINE_BYTES = 64 * 1024  # a 1,000-ray scan has 8 KiB; longer lines are no log
_KEPT_COMPLAINTS = 5


@dataclass(frozen=True, slots=True, eq=False)
class LaserLine:
    """One FLASER line. `ranges_m` are as logged: values of about 50 m and more mean no return."""

    stamp_s: float
    ranges_m: npt.NDArray[np.float32]
    laser_pose: tuple[float, float, float]
    robot_pose: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class OdometryLine:
    """One ODOM line: pose in metres and radians, speeds in m/s and rad/s."""

    stamp_s: float
    pose: tuple[float, float, float]
    linear_m_s: float
    angular_rad_s: float


Record: TypeAlias = LaserLine | OdometryLine


@dataclass(slots=True)
class LogCount:
    """What a reading met: filled while the log is read."""

    scans: int = 0
    odometry: int = 0
    skipped: int = 0
    malformed: int = 0
    late: int = 0
    params: dict[str, str] = field(default_factory=dict)
    complaints: list[str] = field(default_factory=list)

    def complain(self, line_number: int, reason: str) -> None:
        """Count a malformed line; the first few are kept in words."""
        self.malformed += 1
        if len(self.complaints) < _KEPT_COMPLAINTS:
            self.complaints.append(f"line {line_number}: {reason}")


def open_log(path: str | Path) -> BinaryIO:
    """Open a log, decompressing .bz2 and .gz on the fly. Raises ConfigError when there is no such file."""
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f"no such log file: {path}")
    if path.suffix == ".bz2":
        return cast(BinaryIO, io.BufferedReader(bz2.BZ2File(path)))
    if path.suffix == ".gz":
        return cast(BinaryIO, io.BufferedReader(gzip.GzipFile(path)))
    return path.open("rb")


def read_log(source: BinaryIO, count: LogCount) -> Iterator[Record]:
    """Every scan and odometry line in file order; `count` tells what else there was."""
    number = 0
    while raw := source.readline(LINE_BYTES + 1):
        number += 1
        if len(raw) > LINE_BYTES:
            count.complain(number, f"longer than {LINE_BYTES} bytes")
            while raw and not raw.endswith(b"\n"):
                raw = source.readline(LINE_BYTES)
            continue
        words = raw.split()
        if not words or words[0].startswith(b"#"):
            continue
        try:
            record = _parse(words, count)
        except (ValueError, IndexError) as error:
            count.complain(number, str(error))
            continue
        if record is not None:
            yield record


def _parse(words: list[bytes], count: LogCount) -> Record | None:
    """One line's words as a record; ValueError says what is wrong with them."""
    kind = words[0]
    if kind == b"FLASER":
        scan = _laser(words)
        count.scans += 1
        return scan
    if kind == b"ODOM":
        odometry = _odometry(words)
        count.odometry += 1
        return odometry
    if kind == b"PARAM":
        if len(words) < 3:
            raise ValueError("PARAM needs a name and a value")
        count.params[words[1].decode(errors="replace")] = words[2].decode(errors="replace")
        return None
    if not kind.isascii() or not kind.replace(b"-", b"").replace(b"_", b"").isalnum():
        raise ValueError(f"{kind[:20]!r} is no message name")
    count.skipped += 1
    return None


def _numbers(words: list[bytes], what: str) -> list[float]:
    values = [float(word) for word in words]
    if not all(map(math.isfinite, values)):
        raise ValueError(f"{what} has a value that is not a finite number")
    return values


def _laser(words: list[bytes]) -> LaserLine:
    readings = int(words[1])
    if readings < 1 or len(words) != readings + 11:
        raise ValueError(f"FLASER with {readings} readings has {len(words)} words, not {readings + 11}")
    values = _numbers(words[2 : readings + 9], "FLASER")
    ranges = np.array(values[:readings], dtype=np.float32)
    ranges.flags.writeable = False
    x, y, heading, robot_x, robot_y, robot_heading = values[readings : readings + 6]
    return LaserLine(values[-1], ranges, (x, y, heading), (robot_x, robot_y, robot_heading))


def _odometry(words: list[bytes]) -> OdometryLine:
    if len(words) != 10:
        raise ValueError(f"ODOM has {len(words)} words, not 10")
    x, y, heading, linear, angular, _accel, stamp_s = _numbers(words[1:8], "ODOM")
    return OdometryLine(stamp_s, (x, y, heading), linear, angular)


def in_ipc_order(records: Iterable[Record], count: LogCount, *, window_s: float = 5.0) -> Iterator[Record]:
    """Sort by ipc time, holding back only the last `window_s`; equal stamps keep the file's order.

    A record older than one already given (a step back of more than the window) is given at once and counted `late`.
    """
    waiting: list[tuple[float, int, Record]] = []
    newest = given = -math.inf
    for number, record in enumerate(records):
        heapq.heappush(waiting, (record.stamp_s, number, record))
        newest = max(newest, record.stamp_s)
        while waiting and (waiting[0][0] <= newest - window_s):
            stamp_s, _, ready = heapq.heappop(waiting)
            count.late += stamp_s < given
            given = max(given, stamp_s)
            yield ready
    while waiting:
        yield heapq.heappop(waiting)[2]
