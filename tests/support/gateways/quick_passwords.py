"""Passwords of running gateways hashed in no time: what a real hash costs is a matter of its own tests."""

from __future__ import annotations

from functools import partial

import pytest
from argon2 import PasswordHasher

import gateway.identity.accounts
from gateway.identity.passwords import Passwords

__all__ = ["make_quick", "quick_passwords"]

QUICK = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)


@pytest.fixture
def quick_passwords(monkeypatch: pytest.MonkeyPatch) -> None:
    """For the gateways that the test starts."""
    make_quick(monkeypatch)


def make_quick(patch: pytest.MonkeyPatch) -> None:
    """For the gateways that start while it holds."""
    patch.setattr(gateway.identity.accounts, "Passwords", partial(Passwords, hasher=QUICK))
