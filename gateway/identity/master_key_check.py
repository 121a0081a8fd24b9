"""Checks that a gateway has the master key by which its store's secrets are sealed.

The store keeps a check value, which the first gateway's key makes and which says nothing of the key. A gateway of a
cluster that has another key does not start: it could open nothing of what the others seal, and none of them would be
its peer. One that is alone says so in its log, and serves all the same: of what was sealed elsewhere each part says
what it cannot do.
"""

from __future__ import annotations

import logging

from gateway.domain.automation.rule import SECRET
from gateway.errors import DamagedError
from gateway.identity.certificates.authorities import PURPOSE as CA
from gateway.identity.keys import PURPOSE as API_KEY
from gateway.identity.master import MasterKey
from gateway.store import Store
from gateway.store.engine import StoreEngine
from metaros.errors import ConfigError

__all__ = ["SEALED", "check_master", "note_key", "opened"]

log = logging.getLogger(__name__)

# Everything in the database that a master key has sealed: purpose, table, its key, and the column.
SEALED = (
    (CA, "authorities", "authority", "sealed_key"),
    (API_KEY, "api_keys", "id", "sealed"),
    (SECRET, "rule_secrets", "owner", "sealed"),
)
CHECK = "master_key_check"
CHECK_CHARS = 32
FOREIGN = (
    "this gateway's master key is not the one that the store's secrets are sealed by: copy the first gateway's"
    " master.key into this one's data directory, or give both the same file by --master-key"
)


async def check_master(store: Store, master: MasterKey, *, required: bool) -> None:
    """Compare the key with the store's, which a store that has none takes from this one.

    Raises:
        ConfigError: it is another one, and `required`.
        StoreError: the store cannot say now.
    """
    if await store.run(lambda engine: _is_the_stores(engine, master)):
        return
    if required:
        raise ConfigError(FOREIGN)
    log.warning(FOREIGN)


def note_key(engine: StoreEngine, master: MasterKey) -> None:
    """The store's secrets are sealed by this key from now on; inside a writing transaction of the caller's."""
    engine.execute("DELETE FROM meta WHERE key = ?", CHECK)
    engine.execute("INSERT INTO meta VALUES (?, ?)", CHECK, _checks(master)[0])


def opened(purpose: str, secret_id: str, sealed: bytes, *keys: MasterKey) -> bytes | None:
    """A secret that one of the keys has sealed; None: none of them did."""
    for key in keys:
        try:
            return key.open(purpose, secret_id, sealed)
        except DamagedError:
            continue
    return None


def _is_the_stores(engine: StoreEngine, master: MasterKey) -> bool:
    """In one transaction, so that of two gateways that start at once one is the first."""
    row = engine.fetch("SELECT value FROM meta WHERE key = ?", CHECK)
    if not row and _opens_all(engine, master):
        engine.execute("INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO NOTHING", CHECK, _checks(master)[0])
        row = engine.fetch("SELECT value FROM meta WHERE key = ?", CHECK)
    return bool(row) and str(row[0][0]) in _checks(master)


def _opens_all(engine: StoreEngine, master: MasterKey) -> bool:
    """Whether what an earlier version sealed in this store is this key's; of each kind one is tried."""
    for purpose, table, key, column in SEALED:
        rows = engine.fetch(f"SELECT {key}, {column} FROM {table} WHERE {column} IS NOT NULL ORDER BY {key} LIMIT 1")
        for secret_id, sealed in ((str(row[0]), bytes(row[1])) for row in rows):
            if sealed and opened(purpose, secret_id, sealed, master) is None:
                return False
    return True


def _checks(master: MasterKey) -> list[str]:
    return [key.hex()[:CHECK_CHARS] for key in master.subkeys("check")]
