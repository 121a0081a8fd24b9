"""Where `metaros user`, `metaros key` and `metaros signin` work: on a running gateway, or directly in its store.

Whoever can read a gateway's data directory may do everything there: so the first key of a gateway is made before the
gateway has ever run, and who is locked out comes in again.
"""

from __future__ import annotations

import getpass
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from gateway.cli.data_dir import gateway_dir
from metaros.cli.shared.gateway_http import GatewayClient, open_gateway
from metaros.errors import UsageError

if TYPE_CHECKING:
    from gateway.identity.master import MasterKey
    from gateway.store.engine import StoreEngine
    from gateway.store.ledger import Transact

__all__ = [
    "LocalDir",
    "LocalStore",
    "Robots",
    "RoleOption",
    "checked_role",
    "client_or_none",
    "life_s",
    "local_store",
    "read_password",
]

Result = TypeVar("Result")
ROLES = ("viewer", "operator", "admin")
_LIFE = re.compile(r"(\d{1,6})([smhdwy])")
_UNIT_S = {"s": 1, "m": 60, "h": 3600, "d": 86_400, "w": 604_800, "y": 31_536_000}

LocalDir = Annotated[
    Path | None,
    typer.Option(
        "--data-dir",
        file_okay=False,
        callback=gateway_dir,
        metavar="DIR",
        help="Work in this data directory of a gateway, which may run or not, instead of asking one.",
    ),
]
RoleOption = Annotated[str, typer.Option("--role", "-r", metavar="ROLE", help="viewer, operator or admin.")]
Robots = Annotated[
    list[str] | None,
    typer.Option("--robots", metavar="GLOB", help="Only these robots: sim_* or an id; may be repeated."),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalStore:
    """A gateway's store on this machine: each job is one transaction."""

    run: Transact
    folder: Path
    now_ns: int

    def change(self, action: str, target: str, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that changes something: it and its row in the audit log are kept together, or neither is."""
        from gateway.store.accounts.audit import AuditEvent, append

        event = AuditEvent(
            at_ns=self.now_ns,
            kind="local",
            actor="local",
            name=getpass.getuser(),
            role="admin",
            action=action,
            method="CLI",
            target=target,
            status=200,
            detail="metaros on the data directory",
        )

        def audited(engine: StoreEngine) -> Result:
            done = job(engine)
            append(engine, [event])
            return done

        return self.run(audited)

    @property
    def master(self) -> MasterKey:
        """The gateway's master key, made where there is none."""
        from gateway.identity.master import MasterKey

        return MasterKey.load_or_make(self.folder)


def client_or_none(data_dir: Path | None, store: str, gateway: str) -> GatewayClient | None:
    """The gateway to ask; None: work in the data directory or the store.

    Raises:
        UsageError: both were said.
    """
    if (data_dir is not None or store) and gateway:
        raise UsageError("say either --gateway, or --data-dir and --store")
    return None if data_dir is not None or store else open_gateway(gateway)


@contextmanager
def local_store(data_dir: Path | None, store: str) -> Iterator[LocalStore]:
    """The store of a data directory, made where there is none.

    Raises:
        ConfigError: it cannot be used.
    """
    from gateway.settings import default_data_dir
    from gateway.store.engines import open_engine
    from gateway.store.ledger import in_transaction
    from gateway.store.private_dir import make_private
    from metaros.clock import SystemClock

    folder = make_private(data_dir or default_data_dir())
    engine, _ = open_engine(store, folder)
    try:
        yield LocalStore(run=in_transaction(engine), folder=folder, now_ns=SystemClock().wall_ns())
    finally:
        engine.close()


def life_s(text: str) -> float | None:
    """Seconds of "30d"; None for "" or "never". UsageError says what is understood."""
    if text in ("", "never"):
        return None
    match = _LIFE.fullmatch(text)
    if match is None or not int(match[1]):
        raise UsageError(f"--expires {text}: not a span like 12h, 30d or 1y")
    return float(int(match[1]) * _UNIT_S[match[2]])


def checked_role(text: str) -> str:
    """UsageError for what is no role."""
    if text not in ROLES:
        raise UsageError(f"--role {text}: one of {', '.join(ROLES)}")
    return text


def read_password(*, from_stdin: bool) -> str:
    """A new password, asked twice on a terminal, or the first line of standard input: never an argument, which every
    process of the machine could read.
    """
    if from_stdin:
        return sys.stdin.readline().rstrip("\r\n")
    first = getpass.getpass("New password: ")
    if getpass.getpass("Again: ") != first:
        raise UsageError("the two passwords differ")
    return first
