"""The driver against pymodbus's own server, over TCP and over a pty; and against things that are no such device."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.interfaces.std_msgs.msg import Bool, Float64
from tests.support.devices.drivers import RunningDriver, running
from tests.support.devices.modbus_device import ModbusDevice, PtyBridge
from tests.support.devices.pty_device import PtyDevice
from tests.support.ports import free_port
from tests.support.waiting import wait_until

MAP = """
[[points]]
name = "temperature"
table = "input"
address = 0
type = "i16"
scale = 0.1
period_s = 0.05
[[points]]
name = "power"
table = "input"
address = 1
type = "u32"
words = "little"
period_s = 0.05
[[points]]
name = "door"
table = "discrete"
address = 3
type = "bool"
period_s = 0.05
[[points]]
name = "setpoint"
table = "holding"
address = 10
type = "u16"
scale = 0.1
period_s = 0.05
writable = true
min = 5
max = 30
[[points]]
name = "motor"
table = "holding"
address = 20
type = "f32"
period_s = 0.05
writable = true
min = -1
max = 1
safe = 0
watchdog_s = 0.3
[[points]]
name = "lamp"
table = "coil"
address = 0
type = "bool"
period_s = 0.05
writable = true
"""
HOLDING = [215, 2, 1]


@pytest.fixture(params=["tcp", "rtu"])
def wired(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, int | str]]:
    """The driver's link, and where the server is to be."""
    if request.param == "tcp":
        port = free_port()
        yield f"tcp://127.0.0.1:{port}", port
    else:
        with PtyDevice(tmp_path) as pty, PtyBridge(pty) as bridge:
            yield f"serial://{pty.path}?baud=9600", bridge.path


@contextmanager
def reading(
    context: metaros.Context, tmp_path: Path, link: str, text: str = MAP, **more: Any
) -> Iterator[RunningDriver]:
    file = tmp_path / "map.toml"
    file.write_text(text)
    with running("modbus", {"link": link, "map": str(file), **more}, context=context) as driver:
        yield driver


def repeat(act: Callable[[], object], until: Callable[[], object]) -> None:
    """Do it again and again until it has had its effect."""

    def step() -> object:
        act()
        return until()

    wait_until(step, every_s=0.02)


def count(driver: RunningDriver, name: str) -> int:
    return int(driver.facts().get(name, 0))


def test_points_are_published_and_written(
    wired: tuple[str, int | str], context: metaros.Context, tmp_path: Path
) -> None:
    link, where = wired
    with ModbusDevice(where, holding=HOLDING) as device, reading(context, tmp_path, link) as driver:
        temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
        powers = driver.messages(Float64, "modbus/power", metaros.qos_default)
        authenticators = driver.messages(Bool, "modbus/door", metaros.qos_default)
        setpoints = driver.messages(Float64, "modbus/setpoint", metaros.qos_default)
        wait_until(lambda: temperatures and powers and authenticators and setpoints)
        assert (temperatures[-1].data, powers[-1].data, authenticators[-1].data) == (pytest.approx(21.5), 65538, True)
        assert {address for function, address, size in device.requests if function == 4} == {0}  # together

        sets = driver.viewer.create_publisher(Float64, "/r1/modbus/setpoint/set", metaros.qos_command)
        lamp = driver.viewer.create_publisher(Bool, "/r1/modbus/lamp/set", metaros.qos_command)
        repeat(lambda: sets.publish(Float64(data=20.5)), lambda: (6, 10, [205]) in device.written)
        wait_until(lambda: setpoints[-1].data == pytest.approx(20.5))
        repeat(lambda: lamp.publish(Bool(data=True)), lambda: (5, 0, [True]) in device.written)
        for wrong in (4.9, 30.1, float("nan")):
            sets.publish(Float64(data=wrong))
        wait_until(lambda: count(driver, "refused_commands") >= 1)
        assert {values[0] for _, address, values in device.written if address == 10} == {205}


def test_what_moves_stops_when_commands_end_and_when_the_driver_does(
    wired: tuple[str, int | str], context: metaros.Context, tmp_path: Path
) -> None:
    link, where = wired
    with ModbusDevice(where) as device, reading(context, tmp_path, link) as driver:
        wait_until(lambda: driver.state() == "working")
        motor = driver.viewer.create_publisher(Float64, "/r1/modbus/motor/set", metaros.qos_command)
        half, zero = (16, 20, [0x3F00, 0]), (16, 20, [0, 0])
        repeat(lambda: motor.publish(Float64(data=0.5)), lambda: half in device.written)
        driver.leap(0.3)
        wait_until(lambda: device.written[-1] == zero)
        repeat(lambda: motor.publish(Float64(data=0.5)), lambda: device.written[-1] == half)
        driver.node.trigger("deactivate")
        assert device.written[-1] == zero


def test_killed_and_restarted(wired: tuple[str, int | str], context: metaros.Context, tmp_path: Path) -> None:
    link, where = wired
    with reading(context, tmp_path, link, timeout=0.1) as driver:
        sets = driver.viewer.create_publisher(Float64, "/r1/modbus/setpoint/set", metaros.qos_command)
        temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
        for _ in range(2):
            wait_until(lambda: driver.state() == "waiting")
            sets.publish(Float64(data=20.5))  # while it is away: refused, also later
            with ModbusDevice(where, holding=HOLDING) as device:
                wait_until(lambda: driver.state() == "working")
                seen = len(temperatures)
                wait_until(lambda seen=seen: len(temperatures) > seen + 2)  # type: ignore[misc]
                assert device.written == []


def test_one_address_that_is_refused_does_not_hide_its_neighbours(context: metaros.Context, tmp_path: Path) -> None:
    port = free_port()
    with ModbusDevice(port, holding=HOLDING) as device:
        device.refused.add(1)
        with reading(context, tmp_path, f"tcp://127.0.0.1:{port}") as driver:
            temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
            wait_until(lambda: temperatures and "power: illegal data address" in driver.status().message)
            assert count(driver, "split_requests") == 1
            device.refused.clear()
            wait_until(lambda: "illegal" not in driver.status().message)


def test_a_slow_device_is_asked_one_thing_at_a_time(context: metaros.Context, tmp_path: Path) -> None:
    port = free_port()
    with ModbusDevice(port, holding=HOLDING) as device:
        device.delay_s = 0.03  # of five requests every 50 ms
        with reading(context, tmp_path, f"tcp://127.0.0.1:{port}") as driver:
            temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
            authenticators = driver.messages(Bool, "modbus/door", metaros.qos_default)
            wait_until(lambda: len(temperatures) > 3 and len(authenticators) > 3)
            assert abs(len(temperatures) - len(authenticators)) <= 2  # each has its turn
            assert driver.state() == "working"


def test_late_answers_on_a_serial_line_are_nobody_s(context: metaros.Context, tmp_path: Path) -> None:
    with (
        PtyDevice(tmp_path) as pty,
        PtyBridge(pty) as bridge,
        ModbusDevice(bridge.path, holding=HOLDING) as device,
    ):
        with reading(context, tmp_path, f"serial://{pty.path}", timeout=0.15) as driver:
            temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
            setpoints = driver.messages(Float64, "modbus/setpoint", metaros.qos_default)
            wait_until(lambda: temperatures and setpoints)
            device.delay_s = 0.2
            wait_until(lambda: count(driver, "late_bytes") > 0)
            device.delay_s = 0.0
            wait_until(lambda: driver.state() == "working")
            seen = len(temperatures)
            wait_until(lambda: len(temperatures) > seen + 3)
            assert {round(one.data, 3) for one in temperatures} == {21.5}
            assert {one.data for one in setpoints} == {0.0}


ONE = '[[points]]\nname = "one"\ntable = "holding"\naddress = 0\ntype = "u16"\nperiod_s = 0.02\n'


def test_late_answers_over_tcp_are_nobody_s(context: metaros.Context, tmp_path: Path) -> None:
    def answer(listener: socket.socket, stop: threading.Event) -> None:
        """Before each answer comes one with the number of the request before: 666."""
        listener.settimeout(60)
        with listener.accept()[0] as client:
            while not stop.is_set() and len(asked := client.recv(12)) == 12:
                number = int.from_bytes(asked[:2])
                for one, value in ((number - 1, 666), (number, 7)):
                    client.sendall(one.to_bytes(2) + bytes.fromhex("0000 0005 01 03 02") + value.to_bytes(2))

    with peer(answer) as port, reading(context, tmp_path, f"tcp://127.0.0.1:{port}", ONE) as driver:
        values = driver.messages(Float64, "modbus/one", metaros.qos_default)
        wait_until(lambda: len(values) > 5 and count(driver, "late_answers") > 5)
        assert {one.data for one in values} == {7.0}


@contextmanager
def peer(live: Callable[[socket.socket, threading.Event], None]) -> Iterator[int]:
    """Something that is no real device listens on a port."""
    stop = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.05)
        thread = threading.Thread(target=live, args=(listener, stop))
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            stop.set()
            thread.join(60)
            assert not thread.is_alive()


def test_garbage_over_tcp(context: metaros.Context, tmp_path: Path) -> None:
    with peer(_babble) as port, reading(context, tmp_path, f"tcp://127.0.0.1:{port}", timeout=0.1) as driver:
        wait_until(lambda: count(driver, "bytes_read") > 10_000 and count(driver, "reconnects") > 2)
        assert driver.state() in ("waiting", "opening")


def _babble(listener: socket.socket, stop: threading.Event) -> None:
    while not stop.is_set():
        try:
            client = listener.accept()[0]
        except TimeoutError:
            continue
        with client:
            try:
                while not stop.wait(0.001):
                    client.sendall(os.urandom(2000))
            except OSError:
                pass


def test_garbage_on_the_serial_line(context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as pty:
        with reading(context, tmp_path, f"serial://{pty.path}", timeout=0.1) as driver:
            for _ in range(100):
                pty.write(os.urandom(10_000))
            wait_until(lambda: driver.state() == "waiting")
            assert count(driver, "garbage_bytes") > 0
        with PtyBridge(pty) as bridge, ModbusDevice(bridge.path, holding=HOLDING):
            with reading(context, tmp_path, f"serial://{pty.path}") as driver:
                wait_until(lambda: driver.state() == "working")
                pty.write(os.urandom(500))
                temperatures = driver.messages(Float64, "modbus/temperature", metaros.qos_default)
                wait_until(lambda: len(temperatures) > 3)
                assert {round(one.data, 3) for one in temperatures} == {21.5}
