"""Everything that the agent keeps in its directory, opened; and waited for while the disk does not let it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
from dataclasses import dataclass
from pathlib import Path

from edge_agent.commands.executed_ids import CommandLog
from edge_agent.commands.stored_results import StoredResults
from edge_agent.config.settings import Settings
from edge_agent.config.topic_table import TopicTable
from edge_agent.errors import DiskError
from edge_agent.link.byte_budget_override import stored_limit
from edge_agent.outbox import Disk, OsDisk, Outbox, forget_series
from edge_agent.state.state_dir import default_state_dir, locked
from edge_agent.state.store_id import StoreId
from edge_agent.twin.setup import TwinStart, open_twin
from metaros.clock import Clock, system_rng
from metaros.limits import LIMITS, Limits

__all__ = ["AgentState", "open_state"]

LOG = logging.getLogger("metaros.agent")
RETRY_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentState:
    """What outlives the process, as it now is."""

    directory: Path
    disk: Disk
    outbox_disk: Disk
    outbox: Outbox
    store_id: StoreId
    command_log: CommandLog
    kept_results: StoredResults
    limit_bytes_per_s: int
    twin: TwinStart


async def open_state(
    settings: Settings, clock: Clock, stack: contextlib.ExitStack, *, limits: Limits = LIMITS
) -> AgentState:
    """Lock and read the state directory; `stack` gives it back. While the disk is full or read-only it tries again.

    Without a place for what is accepted nothing is tapped: samples are then not seen, rather than seen and forgotten.

    Raises:
        ConfigError: another agent holds the directory.
    """
    said = ""
    while True:
        try:
            with contextlib.ExitStack() as held:
                directory = held.enter_context(locked(settings.state_dir or default_state_dir(settings.name)))
                state = read_state(settings, directory, clock, limits)
                stack.push(held.pop_all())
        except DiskError as error:
            if str(error) != said:
                LOG.error("%s: nothing is tapped until it works, tried again every second", error)
            said = str(error)
            await asyncio.sleep(RETRY_S)
        else:
            if said:
                LOG.info("the state directory works again")
            return state


def read_state(settings: Settings, directory: Path, clock: Clock, limits: Limits = LIMITS) -> AgentState:
    """Open everything; DiskError where something cannot be read, or the outbox cannot be written."""
    rng = system_rng()
    disk, outbox_disk = OsDisk(directory), OsDisk(directory / "outbox")
    outbox = Outbox(
        outbox_disk,
        clock,
        new_epoch=lambda: rng.getrandbits(64),
        writer=os.urandom(8).hex(),
        boot_id=boot_id(),
        classes=settings.outbox.classes(),
        reserve_bytes=settings.outbox.reserve_bytes,
    )
    forget_series(outbox, outbox_disk)
    return AgentState(
        directory=directory,
        disk=disk,
        outbox_disk=outbox_disk,
        outbox=outbox,
        store_id=StoreId(disk),
        command_log=CommandLog(disk),
        kept_results=StoredResults(disk),
        limit_bytes_per_s=stored_limit(disk),
        twin=open_twin(
            disk,
            TopicTable(settings.topics),
            clock,
            namespace=settings.namespace,
            boot_id=boot_id(),
            limits=limits,
        ),
    )


def boot_id() -> str:
    """Which run of the operating system this is; empty where it does not say."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""
