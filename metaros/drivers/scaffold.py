"""`metaros driver new`: the folder of a driver kind of one's own, from the templates beside this module."""

from __future__ import annotations

import keyword
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from metaros.errors import ConfigError

__all__ = ["TEMPLATES", "scaffold"]

TEMPLATES: Final = Path(__file__).resolve().parent / "_template"
_NAME: Final = re.compile(r"[a-z][a-z0-9_]{1,40}\Z")


def scaffold(name: str, directory: Path) -> tuple[Path, ...]:
    """Write the folder `name` below `directory`, and tell its files. ConfigError: a name that cannot be a package of
    one's own, a folder that is there, a directory that cannot be written.
    """
    if not _NAME.match(name) or keyword.iskeyword(name):
        raise ConfigError(
            f"{name!r}: a driver is named like a Python package: small letters, digits and _, such as depth"
        )
    if name in sys.stdlib_module_names or name.startswith("test_") or find_spec(name) is not None:
        raise ConfigError(f"{name!r} is the name of a Python package that is there already; choose another")
    folder = directory / name
    written = []
    try:
        directory.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
        for template in sorted(TEMPLATES.glob("*.txt")):
            target = folder / template.stem.replace("test_driver", f"test_{name}")
            target.write_text(template.read_text(encoding="utf-8").replace("$kind", name), encoding="utf-8")
            written.append(target)
    except FileExistsError:
        raise ConfigError(f"{folder} is there already") from None
    except OSError as error:
        raise ConfigError(f"{folder}: {error.strerror}") from None
    return tuple(written)
