"""The board of docs/reference/serial_boards.md, compiled, on a pty: its topics are on the network, and replugged."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import metaros
from metaros.cdr import codec
from metaros.drivers.serial.c_header import render_header
from metaros.drivers.serial.framing import FrameSplitter, encode_frame
from metaros.drivers.serial.protocol import Answer, FromBoard, ToBoard
from metaros.interfaces.std_msgs.msg import Bool, Float64, String
from tests.support.devices.drivers import running
from tests.support.devices.pty_device import PtyDevice
from tests.support.processes.c_compiler import SANITIZERS, WARNINGS, compile_c
from tests.support.waiting import wait_until

PAGE = (Path(__file__).resolve().parents[4] / "docs" / "reference" / "serial_boards.md").read_text(encoding="utf-8")

HARNESS = """
#define _DEFAULT_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stddef.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>
static void board_write(const uint8_t *data, size_t size) {
    if (!size || write(1, data, size) < 0) exit(3);
}
static bool board_read(uint8_t *byte) {
    struct pollfd wanted = {0, POLLIN, 0};
    if (poll(&wanted, 1, 5) <= 0) return false;
    ssize_t size = read(0, byte, 1);
    if (size == 0) exit(0);
    return size == 1;
}
static uint32_t board_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)(now.tv_sec * 1000 + now.tv_nsec / 1000000);
}
static uint32_t board_boot(void) { return (uint32_t)getpid(); }
static double lamp;
static void board_lamp(bool on) { lamp = on ? 100.0 : 0.0; }
static double board_celsius(void) { return 20.5 + lamp; }
"""
MAIN = "\nint main(void) { setup(); for (;;) loop(); return 0; }\n"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("board")
    (folder / "metaros.h").write_text(render_header(["std_msgs/msg/Bool", "std_msgs/msg/Float64"]))
    (board,) = [code for code in re.findall(r"```c\n(.*?)```", PAGE, re.DOTALL) if "void loop" in code]
    return compile_c(HARNESS + board + MAIN, folder, flags=(*WARNINGS, *SANITIZERS))


@contextmanager
def board(program: Path, device: PtyDevice) -> Iterator[subprocess.Popen[bytes]]:
    """The compiled board at the other end of the line."""
    process = subprocess.Popen([program], stdin=device.master, stdout=device.master)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def test_the_board_of_the_page_is_on_the_network(program: Path, context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as device, running("serial", {"port": device.path}, context=context) as driver:
        readings = driver.messages(Float64, "temperature")
        lamp = driver.viewer.create_publisher(Bool, "/r1/lamp", 10)
        with board(program, device):
            wait_until(lambda: any(reading.data == 20.5 for reading in readings))
            wait_until(lambda: lamp.publish(Bool(data=True)) or any(reading.data == 120.5 for reading in readings))
            wait_until(lambda: "greenhouse" in driver.status().message)
            assert driver.status().hardware_id == "greenhouse"
        before = len(readings)
        with board(program, device):  # its reset button
            wait_until(lambda: len(readings) > before + 3)
            wait_until(lambda: driver.facts().get("board_restarts") == "1")


def test_unplugged_and_replugged(program: Path, context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as device, running("serial", {"port": device.path}, context=context) as driver:
        readings = driver.messages(Float64, "temperature")
        with board(program, device):
            wait_until(lambda: readings)
        device.unplug()
        wait_until(lambda: driver.state() == "waiting")
        device.replug()
        before = len(readings)
        with board(program, device):
            wait_until(lambda: len(readings) > before and driver.state() == "working")


class Line:
    """A board in Python: frames by hand."""

    def __init__(self, device: PtyDevice) -> None:
        self.device = device
        self.split = FrameSplitter(max_bytes=65536, count=lambda name: None)
        self.heard: list[tuple[int, int, bytes]] = []

    def send(self, kind: int, channel: int, payload: bytes = b"") -> None:
        self.device.write(encode_frame(kind, channel, payload))

    def hello(self, boot: int = 1) -> None:
        """Once the driver has asked: what came before it opened the port is gone."""
        wait_until(lambda: self.has(ToBoard.ASK, 0, b"\x01"))
        self.send(FromBoard.HELLO, 0, b"\x01" + boot.to_bytes(4, "little") + b"line")

    def declare(self, channel: int, direction: int, topic: str, type_name: str) -> None:
        payload = bytes((direction, len(topic))) + topic.encode() + bytes((len(type_name),)) + type_name.encode()
        self.send(FromBoard.DECLARE, channel, payload)

    def has(self, kind: int, channel: int, payload: bytes | None = None) -> bool:
        self.heard += [tuple(frame) for frame in self.split.feed(self.device.read())]
        return any(k == kind and c == channel and payload in (None, p) for k, c, p in self.heard)


def test_declarations_are_answered(context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as device, running("serial", {"port": device.path}, context=context):
        line = Line(device)
        line.hello()
        wanted = {
            1: ("ok", "std_msgs/msg/Bool", Answer.ACCEPTED),
            2: ("ok", "nobody_msgs/msg/Bool", Answer.UNKNOWN_TYPE),
            3: ("/absolute", "std_msgs/msg/Bool", Answer.BAD_TOPIC),
            4: ("not a topic", "std_msgs/msg/Bool", Answer.BAD_TOPIC),
            5: ("cmd_vel", "geometry_msgs/msg/Twist", Answer.NOT_ALLOWED),
        }
        for channel, (topic, type_name, _) in wanted.items():
            line.declare(channel, 0, topic, type_name)
        for channel, (_, _, answer) in wanted.items():
            wait_until(lambda c=channel, a=answer: line.has(ToBoard.ANSWER, c, bytes((a,))))
        for channel in range(10, 50):
            line.declare(channel, 0, f"topic_{channel}", "std_msgs/msg/Bool")
        wait_until(lambda: line.has(ToBoard.ANSWER, 49, bytes((Answer.TOO_MANY,))))
        line.send(FromBoard.PING, 0, b"\1\2\3\4")
        wait_until(lambda: line.has(ToBoard.PONG, 0))
        (pong,) = [payload for kind, _, payload in line.heard if kind == ToBoard.PONG]
        assert pong[:4] == b"\1\2\3\4"
        assert int.from_bytes(pong[4:], "little") > 1_700_000_000_000_000_000


def test_garbage_on_the_line_is_counted_and_passed(context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as device, running("serial", {"port": device.path}, context=context) as driver:
        texts = driver.messages(String, "text")
        line = Line(device)
        line.hello()
        line.declare(1, 0, "text", "std_msgs/msg/String")
        wait_until(lambda: line.has(ToBoard.ANSWER, 1))
        pattern = bytes(range(256)) * 16
        for _ in range(32):  # the line is read meanwhile, as ptys hold little
            device.write(pattern)
            line.has(0, 0)
        device.write(b"\0")
        line.send(FromBoard.DATA, 1, b"\0\1\0\0\xff\xff\xff\xffx")  # an absurd length within a whole frame
        line.send(FromBoard.DATA, 9, b"\0\1\0\0")  # a channel that nobody declared
        line.send(0x77, 0)
        line.send(FromBoard.DATA, 1, b"\0\1\0\0\6\0\0\0after\0")
        wait_until(lambda: texts)
        assert texts[0].data == "after"
        wait_until(lambda: int(driver.facts().get("bad_message", 0)) >= 3)
        assert int(driver.facts()["bad_crc"]) > 100
        assert driver.state() == "working"


def test_a_slow_line_gets_the_newest(context: metaros.Context, tmp_path: Path) -> None:
    with PtyDevice(tmp_path) as device, running("serial", {"port": device.path}, context=context) as driver:
        line = Line(device)
        line.hello()
        line.declare(1, 1, "numbers", "std_msgs/msg/Float64")
        wait_until(lambda: line.has(ToBoard.ANSWER, 1))
        numbers = driver.viewer.create_publisher(Float64, "/r1/numbers", metaros.qos_sensor_data)
        last = bytes(codec(Float64).encode(Float64(data=-1.0)))
        for count in range(3000):
            numbers.publish(Float64(data=float(count)))
        wait_until(lambda: numbers.publish(Float64(data=-1.0)) or line.has(ToBoard.DATA, 1, last))
