# ruff: noqa: A002
"""The services of diagnostic_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.diagnostic_msgs import msg as diagnostic_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class AddDiagnostics_Request(Message):
    load_namespace: str
    def __init__(
        self,
        *,
        load_namespace: str = ...,
    ) -> None: ...

class AddDiagnostics_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class AddDiagnostics_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[AddDiagnostics_Request]
    response: list[AddDiagnostics_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[AddDiagnostics_Request] = ...,
        response: list[AddDiagnostics_Response] = ...,
    ) -> None: ...

class AddDiagnostics(Service):
    Request = AddDiagnostics_Request
    Response = AddDiagnostics_Response
    Event = AddDiagnostics_Event

class SelfTest_Request(Message): ...

class SelfTest_Response(Message):
    id: str
    passed: int
    status: list[diagnostic_msgs_msg.DiagnosticStatus]
    def __init__(
        self,
        *,
        id: str = ...,
        passed: int = ...,
        status: list[diagnostic_msgs_msg.DiagnosticStatus] = ...,
    ) -> None: ...

class SelfTest_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SelfTest_Request]
    response: list[SelfTest_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SelfTest_Request] = ...,
        response: list[SelfTest_Response] = ...,
    ) -> None: ...

class SelfTest(Service):
    Request = SelfTest_Request
    Response = SelfTest_Response
    Event = SelfTest_Event
