"""The services of type_description_interfaces."""

from metaros.idl import Message, Service
from metaros.interfaces.service_msgs import msg as service_msgs_msg
from metaros.interfaces.type_description_interfaces import msg as type_description_interfaces_msg

class GetTypeDescription_Request(Message):
    type_name: str
    type_hash: str
    include_type_sources: bool
    def __init__(
        self,
        *,
        type_name: str = ...,
        type_hash: str = ...,
        include_type_sources: bool = ...,
    ) -> None: ...

class GetTypeDescription_Response(Message):
    successful: bool
    failure_reason: str
    type_description: type_description_interfaces_msg.TypeDescription
    type_sources: list[type_description_interfaces_msg.TypeSource]
    extra_information: list[type_description_interfaces_msg.KeyValue]
    def __init__(
        self,
        *,
        successful: bool = ...,
        failure_reason: str = ...,
        type_description: type_description_interfaces_msg.TypeDescription = ...,
        type_sources: list[type_description_interfaces_msg.TypeSource] = ...,
        extra_information: list[type_description_interfaces_msg.KeyValue] = ...,
    ) -> None: ...

class GetTypeDescription_Event(Message):
    info: service_msgs_msg.ServiceEventInfo
    request: list[GetTypeDescription_Request]
    response: list[GetTypeDescription_Response]
    def __init__(
        self,
        *,
        info: service_msgs_msg.ServiceEventInfo = ...,
        request: list[GetTypeDescription_Request] = ...,
        response: list[GetTypeDescription_Response] = ...,
    ) -> None: ...

class GetTypeDescription(Service):
    Request = GetTypeDescription_Request
    Response = GetTypeDescription_Response
    Event = GetTypeDescription_Event
