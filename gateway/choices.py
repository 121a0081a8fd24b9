"""What the settings mean to the parts that know nothing of settings."""

from __future__ import annotations

from gateway.api.rate import Rates
from gateway.identity.desk import IdentityChoices
from gateway.settings import Settings
from metaros.clock import Clock

__all__ = ["identity_choices", "rates_of"]


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
    )
