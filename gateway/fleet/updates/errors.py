"""Errors of update files, each with its code in the gateway's table.

RequestError
├── UpdateRefusedError      signed metadata does not count: threshold, version, expiry   update_refused
├── UnknownUpdateError      there is no such file                                        unknown_update
├── WithdrawnError          there was, and it is not handed out any more                 update_withdrawn
└── NoRootError             nobody has published a root yet                              updates_not_set_up
"""

from __future__ import annotations

from gateway.errors import RequestError

__all__ = ["NoRootError", "UnknownUpdateError", "UpdateRefusedError", "WithdrawnError"]


class UpdateRefusedError(RequestError):
    """Signed metadata that does not count; the message names the role and what is wrong."""

    code = "update_refused"


class UnknownUpdateError(RequestError):
    """There is no such metadata, bundle or version."""

    code = "unknown_update"


class WithdrawnError(RequestError):
    """The version was withdrawn: it is not handed out any more."""

    code = "update_withdrawn"


class NoRootError(RequestError):
    """No root has been published to this store: `metaros update init-root` makes one."""

    code = "updates_not_set_up"
