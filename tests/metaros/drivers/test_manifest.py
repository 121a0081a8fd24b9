"""Manifests: what is wrong in one is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from metaros.drivers.manifest import read_manifest
from metaros.errors import ConfigError

HEAD = 'kind = "toy"\nname = "Toy"\nsummary = "Toys."\nquality = "bronze"\n'
STEP = '[[parameters]]\nname = "step"\ntype = "number"\ndefault = 1\nsummary = "How far."\n'


def written(folder: Path, text: str) -> Path:
    path = folder / "toy" / "manifest.toml"
    path.parent.mkdir()
    path.write_text(text)
    return path


def test_what_is_left_out_has_defaults(tmp_path: Path) -> None:
    manifest = read_manifest(written(tmp_path, HEAD + STEP))
    assert manifest.platforms == ("linux", "macos", "windows")
    assert manifest.runs_here
    assert [parameter.name for parameter in manifest.parameters] == ["step", "allow_faults"]
    assert manifest.parameter("allow_faults").local
    with pytest.raises(ConfigError, match="did you mean 'step'"):
        manifest.parameter("stepp")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("kind = ", "manifest.toml"),
        (HEAD.replace("toy", "boy"), "the folder 'toy'"),
        (HEAD.replace("bronze", "tin"), "quality 'tin'"),
        (HEAD + 'platforms = ["amiga"]', "amiga"),
        (HEAD + "colour = 1", "unknown key colour"),
        ('kind = "toy"', "missing"),
        (HEAD + STEP + STEP, "a parameter is there twice"),
        (HEAD + STEP.replace("number", "complex"), "type 'complex'"),
        (HEAD + STEP.replace("default = 1", 'default = "x"'), "default 'x' is no number"),
        (HEAD + STEP + "maximun = 3", "unknown key maximun"),
        (HEAD + '[[publishes]]\ntopic = "a"', r"\[\[publishes\]\].*type"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        read_manifest(written(tmp_path, text))


def test_what_this_machine_lacks_is_named_with_the_extra(tmp_path: Path) -> None:
    manifest = read_manifest(written(tmp_path, HEAD + 'modules = ["sys", "no_such_module"]'))
    assert manifest.missing() == ("no_such_module",)
    with pytest.raises(ConfigError, match=r"no_such_module\ninstall them with: pip install 'metaros\[drivers\]'"):
        manifest.check_runnable()


def test_another_platform_is_named(tmp_path: Path) -> None:
    manifest = read_manifest(written(tmp_path, HEAD + "platforms = []"))
    with pytest.raises(ConfigError, match="it runs on"):
        manifest.check_runnable()
