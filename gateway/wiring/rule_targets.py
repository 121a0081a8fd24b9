"""Wires the targets of rules to the features that carry them out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from gateway.alerting.alerts.manager import AlertManager
from gateway.automation.rules.secrets import Secrets
from gateway.automation.rules.targets.alert import AlertTarget
from gateway.automation.rules.targets.aws import AwsTarget, aws_client
from gateway.automation.rules.targets.capture import CaptureTarget
from gateway.automation.rules.targets.command import CommandTarget, PublishTarget
from gateway.automation.rules.targets.webhook import WebhookTarget
from gateway.domain.automation.delivery import Handler
from gateway.domain.fleet.command import Command
from gateway.domain.principal import Principal
from gateway.fleet.command_manager import CommandManager, NewCommand
from gateway.fleet.manager import FleetManager
from gateway.history.recordings.manager import RecordingManager
from metaros.clock import Clock

__all__ = ["RuleCommands", "RuleTargets"]

WAITS_BY_ITSELF = ("save_recording",)


class RuleCommands:
    """The command manager, as rules use it."""

    def __init__(self, command_manager: CommandManager, fleet: FleetManager) -> None:
        self._command_manager = command_manager
        self._fleet = fleet

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
        order = NewCommand(
            robot=robot,
            kind=kind,
            request=request,
            durable=durable,
            expires_s=expires_s,
            idempotency=idempotency,
        )
        return await self._command_manager.send(order, principal)

    async def wait(self, command_id: str, wait_s: float) -> Command:
        """The command at its end, or as it is after so long."""
        return await self._command_manager.wait(command_id, wait_s)

    def is_actuator(self, robot: str, topic: str) -> bool:
        """Whether what is published on a robot's topic, or asked of its service, moves it."""
        return bool(topic) and self._fleet.is_actuator(robot, topic)

    def waits_by_itself(self, kind: str) -> bool:
        """Whether commands of that kind are kept for their robot without being durable."""
        return kind in WAITS_BY_ITSELF


class RuleTargets:
    """`handlers` are the queue's, by kind; that of functions is not among them."""

    def __init__(
        self,
        secrets: Secrets,
        command_manager: CommandManager,
        fleet: FleetManager,
        recordings: RecordingManager,
        alerts: AlertManager,
        *,
        clock: Clock,
        private_hosts: Sequence[str] = (),
        aws_region: str = "",
        aws_endpoint: str = "",
    ) -> None:
        sent = RuleCommands(command_manager, fleet)
        self._aws = AwsTarget(partial(aws_client, endpoint=aws_endpoint), region=aws_region)
        self.handlers: dict[str, Handler] = {
            "webhook": WebhookTarget(secrets, clock=clock, private_hosts=private_hosts),
            "command": CommandTarget(sent, clock=clock),
            "publish": PublishTarget(sent, clock=clock),
            "capture": CaptureTarget(recordings),
            "alert": AlertTarget(alerts, clock=clock),
            "aws": self._aws,
        }

    def close(self) -> None:
        """Take nothing more."""
        self._aws.close()
