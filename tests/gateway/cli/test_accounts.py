"""`metaros signin`, `user` and `key`: in a data directory without a gateway, and at a running one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gateway.cli.accounts import life_s
from gateway.domain.account import LAMBDA
from gateway.identity.keys import key_secret
from gateway.identity.master import MasterKey
from gateway.identity.store_authenticator import REMEMBERED_S
from gateway.store.engines import open_engine
from gateway.store.ledger import in_transaction
from metaros.clock import ManualClock, SystemClock
from metaros.errors import UsageError
from tests.gateway.harness import client, running_gateway
from tests.support.processes.command_line import ask_metaros

PASSWORD = "correct horse battery"


async def metaros(folder: Path, *arguments: str, stdin: str = "", **env: str) -> tuple[int, str, str]:
    """Run it with a home of its own; exit code, standard output, standard error."""
    home = {"HOME": str(folder), "METAROS_RUNTIME_DIR": str(folder / "run"), **env}
    return await ask_metaros(*arguments, folder=folder, stdin=stdin, **home)


async def test_a_key_made_before_the_gateway_has_ever_run_opens_it(tmp_path: Path) -> None:
    here = ("--data-dir", str(tmp_path / "data"))
    create = ("key", "create", "--name", "ci", "--role", "operator", "--robots", "sim_*", "--scope", "lambda")
    code, out, err = await metaros(tmp_path, *create, *here, "--expires", "30d", "-o", "json")
    assert code == 0, err
    made = json.loads(out)
    assert made["key"] == f"mrk_{made['id']}_{made['secret']}"
    async with running_gateway(tmp_path) as ready, client(ready, key=made["key"]) as http:
        me = (await http.get("/api/v1/auth/me")).json()
        assert (me["id"], me["role"], me["robots"], me["scopes"]) == (made["id"], "operator", ["sim_*"], [LAMBDA])
        code, out, err = await metaros(tmp_path, "key", "list", *here)
        assert (code, made["id"] in out, made["secret"] in out) == (0, True, False), err
        code, _, err = await metaros(tmp_path, "key", "revoke", made["id"], *here)
        assert code == 0, err
    async with running_gateway(tmp_path) as ready, client(ready, key=made["key"]) as http:
        assert (await http.get("/api/v1/auth/me")).status_code == 401


async def test_only_the_master_key_opens_a_lambda_key_s_secret(tmp_path: Path) -> None:
    data = tmp_path / "data"
    create = ("key", "create", "-n", "f", "-r", "operator", "--scope", "lambda", "--data-dir", str(data), "-o", "json")
    made = json.loads((await metaros(tmp_path, *create))[1])
    engine, _ = open_engine("", data)
    try:
        now_ns = 1_700_000_000 * 10**9
        master = MasterKey.load_or_make(data)
        found = in_transaction(engine)(lambda engine: key_secret(engine, made["id"], master, now_ns=now_ns))
    finally:
        engine.close()
    assert found is not None
    assert found[1] == made["secret"]
    files = [path.read_bytes() for path in data.iterdir() if path.is_file()]
    assert not any(made["secret"].encode() in content for content in files)


async def test_people_are_added_changed_and_removed_at_a_gateway(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        env = {"METAROS_GATEWAY_URL": ready.url, "METAROS_KEY": (ready.data_dir / "local.key").read_text().strip()}
        add = ("user", "add", "ada", "--role", "operator", "--robots", "sim_*", "--password-stdin")
        code, out, err = await metaros(tmp_path, *add, stdin=f"{PASSWORD}\n", **env)
        assert (code, out) == (0, "ada: operator, robots sim_*\n"), err
        async with client(ready, key="") as http:
            login = {"name": "ada", "password": PASSWORD}
            assert (await http.post("/api/v1/auth/login", json=login)).json()["role"] == "operator"
        code, out, err = await metaros(tmp_path, "signin", **env)
        assert (code, out.startswith(f"{ready.url}/signin#")) == (0, True), err
        code, _, err = await metaros(tmp_path, "user", "change", "ada", "--role", "viewer", "--disable", **env)
        assert code == 0, err
        listed = json.loads((await metaros(tmp_path, "user", "list", "-o", "json", **env))[1])
        assert [(user["name"], user["role"], user["disabled"]) for user in listed] == [
            ("ada", "viewer", True),
            ("admin", "admin", False),
        ]
        code, _, err = await metaros(tmp_path, "user", "remove", "admin", **env)
        assert (code, "last admin" in err) == (1, True)
        assert (await metaros(tmp_path, "user", "remove", "ada", **env))[0] == 0
        code, _, err = await metaros(tmp_path, "user", "list", **{**env, "METAROS_KEY": "mrk_wrong"})
        assert (code, "not good" in err) == (1, True), err


async def test_who_is_locked_out_comes_in_by_the_data_directory(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key="") as http:
        here = ("--data-dir", str(ready.data_dir))
        code, out, err = await metaros(tmp_path, "signin", *here, "--url", ready.url, "-o", "json")
        assert code == 0, err
        link = json.loads(out)
        assert link["url"] == f"{ready.url}/signin#{link['token']}"
        answer = await http.post("/api/v1/auth/link", json={"token": link["token"]})
        assert (answer.status_code, answer.json()["name"]) == (200, "admin")
        code, _, err = await metaros(tmp_path, "user", "password", "admin", "--password-stdin", *here, stdin=PASSWORD)
        assert code == 0, err
        login = {"name": "admin", "password": PASSWORD}
        assert (await http.post("/api/v1/auth/login", json=login)).status_code == 200


async def test_what_is_done_in_the_data_directory_is_in_the_audit_log(tmp_path: Path) -> None:
    here = ("--data-dir", str(tmp_path / "data"))
    await metaros(tmp_path, "user", "add", "ada", "--role", "admin", *here)
    await metaros(tmp_path, "key", "create", "-n", "ci", "-r", "viewer", *here)
    await metaros(tmp_path, "user", "add", "ada", "--role", "admin", *here)  # refused: it changes nothing
    engine, _ = open_engine("", tmp_path / "data")
    try:
        with engine.transaction(write=False):
            rows = engine.fetch("SELECT action, target, actor FROM audit ORDER BY number")
    finally:
        engine.close()
    assert [tuple(row) for row in rows] == [("users.manage", "ada", "local"), ("keys.manage", "ci", "local")]


async def test_mistakes(tmp_path: Path) -> None:
    here = ("--data-dir", str(tmp_path / "data"))
    found = {
        text: await metaros(tmp_path, *arguments, *here)
        for arguments, text in [
            (("key", "create", "-n", "x", "-r", "king"), "one of viewer"),
            (("key", "create", "-n", "x", "-r", "viewer", "--expires", "soon"), "not a span"),
            (("key", "list", "--gateway", "http://127.0.0.1:9"), "say either"),
            (("user", "change", "ada"), "say what to change"),
        ]
    }
    assert {text: (code, text in err) for text, (code, _, err) in found.items()} == dict.fromkeys(found, (2, True)), (
        found
    )


def test_spans() -> None:
    assert [life_s(text) for text in ("", "never", "90s", "12h", "30d", "1y")] == [
        None,
        None,
        90,
        43_200,
        2_592_000,
        31_536_000,
    ]
    for text in ("0d", "d", "1.5d", "-1d", "1 d", "9999999d"):
        with pytest.raises(UsageError):
            life_s(text)


async def test_everybody_is_signed_out_at_a_running_gateway(tmp_path: Path) -> None:
    here = ("--data-dir", str(tmp_path / "data"))
    clock = ManualClock(wall_ns=SystemClock().wall_ns())
    async with running_gateway(tmp_path, clock=clock) as ready:
        code, _, err = await metaros(
            tmp_path, "user", "add", "ada", "--role=viewer", "--password-stdin", *here, stdin=PASSWORD
        )
        assert code == 0, err
        async with client(ready, key="", Origin=ready.url) as http:
            for arguments in (("--everybody",), ("ada",)):
                await http.post("/api/v1/auth/login", json={"name": "ada", "password": PASSWORD})
                assert (await http.get("/api/v1/auth/me")).json()["name"] == "ada"
                code, out, err = await metaros(tmp_path, "user", "signout", *arguments, *here)
                assert (code, out) == (0, "1 session ended\n"), err
                assert (await http.get("/api/v1/auth/me")).json()["name"] == "ada", "it is remembered, for so long"
                clock.advance(REMEMBERED_S)
                assert (await http.get("/api/v1/auth/me")).json().get("name") != "ada"
        code, _, err = await metaros(tmp_path, "user", "signout", *here)
        assert (code, "--everybody" in err) == (2, True)
