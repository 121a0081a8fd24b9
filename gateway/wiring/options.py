"""Options of the parts, derived from the settings."""

from __future__ import annotations

from gateway.api.middleware.rate import Rates
from gateway.automation.functions.service import FunctionOptions
from gateway.identity.manager import IdentityChoices
from gateway.settings import Settings
from metaros.automation.functions.egress.rules import parse_bound
from metaros.automation.functions.sandbox.level import Level
from metaros.clock import Clock

__all__ = ["function_choices", "identity_choices", "rates_of"]


def rates_of(settings: Settings, clock: Clock) -> Rates:
    """How often somebody may ask."""
    return Rates(
        clock=clock,
        requests=settings.requests_per_s,
        anonymous=settings.anonymous_requests_per_s,
        strangers=None if settings.anonymous_requests_per_s else 0.0,
        robot=settings.robot_requests_per_s,
        sign_in=settings.sign_ins_per_min / 60,
    )


def identity_choices(settings: Settings) -> IdentityChoices:
    """How robots get their identity."""
    return IdentityChoices(
        fleet=settings.fleet,
        required=settings.enrolled_only,
        certificate_s=settings.robot_certificate_s,
        ca_cert=settings.ca_cert,
        ca_key=settings.ca_key,
        master_key=settings.master_key,
    )


def function_choices(settings: Settings) -> FunctionOptions:
    """Whether functions run here, and how."""
    return FunctionOptions(
        on=settings.functions,
        require=Level[settings.sandbox_require],
        workers=settings.function_workers,
        egress=parse_bound(settings.function_egress, field="--function-egress"),
    )
