"""The services of metaros_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class SetMode_Request(Message):
    mode: str
    def __init__(
        self,
        *,
        mode: str = ...,
    ) -> None: ...

class SetMode_Response(Message):
    success: bool
    message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        message: str = ...,
    ) -> None: ...

class SetMode_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetMode_Request]
    response: list[SetMode_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetMode_Request] = ...,
        response: list[SetMode_Response] = ...,
    ) -> None: ...

class SetMode(Service):
    Request = SetMode_Request
    Response = SetMode_Response
    Event = SetMode_Event
