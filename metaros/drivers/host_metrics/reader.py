"""This host's CPU, memory, disk, temperature and network, read by psutil; for the driver and for the agent."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import psutil

from metaros.clock import Clock

__all__ = ["HOST_TOPICS", "HostReader", "HostTopic", "Reading", "read_all"]

LOG = logging.getLogger("metaros.drivers.host_metrics")
Reading = dict[str, Any]


@dataclass(frozen=True, slots=True)
class HostTopic:
    """One topic: its name under the namespace, its type, and who reads its fields."""

    topic: str
    type_name: str
    read: Callable[[HostReader], Reading]


class HostReader:
    """Reads psutil; rates are taken between two calls of the same method, by a monotonic clock."""

    def __init__(self, clock: Clock, *, disk_path: str = "/") -> None:
        self._clock = clock
        self._disk_path = disk_path
        self._before: dict[str, tuple[float, int, int]] = {}
        psutil.cpu_percent(percpu=True)  # the first call only sets the start

    def cpu(self) -> Reading:
        """Busy share of the CPUs since the last call, and the load average."""
        per_core = psutil.cpu_percent(percpu=True)
        return {
            "percent": sum(per_core) / max(len(per_core), 1),
            "per_core": per_core,
            "load_1m": psutil.getloadavg()[0],
            "count": len(per_core),
        }

    def memory(self) -> Reading:
        """Physical memory."""
        memory = psutil.virtual_memory()
        return {
            "percent": memory.percent,
            "used_bytes": memory.used,
            "total_bytes": memory.total,
            "available_bytes": memory.available,
        }

    def disk(self) -> Reading:
        """The root file system's fill, and all disks' traffic."""
        usage, counters = psutil.disk_usage(self._disk_path), psutil.disk_io_counters()
        totals = (counters.read_bytes, counters.write_bytes) if counters else (0, 0)
        read, write = self._rates("disk", *totals)
        return {
            "path": self._disk_path,
            "percent": usage.percent,
            "used_bytes": usage.used,
            "total_bytes": usage.total,
            "read_bytes_per_s": read,
            "write_bytes_per_s": write,
        }

    def temperature(self) -> Reading:
        """All sensors; `celsius` is the hottest, NaN where the machine has none."""
        sensors: dict[str, list[Any]] = getattr(psutil, "sensors_temperatures", dict)()
        found = {
            f"{chip}/{entry.label or index}": entry.current
            for chip, entries in sensors.items()
            for index, entry in enumerate(entries)
        }
        hottest = max(found, key=lambda name: found[name], default="")
        return {
            "celsius": found.get(hottest, math.nan),
            "sensor": hottest,
            "names": list(found),
            "values": list(found.values()),
        }

    def network(self) -> Reading:
        """All interfaces' traffic, loopback left out."""
        counters = [item for name, item in psutil.net_io_counters(pernic=True).items() if name != "lo"]
        received, sent = sum(item.bytes_recv for item in counters), sum(item.bytes_sent for item in counters)
        rx, tx = self._rates("network", received, sent)
        return {"rx_bytes_per_s": rx, "tx_bytes_per_s": tx, "rx_bytes": received, "tx_bytes": sent}

    def _rates(self, name: str, first: int, second: int) -> tuple[float, float]:
        """Both counters per second since the last call; 0 at first, and when a counter was reset."""
        now_s = self._clock.monotonic_s()
        before = self._before.get(name)
        self._before[name] = (now_s, first, second)
        if before is None or now_s <= before[0]:
            return 0.0, 0.0
        span_s = now_s - before[0]
        return max(0.0, (first - before[1]) / span_s), max(0.0, (second - before[2]) / span_s)


HOST_TOPICS = (
    HostTopic("host/cpu", "metaros_msgs/msg/HostCpu", HostReader.cpu),
    HostTopic("host/memory", "metaros_msgs/msg/HostMemory", HostReader.memory),
    HostTopic("host/disk", "metaros_msgs/msg/HostDisk", HostReader.disk),
    HostTopic("host/temperature", "metaros_msgs/msg/HostTemperature", HostReader.temperature),
    HostTopic("host/network", "metaros_msgs/msg/HostNetwork", HostReader.network),
)


def read_all(reader: HostReader, topics: Iterable[HostTopic], unreadable: set[str]) -> list[tuple[HostTopic, Reading]]:
    """All readings; what this machine does not let us read is said once and left out."""
    readings = []
    for item in topics:
        try:
            readings.append((item, item.read(reader)))
        except (OSError, psutil.Error) as error:
            if item.topic not in unreadable:
                LOG.warning("cannot read %s: %s", item.topic, error)
            unreadable.add(item.topic)
    return readings
