"""Every type of the catalogue is a DDS type, and the bytes are those that DDS itself would write."""

from __future__ import annotations

import pytest
from cyclonedds.idl import IdlStruct

from metaros.cdr import codec
from metaros.dds.types import make_sample, message_type, with_header
from metaros.errors import UsageError
from metaros.idl import Catalogue, default_catalogue, parse_definition
from metaros.interfaces.sensor_msgs.msg import LaserScan
from tests.metaros.dds import dds_types as dds


def test_every_shipped_type_has_a_dds_type() -> None:
    catalogue = default_catalogue()
    names = [name for name in catalogue.names("msg") if name.startswith(("sensor_msgs", "geometry_msgs", "nav_msgs"))]
    assert len(names) > 50
    for name in names:
        made = message_type(name, catalogue)
        made.__idl__.fill_type_data()
        assert made is message_type(name, catalogue)


def test_dds_reads_our_bytes_and_we_read_its() -> None:
    stamp = dds.Time(sec=-3, nanosec=9)
    theirs: IdlStruct = dds.LaserScan(dds.Header(stamp, "ö"), 0, 1, 2, 3, 4, 5, 6, [7.5] * 3, [1.0])
    data = theirs.serialize(use_version_2=False)
    ours = codec(LaserScan).decode(data)
    assert (ours.header.stamp.sec, ours.header.frame_id, ours.ranges.tolist()) == (-3, "ö", [7.5, 7.5, 7.5])
    assert codec(LaserScan).encode(ours) == data
    assert dds.LaserScan.deserialize(codec(LaserScan).encode(ours)) == theirs


def test_padding_of_dds_is_taken_off_and_a_header_keeps_the_alignment() -> None:
    made = message_type("std_msgs/msg/String", default_catalogue())
    padded = b"\0\1\0\3\x05\0\0\0hall\0\0\0\0"
    assert made.deserialize(padded).cdr == b"\0\1\0\0\x05\0\0\0hall\0"
    assert make_sample(made, b"x").serialize() == b"x"
    assert with_header(b"\0\1\0\0body", b"h" * 16) == b"\0\1\0\0" + b"h" * 16 + b"body"


def test_wide_strings_are_refused_by_name() -> None:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_definition("wstring text", "my_msgs/msg/Wide"))
    with pytest.raises(UsageError, match="wstring"):
        message_type("my_msgs/msg/Wide", catalogue)
