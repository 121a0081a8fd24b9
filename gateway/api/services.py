"""The gateway's features as the API uses them, in one dataclass that `app.py` fills."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from starlette.requests import HTTPConnection

from gateway.alerting.alerts.manager import AlertManager
from gateway.alerting.alerts.notices.service import Notices
from gateway.alerting.backtest import BacktestManager
from gateway.alerting.watch.watch import Watch
from gateway.api.middleware.rate import Rates
from gateway.api.open_connections import OpenConnections
from gateway.automation.events.journal import EventJournal
from gateway.automation.functions.service import Functions
from gateway.automation.queue.manager import QueueManager
from gateway.automation.rules.service import Rules
from gateway.domain.fleet.lease import LeaseTable
from gateway.fleet.command_manager import CommandManager
from gateway.fleet.manager import FleetManager
from gateway.fleet.nodes.feature import Nodes
from gateway.fleet.rollouts.manager import RolloutManager
from gateway.fleet.ros.goals import GoalManager
from gateway.fleet.ros.graph_registry import GraphRegistry
from gateway.fleet.ros.offers import OfferManager
from gateway.fleet.talk import TalkManager
from gateway.fleet.teleop import TeleopManager
from gateway.fleet.twins.feature import Twins
from gateway.fleet.updates.repository import Repository
from gateway.history.manager import HistoryManager
from gateway.history.recordings.manager import RecordingManager
from gateway.identity.accounts import Accounts
from gateway.identity.audit import AuditLog
from gateway.identity.authenticator import Authenticator
from gateway.identity.manager import IdentityManager
from gateway.identity.oidc.client import OidcClient
from gateway.identity.tickets import Tickets
from gateway.ingest.links import Links
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from gateway.ops.meters import Families, Meters
from gateway.ops.traces import Traces
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.storage import StorageManager
from metaros.clock import Clock

__all__ = ["Services", "services_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Services:
    """Every feature behind a route."""

    settings: Settings
    authenticator: Authenticator
    accounts: Accounts
    audit: AuditLog
    oidc: OidcClient | None
    open_connections: OpenConnections
    tickets: Tickets
    rates: Rates
    identities: IdentityManager
    grpc_port: Callable[[], int]
    programs_port: Callable[[], int]
    clock: Clock
    registry: Registry
    links: Links
    store: Store
    storage: StorageManager
    history: HistoryManager
    recordings: RecordingManager
    hub: Hub
    fleet: FleetManager
    graphs: GraphRegistry
    goals: GoalManager
    offers: OfferManager
    command_manager: CommandManager
    teleop: TeleopManager
    talk: TalkManager
    twins: Twins
    nodes: Nodes
    updates: Repository
    rollouts: RolloutManager
    leases: LeaseTable
    events: EventJournal
    alerts: AlertManager
    watch: Watch
    notices: Notices
    backtests: BacktestManager
    queue: QueueManager
    functions: Functions
    rules: Rules
    demand_of: Callable[[str], dict[str, float]]
    describe: Callable[[str], dict[str, Any]]
    checks: Callable[[], dict[str, str]]
    meters: Meters
    traces: Traces
    families: Callable[[], Awaitable[Families]]
    report: Callable[[], Awaitable[dict[str, Any]]]
    is_draining: Callable[[], bool]


def services_of(connection: HTTPConnection) -> Services:
    """The services of the application a request or socket belongs to."""
    services: Services = connection.app.state.services
    return services
