from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ListRobotsRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListRobotsResponse(_message.Message):
    __slots__ = ("robots",)
    ROBOTS_FIELD_NUMBER: _ClassVar[int]
    robots: _containers.RepeatedCompositeFieldContainer[FleetRobot]
    def __init__(self, robots: _Optional[_Iterable[_Union[FleetRobot, _Mapping]]] = ...) -> None: ...

class GetRobotRequest(_message.Message):
    __slots__ = ("robot",)
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    robot: str
    def __init__(self, robot: _Optional[str] = ...) -> None: ...

class FleetRobot(_message.Message):
    __slots__ = ("robot", "namespace", "hostname", "agent_version", "online", "labels", "lease_holder")
    class LabelsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    NAMESPACE_FIELD_NUMBER: _ClassVar[int]
    HOSTNAME_FIELD_NUMBER: _ClassVar[int]
    AGENT_VERSION_FIELD_NUMBER: _ClassVar[int]
    ONLINE_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    LEASE_HOLDER_FIELD_NUMBER: _ClassVar[int]
    robot: str
    namespace: str
    hostname: str
    agent_version: str
    online: bool
    labels: _containers.ScalarMap[str, str]
    lease_holder: str
    def __init__(self, robot: _Optional[str] = ..., namespace: _Optional[str] = ..., hostname: _Optional[str] = ..., agent_version: _Optional[str] = ..., online: _Optional[bool] = ..., labels: _Optional[_Mapping[str, str]] = ..., lease_holder: _Optional[str] = ...) -> None: ...

class SendCommandRequest(_message.Message):
    __slots__ = ("robot", "kind", "request_json", "durable", "expires_s", "timeout_s", "idempotency_key", "wait_s", "sent_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    REQUEST_JSON_FIELD_NUMBER: _ClassVar[int]
    DURABLE_FIELD_NUMBER: _ClassVar[int]
    EXPIRES_S_FIELD_NUMBER: _ClassVar[int]
    TIMEOUT_S_FIELD_NUMBER: _ClassVar[int]
    IDEMPOTENCY_KEY_FIELD_NUMBER: _ClassVar[int]
    WAIT_S_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    kind: str
    request_json: str
    durable: bool
    expires_s: float
    timeout_s: float
    idempotency_key: str
    wait_s: float
    sent_ns: int
    def __init__(self, robot: _Optional[str] = ..., kind: _Optional[str] = ..., request_json: _Optional[str] = ..., durable: _Optional[bool] = ..., expires_s: _Optional[float] = ..., timeout_s: _Optional[float] = ..., idempotency_key: _Optional[str] = ..., wait_s: _Optional[float] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class GetCommandRequest(_message.Message):
    __slots__ = ("command",)
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    command: str
    def __init__(self, command: _Optional[str] = ...) -> None: ...

class FleetCommand(_message.Message):
    __slots__ = ("command", "robot", "kind", "state", "durable", "issued_by", "request_json", "result_json", "code", "message", "issued_ns", "expires_ns", "delivered_ns", "running_ns", "ended_ns")
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    DURABLE_FIELD_NUMBER: _ClassVar[int]
    ISSUED_BY_FIELD_NUMBER: _ClassVar[int]
    REQUEST_JSON_FIELD_NUMBER: _ClassVar[int]
    RESULT_JSON_FIELD_NUMBER: _ClassVar[int]
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    ISSUED_NS_FIELD_NUMBER: _ClassVar[int]
    EXPIRES_NS_FIELD_NUMBER: _ClassVar[int]
    DELIVERED_NS_FIELD_NUMBER: _ClassVar[int]
    RUNNING_NS_FIELD_NUMBER: _ClassVar[int]
    ENDED_NS_FIELD_NUMBER: _ClassVar[int]
    command: str
    robot: str
    kind: str
    state: str
    durable: bool
    issued_by: str
    request_json: str
    result_json: str
    code: str
    message: str
    issued_ns: int
    expires_ns: int
    delivered_ns: int
    running_ns: int
    ended_ns: int
    def __init__(self, command: _Optional[str] = ..., robot: _Optional[str] = ..., kind: _Optional[str] = ..., state: _Optional[str] = ..., durable: _Optional[bool] = ..., issued_by: _Optional[str] = ..., request_json: _Optional[str] = ..., result_json: _Optional[str] = ..., code: _Optional[str] = ..., message: _Optional[str] = ..., issued_ns: _Optional[int] = ..., expires_ns: _Optional[int] = ..., delivered_ns: _Optional[int] = ..., running_ns: _Optional[int] = ..., ended_ns: _Optional[int] = ...) -> None: ...

class AcquireLeaseRequest(_message.Message):
    __slots__ = ("robot", "holder")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    robot: str
    holder: str
    def __init__(self, robot: _Optional[str] = ..., holder: _Optional[str] = ...) -> None: ...

class RenewLeaseRequest(_message.Message):
    __slots__ = ("robot", "lease_id")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    robot: str
    lease_id: str
    def __init__(self, robot: _Optional[str] = ..., lease_id: _Optional[str] = ...) -> None: ...

class ReleaseLeaseRequest(_message.Message):
    __slots__ = ("robot", "lease_id")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    robot: str
    lease_id: str
    def __init__(self, robot: _Optional[str] = ..., lease_id: _Optional[str] = ...) -> None: ...

class ReleaseLeaseResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class FleetLease(_message.Message):
    __slots__ = ("robot", "lease_id", "topic", "valid_ms")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    VALID_MS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    lease_id: str
    topic: str
    valid_ms: int
    def __init__(self, robot: _Optional[str] = ..., lease_id: _Optional[str] = ..., topic: _Optional[str] = ..., valid_ms: _Optional[int] = ...) -> None: ...

class DriveRequest(_message.Message):
    __slots__ = ("robot", "holder", "linear", "angular", "sent_ns")
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    LINEAR_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_FIELD_NUMBER: _ClassVar[int]
    SENT_NS_FIELD_NUMBER: _ClassVar[int]
    robot: str
    holder: str
    linear: float
    angular: float
    sent_ns: int
    def __init__(self, robot: _Optional[str] = ..., holder: _Optional[str] = ..., linear: _Optional[float] = ..., angular: _Optional[float] = ..., sent_ns: _Optional[int] = ...) -> None: ...

class DriveReply(_message.Message):
    __slots__ = ("lease_id", "valid_ms", "rtt_ms")
    LEASE_ID_FIELD_NUMBER: _ClassVar[int]
    VALID_MS_FIELD_NUMBER: _ClassVar[int]
    RTT_MS_FIELD_NUMBER: _ClassVar[int]
    lease_id: str
    valid_ms: int
    rtt_ms: float
    def __init__(self, lease_id: _Optional[str] = ..., valid_ms: _Optional[int] = ..., rtt_ms: _Optional[float] = ...) -> None: ...
