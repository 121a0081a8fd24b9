"""`--data-dir` with the directory of `metaros up`, in which its gateway's is a folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from gateway.cli.data_dir import gateway_dir
from gateway.store.sqlite import DATABASE
from metaros.cli.main import build_app
from metaros.cli.shared.instances import open_data_dir
from metaros.errors import ConfigError
from tests.gateway.harness import client, running_gateway
from tests.support.processes.command_line import ask_metaros, call_metaros

OWN = ("up", "doctor")  # whose --data-dir is that of `metaros up` itself


@pytest.fixture
def of_up(tmp_path: Path) -> Path:
    """The directory of a `metaros up` that is over."""
    data = open_data_dir(tmp_path / "up")
    (data.path / "logs").mkdir()
    data.lock.close()
    return data.path


async def test_a_key_is_made_in_the_store_of_metaros_up(of_up: Path) -> None:
    async with running_gateway(of_up, data_dir=of_up / "gateway") as ready:
        create = ("key", "create", "--name", "ci", "--role", "operator", "--data-dir", str(of_up), "-o", "json")
        code, out, err = await ask_metaros(*create)
        assert code == 0, err
        made = json.loads(out)
        async with client(ready, key=made["key"]) as http:
            assert (await http.get("/api/v1/auth/me")).json()["id"] == made["id"]
    assert not (of_up / DATABASE).exists()


def test_its_folder_counts_before_its_first_gateway_and_a_new_directory_is_taken_as_it_is(
    of_up: Path, tmp_path: Path
) -> None:
    done = call_metaros("gateway", "store", "migrate", "--data-dir", str(of_up))
    assert done.code == 0, done.err
    assert (of_up / "gateway" / DATABASE).exists()
    for new in (tmp_path / "new", of_up / "gateway"):
        assert gateway_dir(new) == new
    assert gateway_dir(None) is None


def test_two_stores_are_an_error_that_says_where_they_are(of_up: Path) -> None:
    for folder in (of_up, of_up / "gateway"):
        folder.mkdir(exist_ok=True)
        (folder / DATABASE).touch()
    done = call_metaros("key", "list", "--data-dir", str(of_up))
    assert done.code == 2
    assert f"Say --data-dir {of_up / 'gateway'}" in done.err
    with pytest.raises(ConfigError) as refused:
        gateway_dir(of_up)
    assert refused.value.code == "invalid_config"


def test_every_command_looks_there() -> None:
    options = dict(_options(typer.main.get_command(build_app()), ""))
    known = {
        "key create",
        "user add",
        "signin",
        "audit verify",
        "gateway",
        "gateway backup take",
        "gateway store check",
    }
    assert known < {*options}
    assert [name for name, option in options.items() if option.callback is None] == []


def _options(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Each command's `--data-dir`, but those of `metaros up` itself."""
    for word, sub in getattr(command, "commands", {}).items():
        yield from _options(sub, f"{name} {word}".strip()) if word not in OWN else ()
    yield from ((name, option) for option in command.params if "--data-dir" in option.opts)
