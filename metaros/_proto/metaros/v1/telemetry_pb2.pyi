from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

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
