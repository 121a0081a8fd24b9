"""The driver: decodes samples, filters, publishes."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from metaros.drivers.context import DriverContext
from metaros.drivers.imu.complementary import ComplementaryFilter
from metaros.drivers.imu.csv_lines import CsvDecoder
from metaros.drivers.imu.sample import Quaternion, Sample, Vector, plausible
from metaros.drivers.imu.witmotion import WitMotionDecoder
from metaros.drivers.serial_port import SerialPort
from metaros.interfaces.geometry_msgs.msg import Quaternion as QuaternionMessage
from metaros.interfaces.geometry_msgs.msg import Vector3
from metaros.interfaces.sensor_msgs.msg import Imu, MagneticField, Temperature
from metaros.interfaces.std_msgs.msg import Header

__all__ = ["ImuDevice", "make"]

SLOW_EVERY_S: Final = 1.0
_NONE: Final = np.array([-1.0, *[0.0] * 8])


def make(context: DriverContext) -> ImuDevice:
    """An IMU on the port of the parameters."""
    return ImuDevice(context)


class ImuDevice:
    """Publishes each sample that is plausible. Gravity stays in: at rest, level, z is +9.81."""

    def __init__(self, context: DriverContext) -> None:
        self._context = context
        self._port: SerialPort | None = None
        self._filter = ComplementaryFilter(gain=context["gain"], estimate_bias=context["estimate_bias"])
        self._sample_s = 0.0
        self._slow_s = -math.inf
        self._samples = context.publisher(Imu, "imu")
        self._fields = context.publisher(MagneticField, "magnetic_field", reading=False)
        self._temperatures = context.publisher(Temperature, "temperature", reading=False)

    def open(self) -> None:
        """Open the port."""
        context = self._context
        self._port = SerialPort(context, context["port"], context["baud"])
        self._filter = ComplementaryFilter(gain=context["gain"], estimate_bias=context["estimate_bias"])
        self._sample_s = context.clock.monotonic_s()
        context.opened(f"reading {self._port.port}", hardware_id="")

    def run(self) -> None:
        """Read."""
        context, port = self._context, self._port
        assert port is not None
        decoder = self._decoder()
        while not context.stopping:
            data = port.read()
            if not data:
                continue
            stamp_ns = context.clock.wall_ns()
            for sample in decoder.feed(data):
                if plausible(sample):
                    self._publish(sample, stamp_ns)
                else:
                    context.count("implausible")

    def close(self) -> None:
        """Close the port."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _decoder(self) -> CsvDecoder | WitMotionDecoder:
        context = self._context
        if context["protocol"] == "witmotion":
            return WitMotionDecoder(context.count)
        units = {name: context[f"{name}_unit"] for name in ("acceleration", "rate", "magnetic")}
        return CsvDecoder(context.count, **units)

    def _publish(self, sample: Sample, stamp_ns: int) -> None:
        context, now_s = self._context, self._context.clock.monotonic_s()
        self._filter.update(sample.acceleration_m_s2, sample.rate_rad_s, now_s - self._sample_s)
        self._sample_s = now_s
        header = Header(stamp=context.stamp(stamp_ns), frame_id=context["frame_id"])
        self._samples.publish(self._imu(sample, header), stamp_ns=stamp_ns)
        if sample.magnetic_t is not None:
            field = MagneticField(header=header, magnetic_field=_vector(sample.magnetic_t))
            self._fields.publish(field, stamp_ns=stamp_ns)
        if now_s - self._slow_s >= SLOW_EVERY_S:
            self._slow_s = now_s
            context.fact("gyroscope_bias_rad_s", " ".join(f"{value:.5f}" for value in self._filter.bias))
            if sample.temperature_c is not None:
                temperature = Temperature(header=header, temperature=sample.temperature_c)
                self._temperatures.publish(temperature, stamp_ns=stamp_ns)

    def _imu(self, sample: Sample, header: Header) -> Imu:
        context = self._context
        x, y, z = (rate - bias for rate, bias in zip(sample.rate_rad_s, self._filter.bias, strict=True))
        message = Imu(
            header=header,
            linear_acceleration=_vector(sample.acceleration_m_s2),
            linear_acceleration_covariance=_diagonal(*[context["acceleration_stddev"]] * 3),
            angular_velocity=_vector((x, y, z)),
            angular_velocity_covariance=_diagonal(*[context["rate_stddev"]] * 3),
            orientation_covariance=_NONE,
        )
        orientation, yaw_stddev = self._orientation(sample)
        if orientation is not None:
            message.orientation = _quaternion(orientation)
            message.orientation_covariance = _diagonal(*[context["orientation_stddev"]] * 2, yaw_stddev)
        return message

    def _orientation(self, sample: Sample) -> tuple[Quaternion | None, float]:
        whose, stddev = self._context["orientation"], self._context["orientation_stddev"]
        if whose == "none":
            return None, 0.0
        if whose == "device" or (whose == "auto" and sample.orientation is not None):
            return sample.orientation, stddev
        return self._filter.orientation, math.pi if stddev else 0.0


def _vector(values: Vector) -> Vector3:
    x, y, z = values
    return Vector3(x=x, y=y, z=z)


def _quaternion(values: Quaternion) -> QuaternionMessage:
    w, x, y, z = values
    return QuaternionMessage(x=x, y=y, z=z, w=w)


def _diagonal(*stddevs: float) -> Any:
    return np.diag([stddev * stddev for stddev in stddevs]).ravel()
