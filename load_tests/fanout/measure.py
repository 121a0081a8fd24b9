"""One measurement: viewers connect to a server that runs, it publishes a load, and everything is taken."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

from load_tests.fanout.client import Taken, Viewer, take
from load_tests.fanout.servers import Load
from load_tests.peers.measure import busy_cpu_s, process_cpu_s, resident_bytes

__all__ = ["Figures", "Server", "median"]


@dataclass(frozen=True)
class Figures:
    """What one run showed. CPU is that of the server's process, all its threads; latencies are in ms."""

    cores: float
    net_cores: float  # without what publishing to nobody takes
    us_a_delivery: float
    p50_ms: float
    p99_ms: float
    delivered: float  # of what was to be delivered
    least: float  # the same, of the viewer that got least
    client_cores: float
    foreign_cores: float  # what everything else on the machine took meanwhile


class Server:
    """A server's process."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "load_tests.fanout.servers", *arguments]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.port = int(self._line())

    def run(
        self,
        load: Load,
        viewers: int,
        kind: Callable[[int], Viewer],
        *,
        quickack: bool = False,
        alone_cores: float = 0.0,
    ) -> Figures:
        """Connect viewers, publish, take."""
        opened = [kind(self.port) for _ in range(viewers)]
        try:
            busy_s, pid = busy_cpu_s() or 0.0, self._process.pid
            own_s = process_cpu_s(pid)
            answer: list[str] = []
            publishing = threading.Thread(target=lambda: answer.append(self._publish(load)))
            publishing.start()
            taken = take(opened, lambda: not publishing.is_alive(), quickack=quickack)
            publishing.join()
            foreign_s = (busy_cpu_s() or 0.0) - busy_s - (process_cpu_s(pid) - own_s) - taken.cpu_s
        finally:
            for viewer in opened:
                viewer.socket.close()
        cpu_s, sent = (float(word) for word in answer[0].split())
        figures = _figures(taken, load, cpu_s, int(sent))
        net_cores = max(0.0, figures.cores - alone_cores)
        return replace(figures, net_cores=net_cores, foreign_cores=max(0.0, foreign_s) / taken.wall_s)

    def alone(self, load: Load) -> float:
        """The cores that publishing to nobody takes."""
        cpu_s, _ = (float(word) for word in self._publish(load).split())
        return cpu_s / load.seconds

    def resident_mib(self) -> float:
        """The process's memory."""
        return (resident_bytes(self._process.pid) or 0) / 2**20

    def stop(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _publish(self, load: Load) -> str:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asdict(load)) + "\n")
        self._process.stdin.flush()
        return self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the server ended")
        return str(line)


def _figures(taken: Taken, load: Load, cpu_s: float, sent: int) -> Figures:
    latencies, got = sorted(taken.latencies_ns), sum(taken.counts)
    wanted = sent * len(taken.counts)
    return Figures(
        cores=cpu_s / load.seconds,
        net_cores=cpu_s / load.seconds,
        us_a_delivery=cpu_s * 1e6 / max(1, got),
        p50_ms=latencies[len(latencies) // 2] / 1e6 if latencies else 0.0,
        p99_ms=latencies[int(len(latencies) * 0.99)] / 1e6 if latencies else 0.0,
        delivered=got / wanted,
        least=min(taken.counts) / sent,
        client_cores=taken.cpu_s / taken.wall_s,
        foreign_cores=0.0,
    )


def median(runs: list[Figures], name: str) -> float:
    """The median of one figure."""
    return float(statistics.median(getattr(run, name) for run in runs))
