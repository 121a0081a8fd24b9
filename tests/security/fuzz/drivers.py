"""Targets of devices: every decoder of what comes over a wire, from the first byte to a reading."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.diff_drive.protocol import parse_encoders
from metaros.drivers.gps.reader import EpochReader
from metaros.drivers.imu.csv_lines import CsvDecoder
from metaros.drivers.imu.witmotion import WitMotionDecoder
from metaros.drivers.joystick.events import EventReader
from metaros.drivers.ld19.protocol import PacketStream
from metaros.drivers.lines import LineSplitter
from metaros.drivers.mavlink.codec import Codec
from metaros.drivers.modbus.protocol import RefusedError, find_rtu, read_request
from metaros.drivers.opus import OpusDecoder, OpusEncoder
from metaros.drivers.rplidar.samples import CapsuleStream, NodeStream
from metaros.drivers.serial.framing import FrameSplitter, encode_frame
from metaros.drivers.serial.protocol import FromBoard, parse_declare, parse_hello
from metaros.drivers.serial_sensor.fields import line_reader
from metaros.drivers.vlp16.packets import packet_problem
from metaros.drivers.vlp16.position import parse_position
from metaros.drivers.vlp16.revolutions import RevolutionSplitter, decode
from metaros.errors import DecodeError
from metaros.link.video_frames import frame_of
from tests.security.fuzz.target import MIB, Target
from tests.support.devices.gps_emulator import nmea_epoch, pvt
from tests.support.devices.imu_emulator import wit_round
from tests.support.devices.ld19_emulator import Ld19Emulator
from tests.support.devices.rplidar_emulator import capsule, node
from tests.support.devices.video import COMPRESSED_VIDEO, access_units, video_message
from tests.support.devices.vlp16_emulator import Vlp16Emulator, position_packet

__all__ = ["TARGETS"]


class Nothing(Exception):
    """No reading came of it."""


def _ignore(*_: Any) -> None:
    """Counts go nowhere."""


def some(readings: Iterable[Any]) -> None:
    """Take all; `Nothing` where there was none."""
    if not [reading for reading in readings if reading is not None]:
        raise Nothing


def board(data: bytes) -> None:
    """Frames of a serial board, and what its declarations say."""
    found = []
    for frame in FrameSplitter(max_bytes=4096, count=_ignore).feed(data):
        with contextlib.suppress(DecodeError):
            if frame.kind == FromBoard.HELLO:
                parse_hello(frame.payload)
            elif frame.kind == FromBoard.DECLARE:
                parse_declare(frame.channel, frame.payload)
            found.append(frame)
    some(found)


def vlp16(data: bytes) -> None:
    """The same packet before and after the one that is tried, so that turns end."""
    cutter = RevolutionSplitter()
    good = [Vlp16Emulator(azimuth_deg=azimuth).packet() for azimuth in (100.0, 190.0, 300.0, 100.0, 190.0)]
    for packet in (*good, data, *good):
        turn = cutter.add(packet, 1_700_000_000_000_000_000)
        if turn is not None:
            assert np.isfinite(decode(turn)["x"]).all()
    if packet_problem(data):
        raise Nothing


def mavlink(data: bytes) -> None:
    """Messages of the dialect."""
    codec = Codec(system=255, component=190, count=_ignore, key=b"", wall_ns=1_700_000_000_000_000_000)
    some(codec.feed(data))


def modbus(data: bytes) -> None:
    """The answer to a request, somewhere on a serial line."""
    with contextlib.suppress(RefusedError):
        some([find_rtu(data, 1, read_request("holding", 0x6B, 3))])


def opus(data: bytes) -> None:
    """One packet of sound."""
    decoder = OpusDecoder(1)
    if not len(decoder.decode(data)):
        raise Nothing


def lines(read: Callable[[str], Any]) -> Callable[[bytes], None]:
    """Whole lines of a stream, each read."""

    def run(data: bytes) -> None:
        found = []
        for line in LineSplitter(max_bytes=1024, count=_ignore).feed(data):
            with contextlib.suppress(ValueError):
                found.append(read(line))
        some(found)

    return run


def _sound() -> bytes:
    encoder = OpusEncoder(48_000, 1, bitrate=24_000)
    tone = (8000 * np.sin(np.arange(9600) * 0.06)).astype(np.int16)
    return encoder.encode(tone)[-1]


def _hello() -> bytes:
    declaration = b"\0\x04lamp\x11std_msgs/msg/Bool"
    return (
        encode_frame(1, 0, b"\x01\x02\0\0\0pump") + encode_frame(2, 1, declaration) + encode_frame(3, 1, b"\0\1\0\0\1")
    )


def _heartbeat() -> bytes:
    return bytes(dialect.MAVLink(None, srcSystem=1).heartbeat_encode(2, 3, 81, 4, 4).pack(dialect.MAVLink(None, 1, 1)))


_PRESS = struct.pack("<qqHHi", 1, 2, 1, 304, 1) + struct.pack("<qqHHi", 1, 2, 0, 0, 0)
_CIRCLE = b"".join(node(angle, 1500, 20, start=angle == 0) for angle in range(0, 360, 20))
_CAPSULES = capsule(0, [(1000, 0)] * 32, start=True) + capsule(40, [(1000, 0)] * 32) + capsule(80, [(1000, 0)] * 32)
ERRORS = (Nothing,)

TARGETS = (
    Target(
        name="LD19 packets",
        run=lambda d: some(PacketStream().feed(d)),
        errors=ERRORS,
        seeds=(Ld19Emulator().turns(0.1),),
        cost=2,
    ),
    Target(name="RPLIDAR nodes", run=lambda d: some(NodeStream().feed(d)), errors=ERRORS, seeds=(_CIRCLE,), cost=2),
    Target(
        name="RPLIDAR capsules", run=lambda d: some(CapsuleStream().feed(d)), errors=ERRORS, seeds=(_CAPSULES,), cost=2
    ),
    Target(
        name="VLP-16 packets",
        run=vlp16,
        errors=ERRORS,
        seeds=(Vlp16Emulator().packet(),),
        cost=20,
        per_byte=2000,
        base_bytes=16 * MIB,
    ),
    Target(
        name="VLP-16 position",
        run=lambda d: some([parse_position(d)]),
        errors=ERRORS,
        seeds=(position_packet(us=5, pps=3),),
    ),
    Target(
        name="GPS stream",
        run=lambda d: some(EpochReader(_ignore).feed(d, 1.0)),
        errors=ERRORS,
        seeds=(nmea_epoch(1) + nmea_epoch(2), pvt()),
        cost=20,
        per_byte=2000,
    ),
    Target(
        name="IMU lines",
        run=lambda d: some(CsvDecoder(_ignore, acceleration="m/s2", rate="rad/s", magnetic="T").feed(d)),
        errors=ERRORS,
        seeds=(b"0.1,0.2,9.8,0.01,0.02,0.03\n",),
    ),
    Target(
        name="WitMotion frames",
        run=lambda d: some(WitMotionDecoder(_ignore).feed(d)),
        errors=ERRORS,
        seeds=(wit_round() + wit_round(),),
        cost=2,
    ),
    Target(name="Modbus RTU", run=modbus, errors=ERRORS, seeds=(bytes.fromhex("010306022b00000064057a"),), cost=20),
    Target(name="input events", run=lambda d: some(EventReader(_ignore).feed(d)), errors=ERRORS, seeds=(_PRESS,)),
    Target(name="encoder lines", run=lines(parse_encoders), errors=ERRORS, seeds=(b"12 -34\r\n",)),
    Target(
        name="serial sensor, JSON",
        run=lines(line_reader("json", ("t", "air.p"), "")),
        errors=ERRORS,
        seeds=(b'{"t": 21.5, "air": {"p": 1013}}\n',),
    ),
    Target(
        name="serial sensor, columns",
        run=lines(line_reader("csv", ("a", "b"), "")),
        errors=ERRORS,
        seeds=(b"1.5, 2.5\n",),
    ),
    Target(name="serial board frames", run=board, errors=ERRORS, seeds=(_hello(),), cost=2),
    Target(name="MAVLink stream", run=mavlink, errors=ERRORS, seeds=(_heartbeat() * 2,), cost=10, per_byte=2000),
    Target(
        name="Opus packet", run=opus, errors=(Nothing, DecodeError), seeds=(_sound(),), cost=10, base_bytes=16 * MIB
    ),
    Target(
        name="video frames",
        run=lambda d: frame_of(COMPRESSED_VIDEO, d),
        errors=(),
        seeds=(video_message(access_units(1)[0]),),
    ),
)
