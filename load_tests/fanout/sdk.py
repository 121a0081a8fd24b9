"""The server of PyPI's foxglove-sdk, in a process of its own, which publishes what it is told.

    python -m load_tests.fanout.sdk [--core 0]

Prints its port; then each line of its input, JSON of a `Load`, is published, and it prints how many messages it were.
What wakes up every millisecond is the same as in the gateway's process, and no less light: see servers.py.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

import foxglove

from load_tests.fanout.load import SETTLE_S, STEP_S, TOPIC, Load, due_of, read_load
from metaros.idl import schema_text

__all__ = ["main"]

TYPE = "std_msgs/msg/UInt8MultiArray"


def _publish(channel: foxglove.Channel, load: Load) -> int:
    sent, tail = 0, b"x" * (load.size - 8)
    for due in due_of(load):
        if due:
            message, log_time = time.monotonic_ns().to_bytes(8, "little") + tail, time.time_ns()
            for _ in range(due):
                channel.log(message, log_time=log_time)
            sent += due
        time.sleep(STEP_S)
    return sent


def main(argv: list[str]) -> int:
    """Be the server."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--core", type=int, help="the one CPU that it runs on")
    options = parser.parse_args(argv)
    if options.core is not None:
        os.sched_setaffinity(0, {options.core})
    server = foxglove.start_server(name="bench", port=0)
    schema = foxglove.Schema(name=TYPE, encoding="ros2msg", data=schema_text(TYPE).encode())
    channel = foxglove.Channel(TOPIC, schema=schema, message_encoding="cdr")
    print(server.port, flush=True)
    while (load := read_load()) is not None:
        sent = _publish(channel, load)
        time.sleep(SETTLE_S)
        print(sent, flush=True)
    server.stop()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
