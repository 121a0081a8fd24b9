"""`metaros doctor`: check each hop from this machine's Python to the gateway, and say which one fails and the fix."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metaros.cli.shared.options import DEFAULT_ZENOH_PORT, Domain, Format, FormatOption, ZenohPort

if TYPE_CHECKING:
    from metaros.cli.doctor.checks import Finding
    from metaros.cli.shared.output import Output

__all__ = ["register"]

MARKS = {"ok": ("✓", "32"), "note": ("·", "2"), "warning": ("!", "33"), "failed": ("✗", "1;31")}


def register(app: typer.Typer) -> None:
    """Add the noun."""
    app.command("doctor")(doctor)


def doctor(
    port: Annotated[
        int | None, typer.Option("--port", "-p", min=1, max=65535, metavar="PORT", help="The gateway's HTTP port.")
    ] = None,
    data_dir: Annotated[
        Path | None, typer.Option("--data-dir", metavar="DIR", help="Check this directory's disk.")
    ] = None,
    zenoh_port: ZenohPort = DEFAULT_ZENOH_PORT,
    domain: Domain = 0,
    output: FormatOption = Format.TEXT,
) -> None:
    """Check this machine's Meta-ROS; exit code 1 where something fails."""
    from metaros.cli.doctor.checks import Doctor
    from metaros.cli.shared.output import Output
    from metaros.clock import SystemClock

    out = Output(output)
    findings = []
    clock = SystemClock()
    for finding in Doctor(port=port, data_dir=data_dir, zenoh_port=zenoh_port, domain=domain, clock=clock).findings():
        findings.append(finding)
        if not out.json:
            _show(out, finding)
    failed = [finding for finding in findings if finding.state == "failed"]
    if out.json:
        out.objects({"ok": not failed, "checks": [asdict(finding) for finding in findings]})
    else:
        warnings = sum(finding.state == "warning" for finding in findings)
        more = f", {warnings} warning{'s' * (warnings > 1)}" if warnings else ""
        last = out.style("All is well", "1;32") if not failed else out.style(f"{failed[0].check}: failed", "1;31")
        out.line(f"\n  {last}{more}")
    if failed:
        raise typer.Exit(1)


def _show(out: Output, finding: Finding) -> None:
    mark, code = MARKS[finding.state]
    out.line(f"  {out.style(mark, code)} {finding.check:<11} {finding.text}")
    if finding.fix:
        out.line(f"    {'':<11} {out.style('→ ' + finding.fix, '33' if finding.state != 'failed' else '31')}")
