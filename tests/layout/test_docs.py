"""Docs are part of the change: limits, error codes, flags, routes and links, each checked against the code."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "docs" / "reference"


def reference(*names: str) -> str:
    """The text of reference pages."""
    return "\n".join((REFERENCE / name).read_text() for name in names)


def test_every_limit_is_documented() -> None:
    from metaros.limits import Limits

    text = reference("limits.md")
    assert [f.name for f in dataclasses.fields(Limits) if f"`{f.name}`" not in text] == []


def test_every_error_code_is_documented() -> None:
    import edge_agent.errors
    import edge_agent.update.errors
    import gateway.errors
    import gateway.fleet.rollouts.errors
    import gateway.fleet.updates.errors
    import gateway.identity.errors
    import metaros.errors
    import metaros.fleet.bundle

    codes = {
        value.code
        for module in (
            metaros.errors,
            edge_agent.errors,
            edge_agent.update.errors,
            gateway.errors,
            gateway.identity.errors,
            gateway.fleet.rollouts.errors,
            gateway.fleet.updates.errors,
            metaros.fleet.bundle,
        )
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Exception) and hasattr(value, "code")
    }
    text = reference("errors.md")
    assert [code for code in sorted(codes) if f"`{code}`" not in text] == []


def commands(command: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command of the tree with its path."""
    yield path, command
    for name, child in getattr(command, "commands", {}).items():
        yield from commands(child, (*path, name))


def command_tree() -> list[tuple[tuple[str, ...], click.Command]]:
    """The whole `metaros` command, plug-in nouns included."""
    from metaros.cli.main import build_app

    return list(commands(typer.main.get_command(build_app())))


def test_every_command_and_flag_is_documented() -> None:
    text = reference("cli.md", "agent.md", "gateway.md")
    missing = []
    for path, command in command_tree():
        if path and f"metaros {' '.join(path)}" not in text:
            missing.append(f"metaros {' '.join(path)}")
        for parameter in command.params:
            flags = [o for o in [*parameter.opts, *parameter.secondary_opts] if o.startswith("--")]
            missing += [f"{' '.join(path)} {flag}" for flag in flags if f"{flag}" not in text and flag != "--help"]
    assert missing == []


def test_every_route_is_documented(tmp_path: Path) -> None:
    from gateway.api import route_paths

    text = reference("rest.md", "stream.md")
    assert [path for path in route_paths() if f"`{path}`" not in text and path not in text] == []


def test_where_is_what_has_forty_answers_of_one_link_each() -> None:
    page = ROOT / "docs" / "topics" / "architecture.md"
    table = page.read_text().partition("## Where is what")[2]
    answers = re.findall(r"^\| [^|]+\? \| \[[^]]+\]\(([^)]+)\) \|$", table, re.MULTILINE)
    assert len(answers) >= 40
    assert len(answers) == len(set(answers)) == len(re.findall(r"^\| [^|*]+\? ", table, re.MULTILINE))
    assert [link for link in answers if not (page.parent / link).is_file()] == []


def test_links_between_pages_lead_somewhere() -> None:
    broken = []
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text())
        local = [target for target in targets if "://" not in target]
        broken += [f"{page.relative_to(ROOT)} -> {target}" for target in local if not (page.parent / target).exists()]
    assert broken == []


@pytest.mark.parametrize("page", ["README.md", "docs/start/index.md"])
def test_python_snippets_compile(page: str) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    for number, block in enumerate(blocks):
        compile(block, f"{page}#{number}", "exec")


def test_every_key_of_a_launch_table_is_documented() -> None:
    from metaros.supervise.launch_table import NODE_KEYS, RESTART_KEYS, TABLE_KEYS

    text = reference("launch.md")
    assert [key for key in (*TABLE_KEYS, *NODE_KEYS, *RESTART_KEYS) if f"| `{key}` |" not in text] == []
