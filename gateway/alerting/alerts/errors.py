"""The errors of alerts; their codes are rows of the gateway's table.

RequestError
├── UnknownAlertError      there is no such alert                      unknown_alert
├── UnknownSilenceError    there is no such silence                    unknown_silence
├── UnknownRouteError      notices have no route of that name          unknown_route
└── AlertStateError        the alert is resolved                       alert_state
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = ["AlertStateError", "UnknownAlertError", "UnknownRouteError", "UnknownSilenceError"]


class UnknownAlertError(RequestError):
    """There is no such alert, as far as who asks may know."""

    code = "unknown_alert"

    @classmethod
    def of(cls, alert_id: str) -> UnknownAlertError:
        """In the same words whether there is none or its robot is out of scope."""
        return cls(f"there is no alert {alert_id[:40]!r}")


class UnknownSilenceError(RequestError):
    """There is no such silence, as far as who asks may know."""

    code = "unknown_silence"

    @classmethod
    def of(cls, silence_id: str) -> UnknownSilenceError:
        """In the same words whether there is none or its robots are out of scope."""
        return cls(f"there is no silence {silence_id[:40]!r}")


class UnknownRouteError(RequestError):
    """Notices have no route of that name."""

    code = "unknown_route"


class AlertStateError(RequestError):
    """The alert is resolved: nothing of the kind can be done about it any more."""

    code = "alert_state"
