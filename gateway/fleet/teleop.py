"""Teleoperation: the lease, drive commands under it, and the stop that ends it.

The gateway is neither of the two watchdogs (design D13): when drive commands stop coming, the agent and the base stop
the robot by themselves. What the gateway adds is the lease, and a zero command as soon as it knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from gateway.domain.fleet.lease import Lease, LeaseTable
from gateway.errors import InvalidRequestError, RobotError
from gateway.fleet.command_dispatcher import CommandDispatcher
from gateway.fleet.lease_manager import HeldLease, LeaseManager
from gateway.fleet.robots import FindRobot, RobotView, SendFrame
from gateway.fleet.ros.graph import RobotGraph
from gateway.fleet.ros.types import TypeRegistry
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["TWIST", "TWIST_STAMPED", "TeleopManager"]

TWIST = "geometry_msgs/msg/Twist"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"


class TeleopManager(LeaseManager):
    """Takes, keeps and ends drives; lives on the event loop."""

    topic = "cmd_vel"

    def __init__(
        self, find: FindRobot, commands: CommandDispatcher, leases: LeaseTable, send: SendFrame, *, clock: Clock
    ) -> None:
        super().__init__(find, commands, leases, send, clock=clock)
        self._types = TypeRegistry()
        self._graph_of: Callable[[str], RobotGraph] = lambda robot_id: RobotGraph(robot=robot_id)

    def use_graphs(self, graph_of: Callable[[str], RobotGraph]) -> None:
        """Where robots' subscriptions are told, with their types."""
        self._graph_of = graph_of

    async def drive(self, drive: HeldLease, *, linear: float, angular: float, sent_ns: int = 0) -> Lease:
        """Send one drive command (m/s, rad/s) and renew the lease; a lease that lapsed unclaimed is taken again.

        `sent_ns` is the driver's wall clock when it was made, 0 = now: the agent drops what is too old.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            raise InvalidRequestError("linear and angular are finite numbers")
        lease = await self._renewed(drive)
        self._command(drive, linear, angular, sent_ns=sent_ns)
        return lease

    def stop(self, drive: HeldLease) -> None:
        """A zero command, if the robot can still be told."""
        if not drive.lost:
            try:
                self._command(drive, 0.0, 0.0)
            except RobotError:
                drive.gone.set()

    def _granting(self, grant: link_pb2.GrantLease) -> link_pb2.Command:
        return link_pb2.Command(grant_lease=grant)

    def _releasing(self, lease_id: str) -> link_pb2.Command:
        return link_pb2.Command(release_lease=link_pb2.ReleaseLease(lease_id=lease_id))

    def _frame(self, teleop: link_pb2.Teleop) -> link_pb2.GatewayFrame:
        return link_pb2.GatewayFrame(teleop=teleop)

    def _command(self, drive: HeldLease, linear: float, angular: float, *, sent_ns: int = 0) -> None:
        view = self._find(drive.robot)
        name, value = self._message(view, drive.topic, linear, angular)
        payload, type_hash = self._types.encode(name, value, view.channel_of(drive.topic))
        self._put(drive, name, type_hash, payload, sent_ns=sent_ns)

    def _message(self, view: RobotView, topic: str, linear: float, angular: float) -> tuple[str, dict[str, object]]:
        twist: dict[str, object] = {"linear": {"x": linear}, "angular": {"z": angular}}
        if not self._wants_stamps(view, topic):
            return TWIST, twist
        sec, nanosec = divmod(self._clock.wall_ns(), 1_000_000_000)
        header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "base_link"}
        return TWIST_STAMPED, {"header": header, "twist": twist}

    def _wants_stamps(self, view: RobotView, topic: str) -> bool:
        """Whether the topic carries TwistStamped: by who publishes it, else by what alone its subscriptions hear."""
        channel = view.channel_of(topic)
        if channel is not None:
            return channel.schema_name == TWIST_STAMPED
        return {end.type_name for end in self._graph_of(view.robot.id).subscribers.get(topic, ())} == {TWIST_STAMPED}
