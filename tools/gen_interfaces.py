"""Write `metaros/interfaces`: for each package and kind a module that makes classes on demand, and its stub.

python tools/gen_interfaces.py           write
python tools/gen_interfaces.py --check   exit 1 and list the files if any differs from what would be written
"""

from __future__ import annotations

import builtins
import json
import re
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY))

from metaros.idl import (  # noqa: E402
    ActionDefinition,
    Catalogue,
    Definition,
    FieldType,
    MessageDefinition,
    ServiceDefinition,
    default_catalogue,
)
from metaros.idl.arrays import DTYPES  # noqa: E402
from metaros.idl.catalogue import shipped_names  # noqa: E402
from metaros.idl.derived import derived_definitions  # noqa: E402

ROOT = REPOSITORY / "metaros" / "interfaces"

_NUMPY = {base: f"np.{dtype.name if dtype.name != 'bool' else 'bool_'}" for base, dtype in DTYPES.items()}
_KINDS = {"msg": "messages", "srv": "services", "action": "actions"}


def render() -> dict[Path, str]:
    """Every file that belongs below `metaros/interfaces`, with its text."""
    catalogue = default_catalogue()
    packages: dict[str, dict[str, list[str]]] = {}
    for name in shipped_names():
        package, kind, _ = name.split("/")
        packages.setdefault(package, {}).setdefault(kind, []).append(name)
    files = {ROOT / "__init__.py": _ROOT_MODULE}
    for package, kinds in packages.items():
        files[ROOT / package / "__init__.py"] = f'"""The interfaces of {package}."""\n'
        for kind, names in kinds.items():
            files[ROOT / package / f"{kind}.py"] = _module(package, kind, names)
            files[ROOT / package / f"{kind}.pyi"] = _stub(package, kind, names, catalogue)
    return files


def _module(package: str, kind: str, names: list[str]) -> str:
    listed = "".join(f'    "{name.split("/")[2]}",\n' for name in names)
    return _MODULE.format(package=package, kind=kind, plural=_KINDS[kind], listed=listed)


def _stub(package: str, kind: str, names: list[str], catalogue: Catalogue) -> str:
    blocks: list[str] = []
    for name in names:
        definition = catalogue.get(name)
        parts = sorted((*derived_definitions(definition).values(), definition), key=_is_namespace)
        for part in parts:
            block = _message(part) if isinstance(part, MessageDefinition) else _namespace(part)
            short = len(block) == 1 and (not blocks or blocks[-1].endswith("): ..."))
            blocks.append(("\n" if blocks and not short else "") + "\n".join(block))
    text = "\n".join(blocks).replace(f" {package}_{kind}.", " ").replace(f"[{package}_{kind}.", "[")
    shadows = any(re.search(rf"^        {name}: ", text, re.MULTILINE) for name in dir(builtins))
    head = [*(["# ruff: noqa: A002"] if shadows else []), f'"""The {_KINDS[kind]} of {package}."""']
    return "\n".join([*head, *_imports(text), "", text]) + "\n"


def _is_namespace(definition: Definition) -> bool:
    return not isinstance(definition, MessageDefinition)


def _imports(text: str) -> list[str]:
    lines = [""] if "Sequence[" in text or "Any" in text or "Final" in text else []
    lines += ["from collections.abc import Sequence"] if "Sequence[" in text else []
    typing = [name for name in ("Any", "Final") if re.search(rf"\b{name}\b", text)]
    lines += [f"from typing import {', '.join(typing)}"] if typing else []
    if "npt." in text:
        lines += [
            "",
            *(["import numpy as np"] if "np." in text.replace("npt.", "") else []),
            "import numpy.typing as npt",
        ]
    bases = [base for base in ("Action", "Message", "Service") if f"({base}):" in text]
    lines += ["", f"from metaros.idl import {', '.join(bases)}"]
    used = sorted(set(re.findall(r"\b([a-z][a-z0-9_]*)_(msg|srv|action)\.", text)))
    return [*lines, *(f"from metaros.interfaces.{package} import {kind} as {package}_{kind}" for package, kind in used)]


def _message(definition: MessageDefinition) -> list[str]:
    head = f"class {definition.name.split('/')[2]}(Message):"
    lines = [f"    {constant.name}: Final = {_literal(constant.value)}" for constant in definition.constants]
    if not definition.fields:
        return [head, *lines] if lines else [f"{head} ..."]
    lines += [f"    {field.attribute}: {_held(field.type)}" for field in definition.fields]
    parameters = [f"        {field.attribute}: {_accepted(field.type)} = ...," for field in definition.fields]
    return [head, *lines, "    def __init__(", "        self,", "        *,", *parameters, "    ) -> None: ..."]


def _namespace(definition: ServiceDefinition | ActionDefinition) -> list[str]:
    short = definition.name.split("/")[2]
    if isinstance(definition, ServiceDefinition):
        base, parts = "Service", ("Request", "Response", "Event")
    else:
        base, parts = "Action", ("Goal", "Result", "Feedback")
    return [f"class {short}({base}):", *(f"    {part} = {short}_{part}" for part in parts)]


def _literal(value: object) -> str:
    return json.dumps(value) if isinstance(value, str) else repr(value)


def _held(kind: FieldType) -> str:
    """The type of an attribute as one reads it."""
    if kind.array and kind.base in DTYPES:
        return f"npt.NDArray[{_NUMPY[kind.base]}]"
    return f"list[{_one(kind)}]" if kind.array else _one(kind)


def _accepted(kind: FieldType) -> str:
    """The type of a constructor's argument."""
    if kind.array and kind.base in DTYPES:
        numbers = "bool" if kind.base == "bool" else "float" if kind.base.startswith("float") else "int"
        raw = " | bytes | bytearray | memoryview" if DTYPES[kind.base].itemsize == 1 else ""
        return f"npt.NDArray[Any] | Sequence[{numbers}]{raw}"
    return f"list[{_one(kind)}]" if kind.array else _one(kind)


def _one(kind: FieldType) -> str:
    if kind.is_nested:
        package, group, name = kind.base.split("/")
        return f"{package}_{group}.{name}"
    if kind.is_string:
        return "str"
    if kind.base == "bool":
        return "bool"
    return "float" if kind.base.startswith("float") else "int"


_ROOT_MODULE = '''"""The interfaces of the common ROS 2 packages as importable classes.

    from metaros.interfaces.sensor_msgs.msg import LaserScan
    from metaros.interfaces.std_srvs.srv import Trigger

A class is made when it is first asked for. The modules and stubs below are generated by `tools/gen_interfaces.py`.
"""
'''

_MODULE = '''"""The {plural} of {package}, made when first asked for. Generated by tools/gen_interfaces.py."""

from __future__ import annotations

from typing import Any

from metaros.errors import UnknownTypeError
from metaros.idl import message_class

_NAMES = [
{listed}]

__all__ = [*_NAMES]


def __getattr__(name: str) -> type[Any]:
    if not name.startswith("_"):
        try:
            made = message_class(f"{package}/{kind}/{{name}}")
        except UnknownTypeError:
            raise AttributeError(f"{package} has no {kind} {{name!r}}") from None
        globals()[name] = made
        return made
    raise AttributeError(f"module {{__name__!r}} has no attribute {{name!r}}")


def __dir__() -> list[str]:
    return [*_NAMES]
'''


def main(argv: list[str]) -> int:
    """Write the files, or check them."""
    files = render()
    present = {path for pattern in ("*.py", "*.pyi") for path in ROOT.rglob(pattern)}
    stale = sorted(present - files.keys())
    changed = sorted(path for path, text in files.items() if not path.exists() or path.read_text() != text)
    if "--check" in argv:
        for path in (*changed, *stale):
            print(f"differs: {path.relative_to(REPOSITORY)}", file=sys.stderr)
        return 1 if changed or stale else 0
    for path in stale:
        path.unlink()
    for path in changed:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(files[path])
    print(f"{len(changed)} files written, {len(stale)} removed, {len(files)} in all")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
