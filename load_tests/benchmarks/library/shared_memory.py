"""Whether bare eclipse-zenoh's shared memory may be on by default: who loses messages, and what restarts leave.

    python -m load_tests shared_memory [--restarts 3]

A publisher sends 1 MiB a hundred times a second through a pool of 4 MiB; a subscriber counts what arrives, and what of
it through shared memory. The subscriber is like the publisher, has a /dev/shm of its own, is another user, or both are
without privileges and the subscriber may lock 1 MiB of memory. The last case kills the publisher with SIGKILL and
starts it anew, beside a subscriber that stays.
Linux, as root: the processes become `nobody` where a limit is to count.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from load_tests.figures import note
from tests.support.ports import free_port

__all__ = ["main"]

_MIB = 1 << 20
_NOBODY = 65534
_RUN_S = 2.0
_OWN_FILES = ("unshare", "-m", "sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$0" "$@"')
_CASES: dict[str, tuple[dict[str, Any], dict[str, Any], tuple[str, ...]]] = {  # subscriber, publisher, around the first
    "like the publisher": ({}, {}, ()),
    "a /dev/shm of its own": ({}, {}, _OWN_FILES),
    "another user": ({"user": _NOBODY}, {}, ()),
    "both are nobody": ({"user": _NOBODY}, {"user": _NOBODY}, ()),
    "and it may lock 1 MiB": ({"user": _NOBODY, "lock": _MIB}, {"user": _NOBODY}, ()),
}


def _session(role: dict[str, Any]) -> Any:
    import resource

    import zenoh

    config = zenoh.Config()
    listens = role["name"] == "subscribe"
    for key, value in {
        "scouting/multicast/enabled": False,
        "listen/endpoints": [role["endpoint"]] if listens else [],
        "connect/endpoints": [] if listens else [role["endpoint"]],
        "transport/shared_memory/enabled": True,
        "transport/shared_memory/transport_optimization/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    if "lock" in role:
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (role["lock"], role["lock"]))
    if "user" in role:
        os.setgroups([])
        os.setgid(role["user"])
        os.setuid(role["user"])
    return zenoh.open(config)


def _publish(role: dict[str, Any]) -> None:
    import zenoh
    import zenoh.shm

    session = _session(role)  # it closes with its last reference
    publisher = session.declare_publisher("bench/image", congestion_control=zenoh.CongestionControl.BLOCK)
    pool, data = zenoh.shm.ShmProvider.default_backend(4 * _MIB), bytes(_MIB)
    while True:
        buffer = pool.alloc(_MIB, zenoh.shm.BlockOn(zenoh.shm.GarbageCollect()))
        buffer[:] = data
        publisher.put(buffer)
        time.sleep(0.01)


def _subscribe(role: dict[str, Any]) -> None:
    got = {"messages": 0, "shared": 0}

    def on_sample(sample: Any) -> None:
        got["messages"] += len(sample.payload.to_bytes()) == _MIB
        got["shared"] += sample.payload.as_shm() is not None

    session = _session(role)
    session.declare_subscriber("bench/image", on_sample)
    print("ready", flush=True)
    for _ in sys.stdin:
        status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
        print(json.dumps({**got, "locked_kib": int(status["VmLck"].split()[0])}), flush=True)


def _start(stack: ExitStack, role: dict[str, Any], around: Sequence[str] = ()) -> subprocess.Popen[str]:
    command = [*around, sys.executable, "-m", "load_tests.benchmarks.library.shared_memory", "--role", json.dumps(role)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    stack.enter_context(process)
    stack.callback(process.kill)
    return process


def _ask(subscriber: subprocess.Popen[str]) -> dict[str, int]:
    assert subscriber.stdin is not None
    assert subscriber.stdout is not None
    subscriber.stdin.write("\n")
    subscriber.stdin.flush()
    return dict(json.loads(subscriber.stdout.readline()))


def _run(subscriber: dict[str, Any], publisher: dict[str, Any], around: Sequence[str], runs: int) -> dict[str, int]:
    """What the subscriber has after `runs` lives of a publisher, each ended by SIGKILL."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        there = _start(stack, {"name": "subscribe", "endpoint": endpoint, **subscriber}, around)
        assert there.stdout is not None
        there.stdout.readline()
        for _ in range(runs):
            here = _start(stack, {"name": "publish", "endpoint": endpoint, **publisher})
            time.sleep(_RUN_S)
            here.kill()
            here.wait()
        return _ask(there)


def main(argv: Sequence[str] = ()) -> int:
    """Print what each subscriber got and what restarts leave behind."""
    parser = argparse.ArgumentParser(prog="python -m load_tests shared_memory", description="Zenoh's shared memory")
    parser.add_argument("--restarts", type=int, default=3)
    parser.add_argument("--role", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args(list(argv))
    if options.role:
        {"publish": _publish, "subscribe": _subscribe}[options.role["name"]](options.role)
        return 0
    if sys.platform != "linux" or os.geteuid() != 0:
        print("shared_memory: on Linux, as root", file=sys.stderr)
        return 1
    for name, (subscriber, publisher, around) in _CASES.items():
        got = _run(subscriber, publisher, around, 1)
        print(f"{name:<24}{got['messages']:>6} messages, {got['shared']:>4} of them shared")
    note("messages to a subscriber that may lock 1 MiB", [got["messages"]])
    once, often = (_run({}, {}, (), runs)["locked_kib"] for runs in (1, 1 + options.restarts))
    left = (often - once) / 1024 / options.restarts
    print(f"{options.restarts} restarts of the publisher leave {left:.1f} MiB each, locked in the subscriber")
    note("left in a subscriber by a restart of its publisher", [left])
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
