"""Sends commands to robots, and publishes on their topics: kept commands, in the name of the rule.

What cannot move the robot is a durable command under the delivery's id: sent once, however often the delivery is tried,
and waiting for its robot if need be. What moves the robot is never durable, and needs a lease that is held: then it is
sent now, or it is dead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from gateway.automation.rules.targets.calls import Calls, OutOfScopeError, RuleContext, scoped_robot
from gateway.domain.automation.delivery import Dead, Delivery, Done, Result, Retry
from gateway.domain.fleet.command import CANCELLED, DONE, EXPIRED, FAILED, Command
from gateway.domain.principal import Principal
from gateway.errors import LeaseRequiredError, RequestError, RobotError, StoreError, TooManyError
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["CommandTarget", "Orders", "PublishTarget"]

LOOK_AGAIN_S = 5.0  # at a command that waits for its robot
PATIENCE_S = 10.0  # for one whose robot is there


class Orders(Protocol):
    """What is needed of the command manager; the wiring makes the order."""

    async def send(
        self,
        robot: str,
        kind: str,
        request: Mapping[str, Any],
        principal: Principal,
        *,
        durable: bool,
        expires_s: float,
        idempotency: str,
    ) -> Command:
        """Store a command and have it carried out; the same key is the same command."""

    async def wait(self, command_id: str, wait_s: float) -> Command:
        """The command at its end, or as it is after so long."""

    def is_actuator(self, robot: str, topic: str) -> bool:
        """Whether what is published on a robot's topic, or asked of its service, moves it."""

    def waits_by_itself(self, kind: str) -> bool:
        """Whether commands of that kind are kept for their robot without being durable."""


class CommandTarget:
    """A handler of the queue: any kind of command."""

    def __init__(self, orders: Orders, *, clock: Clock) -> None:
        self._calls = Calls()
        self.room, self.timeout_s, self.ended = self._calls.room, self._calls.timeout_s, self._calls.ended
        self._orders = orders
        self._clock = clock

    async def deliver(self, delivery: Delivery) -> Result:
        """Send it, or look how it went."""
        rule_context = RuleContext(delivery)
        request = rule_context.document()
        if not isinstance(request, dict):
            return Dead("command_invalid", "what the rule gives a command is an object: its request")
        with self._calls.counted():
            return await self.send(delivery, rule_context, str(rule_context.fields["command"]), request)

    async def send(self, delivery: Delivery, rule_context: RuleContext, kind: str, request: dict[str, Any]) -> Result:
        """One kept command, and its end."""
        left_s = delivery.put.policy.most_age_s - (self._clock.wall_ns() - delivery.born_ns) / 1e9
        try:
            robot = scoped_robot(rule_context)
            moves = self._orders.is_actuator(robot, str(request.get("topic") or request.get("service") or ""))
            durable = not moves and not self._orders.waits_by_itself(kind)
            command = await self._orders.send(
                robot,
                kind,
                request,
                rule_context.maker.principal(rule_context.name),
                durable=durable,
                expires_s=max(1.0, min(left_s, LIMITS.command_expires_most_s)),
                idempotency=f"rule {delivery.id}",
            )
            if not command.over:
                command = await self._orders.wait(command.id, PATIENCE_S)
        except OutOfScopeError as error:
            return Dead("out_of_scope", str(error))
        except LeaseRequiredError as error:
            return Dead(error.code, f"{error}: a rule drives only under a lease that is held, by lease_id")
        except (StoreError, TooManyError) as error:
            return Retry(error.code, str(error), counts=False)
        except (RequestError, RobotError, MetarosError) as error:
            return Dead(error.code, str(error))
        return _end(command)


class PublishTarget(CommandTarget):
    """A handler of the queue: one message on a robot's topic."""

    async def deliver(self, delivery: Delivery) -> Result:
        """Publish it, or look how that went."""
        rule_context = RuleContext(delivery)
        message = rule_context.document()
        if not isinstance(message, dict):
            return Dead("command_invalid", "what the rule gives a topic is an object: the message")
        fields = {
            name: value
            for name, value in rule_context.fields.items()
            if name in ("topic", "type", "lease_id") and value
        }
        with self._calls.counted():
            return await self.send(delivery, rule_context, "publish", {**fields, "message": message})


def _end(command: Command) -> Result:
    if command.state == DONE:
        return Done(command.id)
    if command.state in (FAILED, EXPIRED, CANCELLED):
        return Dead(command.code or command.state, command.message or f"command {command.id} is {command.state}")
    return Retry("command_waits", f"command {command.id} is {command.state}", LOOK_AGAIN_S, counts=False)
