"""Maps, values, requests and orders, without a device."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU, ModbusPDU

from metaros.drivers.modbus.link import read_link
from metaros.drivers.modbus.pending_writes import AGAIN_S, PendingWrites
from metaros.drivers.modbus.points import Point, read_map
from metaros.drivers.modbus.polling_plan import PollingPlan
from metaros.drivers.modbus.protocol import RefusedError, Request, find_rtu, read_request, rtu_frame, write_request
from metaros.errors import ConfigError


def point(name: str = "p", address: int = 0, **more: object) -> Point:
    given = {"name": name, "table": "holding", "address": address, "type": "u16"} | more
    return Point(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "words", "raw", "value"),
    [
        ("u16", "big", (65535,), 65535),
        ("i16", "big", (65535,), -1),
        ("u32", "big", (1, 2), 65538),
        ("u32", "little", (2, 1), 65538),
        ("i32", "big", (0xFFFF, 0xFFFE), -2),
        ("f32", "big", struct.unpack(">HH", struct.pack(">f", 21.5)), 21.5),
    ],
)
def test_types(kind: str, words: str, raw: tuple[int, ...], value: float) -> None:
    one = point(type=kind, words=words, scale=0.5, offset=1.0)
    assert one.value(raw) == pytest.approx(value * 0.5 + 1)
    assert one.registers(value * 0.5 + 1) == raw


@pytest.mark.parametrize("value", [math.nan, math.inf, -1, 101, 1e300])
def test_what_cannot_be_written(value: float) -> None:
    assert point(min=0, max=100).registers(value) is None
    assert point(type="u16").registers(value) is None or 0 <= value <= 65535


@given(st.floats(allow_nan=False, width=32), st.sampled_from(["u16", "i16", "u32", "i32", "f32"]))
def test_what_is_written_is_what_is_read(value: float, kind: str) -> None:
    one = point(type=kind)
    if (raw := one.registers(value)) is not None:
        assert one.value(raw) == pytest.approx(value, abs=0 if kind == "f32" else 0.5)


GOOD = '[[points]]\nname = "a/b"\ntable = "holding"\naddress = 1\ntype = "u16"\n'


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("points = 1", "at least one"),
        ("x", "Expected"),
        (GOOD + "wat = 1", "unknown or missing: wat"),
        ("[[points]]\nname = 'a'", "unknown or missing: address, table, type"),
        (GOOD + GOOD, "there twice: a/b"),
        (GOOD.replace("a/b", "../b"), "a name has"),
        (GOOD.replace("holding", "coil"), "coil and discrete are bool"),
        (GOOD.replace("= 1", "= 65536"), "address is 0 to 65535"),
        (GOOD.replace("= 1", "= '1'"), "address cannot be '1'"),
        (GOOD + "scale = nan", "scale cannot be nan"),
        (GOOD + "scale = 0", "scale is not 0"),
        (GOOD + "writable = true", "needs min and max"),
        (GOOD + "watchdog_s = 1", "watchdog_s needs safe"),
        (GOOD + "writable = true\nmin = 0\nmax = 1\nsafe = 2", "safe is out of range"),
        (GOOD.replace("holding", "input") + "writable = true\nmin = 0\nmax = 1", "only holding and coil"),
    ],
)
def test_wrong_maps(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "map.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=why):
        read_map(str(file))


def test_a_good_map(tmp_path: Path) -> None:
    file = tmp_path / "map.toml"
    file.write_text(GOOD)
    assert [one.name for one in read_map(str(file))] == ["a/b"]
    file.write_text(GOOD * 257)
    with pytest.raises(ConfigError, match="more than 256"):
        read_map(str(file))


def answer(text: str) -> ModbusPDU:
    found = DecodePDU(False).decode(bytes.fromhex(text))
    assert found is not None
    return found


def test_known_bytes() -> None:
    # The examples of the specification's sections 6.1, 6.3, 6.5, 6.6 and 6.12.
    coils = read_request("coil", 0x13, 0x13)
    assert coils.encode() == bytes.fromhex("0100130013")
    assert coils.values(answer("0103cd6b05"))[:8] == (1, 0, 1, 1, 0, 0, 1, 1)
    registers = read_request("holding", 0x6B, 3)
    assert registers.encode() == bytes.fromhex("03006b0003")
    assert registers.values(answer("0306022b00000064")) == (0x22B, 0, 100)
    assert write_request("coil", 0xAC, (1,)).encode() == bytes.fromhex("0500acff00")
    assert write_request("holding", 1, (3,)).encode() == bytes.fromhex("0600010003")
    assert write_request("holding", 1, (10, 258)).encode() == bytes.fromhex("100001000204000a0102")


@pytest.mark.parametrize(
    ("request_", "granted", "others"),
    [
        (read_request("coil", 0x13, 0x13), "0103cd6b05", ("0203cd6b05", "0102cd6b", "0104cd6b0500")),
        (read_request("holding", 0x6B, 3), "0306022b00000064", ("0406022b00000064", "0304022b0000", "0308" + "00" * 8)),
        (write_request("coil", 0xAC, (1,)), "0500acff00", ("0500ac0000", "0500adff00")),
        (write_request("holding", 1, (3,)), "0600010003", ("0600010004", "0600020003", "1000010001")),
        (write_request("holding", 1, (10, 258)), "1000010002", ("1000010001", "1000020002")),
    ],
)
def test_only_the_answer_to_it_grants_a_request(request_: Request, granted: str, others: tuple[str, ...]) -> None:
    assert request_.answer(bytes.fromhex(granted)) is not None
    assert [request_.answer(bytes.fromhex(other)) for other in (*others, "9702", "ff", "")] == [None] * (
        len(others) + 3
    )
    with pytest.raises(RefusedError, match="illegal data address"):
        request_.answer(bytes([request_.encode()[0] | 0x80, 2]))


def test_an_answer_is_found_behind_garbage() -> None:
    asked = read_request("holding", 0x6B, 3)
    framed = bytes.fromhex("01 0306022b00000064")
    framed += FramerRTU.compute_CRC(framed).to_bytes(2, "big")
    for garbage in (b"", b"\x01\x03", b"\x01\x03\xff", b"\x01" * 9, framed[:-1] + b"\0", bytes(range(250))):
        assert find_rtu(garbage + framed[:-1], 1, asked) is None
        start, answer = find_rtu(garbage + framed, 1, asked) or pytest.fail("hidden")
        assert (start, asked.values(answer)) == (len(garbage), (0x22B, 0, 100))
        assert find_rtu(garbage + framed, 2, asked) is None
    assert rtu_frame(1, asked) == bytes.fromhex("0103006b00037417")


def test_neighbours_are_read_together() -> None:
    points = [
        point("a", 0),
        point("b", 1, type="f32"),
        point("gap", 5),
        point("slow", 3, period_s=9.0),
        point("coil", 0, table="coil", type="bool"),
        *(point(f"far{n}", 200 + n) for n in range(130)),
    ]
    groups = [[one.name for one in group.points] for group in PollingPlan(points).groups]
    assert ["a", "b"] in groups
    assert sorted(len(group) for group in groups) == [1, 1, 1, 2, 5, 125]


def test_what_was_missed_is_not_made_up_for() -> None:
    plan = PollingPlan([point(period_s=1.0)])
    assert len(list(plan.due(0.0))) == 1
    assert list(plan.due(0.9)) == []
    assert len(list(plan.due(60.0))) == 1
    assert list(plan.due(60.5)) == []
    assert plan.wait_s(60.5) == pytest.approx(0.5)


def test_orders_newest_wins_and_watchdog() -> None:
    orders = PendingWrites([point("m", writable=True, min=0, max=9, safe=0.0, watchdog_s=0.3)])
    assert orders.give("m", 3, 0.0)
    assert orders.give("m", 5, 0.1)
    assert not orders.give("m", 10, 0.1)
    assert [registers for _, registers in orders.take(0.1)] == [(5,)]
    assert orders.take(0.3) == []
    ((one, safe),) = orders.take(0.4)
    assert safe == (0,)
    orders.written(one, safe)
    assert orders.take(9.0) == []
    assert [registers for _, registers in orders.end()] == [(0,)]
    assert orders.end() == []


def test_a_safe_value_is_written_again_until_it_is() -> None:
    orders = PendingWrites([point("m", writable=True, min=0, max=9, safe=0.0, watchdog_s=0.3)])
    orders.give("m", 5, 0.0)
    assert len(orders.take(0.0)) == 1
    (first,) = orders.take(1.0)
    assert first[1] == (0,)
    assert orders.take(1.0 + AGAIN_S / 2) == []
    assert orders.take(1.0 + AGAIN_S) == [first]  # the first got no answer
    orders.give("m", 7, 1.5)  # a newer order ends that
    assert [registers for _, registers in orders.take(1.5)] == [(7,)]
    assert orders.take(1.6) == []


def test_what_was_not_made_safe_at_the_end_is_so_later() -> None:
    orders = PendingWrites([point("m", writable=True, min=0, max=9, safe=0.0)])
    orders.give("m", 5, 0.0)
    ((one, safe),) = orders.end()
    assert orders.end() == []
    orders.unwritten(one)
    assert orders.end() == [(one, safe)]


@pytest.mark.parametrize(
    "text", ["", "tcp://", "udp://a:1", "tcp://a:99999", "serial://", "serial:///dev/x?baud=1", "serial:///dev/x?a=1"]
)
def test_links_that_are_none(text: str) -> None:
    with pytest.raises(ConfigError, match="such as"):
        read_link(text)


def test_links() -> None:
    assert (read_link("tcp://10.0.0.5").port, read_link("tcp://[::1]:5020").host) == (502, "::1")
    line = read_link("serial:///dev/ttyUSB0?baud=19200&parity=E&stop=2")
    assert (line.device, line.baud, line.parity, line.stop_bits) == ("/dev/ttyUSB0", 19200, "E", 2)
    assert read_link("serial://COM3").device == "COM3"
