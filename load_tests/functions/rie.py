"""AWS's runtime interface emulator, the program inside PyPI's aws-sam-cli: it serves one function over HTTP.

It is an emulator for one call at a time, made for tests of a container image; it is compared as that.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from load_tests.functions.clients import Endpoint, call_one_by_one
from load_tests.peers.venvs import FOLDER, HomeFailed
from tests.support.ports import free_port
from tests.support.processes.processes import end
from tests.support.waiting import wait_until

__all__ = ["RIE", "rie_program", "running_rie"]

RIE = "aws-sam-cli==1.170.0"
PATH = "/2015-03-31/functions/function/invocations"
_MACHINES = {"x86_64": "x86_64", "aarch64": "arm64"}
_INSTALL_S = 300


def rie_program(folder: Path = FOLDER / "rie") -> Path:
    """The emulator, taken out of the package at first; HomeFailed tells why there is none."""
    machine = _MACHINES.get(platform.machine())
    if sys.platform != "linux" or machine is None:
        raise HomeFailed("AWS offers it for Linux on x86_64 and arm64")
    program = folder / "samcli" / "local" / "rapid" / f"aws-lambda-rie-{machine}"
    if not program.exists():
        uv = shutil.which("uv", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
        install = [uv, "pip", "install"] if uv else [sys.executable, "-m", "pip", "install"]
        command = [*install, "-q", "--no-deps", "--target", str(folder), RIE]
        done = subprocess.run(command, capture_output=True, text=True, timeout=_INSTALL_S)
        if done.returncode or not program.exists():
            raise HomeFailed(f"{RIE} cannot be installed: {done.stderr.strip()[-200:]}")
    program.chmod(0o755)
    return program


@contextmanager
def running_rie(code: Path, handler: str) -> Iterator[Endpoint]:
    """It serves a function of a folder with awslambdaric, and has answered once."""
    port, api_port = free_port(), free_port()
    runtime = [sys.executable, "-m", "awslambdaric", handler]
    addresses = ["--runtime-interface-emulator-address", f"127.0.0.1:{port}"]
    addresses += ["--runtime-api-address", f"127.0.0.1:{api_port}"]
    process = subprocess.Popen(
        [str(rie_program()), "--log-level", "error", *addresses, *runtime],
        cwd=code,
        env={**os.environ, "AWS_LAMBDA_FUNCTION_TIMEOUT": "30", "PYTHONPATH": str(code)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    endpoint = Endpoint(port, PATH)
    try:
        wait_until(lambda: not call_one_by_one(endpoint, 1).failed, timeout_s=30.0)
        yield endpoint
    finally:
        end(process)
