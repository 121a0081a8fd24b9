"""LD19's packets: found in any mess, counted where they are bad, and nothing kept for long."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.ld19.protocol import PACKET_BYTES, POINTS, Packet, PacketStream, crc8, pack
from tests.support.devices.ld19_emulator import Ld19Emulator

# The packet that the maker's manual takes apart.
FROM_THE_MANUAL = bytes.fromhex(
    "54 2C 68 08 AB 7E E0 00 E4 DC 00 E2 D9 00 E5 D5 00 E3 D3 00 E4 D0 00 E9 CD 00 E4 CA 00 E2 C7 00 E9 C5 00 E5"
    "C2 00 E5 C0 00 E5 BE 82 3A 1A 50"
)


def test_the_packet_of_the_manual() -> None:
    (packet,) = PacketStream().feed(FROM_THE_MANUAL)
    assert packet.speed_deg_s == 2152
    assert packet.first_deg == pytest.approx(324.27)
    assert packet.last_deg == pytest.approx(334.70)
    assert (packet.distances_mm[0], packet.intensities[0]) == (224, 228)
    assert packet.clock_ms == 0x1A3A


def test_the_checksum_of_its_table() -> None:
    assert [crc8(bytes((value,))) for value in range(4)] == [0x00, 0x4D, 0x9A, 0xD7]


def test_angles_lie_evenly_and_pass_360() -> None:
    packet = Packet(
        speed_deg_s=3600,
        first_deg=354.5,
        last_deg=5.5,
        distances_mm=(1,) * POINTS,
        intensities=(0,) * POINTS,
        clock_ms=0,
    )
    assert packet.angles_deg == pytest.approx([354.5, 355.5, 356.5, 357.5, 358.5, 359.5, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5])


def test_byte_by_byte_is_the_same() -> None:
    data = Ld19Emulator().turns(0.2)
    stream = PacketStream()
    packets = [packet for byte in data for packet in stream.feed(bytes((byte,)))]
    assert packets == PacketStream().feed(data)
    assert len(packets) == len(data) // PACKET_BYTES
    assert not stream.counters


def test_garbage_between_packets_is_skipped_and_counted() -> None:
    one, two, three = (Ld19Emulator().packet() for _ in range(3))
    stream = PacketStream()
    assert len(stream.feed(b"\x54\x54\x2c" + one + b"junk" + two + three[:20] + three)) == 3
    assert stream.counters["skipped_bytes"] == 3 + 4 + 20
    assert stream.counters["bad_crc"] == 2


@pytest.mark.parametrize("at", range(2, PACKET_BYTES))
def test_a_flipped_bit_anywhere_is_a_bad_checksum(at: int) -> None:
    good = Ld19Emulator().packet()
    bad = bytearray(good)
    bad[at] ^= 0x10
    stream = PacketStream()
    assert stream.feed(bytes(bad) + good) == PacketStream().feed(good)
    assert stream.counters["bad_crc"] >= 1


def test_a_megabyte_of_noise_then_it_works() -> None:
    noise = np.random.default_rng(19).integers(0, 256, 1 << 20, dtype=np.uint8).tobytes()
    stream = PacketStream()
    for at in range(0, len(noise), 4096):
        stream.feed(noise[at : at + 4096])
        assert len(stream._kept) < PACKET_BYTES
    assert stream.counters["skipped_bytes"] > 1_000_000
    good = Ld19Emulator().packet()
    assert PacketStream().feed(good)[0] in stream.feed(bytes(PACKET_BYTES) + good)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=60), st.just(None)), max_size=12), st.integers(1, 50))
def test_whatever_is_between_the_good_ones_are_found(parts: list[bytes | None], chunk: int) -> None:
    emulator = Ld19Emulator()
    sent = [emulator.packet() if part is None else bytes(b & 0x3F for b in part) for part in parts]
    data = b"".join(sent)
    stream = PacketStream()
    found = [packet for at in range(0, len(data), chunk) for packet in stream.feed(data[at : at + chunk])]
    assert [pack(packet) for packet in found] == [one for one, part in zip(sent, parts, strict=True) if part is None]
