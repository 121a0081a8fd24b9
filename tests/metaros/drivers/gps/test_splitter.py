"""NMEA and UBX frames out of a mixed stream."""

from __future__ import annotations

from collections import Counter
from random import Random  # noqa: TID251 - seeded

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.gps.splitter import MAX_NMEA, MAX_UBX, GpsSplitter, nmea_frame, ubx_checksum
from tests.support.devices.gps_emulator import nmea_epoch, pvt


def frames_of(data: bytes, counts: Counter[str] | None = None, *, chunk: int = 4096) -> list[bytes]:
    counts = Counter() if counts is None else counts
    splitter = GpsSplitter(lambda name, by: counts.update({name: by}))
    return [frame for at in range(0, len(data), chunk) for frame in splitter.feed(data[at : at + chunk])]


@pytest.mark.parametrize("chunk", [1, 7, 4096])
def test_a_mixed_stream_gives_each_frame_once(chunk: int) -> None:
    counts: Counter[str] = Counter()
    sentences = nmea_epoch(19).splitlines(keepends=True)
    stream = b"\xd3\x00\x04RTCM" + sentences[0] + pvt() + sentences[1] + b"\xb5\x62junk" + sentences[2]
    assert frames_of(stream, counts, chunk=chunk) == [sentences[0], pvt(), sentences[1], sentences[2]]
    assert counts["skipped_bytes"] == 7 + 6


def test_bad_checksums_are_counted_and_what_follows_is_read() -> None:
    counts: Counter[str] = Counter()
    bad_ubx = bytearray(pvt())
    bad_ubx[20] ^= 1
    good = nmea_frame("GNVTG,084.4,T,,M,022.4,N,41.5,K,A")
    assert frames_of(good.replace(b"41.5", b"41.6") + good + bytes(bad_ubx) + pvt(), counts) == [good, pvt()]
    assert counts["bad_checksum"] >= 2


def test_absurd_lengths_do_not_wait_for_more() -> None:
    absurd = b"\xb5\x62\x01\x07" + (MAX_UBX + 1).to_bytes(2, "little")
    assert frames_of(absurd + pvt()) == [pvt()]
    assert frames_of(b"$" + b"A" * (2 * MAX_NMEA) + nmea_epoch(1)) != []
    assert frames_of(b"$GN" + pvt()) == [pvt()]  # half a sentence, and no line end in sight


def test_the_longest_frame_passes() -> None:
    body = b"\x02\x15" + MAX_UBX.to_bytes(2, "little") + bytes(MAX_UBX)
    frame = b"\xb5\x62" + body + ubx_checksum(body)
    assert frames_of(frame, chunk=100) == [frame]


def test_a_megabyte_of_noise_is_passed_over_and_kept_nowhere() -> None:
    counts: Counter[str] = Counter()
    splitter = GpsSplitter(lambda name, by: counts.update({name: by}))
    noise = Random(7).randbytes(1_000_000)
    for at in range(0, len(noise), 4096):
        assert list(splitter.feed(noise[at : at + 4096])) == []
        assert len(splitter._data) <= MAX_UBX + 8
    assert list(splitter.feed(bytes(MAX_UBX + 8))) == []  # what noise began is not whole any more
    assert list(splitter.feed(pvt())) == [pvt()]
    assert counts["skipped_bytes"] > 990_000


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=50), st.just(b"\xb5\x62"), st.just(b"$GNGGA,"), st.just(b"*00\r\n"))))
def test_anything_in_pieces_gives_what_the_whole_gives(pieces: list[bytes]) -> None:
    whole = b"".join(pieces) + bytes(MAX_UBX + 8) + pvt()
    assert frames_of(whole, chunk=13) == frames_of(whole)
    assert frames_of(whole)[-1] == pvt()
