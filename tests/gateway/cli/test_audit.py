"""`metaros audit` against a real gateway, and on its data directory without one."""

from __future__ import annotations

import json
import os
import sqlite3
from pathlib import Path

from gateway.domain.principal import Role
from gateway.store.sqlite import DATABASE
from tests.gateway.harness import RING, client, running_gateway
from tests.support.processes.command_line import ask_metaros

ADMIN = RING.add(role=Role.ADMIN, name="test admin")


async def metaros(*arguments: str, url: str = "") -> tuple[int, str, str]:
    """Run it; exit code, standard output, standard error."""
    return await ask_metaros("audit", *arguments, METAROS_GATEWAY_URL=url, METAROS_KEY=ADMIN, COLUMNS="250")


async def test_list_and_verify(tmp_path: Path) -> None:
    data = tmp_path / "data"
    async with running_gateway(tmp_path) as ready:
        async with client(ready, key=ADMIN) as http:
            for name in ("ada", "bob"):
                assert (await http.post("/api/v1/users", json={"name": name, "role": "viewer"})).status_code == 201
        code, out, _ = await metaros("list", url=ready.url)
        assert code == 0
        first, second = out.splitlines()[-2:]
        assert "users.manage" in first
        assert "ada: viewer, robots *" in first
        assert "bob" in second
        code, out, _ = await metaros("list", "--before", "2", "--output", "json", url=ready.url)
        assert [row["number"] for row in json.loads(out)] == [1]
        code, out, _ = await metaros("verify", url=ready.url)
        assert (code, "the log holds: 2 rows" in out) == (0, True), out
    code, out, _ = await metaros("verify", "--data-dir", str(data), "--output", "json")
    found = json.loads(out)
    assert (code, found["ok"], found["rows"], found["heads"], found["heads_sealed"]) == (0, True, 2, 1, 1)
    with sqlite3.connect(data / DATABASE) as database:
        database.execute("DROP TRIGGER audit_no_delete")
        database.execute("DELETE FROM audit WHERE number = 1")
    database.close()
    code, out, _ = await metaros("verify", "--data-dir", str(data))
    assert code == 1
    assert "row 1: missing" in out
    assert "THE LOG DOES NOT HOLD" in out


async def test_where_there_is_no_store(tmp_path: Path) -> None:
    code, _, err = await metaros("verify", "--data-dir", str(tmp_path))
    assert (code, "there is no store" in err) == (2, True), err
    assert not os.listdir(tmp_path)
