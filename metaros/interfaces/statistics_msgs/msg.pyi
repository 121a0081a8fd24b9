"""The messages of statistics_msgs."""

from typing import Final

from metaros.idl import Message
from metaros.interfaces.builtin_interfaces import msg as builtin_interfaces_msg

class MetricsMessage(Message):
    measurement_source_name: str
    metrics_source: str
    unit: str
    window_start: builtin_interfaces_msg.Time
    window_stop: builtin_interfaces_msg.Time
    statistics: list[StatisticDataPoint]
    def __init__(
        self,
        *,
        measurement_source_name: str = ...,
        metrics_source: str = ...,
        unit: str = ...,
        window_start: builtin_interfaces_msg.Time = ...,
        window_stop: builtin_interfaces_msg.Time = ...,
        statistics: list[StatisticDataPoint] = ...,
    ) -> None: ...

class StatisticDataPoint(Message):
    data_type: int
    data: float
    def __init__(
        self,
        *,
        data_type: int = ...,
        data: float = ...,
    ) -> None: ...

class StatisticDataType(Message):
    STATISTICS_DATA_TYPE_UNINITIALIZED: Final = 0
    STATISTICS_DATA_TYPE_AVERAGE: Final = 1
    STATISTICS_DATA_TYPE_MINIMUM: Final = 2
    STATISTICS_DATA_TYPE_MAXIMUM: Final = 3
    STATISTICS_DATA_TYPE_STDDEV: Final = 4
    STATISTICS_DATA_TYPE_SAMPLE_COUNT: Final = 5
