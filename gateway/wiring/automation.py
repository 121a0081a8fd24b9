"""Wires queue, rules and functions: what is judged, what is accepted, who delivers it.

Part of the wiring: it reads the living parts of other features, and belongs to none.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from gateway.automation.functions.async_put import event_put
from gateway.automation.functions.replays import Replayer
from gateway.automation.functions.service import FunctionPorts, Functions
from gateway.automation.queue.manager import QueueManager
from gateway.automation.rules.service import Rules
from gateway.automation.rules.target_deliveries import FunctionCall
from gateway.domain.automation.delivery import Put
from gateway.errors import StoreError
from gateway.fleet.command_manager import CommandManager
from gateway.fleet.manager import FleetManager
from gateway.history.recordings.manager import RecordingManager
from gateway.identity.master import MasterKey
from gateway.ops.meters import Families
from gateway.outbound.aws import AwsDestinations
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.automation.deliveries import put
from gateway.store.automation.mapping_cursors import Stream
from gateway.store.commit import CommitHook
from gateway.store.engine import StoreEngine
from gateway.store.objects import ObjectStore
from gateway.store.writes import Committed, StreamWrite
from gateway.wiring.alerting import Alerting
from gateway.wiring.options import function_choices
from gateway.wiring.robot_function_results import RobotResults
from gateway.wiring.rule_targets import RuleTargets
from metaros.clock import Clock, system_rng

__all__ = ["Automation", "Dependencies"]


HOUR_S = 3600.0
Emit = Callable[[str, str, Mapping[str, Any]], None]


class Dependencies(Protocol):
    """The parts of the gateway that carry out what rules say."""

    command_manager: CommandManager
    fleet: FleetManager
    recordings: RecordingManager
    alerting: Alerting


class Automation:
    """Queue, rules and functions; lives on the event loop but for what judges commits."""

    def __init__(
        self, settings: Settings, store: Store, objects: ObjectStore, master: MasterKey, *, emit: Emit, clock: Clock
    ) -> None:
        self._settings = settings
        self._store = store
        self._clock = clock
        self._ends: RuleTargets | None = None
        rng = system_rng()
        self.queue = QueueManager(store, clock=clock, rng=rng)
        self.aws = AwsDestinations(endpoint=settings.aws_endpoint, region=settings.aws_region)
        self.rules = Rules(
            store,
            clock=clock,
            seal=master.seal,
            unseal=master.open,
            function_put=_function_put,
            notify=self.queue.notify,
        )
        ports = FunctionPorts(
            accept=self.queue.accept,
            put=self._put,
            notify=self.queue.notify,
            put_events=self.rules.intake.accept,
            aws=self.aws,
            emit=emit,
        )
        self.functions = Functions(
            store,
            objects,
            settings.data_dir / "functions",
            ports,
            choices=function_choices(settings),
            clock=clock,
            rng=rng,
        )

    async def start(self, dependencies: Dependencies) -> None:
        """Before the first link: what is committed from then on is judged."""
        await self.rules.start()
        await self.functions.start()
        self._ends = ends = self._make_targets(dependencies)
        for kind, handler in {**self.functions.handlers(), **ends.handlers}.items():
            self.queue.handle(kind, handler)
        await self.queue.start()
        replays = await self.queue.replays()
        await Replayer(self.queue.replay, self.functions.catalogue).resume(replays)

    def commit_hook(self) -> CommitHook:
        """What is done within a commit of samples: rules, and results of functions on robots."""
        engine = self.rules.engine
        return RobotResults(engine, engine.on_gateway_events, self._store.gateway_id)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.queue.run())
            group.create_task(self.rules.run())
            group.create_task(self.functions.run())

    async def close(self) -> None:
        """Deliver no more; what runs may end for a while."""
        if self._ends is None:  # it was never started
            return
        await self.rules.close()
        await self.queue.close()
        await self.functions.close()
        self.aws.close()
        self._ends.close()

    def on_committed(self, done: Committed) -> None:
        """The store has more."""
        self.functions.on_committed(_streams(done))

    async def measure(self, found: Families) -> None:
        """What Prometheus is told of queue and functions."""
        functions, totals = self.functions, list(self.functions.meters.totals.values())
        for name in ("invocations", "errors", "throttles", "cold_starts"):
            found.put(f"metaros_function_{name}", sum(getattr(item, name) for item in totals))
        found.put("metaros_function_seconds", sum(item.duration_s for item in totals))
        found.put("metaros_function_running", functions.invoker.running.total())
        status = functions.engine.state().status
        found.put("metaros_function_workers", status.workers if status is not None else 0)
        for share, took_ms in functions.meters.percentiles(window_s=HOUR_S).items():
            found.put("metaros_function_duration_seconds", took_ms / 1000, f"{share:g}")
        found.put("metaros_function_iterator_age_seconds", functions.mappings.oldest_s())
        for outcome, count in self.queue.dispatcher.counts.items():
            found.put("metaros_deliveries_ended", count, outcome)
        with contextlib.suppress(StoreError):  # the rest is told all the same
            held = (await self.queue.status()).totals
            found.put("metaros_deliveries", held.live.rows, "live")
            found.put("metaros_deliveries", held.dead.rows, "dead")

    def _put(self, engine: StoreEngine, puts: Sequence[Put]) -> object:
        return put(engine, puts, gateway=self._store.gateway_id, now_ns=self._clock.wall_ns())

    def _make_targets(self, dependencies: Dependencies) -> RuleTargets:
        own = self._settings
        return RuleTargets(
            self.rules.secrets,
            dependencies.command_manager,
            dependencies.fleet,
            dependencies.recordings,
            dependencies.alerting.manager,
            clock=self._clock,
            private_hosts=own.webhook_private,
            aws_region=own.aws_region,
            aws_endpoint=own.aws_endpoint,
        )


def _function_put(call: FunctionCall) -> Put:
    """What a rule puts for a function; tried again as Lambda does. On the store's thread."""
    return event_put(
        call.name,
        call.qualifier,
        call.payload,
        request_id=call.request_id,
        robot=call.robot,
        event_id=call.event_id,
        dedup=call.dedup,
        context=call.context,
        policy=replace(call.policy, backoff="lambda"),
    )


def _streams(done: Committed) -> Iterator[tuple[Stream, str]]:
    """The streams of messages that a commit knows, with their topics."""
    for write in done.writes:
        if isinstance(write, StreamWrite) and write.run is not None:
            yield Stream(write.robot, write.stream_id, write.epoch), write.run.channel.topic
