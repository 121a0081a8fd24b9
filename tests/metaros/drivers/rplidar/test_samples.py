"""RPLIDAR's nodes and capsules: angles to the letter, and the way back from any garbage."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.rplidar.samples import CAPSULE_BYTES, TRUST, CapsuleStream, NodeStream, Sample
from tests.support.devices.rplidar_emulator import capsule, node


def nodes(count: int, begin: int = 0) -> bytes:
    return b"".join(
        node(index * 0.75 % 360, 1000 + index, 15, start=index % 480 == 0) for index in range(begin, begin + count)
    )


def test_a_node_byte_for_byte() -> None:
    assert node(90.5, 1234.25, 15, start=True) == bytes((0x3D, 0x41, 0x2D, 0x49, 0x13))
    assert NodeStream().feed(bytes((0x3D, 0x41, 0x2D, 0x49, 0x13))) == [Sample(90.5, 1234.25, 15)]


def test_nodes_in_any_pieces() -> None:
    data = nodes(500)
    whole = NodeStream().feed(data)
    stream = NodeStream()
    assert [sample for byte in data for sample in stream.feed(bytes((byte,)))] == whole
    assert [sample.distance_mm for sample in whole] == [1000 + index for index in range(500)]
    assert not stream.counters


@pytest.mark.parametrize("garbage", [b"\0", b"\xff" * 3, b"RP LIDAR System.\r\n", bytes(range(256))])
def test_after_garbage_the_nodes_are_found_again(garbage: bytes) -> None:
    stream = NodeStream()
    samples = stream.feed(nodes(20) + garbage + nodes(200, 20))
    assert len(samples) >= 20 + 200 - TRUST
    assert samples[-100:] == NodeStream().feed(nodes(220))[-100:]
    assert stream.counters["bad_check"] >= 1


def test_a_bad_check_bit_costs_no_more_than_its_node() -> None:
    data = bytearray(nodes(100))
    data[50 * 5 + 1] &= 0xFE
    stream = NodeStream()
    assert len(stream.feed(bytes(data))) == 99
    assert stream.counters == {"bad_check": 1, "skipped_bytes": 5}


def test_a_start_bit_without_its_complement_is_bad() -> None:
    data = bytearray(nodes(100))
    data[0] |= 3
    stream = NodeStream()
    assert len(stream.feed(bytes(data))) == 99
    assert stream.counters["bad_check"] == 1


def test_a_capsule_by_hand() -> None:
    first = capsule(10.0, [(1000, 8), (16383, 63)] + [(0, 0)] * 30, start=True)
    assert len(first) == CAPSULE_BYTES
    assert first[4:9] == struct.pack("<HHB", 1000 << 2, 16383 << 2 | 3, 0xF8)
    samples = CapsuleStream().feed(first + capsule(42.0, [(0, 0)] * 32))
    assert samples[0] == Sample(9.0, 1000.0, 47)
    assert samples[1] == Sample(11.0 - 63 / 8, 16383.0, 47)
    assert samples[31] == Sample(41.0, 0.0, 0)


def test_capsules_pass_360() -> None:
    (sample, *_), last = (lambda found: (found, found[-1]))(
        CapsuleStream().feed(capsule(350.0, [(1, 0)] * 32) + capsule(22.0, [(1, 0)] * 32))
    )
    assert (sample.angle_deg, last.angle_deg) == (350.0, 21.0)


def test_a_capsule_with_a_bad_checksum_and_the_one_before_it_say_nothing() -> None:
    stream = CapsuleStream()
    four = [bytearray(capsule(30.0 * index, [(500 + index, 0)] * 32)) for index in range(5)]
    four[1][40] ^= 1
    samples = stream.feed(b"".join(map(bytes, four)))
    assert {sample.distance_mm for sample in samples} == {502.0, 503.0}
    assert stream.counters["bad_checksum"] == 1
    assert stream.counters["skipped_bytes"] == CAPSULE_BYTES


def test_a_capsule_that_begins_anew_forgets_the_one_before() -> None:
    stream = CapsuleStream()
    assert stream.feed(capsule(0.0, [(1, 0)] * 32) + capsule(90.0, [(2, 0)] * 32, start=True)) == []
    assert stream.feed(capsule(120.0, [(3, 0)] * 32))[0].distance_mm == 2.0


@pytest.mark.parametrize("stream", [NodeStream(), CapsuleStream()])
def test_much_noise(stream: NodeStream | CapsuleStream) -> None:
    noise = np.random.default_rng(52).integers(0, 256, 1 << 17, dtype=np.uint8).tobytes()
    found = 0
    for at in range(0, len(noise), 4096):
        found += len(stream.feed(noise[at : at + 4096]))
        assert len(stream._kept) < CAPSULE_BYTES
    assert stream.counters["skipped_bytes"] > 0.99 * len(noise)
    assert found < 0.01 * len(noise)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300), st.integers(1, 90))
def test_capsules_are_found_after_anything(garbage: bytes, chunk: int) -> None:
    good = b"".join(capsule(30.0 * index, [(700, 4)] * 32) for index in range(6))
    data = garbage + good
    stream = CapsuleStream()
    found = [sample for at in range(0, len(data), chunk) for sample in stream.feed(data[at : at + chunk])]
    assert len(found) >= 3 * 32
    assert found[-1].distance_mm == 700.0
