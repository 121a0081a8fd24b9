"""What the routes and RPCs get of the gateway. Part of the wiring."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway.api.services import Services

if TYPE_CHECKING:
    from gateway.app import Gateway

__all__ = ["services_of"]


def services_of(gateway: Gateway) -> Services:
    """Every feature behind a route or an RPC."""
    return Services(
        settings=gateway.settings,
        door=gateway.door,
        accounts=gateway.accounts,
        audit=gateway.audit,
        oidc=gateway.oidc,
        attendance=gateway.attendance,
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
        orders=gateway.orders,
        teleop=gateway.teleop,
        talk=gateway.talk,
        twins=gateway.twins,
        nodes=gateway.nodes,
        updates=gateway.updates,
        rollouts=gateway.rollouts,
        events=gateway.events.journal,
        alerts=gateway.watching.desk,
        watch=gateway.watching.watch,
        notices=gateway.watching.notices,
        backtests=gateway.watching.backtests,
        queue=gateway.reacting.queue,
        functions=gateway.reacting.functions,
        rules=gateway.reacting.rules,
        leases=gateway.leases,
        demand_of=gateway.demand.told,
        describe=gateway.describe,
        checks=gateway.checks,
        operations=gateway.operations,
    )
