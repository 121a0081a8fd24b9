"""Lines of slcan, signals of a DBC, identifiers and rates, without a bus."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.can.identifiers import read_ids
from metaros.drivers.can.latest import Latest
from metaros.drivers.can.signals import Signals
from metaros.drivers.can.slcan import format_frame, parse_frame
from metaros.errors import ConfigError

DBC = """VERSION ""
BU_: ECU
BO_ 256 Motor: 8 ECU
 SG_ Speed : 0|16@1- (0.1,0) [-3276|3276] "rpm" ECU
 SG_ Hot : 16|1@1+ (1,0) [0|1] "" ECU
BO_ 2364540158 EEC1: 8 ECU
 SG_ EngineSpeed : 24|16@1+ (0.125,0) [0|8031] "rpm" ECU
BO_ 512 Mux: 8 ECU
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" ECU
 SG_ A m0 : 8|16@1+ (1,0) [0|65535] "" ECU
 SG_ B m1 : 8|16@1+ (0.5,0) [0|65535] "V" ECU
"""


@pytest.fixture
def dbc(tmp_path: Path) -> str:
    file = tmp_path / "robot.dbc"
    file.write_text(DBC)
    return str(file)


@given(
    st.booleans(), st.integers(0, (1 << 11) - 1), st.integers(0, (1 << 29) - 1), st.booleans(), st.binary(max_size=8)
)
def test_a_frame_there_and_back(extended: bool, short: int, long: int, remote: bool, data: bytes) -> None:
    identifier = long if extended else short
    line = format_frame(identifier=identifier, extended=extended, remote=remote, length=len(data), data=data)
    assert parse_frame(line[:-1].decode()) == {
        "arbitration_id": identifier,
        "is_extended_id": extended,
        "is_remote_frame": remote,
        "dlc": len(data),
        "data": b"" if remote else data,
    }


@pytest.mark.parametrize(
    "line",
    ["", "t", "t1", "t1230x", "t8000", "t12310", "t1231zz", "t123900", "TFFFFFFFF0", "t12311122", "V1013", "d1230"],
)
def test_lines_that_are_no_frame(line: str) -> None:
    assert parse_frame(line) is None


def test_a_time_stamp_is_left_out() -> None:
    frame = parse_frame("t10021122ABCD")
    assert frame is not None
    assert frame["data"] == b"\x11\x22"


def test_signals(dbc: str) -> None:
    signals = Signals(dbc, "Motor/*, EEC1/EngineSpeed, Mux/?")
    assert signals.names == ["Motor/Speed", "Motor/Hot", "EEC1/EngineSpeed", "Mux/A", "Mux/B"]
    assert dict(signals.values(256, extended=False, data=bytes.fromhex("9cff010000000000"))) == {
        "Motor/Speed": pytest.approx(-10.0),
        "Motor/Hot": 1,
    }
    assert dict(signals.values(512, extended=False, data=bytes.fromhex("0104000000000000"))) == {"Mux/B": 2.0}
    assert dict(signals.values(0xCF004FE, extended=True, data=bytes.fromhex("000000a00f000000"))) == {
        "EEC1/EngineSpeed": 500.0
    }
    assert list(signals.values(256, extended=True, data=bytes(8))) == []  # another frame of the same number


@pytest.mark.parametrize(("identifier", "data"), [(256, b"\1"), (512, b"\x09" + bytes(7)), (512, b"")])
def test_frames_that_do_not_fit_the_file(identifier: int, data: bytes, dbc: str) -> None:
    with pytest.raises(ValueError, match=r"Motor|Mux"):
        list(Signals(dbc, "*").values(identifier, extended=False, data=data))


def test_files_and_patterns_that_cannot_work(dbc: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no signal of"):
        Signals(dbc, "Wheel/*")
    with pytest.raises(ConfigError, match="No such file"):
        Signals(str(tmp_path / "none.dbc"), "*")
    (tmp_path / "bad.dbc").write_text("garbage")
    with pytest.raises(ConfigError, match=r"bad\.dbc"):
        Signals(str(tmp_path / "bad.dbc"), "*")


def test_identifiers() -> None:
    assert read_ids(" 0x100, 0x200-0x202 ,7") == {(each, False) for each in (0x100, 0x200, 0x201, 0x202, 7)}
    assert read_ids("0x00000100-0x00000101, 0x800") == {(0x100, True), (0x101, True), (0x800, True)}
    assert read_ids("") == frozenset()
    for wrong in ("motor", "0x200-0x100", "-1", "0-0x1FFFFFFF", "0x20000000", "0x7FF-0x800"):
        with pytest.raises(ConfigError, match="tx_ids"):
            read_ids(wrong)


def test_the_newest_wins() -> None:
    gate = Latest(10.0, most=2)
    assert gate.give("a", 1, 0.0)
    assert not gate.give("a", 2, 0.01)
    assert not gate.give("a", 3, 0.02)
    assert list(gate.due(0.05)) == []
    assert list(gate.due(0.11)) == [("a", 3)]
    assert list(gate.due(0.5)) == []
    assert gate.give("b", 1, 0.0)
    assert not gate.give("c", 1, 9.0)  # more than it keeps apart
    assert all(Latest(0.0, most=1).give(n, n, 0.0) for n in range(5))
