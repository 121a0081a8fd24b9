from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Encoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ENCODING_CDR: _ClassVar[Encoding]
    ENCODING_JSON: _ClassVar[Encoding]
ENCODING_CDR: Encoding
ENCODING_JSON: Encoding

class SubscribeRequest(_message.Message):
    __slots__ = ("robots", "topics", "series", "max_rate_hz", "latest", "queue_bytes", "encoding")
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    SERIES_FIELD_NUMBER: _ClassVar[int]
    MAX_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    LATEST_FIELD_NUMBER: _ClassVar[int]
    QUEUE_BYTES_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    robots: _containers.RepeatedScalarFieldContainer[str]
    topics: _containers.RepeatedScalarFieldContainer[str]
    series: _containers.RepeatedScalarFieldContainer[str]
    max_rate_hz: float
    latest: bool
    queue_bytes: int
    encoding: Encoding
    def __init__(self, robots: _Optional[_Iterable[str]] = ..., topics: _Optional[_Iterable[str]] = ..., series: _Optional[_Iterable[str]] = ..., max_rate_hz: _Optional[float] = ..., latest: _Optional[bool] = ..., queue_bytes: _Optional[int] = ..., encoding: _Optional[_Union[Encoding, str]] = ...) -> None: ...

class SubscribeReply(_message.Message):
    __slots__ = ("channel", "samples", "info", "values", "dropped")
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    INFO_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    DROPPED_FIELD_NUMBER: _ClassVar[int]
    channel: int
    samples: _containers.RepeatedCompositeFieldContainer[Sample]
    info: ChannelInfo
    values: _containers.RepeatedCompositeFieldContainer[SeriesValues]
    dropped: int
    def __init__(self, channel: _Optional[int] = ..., samples: _Optional[_Iterable[_Union[Sample, _Mapping]]] = ..., info: _Optional[_Union[ChannelInfo, _Mapping]] = ..., values: _Optional[_Iterable[_Union[SeriesValues, _Mapping]]] = ..., dropped: _Optional[int] = ...) -> None: ...

class ChannelInfo(_message.Message):
    __slots__ = ("channel", "robot", "topic", "type_name", "type_hash", "encoding", "schema_encoding", "schema")
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    TYPE_HASH_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_ENCODING_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_FIELD_NUMBER: _ClassVar[int]
    channel: int
    robot: str
    topic: str
    type_name: str
    type_hash: str
    encoding: str
    schema_encoding: str
    schema: bytes
    def __init__(self, channel: _Optional[int] = ..., robot: _Optional[str] = ..., topic: _Optional[str] = ..., type_name: _Optional[str] = ..., type_hash: _Optional[str] = ..., encoding: _Optional[str] = ..., schema_encoding: _Optional[str] = ..., schema: _Optional[bytes] = ...) -> None: ...

class Sample(_message.Message):
    __slots__ = ("channel", "seq", "stamp_ns", "receive_ns", "cdr", "json", "undecoded")
    CHANNEL_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    RECEIVE_NS_FIELD_NUMBER: _ClassVar[int]
    CDR_FIELD_NUMBER: _ClassVar[int]
    JSON_FIELD_NUMBER: _ClassVar[int]
    UNDECODED_FIELD_NUMBER: _ClassVar[int]
    channel: int
    seq: int
    stamp_ns: int
    receive_ns: int
    cdr: bytes
    json: str
    undecoded: str
    def __init__(self, channel: _Optional[int] = ..., seq: _Optional[int] = ..., stamp_ns: _Optional[int] = ..., receive_ns: _Optional[int] = ..., cdr: _Optional[bytes] = ..., json: _Optional[str] = ..., undecoded: _Optional[str] = ...) -> None: ...

class SeriesValues(_message.Message):
    __slots__ = ("robot", "stamp_ns", "values")
    class ValuesEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    STAMP_NS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    robot: str
    stamp_ns: int
    values: _containers.ScalarMap[str, float]
    def __init__(self, robot: _Optional[str] = ..., stamp_ns: _Optional[int] = ..., values: _Optional[_Mapping[str, float]] = ...) -> None: ...

class QueryRequest(_message.Message):
    __slots__ = ("robot", "topics", "start", "end", "limit", "newest_first", "encoding", "cursor")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOPICS_FIELD_NUMBER: _ClassVar[int]
    START_FIELD_NUMBER: _ClassVar[int]
    END_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    NEWEST_FIRST_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    CURSOR_FIELD_NUMBER: _ClassVar[int]
    robot: str
    topics: _containers.RepeatedScalarFieldContainer[str]
    start: str
    end: str
    limit: int
    newest_first: bool
    encoding: Encoding
    cursor: str
    def __init__(self, robot: _Optional[str] = ..., topics: _Optional[_Iterable[str]] = ..., start: _Optional[str] = ..., end: _Optional[str] = ..., limit: _Optional[int] = ..., newest_first: _Optional[bool] = ..., encoding: _Optional[_Union[Encoding, str]] = ..., cursor: _Optional[str] = ...) -> None: ...

class QueryReply(_message.Message):
    __slots__ = ("channels", "samples", "gaps", "cursor")
    CHANNELS_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    GAPS_FIELD_NUMBER: _ClassVar[int]
    CURSOR_FIELD_NUMBER: _ClassVar[int]
    channels: _containers.RepeatedCompositeFieldContainer[ChannelInfo]
    samples: _containers.RepeatedCompositeFieldContainer[Sample]
    gaps: _containers.RepeatedCompositeFieldContainer[StoredGap]
    cursor: str
    def __init__(self, channels: _Optional[_Iterable[_Union[ChannelInfo, _Mapping]]] = ..., samples: _Optional[_Iterable[_Union[Sample, _Mapping]]] = ..., gaps: _Optional[_Iterable[_Union[StoredGap, _Mapping]]] = ..., cursor: _Optional[str] = ...) -> None: ...

class StoredGap(_message.Message):
    __slots__ = ("topic", "from_ns", "to_ns", "count", "reason")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    FROM_NS_FIELD_NUMBER: _ClassVar[int]
    TO_NS_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    topic: str
    from_ns: int
    to_ns: int
    count: int
    reason: str
    def __init__(self, topic: _Optional[str] = ..., from_ns: _Optional[int] = ..., to_ns: _Optional[int] = ..., count: _Optional[int] = ..., reason: _Optional[str] = ...) -> None: ...

class PublishRequest(_message.Message):
    __slots__ = ("robot", "topic", "type_name", "cdr", "json", "lease_id", "sent_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    CDR_FIELD_NUMBER: _ClassVar[int]
    JSON_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    topic: str
    type_name: str
    cdr: bytes
    json: str
    lease_id: str
    sent_ns: int
    def __init__(self, robot: _Optional[str] = ..., topic: _Optional[str] = ..., type_name: _Optional[str] = ..., cdr: _Optional[bytes] = ..., json: _Optional[str] = ..., lease_id: _Optional[str] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class PublishResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class CallServiceRequest(_message.Message):
    __slots__ = ("robot", "service", "type_name", "json", "timeout_s", "lease_id", "sent_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    SERVICE_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    JSON_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    service: str
    type_name: str
    json: str
    timeout_s: float
    lease_id: str
    sent_ns: int
    def __init__(self, robot: _Optional[str] = ..., service: _Optional[str] = ..., type_name: _Optional[str] = ..., json: _Optional[str] = ..., timeout_s: _Optional[float] = ..., lease_id: _Optional[str] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class CallServiceResponse(_message.Message):
    __slots__ = ("json",)
    JSON_FIELD_NUMBER: _ClassVar[int]
    json: str
    def __init__(self, json: _Optional[str] = ...) -> None: ...

class SendGoalRequest(_message.Message):
    __slots__ = ("robot", "action", "type_name", "json", "timeout_s", "lease_id", "sent_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    TYPE_NAME_FIELD_NUMBER: _ClassVar[int]
    JSON_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    action: str
    type_name: str
    json: str
    timeout_s: float
    lease_id: str
    sent_ns: int
    def __init__(self, robot: _Optional[str] = ..., action: _Optional[str] = ..., type_name: _Optional[str] = ..., json: _Optional[str] = ..., timeout_s: _Optional[float] = ..., lease_id: _Optional[str] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class WatchGoalRequest(_message.Message):
    __slots__ = ("robot", "goal")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    robot: str
    goal: str
    def __init__(self, robot: _Optional[str] = ..., goal: _Optional[str] = ...) -> None: ...

class GoalReply(_message.Message):
    __slots__ = ("goal", "kind", "status", "json", "message")
    GOAL_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    JSON_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    goal: str
    kind: str
    status: str
    json: str
    message: str
    def __init__(self, goal: _Optional[str] = ..., kind: _Optional[str] = ..., status: _Optional[str] = ..., json: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class CancelGoalRequest(_message.Message):
    __slots__ = ("robot", "goal")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    GOAL_FIELD_NUMBER: _ClassVar[int]
    robot: str
    goal: str
    def __init__(self, robot: _Optional[str] = ..., goal: _Optional[str] = ...) -> None: ...

class CancelGoalResponse(_message.Message):
    __slots__ = ("canceling",)
    CANCELING_FIELD_NUMBER: _ClassVar[int]
    canceling: bool
    def __init__(self, canceling: _Optional[bool] = ...) -> None: ...
