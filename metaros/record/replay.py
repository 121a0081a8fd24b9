"""`metaros play`: a CARMEN log of a real robot as LaserScan, Odometry and tf, with nothing lost.

Messages are RELIABLE and KEEP_ALL, which Zenoh turns into back-pressure: at full speed a slow reader slows the replay
down instead of losing samples. `header.stamp` is the log's ipc time; the source time stamp beside the payload is now.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from metaros.clock import Clock
from metaros.errors import ConfigError
from metaros.idl import names
from metaros.interfaces.nav_msgs.msg import Odometry
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.tf2_msgs.msg import TFMessage
from metaros.node import Context, Node
from metaros.record.carmen import LaserLine, LogCount, Record, in_ipc_order, open_log, read_log
from metaros.record.carmen_messages import odometry_message, scan_message, tf_message
from metaros.record.playback_clock import PlaybackClock
from metaros.wire import qos_reliable_all

__all__ = ["PlayReport", "play_carmen"]

_PROGRESS_S = 0.5
_SETTLE_S = 0.5  # readers of the second and third topic usually follow the first within this time


@dataclass(frozen=True, slots=True)
class PlayReport:
    """What a replay has sent so far: `log_s` is the way into the log, `late` counts records that came out of order."""

    scans: int = 0
    odometry: int = 0
    skipped: int = 0
    malformed: int = 0
    late: int = 0
    log_s: float = 0.0
    complaints: tuple[str, ...] = ()


class _Player:
    """One robot's three publishers, and what went through them."""

    def __init__(self, name: str, context: Context) -> None:
        self.name = name
        self.scans = self.odometry = 0
        self.count = LogCount()
        self._earlier_log_s = 0.0
        self._log_s = 0.0
        self.node = Node("player", namespace=f"/{name}", context=context)
        self._scan = self.node.create_publisher(LaserScan, "scan", qos_reliable_all)
        self._odom = self.node.create_publisher(Odometry, "odom", qos_reliable_all)
        self._tf = self.node.create_publisher(TFMessage, "tf", qos_reliable_all)
        self.topics = (self._scan.topic, self._odom.topic, self._tf.topic)

    def send(self, record: Record, *, log_s: float) -> None:
        """Publish one record; blocks while readers are full."""
        self._log_s = log_s
        if isinstance(record, LaserLine):
            self._scan.publish(scan_message(self.name, record))
            self.scans += 1
            return
        self._odom.publish(odometry_message(self.name, record))
        self._tf.publish(tf_message(self.name, record, laser_x_m=_laser_offset(self.count)))
        self.odometry += 1

    def start_round(self) -> None:
        """The log begins anew."""
        self._earlier_log_s += self._log_s
        self._log_s = 0.0

    def report(self) -> PlayReport:
        """So far."""
        count = self.count
        return PlayReport(
            scans=self.scans,
            odometry=self.odometry,
            skipped=count.skipped,
            malformed=count.malformed,
            late=count.late,
            log_s=self._earlier_log_s + self._log_s,
            complaints=tuple(count.complaints),
        )


class _Progress:
    """Tells the caller how far it is, about twice a second."""

    def __init__(self, tell: Callable[[PlayReport], None], clock: Clock) -> None:
        self.tell = tell
        self.clock = clock
        self._next_s = clock.monotonic_s() + _PROGRESS_S

    def is_due(self) -> bool:
        """Whether it is time again."""
        now_s = self.clock.monotonic_s()
        if now_s < self._next_s:
            return False
        self._next_s = now_s + _PROGRESS_S
        return True


def play_carmen(
    path: str | Path,
    *,
    name: str,
    context: Context,
    rate: float = 1.0,
    limit_s: float | None = None,
    loop: bool = False,
    wait_subscriber_s: float = 5.0,
    on_progress: Callable[[PlayReport], None] | None = None,
    stop: threading.Event | None = None,
) -> PlayReport:
    """Replay `path` on /<name>/scan, /<name>/odom and /<name>/tf; `rate` 0 is full speed, 1 original, 20 twenty-fold.

    Blocks until the end of the log, `limit_s` seconds of log time, or `stop`. Waits up to `wait_subscriber_s` for
    subscribers before the first message. `on_progress` is called about twice a second and at the end. Raises
    ConfigError for a missing file or a bad rate, NameError_ for a bad name.
    """
    names.validate_node(name)
    stop = stop or threading.Event()
    progress = _Progress(on_progress or _ignore, context.clock)
    PlaybackClock(rate)  # refuses a bad rate before anything is declared
    open_log(path).close()
    player = _Player(name, context)
    with player.node:
        _wait_for_subscribers(player, context, wait_subscriber_s, stop)
        while not stop.is_set():
            sent = player.scans + player.odometry
            _play_once(
                _records(path, player.count), player, PlaybackClock(rate), limit_s=limit_s, progress=progress, stop=stop
            )
            if player.scans + player.odometry == sent and not stop.is_set():
                raise ConfigError(f"{path}: no FLASER or ODOM line in it: is it a CARMEN log?")
            if not loop:
                break
            player.start_round()
    report = player.report()
    progress.tell(report)
    return report


def _play_once(
    records: Iterator[tuple[Record, float]],
    player: _Player,
    pace: PlaybackClock,
    *,
    limit_s: float | None,
    progress: _Progress,
    stop: threading.Event,
) -> None:
    """One pass through the log, each record at its time."""
    for record, log_s in records:
        if stop.is_set() or (limit_s is not None and log_s > limit_s):
            return
        wait_s = pace.wait_s(log_s, now_s=progress.clock.monotonic_s())
        if wait_s > 0.0 and stop.wait(wait_s):
            return
        player.send(record, log_s=log_s)
        if progress.is_due():
            progress.tell(player.report())


def _records(path: str | Path, count: LogCount) -> Iterator[tuple[Record, float]]:
    """Records in order of ipc time, with their seconds since the first one."""
    with closing(open_log(path)) as source:
        start_s: float | None = None
        for record in in_ipc_order(read_log(source, count), count):
            start_s = record.stamp_s if start_s is None else start_s
            yield record, record.stamp_s - start_s


def _laser_offset(count: LogCount) -> float:
    """How far before the robot's middle the front laser sits, if the log says so."""
    try:
        return float(count.params.get("robot_frontlaser_offset", "0"))
    except ValueError:
        return 0.0


def _wait_for_subscribers(player: _Player, context: Context, timeout_s: float, stop: threading.Event) -> None:
    """Until every topic has a subscription; those of some topics alone are enough after a moment more."""
    begin_s = context.clock.monotonic_s()
    first_s: float | None = None
    while not stop.wait(0.01):
        now_s = context.clock.monotonic_s()
        subscribed = sum(bool(context.graph.endpoints(topic=topic, kind="MS")) for topic in player.topics)
        if subscribed and first_s is None:
            first_s = now_s
        settled = first_s is not None and now_s - first_s >= _SETTLE_S
        if subscribed == len(player.topics) or settled or now_s - begin_s >= timeout_s:
            return


def _ignore(_report: PlayReport) -> None:
    """No progress wanted."""
