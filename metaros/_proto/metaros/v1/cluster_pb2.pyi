from metaros._proto.metaros.v1 import link_pb2 as _link_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Mirror(_message.Message):
    __slots__ = ("anew", "whole", "schemas", "robots")
    ANEW_FIELD_NUMBER: _ClassVar[int]
    WHOLE_FIELD_NUMBER: _ClassVar[int]
    SCHEMAS_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    anew: bool
    whole: bool
    schemas: _containers.RepeatedScalarFieldContainer[bytes]
    robots: _containers.RepeatedCompositeFieldContainer[MirroredRobot]
    def __init__(self, anew: _Optional[bool] = ..., whole: _Optional[bool] = ..., schemas: _Optional[_Iterable[bytes]] = ..., robots: _Optional[_Iterable[_Union[MirroredRobot, _Mapping]]] = ...) -> None: ...

class MirroredRobot(_message.Message):
    __slots__ = ("robot", "gone", "introduction", "channels", "series", "values", "state", "statistics", "counts")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    GONE_FIELD_NUMBER: _ClassVar[int]
    INTRODUCTION_FIELD_NUMBER: _ClassVar[int]
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    STATISTICS_FIELD_NUMBER: _ClassVar[int]
    COUNTS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    gone: bool
    introduction: Introduction
    channels: _containers.RepeatedCompositeFieldContainer[_link_pb2.Channel]
    series: _containers.RepeatedCompositeFieldContainer[_link_pb2.Series]
    values: _link_pb2.MetricBatch
    state: MirroredState
    statistics: _link_pb2.TopicStatistics
    counts: _containers.RepeatedCompositeFieldContainer[TopicCount]
    def __init__(self, robot: _Optional[str] = ..., gone: _Optional[bool] = ..., introduction: _Optional[_Union[Introduction, _Mapping]] = ..., channels: _Optional[_Iterable[_Union[_link_pb2.Channel, _Mapping]]] = ..., series: _Optional[_Iterable[_Union[_link_pb2.Series, _Mapping]]] = ..., values: _Optional[_Union[_link_pb2.MetricBatch, _Mapping]] = ..., state: _Optional[_Union[MirroredState, _Mapping]] = ..., statistics: _Optional[_Union[_link_pb2.TopicStatistics, _Mapping]] = ..., counts: _Optional[_Iterable[_Union[TopicCount, _Mapping]]] = ...) -> None: ...

class Introduction(_message.Message):
    __slots__ = ("session_number", "namespace", "hostname", "agent_version", "labels", "since_ns", "generation")
    class LabelsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    SESSION_NUMBER_FIELD_NUMBER: _ClassVar[int]
    NAMESPACE_FIELD_NUMBER: _ClassVar[int]
    HOSTNAME_FIELD_NUMBER: _ClassVar[int]
    AGENT_VERSION_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    GENERATION_FIELD_NUMBER: _ClassVar[int]
    session_number: int
    namespace: str
    hostname: str
    agent_version: str
    labels: _containers.ScalarMap[str, str]
    since_ns: int
    generation: int
    def __init__(self, session_number: _Optional[int] = ..., namespace: _Optional[str] = ..., hostname: _Optional[str] = ..., agent_version: _Optional[str] = ..., labels: _Optional[_Mapping[str, str]] = ..., since_ns: _Optional[int] = ..., generation: _Optional[int] = ...) -> None: ...

class MirroredState(_message.Message):
    __slots__ = ("last_seen_ns", "rtt_s", "lag_ns", "bytes_per_s", "samples", "bytes", "duplicates", "gaps", "lost", "over_quota", "put_off", "forks", "epochs")
    LAST_SEEN_NS_FIELD_NUMBER: _ClassVar[int]
    RTT_S_FIELD_NUMBER: _ClassVar[int]
    LAG_NS_FIELD_NUMBER: _ClassVar[int]
    BYTES_PER_S_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    DUPLICATES_FIELD_NUMBER: _ClassVar[int]
    GAPS_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    OVER_QUOTA_FIELD_NUMBER: _ClassVar[int]
    PUT_OFF_FIELD_NUMBER: _ClassVar[int]
    FORKS_FIELD_NUMBER: _ClassVar[int]
    EPOCHS_FIELD_NUMBER: _ClassVar[int]
    last_seen_ns: int
    rtt_s: float
    lag_ns: int
    bytes_per_s: float
    samples: int
    bytes: int
    duplicates: int
    gaps: int
    lost: int
    over_quota: int
    put_off: int
    forks: int
    epochs: int
    def __init__(self, last_seen_ns: _Optional[int] = ..., rtt_s: _Optional[float] = ..., lag_ns: _Optional[int] = ..., bytes_per_s: _Optional[float] = ..., samples: _Optional[int] = ..., bytes: _Optional[int] = ..., duplicates: _Optional[int] = ..., gaps: _Optional[int] = ..., lost: _Optional[int] = ..., over_quota: _Optional[int] = ..., put_off: _Optional[int] = ..., forks: _Optional[int] = ..., epochs: _Optional[int] = ...) -> None: ...

class TopicCount(_message.Message):
    __slots__ = ("channel_id", "received", "received_bytes", "lost", "last_stamp_ns")
    CHANNEL_ID_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    RECEIVED_BYTES_FIELD_NUMBER: _ClassVar[int]
    LOST_FIELD_NUMBER: _ClassVar[int]
    LAST_STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    channel_id: int
    received: int
    received_bytes: int
    lost: int
    last_stamp_ns: int
    def __init__(self, channel_id: _Optional[int] = ..., received: _Optional[int] = ..., received_bytes: _Optional[int] = ..., lost: _Optional[int] = ..., last_stamp_ns: _Optional[int] = ...) -> None: ...

class MirrorAgain(_message.Message):
    __slots__ = ("robots",)
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    robots: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, robots: _Optional[_Iterable[str]] = ...) -> None: ...

class Interest(_message.Message):
    __slots__ = ("anew", "robots")
    ANEW_FIELD_NUMBER: _ClassVar[int]
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    anew: bool
    robots: _containers.RepeatedCompositeFieldContainer[RobotInterest]
    def __init__(self, anew: _Optional[bool] = ..., robots: _Optional[_Iterable[_Union[RobotInterest, _Mapping]]] = ...) -> None: ...

class RobotInterest(_message.Message):
    __slots__ = ("robot", "topics")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    topics: _containers.RepeatedCompositeFieldContainer[TopicInterest]
    def __init__(self, robot: _Optional[str] = ..., topics: _Optional[_Iterable[_Union[TopicInterest, _Mapping]]] = ...) -> None: ...

class TopicInterest(_message.Message):
    __slots__ = ("topic", "max_rate_hz")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    MAX_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    topic: str
    max_rate_hz: float
    def __init__(self, topic: _Optional[str] = ..., max_rate_hz: _Optional[float] = ...) -> None: ...

class KeyFrameWanted(_message.Message):
    __slots__ = ("robot", "topic")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    robot: str
    topic: str
    def __init__(self, robot: _Optional[str] = ..., topic: _Optional[str] = ...) -> None: ...

class Forwarded(_message.Message):
    __slots__ = ("runs",)
    RUNS_FIELD_NUMBER: _ClassVar[int]
    runs: _containers.RepeatedCompositeFieldContainer[ForwardedRun]
    def __init__(self, runs: _Optional[_Iterable[_Union[ForwardedRun, _Mapping]]] = ...) -> None: ...

class ForwardedRun(_message.Message):
    __slots__ = ("robot", "generation", "receive_ns", "batch")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    GENERATION_FIELD_NUMBER: _ClassVar[int]
    RECEIVE_NS_FIELD_NUMBER: _ClassVar[int]
    BATCH_FIELD_NUMBER: _ClassVar[int]
    robot: str
    generation: int
    receive_ns: int
    batch: _link_pb2.Batch
    def __init__(self, robot: _Optional[str] = ..., generation: _Optional[int] = ..., receive_ns: _Optional[int] = ..., batch: _Optional[_Union[_link_pb2.Batch, _Mapping]] = ...) -> None: ...
