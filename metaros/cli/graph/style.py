"""The colours of the drawn graph, light and dark. Text and tones keep a contrast of at least 4.5 to their ground."""

from __future__ import annotations

__all__ = ["STYLE"]

STYLE = """
svg{--paper:#fafbfd;--ink:#182033;--soft:#5c677d;--line:#98a5bb;--card:#fff;--rim:#cdd6e4;--frame:#f0f3f9;--frame-rim:#dbe2ee;
--node:#e3edff;--node-rim:#6d9bf0;--topic:#3a76e0;--service:#8450d8;--action:#0b8a74;--fault:#cf2318;--warn:#96640a}
@media(prefers-color-scheme:dark){svg{--paper:#0f131b;--ink:#e7ebf3;--soft:#94a0b6;--line:#5a6881;--card:#1a212e;--rim:#323d51;
--frame:#141a25;--frame-rim:#262f40;--node:#1c3157;--node-rim:#5b8def;--topic:#6ea0f7;--service:#b48df2;--action:#3fc4ab;
--fault:#ff7468;--warn:#e3ac44}}
text{font:10px ui-monospace,SFMono-Regular,Menlo,Consolas,'DejaVu Sans Mono',monospace;fill:var(--ink)}
.paper{fill:var(--paper)}.heading{font:600 17px system-ui,sans-serif}.muted{font-size:11px;fill:var(--soft)}
.name{font-size:12.5px}.small{fill:var(--soft)}.end{text-anchor:end}.middle{text-anchor:middle}.wrong{font-size:11px;fill:var(--fault)}
.frame rect{fill:var(--frame);stroke:var(--frame-rim)}.frame text{font-size:12px;font-weight:600;fill:var(--soft)}
.node rect{fill:var(--node);stroke:var(--node-rim);stroke-width:1.3}.node .name{font-weight:600}
.topic rect,.service rect,.action rect{fill:var(--card);stroke:var(--rim)}
.topic .bar{fill:var(--topic);stroke:none}.service .bar{fill:var(--service);stroke:none}
.action .bar{fill:var(--action);stroke:none}
.fact{fill:var(--ink)}.lonely rect{stroke:var(--warn);stroke-dasharray:4 3}
.lonely .bar{fill:var(--warn)}.lonely .fact{fill:var(--warn)}
.ill rect{stroke:var(--fault);stroke-width:1.4}.ill .bar{fill:var(--fault)}
.arc{fill:none;stroke:var(--line);stroke-width:1.3}.arc:hover{stroke:var(--ink);stroke-width:2.2}
.arc.fault{stroke:var(--fault);stroke-width:1.7;stroke-dasharray:6 4}
.arc.part{stroke:var(--warn);stroke-width:1.7;stroke-dasharray:6 4}
.tip{fill:var(--line)}.tip-fault{fill:var(--fault)}.tip-part{fill:var(--warn)}
.topic.key rect{fill:var(--topic);stroke:none}.service.key rect{fill:var(--service);stroke:none}
.action.key rect{fill:var(--action);stroke:none}
.lonely.key rect{fill:none}.fault.key rect{fill:none;stroke:var(--fault);stroke-dasharray:4 3}
""".strip()
