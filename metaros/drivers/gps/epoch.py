"""What a receiver knows of one moment, from NMEA sentences or one UBX message. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from typing import Any, Final

__all__ = ["FIX", "GBAS_FIX", "NO_FIX", "SBAS_FIX", "Epoch", "from_nmea", "from_pvt"]

# As sensor_msgs/NavSatStatus has them.
NO_FIX: Final = -1
FIX: Final = 0
SBAS_FIX: Final = 1
GBAS_FIX: Final = 2

# GGA: 1 alone, 2 differential, 3 PPS, 4 and 5 RTK fixed and float. Dead reckoning (6), what somebody typed (7) and a
# simulation (8) are no fix.
_QUALITIES: Final = {1: FIX, 2: SBAS_FIX, 3: FIX, 4: GBAS_FIX, 5: GBAS_FIX}
_KNOT_M_S: Final = 1852 / 3600
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_MAX_SPEED_M_S: Final = 600.0  # receivers for civil use stop at 515 m/s
_UP_TO_ACROSS: Final = 2.0  # heights are about twice as uncertain, where nothing is told of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Epoch:
    """Degrees, metres above the ellipsoid, m/s; NaN is unknown. `deviations_m`: east, north, up, one sigma."""

    source: str
    status: int
    latitude: float = math.nan
    longitude: float = math.nan
    altitude_m: float = math.nan
    deviations_m: tuple[float, float, float] | None = None
    velocity_m_s: tuple[float, float, float] | None = None
    utc_ns: int | None = None
    satellites: int | None = None
    hdop: float | None = None

    def variances(self, uere_m: float) -> tuple[tuple[float, float, float], bool]:
        """East, north, up in m2, and whether the receiver told them; otherwise by HDOP and the error of one range."""
        if self.deviations_m is not None:
            east, north, up = self.deviations_m
            return (east * east, north * north, up * up), True
        across = ((self.hdop or 1.0) * uere_m) ** 2
        return (across, across, across * _UP_TO_ACROSS**2), False


def from_nmea(round_: Mapping[str, Any]) -> Epoch | None:
    """The GGA, RMC, GST and VTG of one moment, parsed by pynmeagps, as one; None where nothing tells of a fix."""
    gga, rmc, gst, vtg = (round_.get(kind) for kind in ("GGA", "RMC", "GST", "VTG"))
    if gga is None and rmc is None:
        return None
    status = _QUALITIES.get(_field(gga, "quality"), NO_FIX) if gga is not None else FIX
    if rmc is not None and _field(rmc, "status") != "A":
        status = NO_FIX
    place = _place(_number(gga or rmc, "lat"), _number(gga or rmc, "lon"))
    if place is None:
        status = NO_FIX
    latitude, longitude = place if place is not None and status != NO_FIX else (math.nan, math.nan)
    altitude_m = _number(gga, "alt") + (0.0 if math.isnan(_number(gga, "sep")) else _number(gga, "sep"))
    return Epoch(
        source="NMEA",
        status=status,
        latitude=latitude,
        longitude=longitude,
        altitude_m=altitude_m if status != NO_FIX else math.nan,
        deviations_m=_deviations(gst),
        velocity_m_s=_velocity(rmc, vtg) if status != NO_FIX else None,
        utc_ns=_utc_ns(rmc) if status != NO_FIX else None,
        satellites=None if math.isnan(_number(gga, "numSV")) else int(_number(gga, "numSV")),
        hdop=_positive(_number(gga, "HDOP")),
    )


def from_pvt(pvt: Any) -> Epoch:
    """UBX-NAV-PVT, parsed by pyubx2: lengths are in mm, speeds in mm/s."""
    place = _place(pvt.lat, pvt.lon)
    good = pvt.gnssFixOk and pvt.fixType in (2, 3, 4) and not pvt.invalidLlh and place is not None
    status = NO_FIX if not good else GBAS_FIX if pvt.carrSoln else SBAS_FIX if pvt.diffSoln else FIX
    latitude, longitude = place if place is not None and good else (math.nan, math.nan)
    across, up = pvt.hAcc / 1000 / math.sqrt(2), pvt.vAcc / 1000  # hAcc is of the distance, not of one axis
    utc_ns = None
    if pvt.validDate and pvt.validTime:
        utc_ns = _calendar_ns(pvt.year, pvt.month, pvt.day, pvt.hour, pvt.min, pvt.second)
    return Epoch(
        source="UBX",
        status=status,
        latitude=latitude,
        longitude=longitude,
        altitude_m=pvt.height / 1000 if good and pvt.fixType != 2 else math.nan,
        deviations_m=(across, across, up) if good else None,
        velocity_m_s=(pvt.velE / 1000, pvt.velN / 1000, -pvt.velD / 1000) if good else None,
        utc_ns=None if utc_ns is None else utc_ns + pvt.nano,
        satellites=pvt.numSV,
    )


def _field(sentence: Any, name: str) -> Any:
    """pynmeagps has "" for an empty field, and leaves out those that a short sentence lacks."""
    return getattr(sentence, name, "")


def _number(sentence: Any, name: str) -> float:
    value = _field(sentence, name)
    return float(value) if isinstance(value, int | float) else math.nan


def _positive(value: float) -> float | None:
    return value if math.isfinite(value) and value > 0 else None


def _place(latitude: float, longitude: float) -> tuple[float, float] | None:
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 else None


def _deviations(gst: Any) -> tuple[float, float, float] | None:
    values = (_number(gst, "stdLong"), _number(gst, "stdLat"), _number(gst, "stdAlt"))
    return values if all(math.isfinite(value) and value >= 0 for value in values) else None


def _velocity(rmc: Any, vtg: Any) -> tuple[float, float, float] | None:
    speed, course = _number(rmc, "spd") * _KNOT_M_S, _number(rmc, "cog")
    if math.isnan(speed):
        speed, course = _number(vtg, "sogk") / 3.6, _number(vtg, "cogt")
    if not 0 <= speed <= _MAX_SPEED_M_S:
        return None
    if math.isnan(course):  # a receiver that stands tells no course
        return (0.0, 0.0, 0.0) if speed < 1 else None
    angle = math.radians(course)
    return (speed * math.sin(angle), speed * math.cos(angle), 0.0)


def _utc_ns(rmc: Any) -> int | None:
    day, moment = _field(rmc, "date"), _field(rmc, "time")
    if not (isinstance(day, date) and isinstance(moment, time)):
        return None
    whole = _calendar_ns(day.year, day.month, day.day, moment.hour, moment.minute, moment.second)
    return None if whole is None else whole + moment.microsecond * 1000


def _calendar_ns(year: int, month: int, day: int, hour: int, minute: int, second: int) -> int | None:
    try:
        moment = datetime(year, month, day, hour, minute, tzinfo=UTC) + timedelta(seconds=second)  # a leap second is 60
    except ValueError:
        return None
    return round((moment - _EPOCH).total_seconds()) * 1_000_000_000
