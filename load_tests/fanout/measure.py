"""One measurement: viewers connect to a server that runs, somebody publishes a load, and everything is taken.

CPU is the process's own clock, user and system time of all its threads, read from outside: no ticks of 10 ms.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import threading
import time
from array import array
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field

from load_tests.fanout.client import Taken, Viewer, take
from load_tests.fanout.load import Load
from load_tests.peers.measure import busy_cpu_s, process_cpu_s, resident_bytes

__all__ = ["Figures", "Process", "Server", "cpu_clock_s", "median", "percentile_ms"]


@dataclass(frozen=True)
class Figures:
    """What one run showed. CPU is that of the server's process, all its threads; latencies are in ms."""

    cores: float
    generator_cores: float  # what publishing to nobody takes of them
    us_a_delivery: float
    p50_ms: float
    p99_ms: float
    delivered: float  # of what was to be delivered
    least: float  # the same, of the viewer that got least
    client_cores: float
    foreign_cores: float  # what everything else on the machine took meanwhile
    latencies_ns: Sequence[int] = field(repr=False, compare=False)  # sorted

    @property
    def net_cores(self) -> float:
        """Without the generator."""
        return max(0.0, self.cores - self.generator_cores)


class Process:
    """A process that publishes the loads it is told; `told` is what it said when it was up."""

    def __init__(self, module: str, *arguments: str) -> None:
        command = [sys.executable, "-m", f"load_tests.fanout.{module}", *arguments]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.pid = self._process.pid
        self.told = self._line()

    def publish(self, load: Load) -> int:
        """Returns when it is done: how many messages it were."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asdict(load)) + "\n")
        self._process.stdin.flush()
        return int(self._line())

    def stop(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("a process of the benchmark ended")
        return str(line)


class Server(Process):
    """A server that viewers connect to."""

    def __init__(self, module: str, *arguments: str) -> None:
        super().__init__(module, *arguments)
        self.port, *others = (int(word) for word in self.told.split())
        self.robot_port = others[0] if others else 0

    def run(
        self,
        load: Load,
        viewers: int,
        kind: Callable[[int], Viewer],
        *,
        quickack: bool = False,
        publisher: Process | None = None,
        alone_cores: float = 0.0,
    ) -> Figures:
        """Connect viewers, publish (the server itself, unless there is a publisher), take."""
        opened = [kind(self.port) for _ in range(viewers)]
        source = publisher or self
        try:
            busy_s, ours_s = busy_cpu_s() or 0.0, self._parts_s(publisher)
            answer: list[tuple[int, float]] = []
            publishing = threading.Thread(target=lambda: answer.append(self._watch(source, load)))
            publishing.start()
            taken = take(opened, lambda: not publishing.is_alive(), quickack=quickack)
            publishing.join()
            foreign_s = (busy_cpu_s() or 0.0) - busy_s - (self._parts_s(publisher) - ours_s) - taken.cpu_s
        finally:
            for viewer in opened:
                viewer.socket.close()
        sent, cpu_s = answer[0]
        return _figures(taken, load, cpu_s, sent, alone_cores=alone_cores, foreign_s=foreign_s)

    def alone(self, load: Load) -> float:
        """The cores that publishing to nobody takes."""
        return self._watch(self, load)[1] / load.seconds

    def resident_mib(self) -> float:
        """The process's memory."""
        return (resident_bytes(self.pid) or 0) / 2**20

    def _watch(self, source: Process, load: Load) -> tuple[int, float]:
        """Messages, and the CPU time that this server took meanwhile."""
        before_s = cpu_clock_s(self.pid)
        sent = source.publish(load)
        return sent, cpu_clock_s(self.pid) - before_s

    def _parts_s(self, publisher: Process | None) -> float:
        return process_cpu_s(self.pid) + (process_cpu_s(publisher.pid) if publisher is not None else 0.0)


def cpu_clock_s(pid: int) -> float:
    """CPU time of all threads of a process so far, to the nanosecond; Linux numbers such clocks by the process."""
    return time.clock_gettime(~pid << 3 | 2)


def percentile_ms(latencies_ns: Sequence[int], share: float) -> float:
    """Of sorted latencies; 0 where there are none."""
    return latencies_ns[int((len(latencies_ns) - 1) * share)] / 1e6 if latencies_ns else 0.0


def _figures(taken: Taken, load: Load, cpu_s: float, sent: int, *, alone_cores: float, foreign_s: float) -> Figures:
    latencies, got = sorted(taken.latencies_ns), sum(taken.counts)
    return Figures(
        cores=cpu_s / load.seconds,
        generator_cores=alone_cores,
        us_a_delivery=cpu_s * 1e6 / max(1, got),
        p50_ms=percentile_ms(latencies, 0.5),
        p99_ms=percentile_ms(latencies, 0.99),
        delivered=got / (sent * len(taken.counts)),
        least=min(taken.counts) / sent,
        client_cores=taken.cpu_s / taken.wall_s,
        foreign_cores=max(0.0, foreign_s) / taken.wall_s,
        latencies_ns=array("q", latencies),
    )


def median(runs: list[Figures], name: str) -> float:
    """The median of one figure."""
    return float(statistics.median(getattr(run, name) for run in runs))
