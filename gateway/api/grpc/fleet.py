"""FleetService: what REST does, for programs; every call is authorized, see serving.py."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import document, speed, stamp
from gateway.api.grpc.stream_authorization import while_authorized
from gateway.api.rest.fleet.orders import check_kind, seen_command
from gateway.domain.fleet.command import Command
from gateway.domain.fleet.lease import Lease
from gateway.fleet.command_manager import NewCommand
from gateway.fleet.lease_manager import HeldLease
from gateway.ingest.registry import RobotRecord
from metaros._proto import fleet_pb2
from metaros.limits import LIMITS

__all__ = ["FleetService"]


class FleetService:
    """Each method is one call that was let in."""

    async def ListRobots(self, request: fleet_pb2.ListRobotsRequest, call: Call) -> Any:
        """Every robot in scope, by id."""
        records = [item for item in call.services.registry.all() if call.principal.sees(item.robot.id)]
        return fleet_pb2.ListRobotsResponse(robots=[robot_view(call, item) for item in records])

    async def GetRobot(self, request: fleet_pb2.GetRobotRequest, call: Call) -> Any:
        """One robot."""
        call.require(request.robot)
        return robot_view(call, call.services.registry.get(request.robot))

    async def SendCommand(self, request: fleet_pb2.SendCommandRequest, call: Call) -> Any:
        """As POST /api/v1/robots/ROBOT/commands."""
        call.require(request.robot)
        check_kind(request.kind, call.principal)
        order = NewCommand(
            robot=request.robot,
            kind=request.kind,
            request=document(request.request_json, "request_json"),
            durable=request.durable,
            expires_s=request.expires_s or LIMITS.command_expires_s,
            timeout_s=request.timeout_s or LIMITS.command_timeout_s,
            idempotency=request.idempotency_key or None,
            sent_ns=stamp(request.sent_ns),
        )
        command = await call.services.command_manager.send(order, call.principal)
        call.detail = f"{command.id} {command.kind} {command.state}"
        if request.wait_s > 0 and not command.over:
            command = await call.services.command_manager.wait(command.id, request.wait_s)
        return command_view(command)

    async def GetCommand(self, request: fleet_pb2.GetCommandRequest, call: Call) -> Any:
        """One command."""
        return command_view(await seen_command(call.services, call.principal, request.command))

    async def WatchCommand(self, request: fleet_pb2.GetCommandRequest, call: Call) -> AsyncIterator[Any]:
        """The command as it is, then at each change, until it is over."""
        await seen_command(call.services, call.principal, request.command)
        async with while_authorized(call):
            async for command in call.services.command_manager.watch(request.command):
                yield command_view(command)

    async def AcquireLease(self, request: fleet_pb2.AcquireLeaseRequest, call: Call) -> Any:
        """Take the robot's lease; it ends by itself unless it is renewed."""
        call.require(request.robot)
        drive = await call.services.teleop.take(request.robot, request.holder)
        return lease_view(drive.robot, drive.lease_id, drive.topic)

    async def RenewLease(self, request: fleet_pb2.RenewLeaseRequest, call: Call) -> Any:
        """More time for the lease."""
        call.require(request.robot)
        lease: Lease = await call.services.teleop.renew(request.robot, request.lease_id)
        return lease_view(lease.robot, lease.lease_id, "")

    async def ReleaseLease(self, request: fleet_pb2.ReleaseLeaseRequest, call: Call) -> Any:
        """Stop the robot and give the lease back."""
        call.require(request.robot)
        await call.services.teleop.end(request.robot, request.lease_id)
        return fleet_pb2.ReleaseLeaseResponse()

    async def Drive(self, requests: AsyncIterator[fleet_pb2.DriveRequest], call: Call) -> AsyncIterator[Any]:
        """Drive while messages come; whatever the end, the robot is stopped and the lease given back."""
        async with while_authorized(call):
            drive: HeldLease | None = None
            me = object()  # a bucket of its own
            try:
                async for request in requests:
                    call.services.rates.take("messages", me)
                    if drive is None:
                        call.require(request.robot)
                        drive = await call.services.teleop.take(request.robot, request.holder)
                    await call.services.teleop.drive(
                        drive,
                        linear=speed(request.linear, "linear"),
                        angular=speed(request.angular, "angular"),
                        sent_ns=stamp(request.sent_ns),
                    )
                    rtt_ms = call.services.teleop.rtt_ms(drive.robot) or 0.0
                    yield fleet_pb2.DriveReply(
                        lease_id=drive.lease_id, valid_ms=round(LIMITS.lease_s * 1000), rtt_ms=rtt_ms
                    )
            finally:
                if drive is not None:
                    await asyncio.shield(call.services.teleop.release(drive))


def robot_view(call: Call, record: RobotRecord) -> fleet_pb2.FleetRobot:
    """A robot as this API shows it."""
    lease = call.services.leases.holder_of(record.robot.id, now_s=call.services.clock.monotonic_s())
    return fleet_pb2.FleetRobot(
        robot=record.robot.id,
        namespace=record.robot.namespace,
        hostname=record.robot.hostname,
        agent_version=record.robot.agent_version,
        online=record.online,
        labels=dict(record.robot.labels),
        lease_holder=lease.holder if lease is not None else "",
    )


def command_view(item: Command) -> fleet_pb2.FleetCommand:
    """A command as this API shows it."""
    return fleet_pb2.FleetCommand(
        command=item.id,
        robot=item.robot,
        kind=item.kind,
        state=item.state,
        durable=item.durable,
        issued_by=item.issued_by,
        request_json=item.request,
        result_json=item.result,
        code=item.code,
        message=item.message,
        issued_ns=item.issued_ns,
        expires_ns=item.expires_ns,
        delivered_ns=item.delivered_ns,
        running_ns=item.running_ns,
        ended_ns=item.ended_ns,
    )


def lease_view(robot: str, lease_id: str, topic: str) -> fleet_pb2.FleetLease:
    """A lease for who took it."""
    return fleet_pb2.FleetLease(robot=robot, lease_id=lease_id, topic=topic, valid_ms=round(LIMITS.lease_s * 1000))
