"""What the API needs of the gateway, in one bundle that `app.py` fills."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from starlette.requests import HTTPConnection

from gateway.alerts.desk import AlertDesk
from gateway.alerts.notices.feature import Notices
from gateway.api.attendance import Attendance
from gateway.api.rate import Rates
from gateway.backtest import BacktestDesk
from gateway.domain.lease import LeaseTable
from gateway.events.journal import EventJournal
from gateway.fleet.desk import FleetDesk
from gateway.fleet.goals import GoalDesk
from gateway.fleet.graph_book import GraphBook
from gateway.fleet.node_feature import Nodes
from gateway.fleet.offers import OfferDesk
from gateway.fleet.orders import OrderDesk
from gateway.fleet.rollouts import RolloutDesk
from gateway.fleet.talk import TalkDesk
from gateway.fleet.teleop import TeleopDesk
from gateway.fleet.twin_feature import Twins
from gateway.functions.feature import Functions
from gateway.history.desk import HistoryDesk
from gateway.identity.accounts import Accounts
from gateway.identity.audit import AuditLog
from gateway.identity.desk import IdentityDesk
from gateway.identity.door import Door
from gateway.identity.oidc import OidcClient
from gateway.identity.tickets import Tickets
from gateway.ingest.links import Links
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from gateway.operations import Operations
from gateway.queue.desk import QueueDesk
from gateway.recordings.desk import RecordingDesk
from gateway.rules.feature import Rules
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.storage import StorageDesk
from gateway.updates.repository import Repository
from gateway.watch.watch import Watch
from metaros.clock import Clock

__all__ = ["Services", "services_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Services:
    """Every feature behind a route."""

    settings: Settings
    door: Door
    accounts: Accounts
    audit: AuditLog
    oidc: OidcClient | None
    attendance: Attendance
    tickets: Tickets
    rates: Rates
    identities: IdentityDesk
    grpc_port: Callable[[], int]
    programs_port: Callable[[], int]
    clock: Clock
    registry: Registry
    links: Links
    store: Store
    storage: StorageDesk
    history: HistoryDesk
    recordings: RecordingDesk
    hub: Hub
    fleet: FleetDesk
    graphs: GraphBook
    goals: GoalDesk
    offers: OfferDesk
    orders: OrderDesk
    teleop: TeleopDesk
    talk: TalkDesk
    twins: Twins
    nodes: Nodes
    updates: Repository
    rollouts: RolloutDesk
    leases: LeaseTable
    events: EventJournal
    alerts: AlertDesk
    watch: Watch
    notices: Notices
    backtests: BacktestDesk
    queue: QueueDesk
    functions: Functions
    rules: Rules
    demand_of: Callable[[str], dict[str, float]]
    describe: Callable[[str], dict[str, Any]]
    checks: Callable[[], dict[str, str]]
    operations: Operations


def services_of(connection: HTTPConnection) -> Services:
    """The services of the application a request or socket belongs to."""
    services: Services = connection.app.state.services
    return services
