"""The driver: reads the receiver and publishes its epochs."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.drivers.gps.epoch import NO_FIX, Epoch
from metaros.drivers.gps.reader import EpochReader, pvt_request
from metaros.drivers.serial_port import SerialPort
from metaros.interfaces.geometry_msgs.msg import Twist, TwistStamped, Vector3
from metaros.interfaces.sensor_msgs.msg import NavSatFix, NavSatStatus, TimeReference
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["GpsDevice", "make"]

PAUSE_NS: Final = 30_000_000


def make(context: DriverContext) -> GpsDevice:
    """A receiver on the port of the parameters."""
    return GpsDevice(context)


class GpsDevice:
    """A fix that is known gets its covariance; one that is not is NaN, so that nobody drives to 0, 0."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._port: SerialPort | None = None
        self._fixes = context.publisher(NavSatFix, "fix")
        self._velocities = context.publisher(TwistStamped, "velocity", reading=False)
        self._times = context.publisher(TimeReference, "time_reference", reading=False)

    def open(self) -> None:
        """Open the port."""
        context = self._context
        self._port = SerialPort(context, context["port"], context["baud"])
        if context["request_pvt"]:
            self._port.write(pvt_request())
        context.opened(f"reading {self._port.port}", hardware_id="")

    def run(self) -> None:
        """Read. An epoch's stamp is the moment of its first bytes: after a pause, or after the epoch before."""
        context, port = self._context, self._port
        assert port is not None
        reader = EpochReader(context.count)
        begun_ns, received_ns = None, 0
        while not context.stopping:
            data, now_ns = port.read(), context.clock.wall_ns()
            if data:
                if begun_ns is None or now_ns - received_ns > PAUSE_NS:
                    begun_ns = now_ns
                received_ns = now_ns
            for epoch in reader.feed(data, context.clock.monotonic_s()):
                self._publish(epoch, begun_ns or now_ns)
                begun_ns = None

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _publish(self, epoch: Epoch, begun_ns: int) -> None:
        context = self._context
        self._report(epoch)
        stamp_ns = begun_ns - round(context["delay"] * 1e9)
        header = Header(stamp=context.stamp(stamp_ns), frame_id=context["frame_id"])
        self._fixes.publish(_fix(epoch, header, context["uere"]), stamp_ns=stamp_ns)
        if epoch.velocity_m_s is not None:
            x, y, z = epoch.velocity_m_s
            twist = Twist(linear=Vector3(x=x, y=y, z=z))
            self._velocities.publish(TwistStamped(header=header, twist=twist), stamp_ns=stamp_ns)
        if epoch.utc_ns is not None:
            reference = TimeReference(header=header, time_ref=context.stamp(epoch.utc_ns), source="gps")
            self._times.publish(reference, stamp_ns=stamp_ns)

    def _report(self, epoch: Epoch) -> None:
        context = self._context
        context.fact("protocol", epoch.source)
        context.fact("fix", {-1: "none", 0: "satellites", 1: "differential", 2: "RTK"}[epoch.status])
        if epoch.satellites is not None:
            context.fact("satellites", epoch.satellites)
        if epoch.hdop is not None:
            context.fact("hdop", epoch.hdop)
        context.warn("no fix" if epoch.status == NO_FIX else "")


def _fix(epoch: Epoch, header: Header, uere_m: float) -> NavSatFix:
    status = NavSatStatus(status=epoch.status, service=NavSatStatus.SERVICE_GPS)
    fix = NavSatFix(
        header=header,
        status=status,
        latitude=epoch.latitude,
        longitude=epoch.longitude,
        altitude=epoch.altitude_m,
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
    if epoch.status != NO_FIX and math.isfinite(epoch.latitude):
        (east, north, up), from_receiver = epoch.variances(uere_m)
        fix.position_covariance = np.diag((east, north, up)).ravel()
        known, guessed = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN, NavSatFix.COVARIANCE_TYPE_APPROXIMATED
        fix.position_covariance_type = known if from_receiver else guessed
    return fix
