"""The C header, compiled by the system's compiler: byte for byte what our codec and our framing write."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from metaros.cdr import codec
from metaros.drivers.serial.c_header import render_header
from metaros.drivers.serial.framing import Frame, FrameSplitter, encode_frame
from metaros.errors import ConfigError, DefinitionError, UnknownTypeError
from metaros.idl import default_catalogue, message_class, type_hash
from metaros.interfaces.sensor_msgs.msg import BatteryState
from metaros.wire.attachment import pack_attachment
from metaros.wire.keys import DataKey
from tests.support.processes.c_compiler import SANITIZERS, WARNINGS, compile_c

TYPES = (
    "builtin_interfaces/msg/Time",
    "diagnostic_msgs/msg/DiagnosticArray",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/Twist",
    "nav_msgs/msg/Odometry",
    "rcl_interfaces/msg/ParameterEvent",
    "sensor_msgs/msg/BatteryState",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/MagneticField",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/Range",
    "shape_msgs/msg/Mesh",
    "std_msgs/msg/Bool",
    "std_msgs/msg/ColorRGBA",
    "std_msgs/msg/Empty",
    "std_msgs/msg/Float64",
    "std_msgs/msg/Int32MultiArray",
    "std_msgs/msg/String",
    "std_srvs/srv/SetBool",
    "tf2_msgs/msg/TFMessage",
    "trajectory_msgs/msg/JointTrajectory",
)
MESSAGES = (*(name for name in TYPES if "/srv/" not in name), "std_srvs/srv/SetBool_Request")

ECHO = """
#include "metaros.h"
/* number of the type u8, size u32, bytes -> size u32, bytes: decoded into the struct and encoded again; 0: refused */
static uint8_t in[1 << 18], out[1 << 18];
#define ONE(number, type) case number: {{ static type m; \\
    if (type##_decode(&m, in, size)) {{ written = type##_encode(&m, out, sizeof out); }} break; }}
int main(void) {{
    uint8_t head[5];
    while (fread(head, 1, 5, stdin) == 5) {{
        size_t size = (size_t)head[1] | (size_t)head[2] << 8 | (size_t)head[3] << 16, written = 0;
        if (fread(in, 1, size, stdin) != size) return 1;
        switch (head[0]) {{ {cases} default: return 2; }}
        uint8_t answer[4] = {{(uint8_t)written, (uint8_t)(written >> 8), (uint8_t)(written >> 16), 0}};
        fwrite(answer, 1, 4, stdout);
        fwrite(out, 1, written, stdout);
        fflush(stdout);
    }}
    return 0;
}}
"""


def c_name(name: str) -> str:
    package, kind, short = name.split("/")
    return f"{package}_{short}" if kind == "msg" else f"{package}_{kind}_{short}"


class Echo:
    """The compiled program: CDR in, the CDR of what its struct held out."""

    def __init__(self, folder: Path) -> None:
        (folder / "metaros.h").write_text(render_header(TYPES))
        cases = " ".join(f"ONE({number}, {c_name(name)})" for number, name in enumerate(MESSAGES))
        program = compile_c(ECHO.format(cases=cases), folder, flags=(*WARNINGS, *SANITIZERS))
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __call__(self, name: str, data: bytes) -> bytes:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(bytes((MESSAGES.index(name),)) + len(data).to_bytes(4, "little") + data)
        self.process.stdin.flush()
        size = int.from_bytes(self.process.stdout.read(4), "little")
        return self.process.stdout.read(size)

    def close(self) -> int:
        assert self.process.stdin is not None
        self.process.stdin.close()
        code = self.process.wait(60)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


@pytest.fixture(scope="module")
def echo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Echo]:
    made = Echo(tmp_path_factory.mktemp("echo"))
    yield made
    assert made.close() == 0


def random_message(name: str, rng: random.Random) -> Any:
    """A message with something in every field."""
    message = message_class(name)()
    for field in default_catalogue().message(name).fields:
        setattr(message, field.attribute, _value(field.type, rng))
    return message


def _value(kind: Any, rng: random.Random) -> Any:
    if kind.array:
        count = kind.capacity if kind.array == "fixed" else rng.randrange(min(kind.capacity or 6, 6))
        return [_value(kind.element, rng) for _ in range(count)]
    if kind.is_nested:
        return random_message(kind.base, rng)
    if kind.is_string:
        return "".join(rng.choice("abcdé /") for _ in range(rng.randrange(12)))
    if kind.base.startswith("float"):
        return rng.choice((0.0, -1.5, 3.25, float("inf"), 1e-3)) if kind.base == "float64" else rng.choice((0.5, -2.0))
    if kind.base == "bool":
        return rng.random() < 0.5
    bits = int("".join(c for c in kind.base if c.isdigit()) or 8)
    return rng.getrandbits(bits) - (1 << bits - 1 if kind.base.startswith("int") else 0)


@pytest.mark.parametrize("name", MESSAGES)
def test_structs_hold_every_byte(echo: Echo, name: str) -> None:
    rng = random.Random(name)
    for _ in range(20):
        data = bytes(codec(name).encode(random_message(name, rng)))
        assert echo(name, data) == data


@pytest.mark.parametrize("name", MESSAGES)
def test_garbage_is_refused_or_held_never_read_past(echo: Echo, name: str) -> None:
    rng = random.Random(name)
    data = bytes(codec(name).encode(random_message(name, rng)))
    for cut in range(len(data)):
        echo(name, data[:cut])
    for _ in range(100):
        echo(name, b"\0\1\0\0" + rng.randbytes(rng.randrange(200)))
        wrong = bytearray(data)
        wrong[rng.randrange(4, len(wrong))] = rng.randrange(256)
        echo(name, bytes(wrong))


def test_what_does_not_fit_is_refused(echo: Echo) -> None:
    text = codec("std_msgs/msg/String").encode(message_class("std_msgs/msg/String")(data="x" * 63))
    assert echo("std_msgs/msg/String", bytes(text)) == bytes(text)
    long = codec("std_msgs/msg/String").encode(message_class("std_msgs/msg/String")(data="x" * 64))
    assert echo("std_msgs/msg/String", bytes(long)) == b""
    scan = message_class("sensor_msgs/msg/LaserScan")(ranges=[1.0] * 65)
    assert echo("sensor_msgs/msg/LaserScan", bytes(codec("sensor_msgs/msg/LaserScan").encode(scan))) == b""
    assert echo("std_msgs/msg/Bool", b"\0\0\0\0\1") == b""  # big-endian


ONCE = """
#include "metaros.h"
static void show(const uint8_t *data, size_t size) {
    for (size_t i = 0; i < size; i++) printf("%02x", data[i]);
    printf("\\n");
}
int main(void) {
    uint8_t out[512], payload[300];
    char key[256];
    const uint8_t id[16] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
    for (size_t i = 0; i < sizeof payload; i++) payload[i] = (uint8_t)(i % 256);
    show(out, metaros_frame(out, sizeof out, METAROS_DATA, 9, payload, sizeof payload));
    show(out, metaros_hello(out, sizeof out, 0x01020304, "pump"));
    show(out, metaros_declare(out, sizeof out, 2, true, "led", std_msgs_Bool_TYPE));
    show(out, metaros_frame(out, 20, METAROS_DATA, 9, payload, sizeof payload));
    metaros_key(key, sizeof key, 7, "/r1/led", std_msgs_Bool_DDS_TYPE, std_msgs_Bool_HASH);
    printf("%s\\n", key);
    metaros_attachment(out, 5, 1700000000123456789, id);
    show(out, 33);
    printf("%d %d\\n", sensor_msgs_BatteryState_POWER_SUPPLY_STATUS_FULL, (int)sizeof(std_msgs_Empty));
    return 0;
}
"""

RECEIVE = """
#include "metaros.h"
int main(void) {
    static uint8_t buffer[400];
    metaros_receiver receiver = {buffer, sizeof buffer, 0, false};
    metaros_received frame;
    int byte;
    while ((byte = getchar()) != EOF)
        if (metaros_receive(&receiver, (uint8_t)byte, &frame)) {
            printf("%d %d ", frame.kind, frame.channel);
            for (size_t i = 0; i < frame.size; i++) printf("%02x", frame.payload[i]);
            printf("\\n");
        }
    return 0;
}
"""


def test_frames_keys_and_attachments_are_ours(tmp_path: Path) -> None:
    (tmp_path / "metaros.h").write_text(render_header(TYPES))
    program = compile_c(ONCE, tmp_path, flags=(*WARNINGS, *SANITIZERS))
    lines = subprocess.run([program], capture_output=True, text=True, check=True, timeout=60).stdout.splitlines()
    payload = bytes(number % 256 for number in range(300))
    split = FrameSplitter(max_bytes=4096, count=lambda name: pytest.fail(name))
    (data,) = split.feed(bytes.fromhex(lines[0]))
    assert data == Frame(3, 9, payload)
    assert bytes.fromhex(lines[1]) == encode_frame(1, 0, b"\x01\x04\x03\x02\x01pump")
    assert bytes.fromhex(lines[2]) == encode_frame(2, 2, b"\x01\x03led\x11std_msgs/msg/Bool")
    assert lines[3] == ""
    assert lines[4] == str(DataKey(7, "/r1/led", "std_msgs/msg/Bool", type_hash("std_msgs/msg/Bool")))
    assert bytes.fromhex(lines[5]) == pack_attachment(5, 1700000000123456789, bytes(range(1, 17)))
    assert lines[6] == f"{BatteryState.POWER_SUPPLY_STATUS_FULL} 1"


def test_the_receiver_hears_what_we_send_between_garbage(tmp_path: Path) -> None:
    (tmp_path / "metaros.h").write_text(render_header(["std_msgs/msg/Bool"]))
    program = compile_c(RECEIVE, tmp_path, flags=(*WARNINGS, *SANITIZERS))
    rng = random.Random(5)
    frames = [
        (rng.randrange(256), rng.randrange(256), rng.randbytes(rng.choice((0, 1, 30, 253, 254, 300))))
        for _ in range(200)
    ]
    line = b"".join(rng.randbytes(rng.randrange(600)).replace(b"\0", b"x") + b"\0" + encode_frame(*f) for f in frames)
    done = subprocess.run([program], input=line + rng.randbytes(1 << 20), capture_output=True, timeout=120, check=True)
    received = [row.split(" ") for row in done.stdout.decode().splitlines()]
    assert [(int(kind), int(channel), bytes.fromhex(data)) for kind, channel, data in received][: len(frames)] == frames


def test_what_c_cannot_have_is_refused() -> None:
    with pytest.raises(DefinitionError, match="wide string"):
        render_header(["example_interfaces/msg/WString"])
    with pytest.raises(UnknownTypeError):
        render_header(["std_msgs/msg/Nothing"])
    with pytest.raises(DefinitionError, match="is an action"):
        render_header(["example_interfaces/action/Fibonacci"])
    with pytest.raises(ConfigError, match="1 to 64"):
        render_header([])
