"""The services of sensor_msgs."""

from metaros.idl import Message, Service
from metaros.interfaces.sensor_msgs import msg as sensor_msgs_msg
from metaros.interfaces.service_msgs import msg as service_msgs_msg

class SetCameraInfo_Request(Message):
    camera_info: sensor_msgs_msg.CameraInfo
    def __init__(
        self,
        *,
        camera_info: sensor_msgs_msg.CameraInfo = ...,
    ) -> None: ...

class SetCameraInfo_Response(Message):
    success: bool
    status_message: str
    def __init__(
        self,
        *,
        success: bool = ...,
        status_message: str = ...,
    ) -> None: ...

class SetCameraInfo_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[SetCameraInfo_Request]
    response: list[SetCameraInfo_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[SetCameraInfo_Request] = ...,
        response: list[SetCameraInfo_Response] = ...,
    ) -> None: ...

class SetCameraInfo(Service):
    Request = SetCameraInfo_Request
    Response = SetCameraInfo_Response
    Event = SetCameraInfo_Event
