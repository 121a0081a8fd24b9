"""The [black_box] table."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.config.settings import load_settings
from metaros.errors import ConfigError


def load(folder: Path, text: str) -> BlackBoxSettings:
    (folder / "agent.toml").write_text(text)
    return load_settings(folder / "agent.toml").black_box


def test_defaults_and_every_key(tmp_path: Path) -> None:
    assert load(tmp_path, "") == BlackBoxSettings(minutes=5.0, quota_bytes=512 << 20, topics=("**",))
    text = (
        "[black_box]\nenabled = false\nminutes = 2\nquota_bytes = 1048576\ntopics = ['/a/**']\nexclude = ['**/raw']\n"
        "keep = 'disk'\nmemory_bytes = 2097152\n"
    )
    assert load(tmp_path, text) == BlackBoxSettings(
        enabled=False,
        minutes=2,
        quota_bytes=1 << 20,
        topics=("/a/**",),
        exclude=("**/raw",),
        keep="disk",
        memory_bytes=2 << 20,
    )


@pytest.mark.parametrize(
    "line",
    [
        "enabled = 1",
        "keep = 'tape'",
        "memory_bytes = 1000",
        "minutes = 0",
        "minutes = 100000",
        "minutes = true",
        "quota_bytes = 1000",
        "quota_bytes = 1e9",
        "topics = '**'",
        "topics = [1]",
        "exclude = ['a b']",
        "seconds = 3",
    ],
)
def test_wrong_values_name_key_and_file(tmp_path: Path, line: str) -> None:
    with pytest.raises(ConfigError, match=rf"agent.toml: .*black_box\.{line.split()[0]}"):
        load(tmp_path, f"[black_box]\n{line}\n")
