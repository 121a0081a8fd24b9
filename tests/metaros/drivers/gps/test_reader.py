"""From bytes to epochs."""

from __future__ import annotations

import math
from collections import Counter
from random import Random  # noqa: TID251 - seeded

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.drivers.gps.epoch import GBAS_FIX, NO_FIX, SBAS_FIX, Epoch
from metaros.drivers.gps.reader import PREFER_UBX_S, EpochReader, pvt_request
from metaros.drivers.gps.splitter import nmea_frame, ubx_checksum
from tests.support.devices.gps_emulator import nmea_epoch, nmea_no_fix, pvt

UTC_NS = 1_774_269_319_000_000_000  # 23 March 2026, 12:35:19


def read(data: bytes, counts: Counter[str] | None = None) -> list[Epoch]:
    counts = Counter() if counts is None else counts
    reader = EpochReader(lambda name, by: counts.update({name: by}))
    return [*reader.feed(data, 0.0), *reader.feed(b"", 0.1)]


def test_the_sentences_of_one_moment_are_one_epoch() -> None:
    (epoch,) = read(nmea_epoch(19))
    assert (epoch.source, epoch.status, epoch.satellites, epoch.hdop) == ("NMEA", 0, 8, 0.9)
    assert (epoch.latitude, epoch.longitude) == (pytest.approx(48.1173, abs=1e-6), pytest.approx(11.516667, abs=1e-6))
    assert epoch.altitude_m == pytest.approx(545.4 + 46.9)
    assert epoch.deviations_m == (0.9, 0.8, 1.5)
    assert epoch.utc_ns == UTC_NS
    speed = 22.4 * 1852 / 3600
    course = math.radians(84.4)
    assert epoch.velocity_m_s == pytest.approx((speed * math.sin(course), speed * math.cos(course), 0.0))


def test_after_the_first_an_epoch_is_complete_with_its_last_sentence() -> None:
    reader = EpochReader(lambda *_: None)
    assert list(reader.feed(nmea_epoch(1), 0.0)) == []
    assert len(list(reader.feed(nmea_epoch(2), 1.0))) == 2
    assert len(list(reader.feed(nmea_epoch(3), 2.0))) == 1
    assert list(reader.feed(b"", 2.1)) == []


def test_hdop_gives_the_covariance_where_the_receiver_tells_no_accuracy() -> None:
    (epoch,) = read(nmea_epoch(19, gst=False))
    across = (0.9 * 5) ** 2
    assert epoch.variances(5.0) == (pytest.approx((across, across, 4 * across)), False)
    (reported,) = read(nmea_epoch(19))
    assert reported.variances(5.0) == (pytest.approx((0.81, 0.64, 2.25)), True)


@pytest.mark.parametrize(("quality", "status"), [(0, -1), (1, 0), (2, 1), (4, 2), (5, 2), (6, -1), (8, -1)])
def test_the_quality_of_gga_is_the_status(quality: int, status: int) -> None:
    (epoch,) = read(nmea_epoch(19, quality=quality))
    assert epoch.status == status
    assert math.isnan(epoch.latitude) == (status == NO_FIX)
    assert (epoch.velocity_m_s is None) == (status == NO_FIX)


def test_without_a_fix_the_place_is_nan() -> None:
    (epoch,) = read(nmea_no_fix())
    assert epoch.status == NO_FIX
    assert math.isnan(epoch.latitude)
    assert math.isnan(epoch.longitude)
    assert math.isnan(epoch.altitude_m)
    assert (epoch.velocity_m_s, epoch.utc_ns) == (None, None)


def test_a_receiver_with_rmc_alone_has_epochs_too() -> None:
    (epoch,) = read(nmea_frame("GPRMC,123519.00,A,4807.0380,S,01131.0000,W,000.0,,230326,,,A"))
    assert (epoch.latitude, epoch.longitude) == (pytest.approx(-48.1173), pytest.approx(-11.5166667))
    assert epoch.velocity_m_s == (0.0, 0.0, 0.0)
    assert math.isnan(epoch.altitude_m)


def test_nav_pvt_is_one_epoch_by_itself() -> None:
    (epoch,) = read(pvt(nano=-500))
    assert (epoch.source, epoch.status, epoch.satellites) == ("UBX", 0, 11)
    assert (epoch.latitude, epoch.longitude, epoch.altitude_m) == (pytest.approx(48.1), pytest.approx(11.5), 592.3)
    assert epoch.deviations_m == pytest.approx((1.0, 1.0, 2.5), abs=1e-3)
    assert epoch.velocity_m_s == (-2.0, 1.0, -0.3)
    assert epoch.utc_ns == UTC_NS - 500


def test_nav_pvt_tells_how_good_a_fix_is() -> None:
    assert [read(pvt(diffSoln=1))[0].status, read(pvt(carrSoln=2, diffSoln=1))[0].status] == [SBAS_FIX, GBAS_FIX]
    for fields in ({"fixType": 0}, {"gnssFixOk": 0}, {"fixType": 5}, {"invalidLlh": 1}):
        (epoch,) = read(pvt(**fields))
        assert epoch.status == NO_FIX, fields
        assert math.isnan(epoch.latitude)
    assert read(pvt(validTime=0))[0].utc_ns is None
    assert read(pvt(month=13))[0].utc_ns is None


def test_ubx_is_preferred_until_it_falls_silent() -> None:
    reader = EpochReader(lambda *_: None)
    assert [e.source for e in reader.feed(nmea_epoch(1) + pvt() + nmea_epoch(2) + nmea_epoch(3), 10.0)] == ["UBX"]
    later_s = 10.0 + PREFER_UBX_S + 1
    assert {e.source for e in reader.feed(nmea_epoch(20) + nmea_epoch(21), later_s)} == {"NMEA"}


def test_frames_that_are_sound_and_say_nonsense_are_counted() -> None:
    counts: Counter[str] = Counter()
    body = b"\x01\x07\x03\x00abc"
    nonsense = nmea_frame("GNGGA,xx,yy,zz,N,,,q,,,,,,") + b"\xb5\x62" + body + ubx_checksum(body)
    nonsense += nmea_frame("GNGGA,123519.00,9907.0380,N,51131.0000,E,1,08,0.9,545.4,M,46.9,M,,")
    epochs = read(nonsense + nmea_epoch(40), counts)
    assert counts["bad_messages"] >= 1
    assert all(epoch.status == NO_FIX or abs(epoch.latitude) <= 90 for epoch in epochs)
    assert epochs[-1].status == 0


def test_sentences_of_other_kinds_are_left_unread() -> None:
    counts: Counter[str] = Counter()
    assert len(read(nmea_frame("GPGSV,many,x,y,z") + nmea_epoch(5), counts)) == 1
    assert counts["frames"] == 1 + nmea_epoch(5).count(b"$")
    assert counts["bad_messages"] == 0


def test_noise_between_epochs_costs_none_of_them() -> None:
    rng = Random(3)
    reader = EpochReader(lambda *_: None)
    found: list[Epoch] = []
    for second in range(60):
        found += reader.feed(nmea_epoch(second) + rng.randbytes(rng.randrange(200)) + b"\n" * 300, float(second))
    found += reader.feed(b"", 61.0)
    assert len(found) == 60
    assert all(epoch.latitude == pytest.approx(48.1173, abs=1e-6) for epoch in found)


TEXTS = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="*$!"), max_size=80)


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(["GNGGA", "GPRMC", "GNGST", "GNVTG", "GAGGA"]), TEXTS)
def test_no_sound_sentence_whatever_it_says_stops_the_reader(name: str, text: str) -> None:
    for epoch in read(nmea_frame(f"{name},{text}") + nmea_epoch(5)):
        assert epoch.status == NO_FIX or abs(epoch.latitude) <= 90


@settings(max_examples=60, deadline=None)
@given(st.binary(min_size=84, max_size=100))
def test_no_nav_pvt_whatever_it_says_stops_the_reader(payload: bytes) -> None:
    body = b"\x01\x07" + len(payload).to_bytes(2, "little") + payload
    for epoch in read(b"\xb5\x62" + body + ubx_checksum(body)):
        assert epoch.status == NO_FIX or (abs(epoch.latitude) <= 90 and abs(epoch.longitude) <= 180)


def test_the_request_is_ubx_cfg_msg_for_nav_pvt() -> None:
    assert pvt_request() == bytes.fromhex("b562 0601 0300 010701 1351".replace(" ", ""))
