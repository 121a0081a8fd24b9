"""boto3 reads the same documents for every session it makes, a tenth of a second each: here once a process."""

from __future__ import annotations

import functools

import botocore.session

__all__ = ["read_documents_once"]


def read_documents_once() -> None:
    """From now on, for all sessions of this process."""
    if not hasattr(botocore.session.create_loader, "cache_clear"):
        botocore.session.create_loader = functools.cache(botocore.session.create_loader)
