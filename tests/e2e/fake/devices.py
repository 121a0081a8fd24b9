"""A fake robot with devices: diagnostics as our drivers publish them, and those of a foreign ROS 2 node."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from metaros.cdr import codec
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from metaros.interfaces.std_msgs.msg import Header
from tests.e2e.fake.robots import FakeRobot, FakeTopic

__all__ = ["DIAGNOSTICS", "Device", "DeviceRobot", "usual"]

DIAGNOSTICS = FakeTopic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "live", 20.0)


@dataclass
class Device:
    """What a device says of itself; without a `kind` it is a foreign node's."""

    name: str
    kind: str = ""
    state: str = "working"
    level: int = 0
    message: str = ""
    hardware_id: str = ""
    rate_hz: float = 0.0
    values: dict[str, str] = field(default_factory=dict)
    silent: bool = False

    def status(self) -> DiagnosticStatus:
        """As diagnostics have it."""
        own = {"kind": self.kind, "state": self.state, "rate_hz": f"{self.rate_hz:.3g}"} if self.kind else {}
        return DiagnosticStatus(
            level=self.level,
            name=self.name,
            message=self.message or self.state,
            hardware_id=self.hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in {**own, **self.values}.items()],
        )


def usual() -> list[Device]:
    """Some of each sort, all well."""
    return [
        Device("/sim_1/ld19", "ld19", message="/dev/ttyUSB0 at 230400 baud", rate_hz=9.97, values={"readings": "8211"}),
        Device("/sim_1/front_camera", "camera", message="HD Webcam, 1280x720", hardware_id="usb-046d:0825", rate_hz=30),
        Device("/sim_1/gps", "gps", message="fix 3D, 11 satellites", rate_hz=5, values={"satellites": "11"}),
        Device("/sim_1/imu", "imu", rate_hz=100),
        Device("/sim_1/microphone", "microphone", "resting"),
        Device("arm_controller: joint limits", message="all joints within limits", values={"joints": "6"}),
    ]


class DeviceRobot(FakeRobot):
    """Each message tells of one device, in turn."""

    devices: Sequence[Device] = ()
    _turns: Any = None

    @property
    def topics(self) -> tuple[FakeTopic, ...]:
        """Its diagnostics alone: to draw a map and a camera costs more than all that is looked at here."""
        return (DIAGNOSTICS,)

    def device(self, name: str) -> Device:
        """By the last word of its name."""
        return next(device for device in self.devices if device.name.endswith(f"/{name}"))

    def encode(self, topic: FakeTopic, at_s: float) -> bytes:
        """The next device's diagnostics; nothing of one that is silent."""
        if topic is not DIAGNOSTICS:
            return super().encode(topic, at_s)
        self._turns = self._turns or itertools.count()
        device = self.devices[next(self._turns) % len(self.devices)]
        if device.silent:
            return b""
        header = Header(stamp=Time(sec=int(at_s), nanosec=int(at_s % 1 * 1e9)))
        return codec(topic.type).encode(DiagnosticArray(header=header, status=[device.status()]))

    def stored(self, topic: FakeTopic, at_s: float) -> bytes:
        """Of the past: the first device, and that it waited."""
        if topic is not DIAGNOSTICS:
            return self.encode(topic, at_s)
        status = Device(self.devices[0].name, "ld19", "waiting", 2, "/dev/ttyUSB0 is away").status()
        return codec(topic.type).encode(DiagnosticArray(status=[status]))
