"""The colours of a backtest's plot, light and dark. Text keeps a contrast of at least 4.5 to its ground."""

from __future__ import annotations

__all__ = ["STYLE"]

STYLE = """
svg{--paper:#fafbfd;--ink:#182033;--soft:#5c677d;--grid:#e4e9f2;--card:#fff;--rim:#dbe2ee;--line:#2f66cf;--band:#9cc0f7;
--error:#c8221a;--warning:#96640a;--info:#0b7a74}
@media(prefers-color-scheme:dark){svg{--paper:#0f131b;--ink:#e7ebf3;--soft:#94a0b6;--grid:#232b3a;--card:#161c28;--rim:#2b3547;
--line:#7fb0ff;--band:#2f5fa8;--error:#ff7468;--warning:#e3ac44;--info:#3fc4ab}}
text{font:11px ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:var(--ink)}
.paper{fill:var(--paper)}.heading{font:600 18px system-ui,sans-serif}.soft{fill:var(--soft)}
.name{font-size:12.5px;font-weight:600}
.end{text-anchor:end}.middle{text-anchor:middle}.card{fill:var(--card);stroke:var(--rim)}
.grid{stroke:var(--grid);stroke-width:1}.band{fill:var(--band);fill-opacity:.38;stroke:none}
.line{fill:none;stroke:var(--line);stroke-width:1.5;stroke-linejoin:round;stroke-linecap:round}
.span{fill-opacity:.13}.bar{rx:4px}.mark{stroke:var(--card);stroke-width:1.6}.rule{stroke-width:1;stroke-dasharray:3 3}
.error{fill:var(--error)}.warning{fill:var(--warning)}.info{fill:var(--info)}
.rule.error{stroke:var(--error)}.rule.warning{stroke:var(--warning)}.rule.info{stroke:var(--info)}
.mark:hover,.bar:hover{stroke:var(--ink)}
""".strip()
