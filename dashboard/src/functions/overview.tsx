/** A function at a glance: its chart, what calls it, its aliases with canaries, its versions, how it is set up. */

import { useSignal } from "@preact/signals";
import { Badge } from "../admin/badge";
import { Confirm, type Question } from "../admin/modal";
import { functionsApi, type Alias, type FunctionDetail } from "../api/functions";
import { can } from "../api/session";
import { ageText, now } from "../live/age";
import { bytes, duration, integer, percent } from "../ui/format";
import { Link } from "../ui/parts";
import { lazy } from "../views/lazy";
import { FunctionChart } from "./chart";
import type { PartProps } from "./part_props";
import { CANARY_TONES, CANARY_WORDS, canaryText, sharesOf, triggerKind, triggerWords } from "./words";

const AliasDialog = lazy(async () => (await import("./alias_dialogs")).AliasDialog, null);
const CanaryDialog = lazy(async () => (await import("./alias_dialogs")).CanaryDialog, null);
const PublishDialog = lazy(async () => (await import("./alias_dialogs")).PublishDialog, null);
const SettingsDialog = lazy(async () => (await import("./settings_dialog")).SettingsDialog, null);

type Open = { what: "alias" | "canary"; alias: Alias | null } | { what: "publish" | "settings" } | null;

export function OverviewPart({ one, asked }: PartProps) {
  const open = useSignal<Open>(null);
  const question = useSignal<Question | null>(null);
  const close = () => (open.value = null);
  const done = () => void asked.refresh();
  const now_ = open.value;
  return (
    <div class="alert-split">
      <div class="alert-main">
        <FunctionChart stats={one.stats} />
        <TriggersCard one={one} />
        <AliasesCard one={one} onOpen={(next) => (open.value = next)} onAsk={(next) => (question.value = next)} onDone={asked.refresh} />
        <VersionsCard one={one} onPublish={() => (open.value = { what: "publish" })} />
      </div>
      <div class="alert-side">
        <SettingsCard one={one} onEdit={() => (open.value = { what: "settings" })} />
        <EventsCard one={one} />
        {Object.keys(one.environment).length > 0 && <EnvironmentCard environment={one.environment} />}
      </div>
      {now_?.what === "alias" && <AliasDialog one={one} alias={now_.alias} onClose={close} onDone={done} />}
      {now_?.what === "canary" && now_.alias && <CanaryDialog one={one} alias={now_.alias} onClose={close} onDone={done} />}
      {now_?.what === "publish" && <PublishDialog one={one} onClose={close} onDone={done} />}
      {now_?.what === "settings" && <SettingsDialog one={one} onClose={close} onDone={done} />}
      {question.value && <Confirm question={question.value} onClose={() => (question.value = null)} />}
    </div>
  );
}

function TriggersCard({ one: { triggers } }: { one: FunctionDetail }) {
  return (
    <section class="card" aria-label="Called by">
      <header><h2>Called by</h2></header>
      {triggers.length === 0 ? (
        <p class="hint pad-in">Nothing calls it by itself. Make a <Link href="/rules?show=new" class="text-link">rule</Link> that has it as its target, or map a topic to it with boto3's <code>create_event_source_mapping</code>.</p>
      ) : (
        <ul class="rows fn-rows">
          {triggers.map((trigger) => (
            <li key={trigger.id} data-trigger={trigger.kind}>
              <span>
                <span class="chip">{triggerKind(trigger.kind)}</span>{" "}
                {trigger.kind === "rule" || trigger.kind === "schedule" ? <Link href={`/rules/${encodeURIComponent(trigger.id)}`} class="text-link">{triggerWords(trigger)}</Link> : <span class="wrap">{triggerWords(trigger)}</span>}
              </span>
              <Badge tone={trigger.enabled ? "good" : "off"}>{trigger.enabled ? "on" : "off"}</Badge>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

interface AliasesProps {
  one: FunctionDetail;
  onOpen: (open: Open) => void;
  onAsk: (question: Question) => void;
  onDone: () => Promise<void>;
}

function AliasesCard({ one, onOpen, onAsk, onDone }: AliasesProps) {
  const writes = can("functions.write");
  return (
    <section class="card" aria-label="Aliases">
      <header>
        <h2>Aliases</h2>
        {writes && one.published.length > 0 && <button type="button" class="button note-end" onClick={() => onOpen({ what: "alias", alias: null })}>New alias…</button>}
      </header>
      {one.aliases.length === 0 && <p class="hint pad-in">An alias is a name, “live”, that leads to a version: what calls it needs no change when the version does.</p>}
      {one.aliases.length > 0 && (
        <ul class="rows fn-rows">
          {one.aliases.map((alias) => (
            <li key={alias.name} data-alias={alias.name} class="fn-alias">
              <div>
                <b>{alias.name}</b> {alias.canary && <Badge tone={CANARY_TONES[alias.canary.state]}>{CANARY_WORDS[alias.canary.state]}</Badge>}
                <Shares alias={alias} />
                {alias.canary && <p class="sub" data-canary={alias.canary.state}>{canaryText(alias.canary)}</p>}
              </div>
              {writes && (
                <span class="fn-acts">
                  {alias.canary?.state === "running" ? (
                    <button type="button" class="button" onClick={() => onAsk(stopQuestion(one, alias, onDone))}>Stop canary…</button>
                  ) : one.published.length > 1 && <button type="button" class="button" onClick={() => onOpen({ what: "canary", alias })}>Canary…</button>}
                  <button type="button" class="button" onClick={() => onOpen({ what: "alias", alias })} aria-label={`Edit ${alias.name}`}>Edit…</button>
                  <button type="button" class="button" onClick={() => onAsk(removeQuestion(one, alias, onDone))} aria-label={`Delete ${alias.name}`}>Delete…</button>
                </span>
              )}
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

function Shares({ alias }: { alias: Alias }) {
  const shares = sharesOf(alias.version, alias.weights);
  return (
    <span class="fn-shares">
      <span class="queue-bar" aria-hidden="true">{shares.map(([version, share], i) => <i key={version} class={i === 0 ? "fresh" : "late"} style={{ inlineSize: `${share * 100}%` }} />)}</span>
      <small class="num">{shares.map(([version, share]) => (shares.length === 1 ? `version ${version}` : `version ${version} ${percent(share)}`)).join(" · ")}</small>
    </span>
  );
}

const stopQuestion = (one: FunctionDetail, alias: Alias, done: () => Promise<void>): Question => ({
  title: "Stop this canary?",
  text: <p>Every call of {one.name}:{alias.name} goes to version {alias.canary?.stable} again.</p>,
  yes: "Stop it",
  run: async () => {
    await functionsApi.stopCanary(one.name, alias.name);
    await done();
  },
});

const removeQuestion = (one: FunctionDetail, alias: Alias, done: () => Promise<void>): Question => ({
  title: `Delete the alias ${alias.name}?`,
  text: <p>What calls {one.name}:{alias.name} fails from then on. The version itself stays.</p>,
  yes: "Delete it",
  run: async () => {
    await functionsApi.removeAlias(one.name, alias.name);
    await done();
  },
});

function VersionsCard({ one, onPublish }: { one: FunctionDetail; onPublish: () => void }) {
  const leads = (version: string) => one.aliases.filter((alias) => alias.version === version || version in alias.weights);
  return (
    <section class="card" aria-label="Versions">
      <header>
        <h2>Versions</h2>
        {can("functions.write") && <button type="button" class="button note-end" onClick={onPublish}>Publish…</button>}
      </header>
      {one.published.length === 0 ? <p class="hint pad-in">A version never changes: publish one of what runs now, and let an alias lead to it.</p> : (
        <ul class="rows fn-rows">
          {[...one.published].reverse().map(({ version, description, code_sha256: sha, modified }) => (
            <li key={version} data-version={version}>
              <span><b class="num">{version}</b> {leads(version).map(({ name }) => <span key={name} class="chip">{name}</span>)} <span class="wrap">{description}</span></span>
              <small class="num" title={sha}>{sha === one.code_sha256 && "the present code · "}{ageText(now.value - Date.parse(modified))} ago</small>
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

const Row = ({ word, children }: { word: string; children: preact.ComponentChildren }) => <div><dt>{word}</dt><dd class="wrap">{children}</dd></div>;

function SettingsCard({ one, onEdit }: { one: FunctionDetail; onEdit: () => void }) {
  return (
    <section class="card" aria-label="Settings">
      <header><h2>Settings</h2>{can("functions.write") && <button type="button" class="button note-end" onClick={onEdit}>Edit…</button>}</header>
      <dl class="alert-dl">
        <Row word="Handler"><code>{one.handler}</code></Row>
        <Row word="Runtime">{one.runtime}{one.interpreter && !one.interpreter.startsWith(`${one.runtime}.`) && one.interpreter !== one.runtime && <small> runs on {one.interpreter}</small>}</Row>
        <Row word="Timeout">{duration(one.timeout_s)}</Row>
        <Row word="Memory">{one.memory_mb}{"\u202f"}MB</Row>
        <Row word="Disk">{one.disk_mb}{"\u202f"}MB</Row>
        <Row word="At a time">{one.concurrency.reserved === null ? "as many as there are workers" : `at most ${one.concurrency.reserved}`}{one.concurrency.warm > 0 && `, ${one.concurrency.warm} kept warm`}</Row>
        <Row word="Code">{bytes(one.code_bytes)} <small title={one.modified}>{ageText(now.value - Date.parse(one.modified))} ago</small></Row>
        {one.layers.length > 0 && <Row word="Layers">{one.layers.map((arn) => <code key={arn} class="fn-arn">{arn}</code>)}</Row>}
        <Row word="ARN"><code class="fn-arn">{one.arn}</code></Row>
      </dl>
    </section>
  );
}

function EventsCard({ one: { event_invoke: settings } }: { one: FunctionDetail }) {
  const to = [["worked", settings.on_success], ["failed", settings.on_failure || settings.dead_letter]].filter(([, arn]) => arn);
  return (
    <section class="card" aria-label="Events">
      <header><h2>Events</h2></header>
      <dl class="alert-dl">
        <Row word="Tried">{settings.most_retries === 0 ? "once" : `${integer(settings.most_retries + 1)} times`}, for at most {duration(settings.most_age_s)}; then they are dead letters</Row>
        {to.map(([word, arn]) => <Row key={word} word={`When ${word}`}><code class="fn-arn">{arn}</code></Row>)}
      </dl>
    </section>
  );
}

function EnvironmentCard({ environment }: { environment: Record<string, string> }) {
  const shown = can("functions.write");
  return (
    <section class="card" aria-label="Environment">
      <header><h2>Environment</h2>{!shown && <span class="note">admins see the values</span>}</header>
      <dl class="alert-dl fn-environment">{Object.entries(environment).map(([name, value]) => <div key={name}><dt><code>{name}</code></dt><dd class="wrap"><code>{shown ? value : "•••"}</code></dd></div>)}</dl>
    </section>
  );
}
