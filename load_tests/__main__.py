"""`make bench`: every benchmark, or the ones named. Each prints medians of interleaved rounds against its peers.

Options after a single name are that benchmark's own: `python -m load_tests peers --quick`. At the end one table has the
figures, goals and peers of what ran, and what became slower than what is published; `--summary` prints it of the last
run of each, and runs nothing; `--markdown` as docs/topics/performance.md has it, `--write` keeps and publishes them.
"""

from __future__ import annotations

import importlib
import itertools
import sys

from load_tests.figures import gathered
from load_tests.goals import of_benchmark
from load_tests.summary import print_summary, summarise

LIBRARY = {
    "broker": "ZeroMQ messages through the broker and its bridge, against a plain zmq.proxy",
    "cdr": "CDR encode and decode against rosbags",
    "executor": "shares of the fair executor and a critical node's timer beside them",
    "lidar": "a VLP-16 at full rate: parsing, beside a plain loop and velodyne-decoder; all the way to a subscriber",
    "memory": "resident size over an hour of 1 kHz, accelerated, and over images in shared memory",
    "peers": "Meta-ROS beside raw zenoh, cyclonedds-python, pyzmq, metaros 1.1.5 and rospy",
    "pubsub": "typed publish and receive against raw eclipse-zenoh",
    "record": "MCAP writers beside a plain file, PyPI's mcap and rosbags; a recorder on the wire",
    "restart": "kill -9 of a supervised node to the first message of its replacement, against bare python with zenoh",
    "ros2": "programs written for rclpy beside native nodes; their time to the first message beside import numpy",
    "shared_memory": "who loses messages by bare eclipse-zenoh's shared memory, and what restarts leave behind",
    "service": "service round trips and action goals against raw eclipse-zenoh queries",
    "start": "how long programs take to start, beside python -c pass and another copy of this repository",
    "timer": "how late timers are called, per executor",
}
GATEWAY = {
    "anomaly": "what judging 10,000 series costs, beside river's HalfSpaceTrees; what it finds is nab",
    "nab": "what the detectors find on series of a kind that they were not fitted to; the same as make bench-anomaly",
    "attacks": "what an honest client notices while somebody attacks the gateway",
    "board": "what an agent costs a small board: memory, processor, flash; beside a bare Python with zenoh and gRPC",
    "camera": "a picture from its stamp to a canvas in Chromium: JPEG and H.264, and what they cost on the robot",
    "delivery": "durable samples from an agent's outbox to the gateway's disk, and live ones beside them",
    "fanout": "one topic to 1 to 500 WebSocket viewers, beside foxglove-sdk; JSON; one viewer that never reads",
    "fleet": "thousands of robots on one gateway over the real link: steady, storm, viewers, bulk, chaos, growth",
    "functions": "calls of a function: engine, gateway and boto3 beside AWS's runtime interface emulator",
    "history": "24 h of a series in 1000 buckets out of ten million stored rows, on SQLite and PostgreSQL",
    "idle": "what metaros up costs while nobody watches: agents, gateway, simulator",
    "ingest": "metric rows and samples through a real gateway",
    "rest": "pages of 100 of ten thousand robots for 50 clients at a time",
    "rules": "one event among 1,000 and 10,000 event patterns, beside asking each and moto's matcher",
    "storage": "bytes on the gateway's disk for an hour of a robot, beside raw CDR and a rosbags MCAP file",
    "twin": "a change of a thousand robots' desired states: accepted, and lived by",
    "watch": "10,000 series at 1 Hz, from log to alerts; what the event loop notices; restarts",
}
BENCHMARKS = dict(sorted({**LIBRARY, **GATEWAY}.items()))


def module_of(name: str) -> str:
    """The module of a benchmark: `load_tests.benchmarks.library.cdr` for `cdr`."""
    return f"load_tests.benchmarks.{'library' if name in LIBRARY else 'gateway'}.{name}"


def runs_of(name: str) -> list[list[str]]:
    """The options of each run that a figure of this benchmark asks for; one without any where none does."""
    return [options.split() for options in dict.fromkeys(goal.options for goal in of_benchmark(name))] or [[]]


def main(argv: list[str]) -> int:
    """Run the named benchmarks, all without names; exit code 2 for what there is not, 1 when one failed."""
    if argv[:1] == ["--summary"]:
        return summarise(argv[1:])
    names = list(itertools.takewhile(lambda word: not word.startswith("-"), argv))
    if names[:1] == ["fleet"] and names[1:2] and names[1] not in BENCHMARKS:  # its scenario
        names = names[:1]
    options = argv[len(names) :]
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        print(f"unknown benchmark {', '.join(unknown)}; there are: {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    if options and len(names) != 1:
        print("options need the one benchmark that they are for: python -m load_tests peers --quick", file=sys.stderr)
        return 2
    codes, chosen = [], names or list(BENCHMARKS)
    for name in chosen:
        for wanted in [options] if options else runs_of(name):
            if not options:
                print(f"\n{' '.join((name, *wanted))}: {BENCHMARKS[name]}\n", flush=True)
            with gathered(name, wanted) as run:
                run.code = int(importlib.import_module(module_of(name)).main(wanted) or 0)
            codes.append(run.code)
    print_summary(chosen)
    return int(any(codes))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
