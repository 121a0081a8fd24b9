# ruff: noqa: A002
"""The messages of sensor_msgs."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg
from metaros.interfaces.geometry_msgs import msg as geometry_msgs_msg
from metaros.interfaces.std_msgs import msg as std_msgs_msg

class BatteryState(Message):
    POWER_SUPPLY_STATUS_UNKNOWN: Final = 0
    POWER_SUPPLY_STATUS_CHARGING: Final = 1
    POWER_SUPPLY_STATUS_DISCHARGING: Final = 2
    POWER_SUPPLY_STATUS_NOT_CHARGING: Final = 3
    POWER_SUPPLY_STATUS_FULL: Final = 4
    POWER_SUPPLY_HEALTH_UNKNOWN: Final = 0
    POWER_SUPPLY_HEALTH_GOOD: Final = 1
    POWER_SUPPLY_HEALTH_OVERHEAT: Final = 2
    POWER_SUPPLY_HEALTH_DEAD: Final = 3
    POWER_SUPPLY_HEALTH_OVERVOLTAGE: Final = 4
    POWER_SUPPLY_HEALTH_UNSPEC_FAILURE: Final = 5
    POWER_SUPPLY_HEALTH_COLD: Final = 6
    POWER_SUPPLY_HEALTH_WATCHDOG_TIMER_EXPIRE: Final = 7
    POWER_SUPPLY_HEALTH_SAFETY_TIMER_EXPIRE: Final = 8
    POWER_SUPPLY_TECHNOLOGY_UNKNOWN: Final = 0
    POWER_SUPPLY_TECHNOLOGY_NIMH: Final = 1
    POWER_SUPPLY_TECHNOLOGY_LION: Final = 2
    POWER_SUPPLY_TECHNOLOGY_LIPO: Final = 3
    POWER_SUPPLY_TECHNOLOGY_LIFE: Final = 4
    POWER_SUPPLY_TECHNOLOGY_NICD: Final = 5
    POWER_SUPPLY_TECHNOLOGY_LIMN: Final = 6
    POWER_SUPPLY_TECHNOLOGY_TERNARY: Final = 7
    POWER_SUPPLY_TECHNOLOGY_VRLA: Final = 8
    header: std_msgs_msg.Header
    voltage: float
    temperature: float
    current: float
    charge: float
    capacity: float
    design_capacity: float
    percentage: float
    power_supply_status: int
    power_supply_health: int
    power_supply_technology: int
    present: bool
    cell_voltage: npt.NDArray[np.float32]
    cell_temperature: npt.NDArray[np.float32]
    location: str
    serial_number: str
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        voltage: float = ...,
        temperature: float = ...,
        current: float = ...,
        charge: float = ...,
        capacity: float = ...,
        design_capacity: float = ...,
        percentage: float = ...,
        power_supply_status: int = ...,
        power_supply_health: int = ...,
        power_supply_technology: int = ...,
        present: bool = ...,
        cell_voltage: npt.NDArray[Any] | Sequence[float] = ...,
        cell_temperature: npt.NDArray[Any] | Sequence[float] = ...,
        location: str = ...,
        serial_number: str = ...,
    ) -> None: ...

class CameraInfo(Message):
    header: std_msgs_msg.Header
    height: int
    width: int
    distortion_model: str
    d: npt.NDArray[np.float64]
    k: npt.NDArray[np.float64]
    r: npt.NDArray[np.float64]
    p: npt.NDArray[np.float64]
    binning_x: int
    binning_y: int
    roi: RegionOfInterest
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        height: int = ...,
        width: int = ...,
        distortion_model: str = ...,
        d: npt.NDArray[Any] | Sequence[float] = ...,
        k: npt.NDArray[Any] | Sequence[float] = ...,
        r: npt.NDArray[Any] | Sequence[float] = ...,
        p: npt.NDArray[Any] | Sequence[float] = ...,
        binning_x: int = ...,
        binning_y: int = ...,
        roi: RegionOfInterest = ...,
    ) -> None: ...

class ChannelFloat32(Message):
    name: str
    values: npt.NDArray[np.float32]
    def __init__(
        self,
        *,
        name: str = ...,
        values: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class CompressedImage(Message):
    header: std_msgs_msg.Header
    format: str
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        format: str = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class FluidPressure(Message):
    header: std_msgs_msg.Header
    fluid_pressure: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        fluid_pressure: float = ...,
        variance: float = ...,
    ) -> None: ...

class Illuminance(Message):
    header: std_msgs_msg.Header
    illuminance: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        illuminance: float = ...,
        variance: float = ...,
    ) -> None: ...

class Image(Message):
    header: std_msgs_msg.Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: npt.NDArray[np.uint8]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        height: int = ...,
        width: int = ...,
        encoding: str = ...,
        is_bigendian: int = ...,
        step: int = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
    ) -> None: ...

class Imu(Message):
    header: std_msgs_msg.Header
    orientation: geometry_msgs_msg.Quaternion
    orientation_covariance: npt.NDArray[np.float64]
    angular_velocity: geometry_msgs_msg.Vector3
    angular_velocity_covariance: npt.NDArray[np.float64]
    linear_acceleration: geometry_msgs_msg.Vector3
    linear_acceleration_covariance: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        orientation: geometry_msgs_msg.Quaternion = ...,
        orientation_covariance: npt.NDArray[Any] | Sequence[float] = ...,
        angular_velocity: geometry_msgs_msg.Vector3 = ...,
        angular_velocity_covariance: npt.NDArray[Any] | Sequence[float] = ...,
        linear_acceleration: geometry_msgs_msg.Vector3 = ...,
        linear_acceleration_covariance: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class JointState(Message):
    header: std_msgs_msg.Header
    name: list[str]
    position: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    effort: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        name: list[str] = ...,
        position: npt.NDArray[Any] | Sequence[float] = ...,
        velocity: npt.NDArray[Any] | Sequence[float] = ...,
        effort: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class Joy(Message):
    header: std_msgs_msg.Header
    axes: npt.NDArray[np.float32]
    buttons: npt.NDArray[np.int32]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        axes: npt.NDArray[Any] | Sequence[float] = ...,
        buttons: npt.NDArray[Any] | Sequence[int] = ...,
    ) -> None: ...

class JoyFeedback(Message):
    TYPE_LED: Final = 0
    TYPE_RUMBLE: Final = 1
    TYPE_BUZZER: Final = 2
    type: int
    id: int
    intensity: float
    def __init__(
        self,
        *,
        type: int = ...,
        id: int = ...,
        intensity: float = ...,
    ) -> None: ...

class JoyFeedbackArray(Message):
    array: list[JoyFeedback]
    def __init__(
        self,
        *,
        array: list[JoyFeedback] = ...,
    ) -> None: ...

class LaserEcho(Message):
    echoes: npt.NDArray[np.float32]
    def __init__(
        self,
        *,
        echoes: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class LaserScan(Message):
    header: std_msgs_msg.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: npt.NDArray[np.float32]
    intensities: npt.NDArray[np.float32]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: npt.NDArray[Any] | Sequence[float] = ...,
        intensities: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class MagneticField(Message):
    header: std_msgs_msg.Header
    magnetic_field: geometry_msgs_msg.Vector3
    magnetic_field_covariance: npt.NDArray[np.float64]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        magnetic_field: geometry_msgs_msg.Vector3 = ...,
        magnetic_field_covariance: npt.NDArray[Any] | Sequence[float] = ...,
    ) -> None: ...

class MultiDOFJointState(Message):
    header: std_msgs_msg.Header
    joint_names: list[str]
    transforms: list[geometry_msgs_msg.Transform]
    twist: list[geometry_msgs_msg.Twist]
    wrench: list[geometry_msgs_msg.Wrench]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        joint_names: list[str] = ...,
        transforms: list[geometry_msgs_msg.Transform] = ...,
        twist: list[geometry_msgs_msg.Twist] = ...,
        wrench: list[geometry_msgs_msg.Wrench] = ...,
    ) -> None: ...

class MultiEchoLaserScan(Message):
    header: std_msgs_msg.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: list[LaserEcho]
    intensities: list[LaserEcho]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: list[LaserEcho] = ...,
        intensities: list[LaserEcho] = ...,
    ) -> None: ...

class NavSatFix(Message):
    COVARIANCE_TYPE_UNKNOWN: Final = 0
    COVARIANCE_TYPE_APPROXIMATED: Final = 1
    COVARIANCE_TYPE_DIAGONAL_KNOWN: Final = 2
    COVARIANCE_TYPE_KNOWN: Final = 3
    header: std_msgs_msg.Header
    status: NavSatStatus
    latitude: float
    longitude: float
    altitude: float
    position_covariance: npt.NDArray[np.float64]
    position_covariance_type: int
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        status: NavSatStatus = ...,
        latitude: float = ...,
        longitude: float = ...,
        altitude: float = ...,
        position_covariance: npt.NDArray[Any] | Sequence[float] = ...,
        position_covariance_type: int = ...,
    ) -> None: ...

class NavSatStatus(Message):
    STATUS_UNKNOWN: Final = -2
    STATUS_NO_FIX: Final = -1
    STATUS_FIX: Final = 0
    STATUS_SBAS_FIX: Final = 1
    STATUS_GBAS_FIX: Final = 2
    SERVICE_UNKNOWN: Final = 0
    SERVICE_GPS: Final = 1
    SERVICE_GLONASS: Final = 2
    SERVICE_COMPASS: Final = 4
    SERVICE_GALILEO: Final = 8
    status: int
    service: int
    def __init__(
        self,
        *,
        status: int = ...,
        service: int = ...,
    ) -> None: ...

class PointCloud(Message):
    header: std_msgs_msg.Header
    points: list[geometry_msgs_msg.Point32]
    channels: list[ChannelFloat32]
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        points: list[geometry_msgs_msg.Point32] = ...,
        channels: list[ChannelFloat32] = ...,
    ) -> None: ...

class PointCloud2(Message):
    header: std_msgs_msg.Header
    height: int
    width: int
    fields: list[PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: npt.NDArray[np.uint8]
    is_dense: bool
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        height: int = ...,
        width: int = ...,
        fields: list[PointField] = ...,
        is_bigendian: bool = ...,
        point_step: int = ...,
        row_step: int = ...,
        data: npt.NDArray[Any] | Sequence[int] | bytes | bytearray | memoryview = ...,
        is_dense: bool = ...,
    ) -> None: ...

class PointField(Message):
    INT8: Final = 1
    UINT8: Final = 2
    INT16: Final = 3
    UINT16: Final = 4
    INT32: Final = 5
    UINT32: Final = 6
    FLOAT32: Final = 7
    FLOAT64: Final = 8
    name: str
    offset: int
    datatype: int
    count: int
    def __init__(
        self,
        *,
        name: str = ...,
        offset: int = ...,
        datatype: int = ...,
        count: int = ...,
    ) -> None: ...

class Range(Message):
    ULTRASOUND: Final = 0
    INFRARED: Final = 1
    header: std_msgs_msg.Header
    radiation_type: int
    field_of_view: float
    min_range: float
    max_range: float
    range: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        radiation_type: int = ...,
        field_of_view: float = ...,
        min_range: float = ...,
        max_range: float = ...,
        range: float = ...,
        variance: float = ...,
    ) -> None: ...

class RegionOfInterest(Message):
    x_offset: int
    y_offset: int
    height: int
    width: int
    do_rectify: bool
    def __init__(
        self,
        *,
        x_offset: int = ...,
        y_offset: int = ...,
        height: int = ...,
        width: int = ...,
        do_rectify: bool = ...,
    ) -> None: ...

class RelativeHumidity(Message):
    header: std_msgs_msg.Header
    relative_humidity: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        relative_humidity: float = ...,
        variance: float = ...,
    ) -> None: ...

class Temperature(Message):
    header: std_msgs_msg.Header
    temperature: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        temperature: float = ...,
        variance: float = ...,
    ) -> None: ...

class TimeReference(Message):
    header: std_msgs_msg.Header
    time_ref: builtin_interfaces_msg.Time
    source: str
    def __init__(
        self,
        *,
        header: std_msgs_msg.Header = ...,
        time_ref: builtin_interfaces_msg.Time = ...,
        source: str = ...,
    ) -> None: ...
