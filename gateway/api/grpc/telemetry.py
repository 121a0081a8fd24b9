"""TelemetryService: what robots say and what is said to them; every call has passed the gate, see serving.py."""

from __future__ import annotations

from typing import Any

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import document, stamp, text_of
from gateway.fleet.orders import Order
from metaros._proto import telemetry_pb2
from metaros.limits import LIMITS

__all__ = ["TelemetryService"]


class TelemetryService:
    """Each method is one call that was let in."""

    async def Publish(self, request: telemetry_pb2.PublishRequest, call: Call) -> Any:
        """Publish once; ends after the agent's result."""
        call.require(request.robot)
        cdr = request.cdr if request.WhichOneof("message") == "cdr" else None
        message = document(request.json, "json") if cdr is None else None
        asked: dict[str, Any] = {"topic": request.topic, "type": request.type_name}
        asked |= {"message": message} if cdr is None else {"cdr_bytes": len(cdr)}
        order = Order(robot=request.robot, kind="publish", request=asked)
        with call.services.orders.noted(order, call.principal):
            await call.services.fleet.publish(
                request.robot,
                request.topic,
                type_name=request.type_name,
                message=message,
                cdr=cdr,
                size_hint_bytes=len(request.json),
                lease_id=request.lease_id,
                sent_ns=stamp(request.sent_ns),
            )
        return telemetry_pb2.PublishResponse()

    async def CallService(self, request: telemetry_pb2.CallServiceRequest, call: Call) -> Any:
        """Call a service of the robot."""
        call.require(request.robot)
        timeout_s = request.timeout_s or LIMITS.command_timeout_s
        value = document(request.json, "json")
        asked = {"service": request.service, "type": request.type_name, "request": value}
        order = Order(robot=request.robot, kind="call_service", request=asked, timeout_s=timeout_s)
        with call.services.orders.noted(order, call.principal) as noted:
            noted.result = await call.services.fleet.call(
                request.robot,
                request.service,
                type_name=request.type_name,
                request=value,
                timeout_s=timeout_s,
                lease_id=request.lease_id,
                sent_ns=stamp(request.sent_ns),
            )
        return telemetry_pb2.CallServiceResponse(json=text_of(noted.result))
