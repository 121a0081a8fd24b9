"""The driver on python-can's own buses, and on an slcan adapter of a pty."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

import metaros
from metaros.interfaces.can_msgs.msg import Frame
from metaros.interfaces.std_msgs.msg import Float64
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.pty_device import PtyDevice
from tests.support.waiting import wait_until

DBC = """VERSION ""
BU_: ECU
BO_ 256 Motor: 8 ECU
 SG_ Speed : 0|16@1- (0.1,0) [-3276|3276] "rpm" ECU
"""
MULTICAST = "239.74.163.2"


@contextmanager
def on_bus(
    context: metaros.Context, interface: str, channel: str, **params: Any
) -> Iterator[tuple[RunningDriver, Any]]:
    given = {"interface": interface, "channel": channel, "frame_rate": 0, **params}
    with can.Bus(interface=interface, channel=channel) as bus, running("can", given, context=context) as one:
        wait_until(lambda: one.state() == "working")
        yield one, bus


def repeat(act: Callable[[], object], until: Callable[[], object]) -> None:
    """Do it again and again until it has had its effect."""

    def step() -> object:
        act()
        return until()

    wait_until(step, every_s=0.02)


def count(driver: RunningDriver, name: str) -> int:
    return int(driver.facts().get(name, 0))


def message(identifier: int, data: bytes = b"", **more: Any) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=more.pop("extended", False), **more)


@pytest.mark.parametrize(("interface", "channel"), [("virtual", "h"), ("udp_multicast", MULTICAST)])
def test_frames_and_signals(interface: str, channel: str, context: metaros.Context, tmp_path: Path) -> None:
    dbc = tmp_path / "robot.dbc"
    dbc.write_text(DBC)
    if interface == "udp_multicast" and not _has_multicast():
        pytest.skip("no route for multicast on this machine")
    with on_bus(context, interface, channel, dbc=str(dbc)) as (driver, bus):
        frames = driver.messages(Frame, "can/rx", metaros.qos_default)
        speeds = driver.messages(Float64, "can/Motor/Speed", metaros.qos_default)
        repeat(lambda: bus.send(message(256, bytes.fromhex("9cff000000000000"))), lambda: frames and speeds)
        assert speeds[-1].data == pytest.approx(-10.0)
        assert (frames[-1].id, frames[-1].dlc, bytes(frames[-1].data[:2])) == (256, 8, b"\x9c\xff")

        for odd in (
            message(256, b"\1"),  # too short for the file
            message(0x18FF00FF, b"\1\2\3", extended=True),
            message(5, is_fd=True, data=bytes(48)),
            message(7, is_remote_frame=True, dlc=4),
        ):
            bus.send(odd)
        wait_until(lambda: frames[-1].id == 7 and count(driver, "undecoded_frames") == 1)
        assert (frames[-1].is_rtr, frames[-1].dlc, frames[-2].is_extended) == (True, 4, True)
        wait_until(lambda: count(driver, "fd_frames") == 1)
        assert 5 not in {frame.id for frame in frames}


def _has_multicast() -> bool:
    try:
        with can.Bus(interface="udp_multicast", channel=MULTICAST) as bus:
            bus.send(message(1))
    except (OSError, can.CanError):
        return False
    return True


def test_error_frames_are_reported(context: metaros.Context) -> None:
    with on_bus(context, "virtual", "broken") as (driver, bus):
        bus.send(can.Message(is_error_frame=True))
        wait_until(lambda: driver.status().message == "the bus has errors" and count(driver, "error_frames") == 1)
        bus.send(message(1))
        wait_until(lambda: "errors" not in driver.status().message)


def test_a_busy_bus_is_thinned_out(context: metaros.Context) -> None:
    with on_bus(context, "virtual", "busy", frame_rate=5) as (driver, bus):
        frames = driver.messages(Frame, "can/rx", metaros.qos_default)
        for number in range(2000):
            bus.send(message(9, number.to_bytes(2)))
        wait_until(lambda: frames and bytes(frames[-1].data[:2]) == (1999).to_bytes(2))
        assert len(frames) < 200


def test_only_what_is_allowed_is_sent(context: metaros.Context) -> None:
    with on_bus(context, "virtual", "tx", allow_tx=True, tx_ids="0x100-0x101") as (driver, bus):
        sender = driver.viewer.create_publisher(Frame, "/r1/can/tx", metaros.qos_default)
        good = Frame(id=0x100, dlc=2, data=np.array([1, 2, 0, 0, 0, 0, 0, 0], np.uint8))
        repeat(lambda: sender.publish(good), lambda: count(driver, "sent_frames") > 0)
        received = bus.recv(60)
        assert (received.arbitration_id, bytes(received.data), received.is_extended_id) == (0x100, b"\1\2", False)
        refused = count(driver, "refused_commands")
        long = Frame(id=0x100, is_extended=True)
        for wrong in (Frame(id=0x102), long, Frame(id=0x100, dlc=9), Frame(id=0x100, is_error=True), Frame(id=0x900)):
            sender.publish(wrong)
        wait_until(lambda: count(driver, "refused_commands") == refused + 5)
        while (late := bus.recv(0)) is not None:
            assert late.arbitration_id == 0x100


def test_nothing_is_sent_without_permission(context: metaros.Context) -> None:
    with on_bus(context, "virtual", "silent", tx_ids="0x100") as (driver, bus):
        sender = driver.viewer.create_publisher(Frame, "/r1/can/tx", metaros.qos_default)
        frames = driver.messages(Frame, "can/rx", metaros.qos_default)
        for _ in range(10):
            sender.publish(Frame(id=0x100))
            bus.send(message(1))
        wait_until(lambda: bool(frames))
        assert bus.recv(0) is None


def test_an_adapter_on_a_serial_port(context: metaros.Context, tmp_path: Path) -> None:
    params = {"interface": "slcan", "frame_rate": 0, "allow_tx": True, "tx_ids": "0x123", "bitrate": 250_000}
    with (
        PtyDevice(tmp_path) as pty,
        running("can", {**params, "channel": pty.path}, context=context) as driver,
    ):
        frames = driver.messages(Frame, "can/rx", metaros.qos_default)
        sender = driver.viewer.create_publisher(Frame, "/r1/can/tx", metaros.qos_default)
        received = bytearray()

        def says(text: bytes) -> bool:
            received.extend(pty.read())
            return text in received

        wait_until(lambda: says(b"C\rS5\rO\r"))
        pty.write(b"\rt1002AABB\rT18FF00FF11")
        pty.write(b"2\r\a")
        repeat(lambda: pty.write(b"t1002AABB\r"), lambda: len(frames) > 1)
        wait_until(lambda: count(driver, "refused_by_adapter") == 1)

        def sent() -> bool:
            sender.publish(Frame(id=0x123, dlc=1, data=np.array([255, *[0] * 7], np.uint8)))
            return says(b"t1231FF\r")

        wait_until(sent, every_s=0.02)
        for _ in range(100):
            pty.write(os.urandom(10_000))
        pty.write(b"\r")
        seen = len(frames)
        repeat(lambda: pty.write(b"t7FF0\r"), lambda: len(frames) > seen and frames[-1].id == 0x7FF)
        wait_until(lambda: count(driver, "bad_lines") + count(driver, "long_lines") + count(driver, "bad_frames") > 100)

        pty.unplug()
        wait_until(lambda: driver.state() == "waiting")
        pty.replug()
        received.clear()
        wait_until(lambda: driver.state() == "working" and says(b"S5\rO\r"))
        seen = len(frames)
        repeat(lambda: pty.write(b"t0010\r"), lambda: len(frames) > seen)
