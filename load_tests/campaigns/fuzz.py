"""Fuzzing of every decoder for as long as one likes: each in a process of its own, guided by coverage with atheris.

    make campaign ARGS="fuzz --minutes 10 --only picture"

atheris is for Linux alone and nobody else needs it: `.venv/bin/uv pip install --python .venv/bin/python atheris`.
Where it is missing, seeds are broken at random. An input that brings out anything but a documented error, that takes
more memory than its target may, or longer than 20 s is found: it is printed, and kept below `.fuzz/`.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

from metaros.clock import system_rng
from tests.security.fuzz.mutate import mutated
from tests.security.fuzz.target import MIB, Target
from tests.security.fuzz.targets import TARGETS

__all__ = ["main"]

FOUND = Path(".fuzz")
HANG_S = 20
CHECKED = 50  # every so many inputs one is weighed: counting memory costs more than most decoders
RSS_MIB = 2048
MODULES = ["metaros", "edge_agent", "gateway"]


def main(argv: list[str]) -> int:
    """Fuzz the targets one after the other; 1 when anything was found."""
    options = _options(argv)
    if options.inside:
        return _inside(TARGETS[options.inside], round(60 * options.minutes))
    names = [name for name in TARGETS if not options.only or any(word in name for word in options.only)]
    guided = importlib.util.find_spec("atheris") is not None
    print(f"{len(names)} targets, {options.minutes:g} min each, {'atheris' if guided else 'broken seeds'}", flush=True)
    found = sum(_outside(name, options.minutes) for name in names)
    print(f"  {'FAIL' if found else 'PASS'}: {found} of {len(names)} targets with a find", flush=True)
    return int(bool(found))


def _options(argv: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="campaign fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0, help="for each target")
    parser.add_argument("--only", action="append", help="targets with this in their name; may be repeated")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    return parser.parse_args(argv)


def _outside(name: str, minutes: float) -> bool:
    """One target in its own process; whether something was found."""
    command = [sys.executable, "-m", "load_tests.campaigns.fuzz", "--inside", name, "--minutes", str(minutes)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=60 * minutes + 120)
        code, output = ended.returncode, ended.stdout + ended.stderr
    except subprocess.TimeoutExpired as error:
        code, output = -1, f"it did not end: {error}"
    last = next((line for line in reversed(output.splitlines()) if "stat::" in line or "inputs" in line), "")
    print(f"{name:>30}  {'found:' if code else 'nothing'}  {last.strip()}", flush=True)
    if code:
        print(output[-4000:], flush=True)
    return bool(code)


def _inside(target: Target, seconds: int) -> int:
    """Run here until the time is over or something is found."""
    FOUND.mkdir(exist_ok=True)
    corpus = FOUND / "".join(c if c.isalnum() else "_" for c in target.name)
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(target.seeds):
        (corpus / f"seed{number}").write_bytes(seed)
    check = _checked(target)
    if importlib.util.find_spec("atheris") is None:
        return _broken_seeds(target, check, seconds)
    import atheris  # type: ignore[import-not-found,unused-ignore]  # only where somebody installed it

    options = [f"-max_total_time={seconds}", f"-timeout={HANG_S}", f"-rss_limit_mb={RSS_MIB}", "-max_len=8192"]
    options += ["-print_final_stats=1", f"-artifact_prefix={corpus}/found-", "-verbosity=0"]
    for name, module in list(sys.modules.items()):
        if module is not None and name.split(".")[0] in MODULES and "_proto" not in name:
            for function in [item for item in vars(module).values() if _is_of(item, name)]:
                vars(module)[function.__name__] = atheris.instrument_func(function)
    atheris.Setup([sys.argv[0], *options, str(corpus)], check)
    atheris.Fuzz()
    return 0


def _is_of(item: object, module: str) -> bool:
    """Whether it is a plain function that was defined in that module."""
    return type(item).__name__ == "function" and getattr(item, "__module__", "") == module


def _checked(target: Target) -> Callable[[bytes], None]:
    """The target, weighed now and then."""
    count = 0

    def check(data: bytes) -> None:
        nonlocal count
        count += 1
        if count % CHECKED:
            target(data)
            return
        tracemalloc.start()
        target(data)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        if peak > target.base_bytes + MIB + target.per_byte * len(data):
            raise MemoryError(f"{peak} bytes for an input of {len(data)}")

    return check


def _broken_seeds(target: Target, check: Callable[[bytes], None], seconds: int) -> int:
    rng, until_s, count = system_rng(), time.monotonic() + seconds, 0
    while time.monotonic() < until_s:
        data = mutated(target.seeds, rng)
        try:
            check(data)
        except Exception as error:
            print(f"found {type(error).__name__}: {error}\n{data.hex()}", flush=True)
            return 1
        count += 1
    print(f"{count} inputs", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
