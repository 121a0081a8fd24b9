"""The system's C compiler, for tests that compile what we write for boards."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compile_c(source: str, folder: Path, *, flags: Sequence[str] = WARNINGS, name: str = "program") -> Path:
    """The program that the source makes; `folder` has its headers. Only CI may not be without a compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        if os.environ.get("CI"):
            pytest.fail("no C compiler (Debian: apt install gcc libc6-dev)")
        pytest.skip("no C compiler (Debian: apt install gcc libc6-dev)")
    file, program = folder / f"{name}.c", folder / name
    file.write_text(source)
    done = subprocess.run(
        [compiler, *flags, "-I", str(folder), "-o", str(program), str(file)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return program
