"""One measurement: two processes of a peer (and its broker) in a network of their own. Prints the result as JSON.

    python -m load_tests.peers.pair '{"python": …, "module": …, "mode": …, "phase": "flood", "size": 64, …}'

`flood`: publish flat out, count at the receiver over a window. `ping`: round trips, echoed in the callback.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import tempfile
import time
from typing import Any

from load_tests.peers import measure
from load_tests.peers.namespace import own_network
from load_tests.peers.process import PeerFailed, PeerProcess

__all__ = ["WARM_UP_S", "main"]

WARM_UP_S = 0.3
_CONNECT_S = 20.0
_POLL_S = 0.02
_PORTS = 3
_OUR_THREADS = 1  # role.py's reader of commands
_LOSSY = 0.9


def _free_ports(count: int) -> list[int]:
    """Free at this moment; in a network of one's own they stay so."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


class _Window:
    """What the machine and the loopback did between the two ends, beside the given processes."""

    def __init__(self, processes: list[PeerProcess], *, counted: bool) -> None:
        self._pids = [os.getpid(), *(process.pid for process in processes)]
        self._counted = counted
        self._began = self._read()

    def _read(self) -> tuple[float, float, float | None, int | None]:
        own_s = sum(measure.process_cpu_s(pid) for pid in self._pids)
        return time.perf_counter(), own_s, measure.busy_cpu_s(), measure.loopback_bytes() if self._counted else None

    def close(self) -> tuple[int | None, float | None]:
        """Bytes on the loopback, and cores that others kept busy."""
        (began_s, own_was_s, busy_was_s, lo_was), (now_s, own_s, busy_s, lo) = self._began, self._read()
        sent = None if lo is None or lo_was is None else lo - lo_was
        if busy_s is None or busy_was_s is None:
            return sent, None
        return sent, max(0.0, (busy_s - busy_was_s) - (own_s - own_was_s)) / (now_s - began_s)


def _flood(job: dict[str, Any], processes: list[PeerProcess], *, counted: bool) -> dict[str, Any]:
    """The rate, and what it cost."""
    subscriber, publisher = processes[-2:]
    publisher.tell("go")
    deadline_s = time.monotonic() + _CONNECT_S
    while not subscriber.ask()["count"]:
        if time.monotonic() > deadline_s:
            raise PeerFailed(f"nothing arrived in {_CONNECT_S:g} s")
        time.sleep(_POLL_S)
    time.sleep(min(WARM_UP_S, job["seconds"]))
    began, pub_began, window = subscriber.ask(), publisher.ask(), _Window(processes, counted=counted)
    time.sleep(job["seconds"])
    ended, pub_ended, (wire_bytes, others) = subscriber.ask(), publisher.ask(), window.close()
    received, sent = ended["count"] - began["count"], pub_ended["count"] - pub_began["count"]
    result = {
        "rate": received / (ended["at_s"] - began["at_s"]),
        "sent_rate": sent / (pub_ended["at_s"] - pub_began["at_s"]),
        "cpu_pub_us": (pub_ended["cpu_s"] - pub_began["cpu_s"]) / sent * 1e6 if sent else None,
        "cpu_sub_us": (ended["cpu_s"] - began["cpu_s"]) / received * 1e6 if received else None,
        "wire": wire_bytes / (received * job["size"]) if wire_bytes is not None and received > sent * _LOSSY else None,
        "others_cores": others,
    }
    for name, process in (("pub", publisher), ("sub", subscriber)):
        threads = measure.thread_count(process.pid)
        result[f"threads_{name}"] = None if threads is None else threads - _OUR_THREADS
        result[f"resident_{name}"] = measure.resident_bytes(process.pid)
        result[f"objects_{name}"] = measure.shared_object_bytes(process.pid)
    return result


def _ping(job: dict[str, Any], processes: list[PeerProcess], *, counted: bool) -> dict[str, Any]:
    """Round trips, and the bytes that one message costs when it travels alone."""
    ping = processes[-1]
    patience_s = 1.5 * _CONNECT_S + 3 * job["ping_s"]
    ping.ask("warm", timeout_s=patience_s)
    window = _Window(processes, counted=counted)
    result: dict[str, Any] = ping.ask("go", timeout_s=patience_s)
    wire_bytes, result["others_cores"] = window.close()
    if wire_bytes is not None:
        result["extra_bytes"] = wire_bytes / (2 * result["pings"]) - job["size"]
    return result


_PHASES = {"flood": (("subscriber", "publisher"), _flood), "ping": (("echo", "ping"), _ping)}


def main(argv: list[str]) -> int:
    """Run the one measurement of the job; an error of the peer is a result too."""
    counted = own_network()
    with tempfile.TemporaryDirectory(prefix="metaros-bench-", ignore_cleanup_errors=True) as scratch:
        job = {"subscriptions": 1, **json.loads(argv[0]), "ports": _free_ports(_PORTS), "scratch": scratch}
        roles, run = _PHASES[job["phase"]]
        try:
            with contextlib.ExitStack() as stack:
                processes = []
                for role in (*(["broker"] if job.get("brokered") else []), *roles):
                    process = stack.enter_context(PeerProcess(job["python"], {**job, "role": role}))
                    process.answer()
                    processes.append(process)
                result = run(job, processes, counted=counted)
        except PeerFailed as error:
            result = {"error": str(error)}
    print(json.dumps(result), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
