"""The application: every route and RPC of the gateway, and what they are given of it."""

from __future__ import annotations

from starlette.types import ASGIApp

from gateway.api import create_api
from gateway.api.services import Services
from gateway.wiring.gateway import Gateway

__all__ = ["create_app", "services_of"]


def create_app(gateway: Gateway) -> ASGIApp:
    """What answers over HTTP and WebSocket."""
    return create_api(services_of(gateway))


def services_of(gateway: Gateway) -> Services:
    """Every feature behind a route or an RPC."""
    return Services(
        settings=gateway.settings,
        authenticator=gateway.authenticator,
        accounts=gateway.accounts,
        audit=gateway.audit,
        oidc=gateway.oidc,
        open_connections=gateway.open_connections,
        tickets=gateway.tickets,
        rates=gateway.rates,
        identities=gateway.identities,
        grpc_port=lambda: gateway.grpc_port,
        programs_port=lambda: gateway.programs_port,
        clock=gateway.clock,
        registry=gateway.registry,
        links=gateway.links,
        store=gateway.store,
        storage=gateway.storage,
        history=gateway.history,
        recordings=gateway.recordings,
        hub=gateway.hub,
        fleet=gateway.fleet,
        graphs=gateway.ros.graphs,
        goals=gateway.ros.goals,
        offers=gateway.ros.offers,
        command_manager=gateway.command_manager,
        teleop=gateway.teleop,
        talk=gateway.talk,
        twins=gateway.twins,
        nodes=gateway.nodes,
        updates=gateway.updates,
        rollouts=gateway.rollouts,
        events=gateway.events.journal,
        alerts=gateway.alerting.manager,
        watch=gateway.alerting.watch,
        notices=gateway.alerting.notices,
        backtests=gateway.alerting.backtests,
        queue=gateway.automation.queue,
        functions=gateway.automation.functions,
        rules=gateway.automation.rules,
        leases=gateway.leases,
        demand_of=gateway.demand.sent,
        describe=gateway.describe,
        checks=gateway.checks,
        meters=gateway.operations.meters,
        traces=gateway.operations.traces,
        families=gateway.operations.families,
        report=gateway.operations.report,
        is_draining=lambda: gateway.operations.draining,
    )
