"""Generate the Python code of `proto/metaros/v1/*.proto` under `metaros/_proto`, or check that it is fresh.

python tools/gen_proto.py            writes metaros/_proto/metaros/v1/*_pb2.py, *_pb2.pyi and *_pb2_grpc.py
python tools/gen_proto.py --check    exits 1 and names the files that differ, are missing or are left over
"""

from __future__ import annotations

import argparse
import importlib.resources
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "proto"
OUTPUT = ROOT / "metaros" / "_proto"
HEADER = '"""Generated from proto/metaros/v1 by tools/gen_proto.py: do not edit."""\n'
PACKAGE_IMPORT = re.compile(r"^from metaros\.v1 import", re.MULTILINE)
GRPC_STUB = '''\
"""Generated from {source} by tools/gen_proto.py: do not edit."""

from typing import Any

import grpc
import grpc.aio

{classes}'''
CLASSES = """\
class {service}Stub:
    def __init__(self, channel: grpc.Channel | grpc.aio.Channel) -> None: ...
{stub_methods}
class {service}Servicer:
{servicer_methods}
def add_{service}Servicer_to_server(servicer: {service}Servicer, server: grpc.Server | grpc.aio.Server) -> None: ...
"""


def main(argv: list[str] | None = None) -> int:
    """Write the generated files, or compare them; the process's exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing; exit 1 if the files are not fresh")
    options = parser.parse_args(argv)
    files = generate()
    if options.check:
        stale = differences(files)
        for name in stale:
            print(f"metaros/_proto/{name} is not what proto/ says: run `make proto`", file=sys.stderr)
        return 1 if stale else 0
    for name, text in files.items():
        path = OUTPUT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for name in leftovers(files):
        (OUTPUT / name).unlink()
    return 0


def generate() -> dict[str, str]:
    """Every file that belongs under `metaros/_proto`, by its path relative to it."""
    sources = sorted(path.relative_to(SOURCE).as_posix() for path in SOURCE.rglob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        run_protoc(sources, Path(folder))
        files = {
            path.relative_to(folder).as_posix(): PACKAGE_IMPORT.sub(
                "from metaros._proto.metaros.v1 import", path.read_text()
            )
            for path in sorted(Path(folder).rglob("*.py*"))
        }
    for source in sources:
        stub = grpc_stub(source)
        if stub:
            files[source.removesuffix(".proto") + "_pb2_grpc.pyi"] = stub
        else:
            files.pop(source.removesuffix(".proto") + "_pb2_grpc.py", None)
    modules = sorted(Path(name).stem for name in files if name.endswith(".py"))
    exports = "".join(f'    "{name}",\n' for name in modules)
    body = "".join(f"from metaros._proto.metaros.v1 import {name} as {name}\n" for name in modules)
    files["__init__.py"] = f"{HEADER}\n{body}\n__all__ = [\n{exports}]\n"
    files["metaros/__init__.py"] = files["metaros/v1/__init__.py"] = HEADER
    return files


def run_protoc(sources: list[str], output: Path) -> None:
    """Run grpc_tools' protoc on `sources`."""
    from grpc_tools import protoc  # heavy: only when really generating

    well_known = str(importlib.resources.files("grpc_tools") / "_proto")
    flags = [f"-I{SOURCE}", f"-I{well_known}", f"--python_out={output}", f"--pyi_out={output}"]
    code = protoc.main(["protoc", *flags, f"--grpc_python_out={output}", *sources])
    if code != 0:
        raise SystemExit(f"protoc failed with code {code}")


def grpc_stub(source: str) -> str:
    """The .pyi of a _pb2_grpc module, "" where the file has no service: protoc writes none."""
    text = (SOURCE / source).read_text()
    classes = []
    for service, body in re.findall(r"^service (\w+) \{(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        methods = re.findall(r"rpc (\w+)\(", body)
        classes.append(
            CLASSES.format(
                service=service,
                stub_methods="".join(f"    {method}: Any\n" for method in methods),
                servicer_methods="".join(
                    f"    def {method}(self, request: Any, context: Any) -> Any: ...\n" for method in methods
                ),
            )
        )
    return GRPC_STUB.format(source=f"proto/{source}", classes="\n".join(classes)) if classes else ""


def present() -> set[str]:
    """The files that are under `metaros/_proto` now."""
    return {
        path.relative_to(OUTPUT).as_posix()
        for path in OUTPUT.rglob("*")
        if path.suffix in {".py", ".pyi"} and "__pycache__" not in path.parts
    }


def leftovers(files: dict[str, str]) -> list[str]:
    """Files on disk that no proto file accounts for any more."""
    return sorted(present() - files.keys())


def differences(files: dict[str, str]) -> list[str]:
    """Names of files that are stale, missing or left over."""
    there = present()
    wrong = [name for name, text in files.items() if name not in there or (OUTPUT / name).read_text() != text]
    return sorted([*wrong, *leftovers(files)])


if __name__ == "__main__":
    raise SystemExit(main())
