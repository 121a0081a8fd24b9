"""Write the kinds of `docs/reference/drivers.md` from their manifests; the page's head is written by hand.

python tools/gen_drivers.py           write
python tools/gen_drivers.py --check   exit 1 if the page differs from what would be written
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY))

from metaros.drivers import all_manifests  # noqa: E402
from metaros.drivers.manifest import COMMON, PLATFORMS, QUALITIES, Endpoint, Manifest, Parameter  # noqa: E402

PAGE = REPOSITORY / "docs" / "reference" / "drivers.md"
MARK = "<!-- From here on written by tools/gen_drivers.py from the manifests: do not edit. -->\n"


def render() -> str:
    """The whole page: its prose as it is, and the kinds."""
    prose = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    return prose + MARK + "\n".join(line for part in _parts() for line in part).rstrip() + "\n"


def _parts() -> Iterator[Sequence[str]]:
    manifests = all_manifests()
    yield ("", "## Kinds", "")
    yield _table(
        ("kind", "what it is", "quality"), [(f"[`{m.kind}`](#{m.kind})", m.name, m.quality) for m in manifests]
    )
    yield _table(("quality", "means that"), list(QUALITIES.items()))
    yield ("Every kind has these parameters, too:", "")
    yield _parameters(COMMON)
    for manifest in manifests:
        yield from _kind(manifest)


def _kind(manifest: Manifest) -> Iterator[Sequence[str]]:
    yield (f"## {manifest.kind}", "", manifest.summary, "")
    facts = [f"Quality: {manifest.quality}."]
    if manifest.requires:
        facts.append(f"Needs {', '.join(manifest.requires)}: the extra `{manifest.extra}`.")
    if set(manifest.platforms) != set(PLATFORMS):
        facts.append(f"Runs on {' and '.join(manifest.platforms)} only.")
    if manifest.stale_after_s:
        facts.append(f"Stale after {manifest.stale_after_s:g} s without a reading.")
    yield (" ".join(facts), "")
    yield _endpoints("publishes", manifest.publishes)
    yield _endpoints("subscribes to", manifest.subscribes)
    yield _endpoints("serves", manifest.services)
    yield _parameters([parameter for parameter in manifest.parameters if parameter not in COMMON])


def _endpoints(verb: str, endpoints: Sequence[Endpoint]) -> Sequence[str]:
    return _table((verb, "type", ""), [(f"`{item.topic}`", f"`{item.type}`", item.summary) for item in endpoints])


def _parameters(parameters: Sequence[Parameter]) -> Sequence[str]:
    rows = []
    for item in parameters:
        marks = [mark for mark, holds in (("local", item.local), ("live", item.live)) if holds]
        rows.append((f"`{item.name}`", f"`{_shown(item.default)}`", _range(item), ", ".join(marks), item.summary))
    return _table(("parameter", "default", "values", "", "meaning"), rows)


def _range(item: Parameter) -> str:
    unit = f" {item.unit}" if item.unit else ""
    if item.choices:
        return ", ".join(f"`{choice}`" for choice in item.choices) + unit
    low, high = item.minimum, item.maximum
    if low is not None and high is not None:
        return f"{low:g} to {high:g}{unit}"
    bound = f" from {low:g}" if low is not None else f" to {high:g}" if high is not None else ""
    return f"{item.type}{bound}{unit}"


def _shown(value: Any) -> str:
    return '""' if value == "" else str(value).lower() if isinstance(value, bool) else str(value)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Sequence[str]:
    if not rows:
        return ()
    lines = [columns, ["---"] * len(columns), *rows]
    return (*(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines), "")


def main() -> None:
    """Write or check the page."""
    text = render()
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        sys.exit(f"{PAGE.relative_to(REPOSITORY)} is not up to date: run python tools/gen_drivers.py")


if __name__ == "__main__":
    main()
