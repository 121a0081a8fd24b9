"""The environment of a worker, and which client speaks for it."""

from __future__ import annotations

import datetime
import importlib.util
import sys
from collections.abc import Mapping
from typing import Literal

from metaros.automation.functions.calls import FunctionSpec
from metaros.automation.functions.errors import RuntimeRefusedError
from metaros.clock import Clock

__all__ = ["AUTO", "Entry", "check_runtime", "environment_of", "own_entry", "worker_entry"]

Entry = Literal["awslambdaric", "metaros"]
AUTO = "auto"
CLIENT = "METAROS_RUNTIME_CLIENT"
REGION = "local"
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"


def check_runtime(runtime: str) -> None:
    """Whether it is run here: any Python is, by the interpreter of this process.

    Raises:
        RuntimeRefusedError: it is none.
    """
    if not runtime.startswith("python3."):
        raise RuntimeRefusedError(f"the runtime {runtime[:64]!r} is not run here: only python3.*, on {PYTHON}")


def own_entry(wanted: str) -> Entry:
    """The client of workers that say nothing of it: AWS's where it is installed, else ours."""
    if wanted == "metaros":
        return "metaros"
    installed = sys.platform == "linux" and importlib.util.find_spec("awslambdaric") is not None
    return "awslambdaric" if installed or wanted == "awslambdaric" else "metaros"


def worker_entry(spec: FunctionSpec, default: Entry) -> Entry:
    """The client of this function's workers: its environment may choose ours, which streams, or AWS's."""
    wanted = spec.environment.get(CLIENT, "")
    return own_entry(wanted) if wanted in ("awslambdaric", "metaros") else default


def environment_of(spec: FunctionSpec, *, worker: str, clock: Clock) -> Mapping[str, str]:
    """What the platform sets, over what the function's owner did.

    AWS_EXECUTION_ENV does not name python3.12 and later as AWS does: its client would then make a thread for each
    request, at two and a half times the latency.
    """
    date = datetime.datetime.fromtimestamp(clock.wall_ns() / 1e9, datetime.UTC).strftime("%Y/%m/%d")
    warm = spec.min_workers > 0
    return {
        **spec.environment,
        "AWS_LAMBDA_FUNCTION_NAME": spec.name,
        "AWS_LAMBDA_FUNCTION_VERSION": spec.version,
        "AWS_LAMBDA_FUNCTION_MEMORY_SIZE": str(spec.memory_mb),
        "AWS_LAMBDA_LOG_GROUP_NAME": f"/aws/lambda/{spec.name}",
        "AWS_LAMBDA_LOG_STREAM_NAME": f"{date}/[{spec.version}]{worker}",
        "AWS_LAMBDA_INITIALIZATION_TYPE": "provisioned-concurrency" if warm else "on-demand",
        "AWS_REGION": spec.environment.get("AWS_REGION", REGION),
        "AWS_DEFAULT_REGION": spec.environment.get("AWS_DEFAULT_REGION", REGION),
        "AWS_EXECUTION_ENV": f"AWS_Lambda_metaros_{PYTHON}",
    }
