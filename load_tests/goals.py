"""Every benchmark's figures that somebody may ask for: what is wanted of each, and beside whom it is measured.

A benchmark gives its figures by `load_tests.figures.note` under these names; the summary of `make bench` and the table
in docs/topics/performance.md are made of both. A goal is what was set before it was measured. What has none is told
for its peer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["GOALS", "Goal", "of_benchmark", "variant_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """One figure of one benchmark. `least`, `most`: what is wanted; both None: nothing was. `peer`: who is measured in
    the same rounds, "" for nobody. `options`: of the benchmark, where the figure needs some; `less`: less is better.
    """

    benchmark: str
    figure: str
    unit: str
    least: float | None = None
    most: float | None = None
    peer: str = ""
    options: str = ""
    less: bool = True

    @property
    def wanted(self) -> str:
        """The goal in a few signs; "" where there is none."""
        if self.least is not None:
            return f"≥ {self.least:,g} {self.unit}".rstrip()
        return f"≤ {self.most:,g} {self.unit}".rstrip() if self.most is not None else ""

    @property
    def run(self) -> str:
        """The run that measures it: the benchmark, and the options that it needs."""
        return f"{self.benchmark} {self.options}".rstrip()

    @property
    def command(self) -> str:
        """What prints it."""
        return f"python -m load_tests {self.run}"

    def met(self, value: float) -> bool | None:
        """Whether a figure is what was wanted; None where nothing was."""
        if self.least is not None:
            return value >= self.least
        return value <= self.most if self.most is not None else None


def of_benchmark(name: str) -> list[Goal]:
    """The figures of one benchmark."""
    return [goal for goal in GOALS if goal.benchmark == name]


def variant_of(benchmark: str, options: Sequence[str]) -> str:
    """Which of the runs that figures ask for one with these options is: their own options, "" for the plain one."""
    wanted = {goal.options for goal in of_benchmark(benchmark)} - {""}
    return max((one for one in wanted if set(one.split()) <= set(options)), key=len, default="")


_ROSBAGS, _RAW, _SDK, _RIE = "rosbags", "eclipse-zenoh", "foxglove-sdk", "AWS RIE"
_PEERS = (
    ("shared executor, typed 64 B, keep-all, of raw", 0.35, None, "×"),
    ("shared executor, typed 64 B, keep-last 10 flooded, of raw", 0.35, None, "×"),
    ("threads of a node with 20 subscriptions", None, 6, ""),
    ("threads with 20 keep-all subscriptions", None, 8, ""),
    ("dedicated, typed 64 B, of raw", 0.55, None, "×"),
    ("dedicated, bytes 64 B, of raw", 0.8, None, "×"),
    ("typed 64 B, dedicated, against cyclonedds-python 11.0.1", 4, None, "×"),
    ("bytes 1 MiB, against pyzmq 27.3.0", 1, None, "×"),
    ("bytes 1 MiB, of raw with our settings", 0.95, None, "×"),
    ("typed 1 MiB, shared memory, against cyclonedds-python 11.0.1", 5, None, "×"),
    ("RTT p50, shared executor, 64 B, of raw", None, 1.1, "×"),
    ("RTT p50, shared executor, 64 B, of cyclonedds-python 11.0.1", None, 1, "×"),
    ("RTT p50, shared executor, of raw: worst size", None, 1.2, "×"),
    ("RTT p50, dedicated, of raw: worst size", None, 1.2, "×"),
)
_ATTACKS = (
    "login",
    "login_many",
    "slow_loris",
    "slow_bodies",
    "big_bodies",
    "json_depth",
    "bombs",
    "pings",
    "tiny_frames",
    "streams",
)
_CDR = ("String", "Imu", "LaserScan(1080)", "Image(1080p)", "PointCloud2(64k)")
_SHAPES = ("sqlite, one", "sqlite, hundred", "postgres, one", "postgres, hundred")

GOALS: tuple[Goal, ...] = (
    *(
        Goal(benchmark="peers", figure=text, unit=unit, least=least, most=most, less=most is not None)
        for text, least, most, unit in _PEERS
    ),
    Goal(benchmark="pubsub", figure="typed 64 B, dedicated", unit="/s", peer=_RAW, less=False),
    Goal(benchmark="pubsub", figure="typed 64 B, of raw", unit="×", least=0.5, less=False),
    *(
        Goal(benchmark="cdr", figure=f"{operation} {kind}, rosbags ÷ ours", unit="×", least=least, less=False)
        for kind in _CDR
        for operation in ("encode", "decode")
        for least in (3 if kind == "Imu" else 1,)
    ),
    *(Goal(benchmark="ros2", figure=f"{size} B, native ÷ rclpy", unit="×", most=1.2) for size in (64, 65536, 1048576)),
    Goal(benchmark="ros2", figure="rclpy, first message", unit="ms", most=400),
    Goal(benchmark="ros2", figure="rclpy, first message, of import numpy", unit="×"),
    Goal(benchmark="service", figure="call p50, of raw", unit="×", most=1.5),
    Goal(benchmark="service", figure="call p50", unit="µs", peer=_RAW),
    Goal(benchmark="service", figure="goals a second, 32 at a time", unit="/s", less=False),
    Goal(benchmark="executor", figure="critical timer p99, fair executor", unit="ms", most=2, peer="default executor"),
    Goal(benchmark="executor", figure="largest error of a share, 1 ms callbacks", unit="%", most=5),
    Goal(benchmark="timer", figure="p99 late at 100 Hz, single-threaded", unit="µs"),
    Goal(
        benchmark="restart",
        figure="kill -9 to first message, p95",
        unit="ms",
        most=150,
        peer="bare Python and eclipse-zenoh",
    ),
    *(
        Goal(benchmark="start", figure=f"{program}, of python -c pass", unit="×")
        for program in ("metaros --help", "metaros topic list", "metaros gateway", "metaros up")
    ),
    Goal(benchmark="memory", figure="growth, typed, subscriber", unit="bytes a message"),
    Goal(benchmark="broker", figure="64 B through the hub", unit="/s", peer="pyzmq zmq.proxy", less=False),
    Goal(benchmark="broker", figure="64 B, hub ÷ zmq.proxy", unit="×", least=1, less=False),
    Goal(benchmark="broker", figure="64 B, hub, a node listening ÷ zmq.proxy", unit="×", less=False),
    Goal(benchmark="broker", figure="64 B, bare chain ÷ zmq.proxy", unit="×", less=False),
    Goal(
        benchmark="shared_memory", figure="messages to a subscriber that may lock 1 MiB", unit="", least=1, less=False
    ),
    Goal(benchmark="shared_memory", figure="left in a subscriber by a restart of its publisher", unit="MiB", most=0),
    Goal(benchmark="record", figure="1080p written", unit="/s", peer="mcap", less=False),
    Goal(benchmark="record", figure="1080p at 30 Hz, missing", unit="", most=0),
    Goal(benchmark="delivery", figure="samples, SQLite", unit="/s", least=150_000, peer="outbox alone", less=False),
    Goal(benchmark="delivery", figure="samples, PostgreSQL", unit="/s", least=150_000, peer="outbox alone", less=False),
    Goal(benchmark="delivery", figure="live p99, beside 60,000 durable/s", unit="ms", most=10),
    Goal(benchmark="ingest", figure="rows", unit="/s", least=1_500_000, peer="bare grpc.aio", less=False),
    Goal(benchmark="ingest", figure="samples", unit="/s", peer="bare grpc.aio", less=False),
    *(
        Goal(benchmark="history", figure=f"p95 of a day in 1000 buckets, {shape}", unit="ms", most=25)
        for shape in _SHAPES
    ),
    Goal(benchmark="storage", figure="every message, sim, of raw CDR", unit="×", peer="rosbags MCAP with zstd"),
    Goal(benchmark="storage", figure="every message, intel, of raw CDR", unit="×", peer="rosbags MCAP with zstd"),
    Goal(benchmark="storage", figure="every message, sim, of the MCAP file", unit="×", most=1),
    Goal(benchmark="storage", figure="every message, intel, of the MCAP file", unit="×", most=1),
    *(Goal(benchmark="attacks", figure=f"{attack}: p99 with ÷ without", unit="×", most=2) for attack in _ATTACKS),
    Goal(benchmark="fanout", figure=f"64 B to 100, 1 ms: CPU of {_SDK} ÷ ours", unit="×", least=2, less=False),
    Goal(benchmark="fanout", figure=f"64 B to 100, 5 ms: CPU of {_SDK} ÷ ours", unit="×", least=5, less=False),
    Goal(benchmark="fanout", figure=f"65536 B to 100, 5 ms: CPU of {_SDK} ÷ ours", unit="×", least=1.5, less=False),
    *(
        Goal(
            benchmark="fanout",
            figure=f"JSON, {row}: CPU of rosbridge ÷ ours",
            unit="×",
            least=10,
            options="--json",
            less=False,
        )
        for row in ("1000/s to 10", "100/s to 100")
    ),
    Goal(
        benchmark="fanout",
        figure="one of 100 that never reads: p99 of the others, with ÷ without",
        unit="×",
        most=1.1,
        options="--stall",
    ),
    Goal(benchmark="rest", figure="p99 of a page of 100", unit="ms", most=25, peer="bare uvicorn"),
    Goal(benchmark="twin", figure="accepted, sqlite", unit="s", most=1),
    Goal(benchmark="twin", figure="converged, sqlite", unit="s", most=30),
    Goal(benchmark="twin", figure="accepted, postgres", unit="s", most=1),
    Goal(benchmark="twin", figure="converged, postgres", unit="s", most=30),
    Goal(benchmark="anomaly", figure="a sample, detectors", unit="µs", most=5, peer="river 0.26.1 HalfSpaceTrees"),
    Goal(benchmark="anomaly", figure="a sample, everything", unit="µs", most=5, peer="river 0.26.1 HalfSpaceTrees"),
    Goal(benchmark="anomaly", figure="a series, everything", unit="KiB", most=12),
    Goal(benchmark="nab", figure="NAB, leave one category out", unit="", least=68, less=False),
    Goal(benchmark="nab", figure="made-up series, families never looked at", unit="", less=False),
    Goal(benchmark="watch", figure="10,000 series at 1 Hz", unit="% of a core", most=10),
    Goal(benchmark="functions", figure="p50 of a warm call", unit="ms", most=0.3),
    Goal(benchmark="functions", figure="p50 of a bare echo of JSON", unit="ms"),
    Goal(benchmark="functions", figure="one worker", unit="/s", least=5000, less=False),
    Goal(benchmark="functions", figure="cold bare interpreter with AWS's client", unit="ms"),
    Goal(benchmark="functions", figure="cold start by exec", unit="ms", most=60),
    Goal(benchmark="functions", figure="cold start by the fork server", unit="ms", most=12),
    Goal(benchmark="functions", figure="failures with 16 clients", unit="", most=0, peer=_RIE),
    Goal(benchmark="functions", figure="p99, engine", unit="ms", peer=_RIE),
    Goal(benchmark="functions", figure=f"p99, {_RIE} ÷ engine", unit="×", least=3, less=False),
    Goal(benchmark="functions", figure=f"p99, {_RIE} ÷ gateway", unit="×", least=2, less=False),
    Goal(benchmark="functions", figure=f"p99, {_RIE} ÷ gateway, audited REST", unit="×", less=False),
    Goal(benchmark="functions", figure=f"p99, {_RIE} ÷ bare uvicorn and engine", unit="×", less=False),
    Goal(benchmark="camera", figure="H.264 720p, stamp to canvas, p95", unit="ms", most=60),
    Goal(benchmark="camera", figure="JPEG 720p, stamp to canvas, p95", unit="ms"),
    Goal(benchmark="camera", figure="H.264 720p, bandwidth", unit="Mbit/s"),
    Goal(benchmark="camera", figure="H.264 720p, agent", unit="% of a core"),
    Goal(benchmark="lidar", figure="parsing at full rate", unit="% of a core", most=25, peer="velodyne-decoder"),
    Goal(benchmark="lidar", figure="driver at full rate", unit="% of a core"),
    Goal(benchmark="lidar", figure="packets lost on the way to a subscriber", unit="", most=0),
    Goal(benchmark="board", figure="agent, resident", unit="MB", most=60, peer="bare Python, eclipse-zenoh, grpcio"),
    Goal(benchmark="board", figure="agent, 10 topics of 10 Hz", unit="% of a core", most=5),
    Goal(benchmark="board", figure="agent, written to flash an hour", unit="MB", most=50),
    Goal(benchmark="board", figure="agent, written to flash an hour of being watched", unit="MB"),
    Goal(benchmark="idle", figure="an agent, nobody watching", unit="% of a core", most=2, peer="bare eclipse-zenoh"),
    Goal(benchmark="idle", figure="the gateway, nobody watching", unit="% of a core", most=3),
    Goal(benchmark="idle", figure="the simulator, nobody watching", unit="% of a core"),
    Goal(benchmark="rules", figure="one event, 1,000 rules", unit="µs", most=150, peer="moto"),
    Goal(benchmark="rules", figure="one event, 10,000 rules", unit="µs", peer="moto"),
)
