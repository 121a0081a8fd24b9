"""The vehicle's global position: its own estimate, with the quality of its GPS; the GPS alone where it has none."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.interfaces.sensor_msgs.msg import NavSatFix, NavSatStatus
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["PositionPublisher"]

_FRESH_S: Final = 2.0
_STATUS: Final = {3: NavSatStatus.STATUS_FIX, 2: NavSatStatus.STATUS_FIX, 4: NavSatStatus.STATUS_SBAS_FIX}


class PositionPublisher:
    """Publishes `vehicle/fix`. Without a fix the place is NaN, so that nobody takes 0, 0 for one."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._fixes = context.publisher(NavSatFix, "vehicle/fix")
        self._gps: Any = None
        self._global_s = -math.inf

    def on_gps(self, message: Any) -> None:
        """GPS_RAW_INT."""
        self._gps = message
        self._context.fact("satellites", message.satellites_visible)
        if self._context.clock.monotonic_s() - self._global_s > _FRESH_S:
            known = message.fix_type >= 2
            self._publish(message.lat, message.lon, message.alt, known=known)

    def on_global(self, message: Any) -> None:
        """GLOBAL_POSITION_INT; its place is 0, 0 until the vehicle knows one."""
        known = bool(message.lat or message.lon)
        if known:
            self._global_s = self._context.clock.monotonic_s()
            self._publish(message.lat, message.lon, message.alt, known=True)

    def _publish(self, lat: int, lon: int, altitude_mm: int, *, known: bool) -> None:
        context, gps = self._context, self._gps
        if known and not (abs(lat) <= 90 * 10**7 and abs(lon) <= 180 * 10**7):
            context.count("bad_values")
            return
        stamp_ns = context.clock.wall_ns()
        fix = NavSatFix(header=Header(stamp=context.stamp(stamp_ns), frame_id=context["frame_id"]))
        fix.status.service = NavSatStatus.SERVICE_GPS
        fix.status.status = _status(gps, known=known)
        fix.latitude, fix.longitude = (lat / 1e7, lon / 1e7) if known else (math.nan, math.nan)
        fix.altitude = (altitude_mm + _undulation_mm(gps)) / 1000 if known else math.nan
        if known and gps is not None and gps.h_acc and gps.v_acc:  # one sigma in mm; 0: not told
            across, up = (gps.h_acc / 1000) ** 2, (gps.v_acc / 1000) ** 2
            fix.position_covariance = np.diag([across, across, up]).ravel()
            fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
        self._fixes.publish(fix, stamp_ns=stamp_ns)


def _status(gps: Any, *, known: bool) -> int:
    if not known:
        return NavSatStatus.STATUS_NO_FIX
    if gps is None or gps.fix_type < 2:
        return NavSatStatus.STATUS_FIX  # the vehicle knows its place by other means
    return _STATUS.get(gps.fix_type, NavSatStatus.STATUS_GBAS_FIX)  # 5, 6: RTK; 7, 8: static, PPP


def _undulation_mm(gps: Any) -> int:
    """From mean sea level, as autopilots tell it, to the ellipsoid, as NavSatFix wants it; 0 where it is not told."""
    return int(gps.alt_ellipsoid - gps.alt) if gps is not None and gps.alt_ellipsoid else 0
