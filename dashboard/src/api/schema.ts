/**
 * The documents of the gateway's REST interface, and what each operation takes and answers.
 *
 * Written by tools/gen_ts_client.py from the gateway's OpenAPI: do not edit.
 */

/**
 * Who asks, and what they may do. `csrf` goes into X-CSRF-Token; "" where no cookie is used.
 *
 * `has_password`: whether they can sign in by a password; one who cannot may set the first without an old one.
 */
export interface Account {
  kind: "anonymous" | "user" | "key" | "robot";
  id: string;
  name: string;
  role: "none" | "viewer" | "operator" | "admin";
  robots: string[];
  scopes: string[];
  csrf: string;
  has_password: boolean;
  permissions: string[];
}

/** The actions of a robot, by name. */
export interface ActionList {
  actions: GraphAction[];
  next: string | null;
}

/**
 * What is wrong with a robot; one is not resolved for each robot and `cause`. Robot "" is the fleet itself.
 *
 * `reason`, `series`, `detector`, `score` (0 to 1), `value` and the expected band `low` to `high` are of its worst
 * finding. `first` is the robot's stamp where it began, and `path` the robot's page at that time; the other times are
 * the gateway's. `clearing` is since when nothing is wrong any more, before it is resolved. `quiet`: nobody is told of
 * it, because of the alert `inhibited_by` that explains it, or a `silence`. `clip` is the recording of its evidence.
 */
export interface Alert {
  id: string;
  robot: string;
  cause: string;
  state: "open" | "acknowledged" | "resolved";
  severity: "info" | "warning" | "error";
  title: string;
  reason: string;
  series: string;
  detector: string;
  score: number;
  value: number | null;
  low: number | null;
  high: number | null;
  opened: string;
  first: string;
  changed: string;
  seen: string;
  clearing: string | null;
  resolved: string | null;
  resolved_by: string;
  acknowledged: string | null;
  acknowledged_by: string;
  assignee: string;
  times: number;
  clip: string;
  inhibited_by: string;
  silence: string;
  quiet: boolean;
  gateway: string;
  revision: number;
  path: string;
}

/**
 * A check as it is now; `low` and `high` are null where it has no such bound.
 *
 * `changed` names the fields that are not as they come, `changed_by` who made the last change.
 */
export interface AlertCheck {
  id: string;
  title: string;
  unit: string;
  enabled: boolean;
  low: number | null;
  high: number | null;
  for_s: number;
  clear_s: number;
  severity: "info" | "warning" | "error";
  changed: string[];
  changed_by: string;
  changed_at: string | null;
}

/** The table of checks, in its order. */
export interface AlertCheckList {
  checks: AlertCheck[];
  next: string | null;
}

/** Alerts that are not resolved, of robots in one's scope; `quiet` ones, of which nobody is told, count beside. */
export interface AlertCounts {
  open: number;
  acknowledged: number;
  error: number;
  warning: number;
  info: number;
  quiet: number;
}

/** With its findings, the worst first, and its remarks, the oldest first. */
export interface AlertDetail {
  id: string;
  robot: string;
  cause: string;
  state: "open" | "acknowledged" | "resolved";
  severity: "info" | "warning" | "error";
  title: string;
  reason: string;
  series: string;
  detector: string;
  score: number;
  value: number | null;
  low: number | null;
  high: number | null;
  opened: string;
  first: string;
  changed: string;
  seen: string;
  clearing: string | null;
  resolved: string | null;
  resolved_by: string;
  acknowledged: string | null;
  acknowledged_by: string;
  assignee: string;
  times: number;
  clip: string;
  inhibited_by: string;
  silence: string;
  quiet: boolean;
  gateway: string;
  revision: number;
  path: string;
  findings: AlertFinding[];
  remarks: AlertRemark[];
}

/** One thing that is wrong at one place; `series` is a metric, topic, node or stream, "" the whole robot. */
export interface AlertFinding {
  detector: string;
  series: string;
  severity: "info" | "warning" | "error";
  score: number;
  value: number | null;
  low: number | null;
  high: number | null;
  reason: string;
  at: string;
  active: boolean;
}

/** The newest first; `next` is the `before` of the next page, null at the end. */
export interface AlertList {
  alerts: Alert[];
  next: string | null;
}

/** The alert, and what was taught. */
export interface AlertNormal {
  alert: Alert;
  taught: string[];
}

/** What somebody said or did; `by` is empty where the gateway did it. */
export interface AlertRemark {
  number: number;
  at: string;
  by: string;
  kind: string;
  text: string;
}

/** Where notices go: `target` is a URL or HOST:PORT without what is secret; `last_error` of the newest failure. */
export interface AlertRoute {
  name: string;
  kind: "webhook" | "smtp";
  target: string;
  severity: "info" | "warning" | "error";
  robots: string[];
  causes: string[];
  sent: number;
  failed: number;
  waiting: number;
  last: string | null;
  last_error: string;
}

/** The routes of `--notify`, in the file's order. */
export interface AlertRouteList {
  routes: AlertRoute[];
  next: string | null;
}

/** Whether the notice came; `status` is the answer's of a webhook, 0 where there was none, `error` what failed. */
export interface AlertRouteTest {
  ok: boolean;
  status: number;
  error: string;
  took_s: number;
}

/** A name for a version; `weights` are the shares of other versions. */
export interface Alias {
  name: string;
  version: string;
  description: string;
  weights: Record<string, number>;
  canary: Canary | null;
}

/** A key without its secret; `user` is "" for a key of nobody's. `used` is exact to five minutes. */
export interface ApiKey {
  id: string;
  name: string;
  user: string;
  role: "viewer" | "operator" | "admin";
  robots: string[];
  scopes: string[];
  created: string;
  expires: string | null;
  used: string | null;
}

/** The newest first. */
export interface ApiKeyList {
  keys: ApiKey[];
  next: string | null;
}

/** What does not hold, at which row. */
export interface AuditFault {
  number: number;
  fault: "hash" | "missing" | "head" | "export";
  detail: string;
}

/** Rows, the newest first; `next` is `before` of the page after this one, null at the end. */
export interface AuditPage {
  rows: AuditRow[];
  next: number | null;
}

/**
 * Whether every row follows from the one before, and the exported heads are those of this chain.
 *
 * At most 100 faults. `heads` were compared; `heads_sealed` of them were sealed with this gateway's master key.
 */
export interface AuditProof {
  ok: boolean;
  rows: number;
  hash: string;
  faults: AuditFault[];
  heads: number;
  heads_sealed: number;
  heads_error: string;
}

/** A row of the log; `hash` proves it and all before it. */
export interface AuditRow {
  number: number;
  at: string;
  gateway: string;
  kind: string;
  actor: string;
  name: string;
  role: string;
  address: string;
  action: string;
  method: string;
  target: string;
  status: number;
  code: string;
  detail: string;
  hash: string;
}

/** What would have fired. `cut`: there were more rows than are judged at once; this is of the first of them. */
export interface Backtest {
  robot: string;
  span: BacktestSpan;
  samples: number;
  findings: BacktestFinding[];
  alerts: BacktestAlert[];
  series: BacktestSeries[];
  cut: boolean;
  took_s: number;
}

/** What would have been told. */
export interface BacktestAlert {
  cause: string;
  severity: "info" | "warning" | "error";
  title: string;
  reason: string;
  first: string;
  last: string | null;
  findings: number;
}

/** What would have been found, from `at` to `until` (null: at the end still). */
export interface BacktestFinding {
  detector: string;
  series: string;
  cause: string;
  severity: "info" | "warning" | "error";
  score: number;
  value: number | null;
  low: number | null;
  high: number | null;
  reason: string;
  at: string;
  until: string | null;
}

/** How many samples it has, and so many points of it as a plot needs, each as a band's. */
export interface BacktestSeries {
  series: string;
  samples: number;
  points: ([number, number | null, number | null, number | null, number])[];
}

/** From when to when. */
export interface BacktestSpan {
  from: string;
  to: string;
}

/** A series as far as the gateway remembers what it expected: [stamp_ms, value, low, high, score], oldest first. */
export interface Band {
  robot: string;
  series: string;
  points: ([number, number | null, number | null, number | null, number])[];
}

/** What the robot still has of its last minutes, by its clock; `lost` messages did not reach its disk. */
export interface BlackBox {
  from: string | null;
  to: string | null;
  size_bytes: number;
  quota_bytes: number;
  lost: number;
}

/** Both ends included; a step of 0: any value between them. */
export interface Bounds {
  from: number;
  to: number;
  step: number;
}

/** An uploaded bundle; robots can have it once it is `signed`, and until it is `withdrawn`. */
export interface Bundle {
  path: string;
  kind: "node" | "agent";
  name: string;
  version: string;
  min_version: string;
  hw: string[];
  python: string;
  sha256: string;
  size_bytes: number;
  signed: boolean;
  uploaded: string;
  uploaded_by: string;
  withdrawn: string | null;
  reason: string;
}

/** The service's response. */
export interface CallResult {
  response: Record<string, unknown>;
}

/** A new version that an alias leads to now and then: see `PUT …/canary`. Counts are of its present step. */
export interface Canary {
  version: string;
  stable: string;
  weight: number;
  error_rate: number;
  least_invocations: number;
  for_s: number;
  step: number;
  state: "running" | "promoted" | "rolled_back" | "cancelled";
  reason: string;
  began: string;
  changed: string;
  invocations: number;
  errors: number;
}

/** Whether the server will stop the goal; its end is told like any other. */
export interface Cancelled {
  canceling: boolean;
}

/** One difference; `path` is a JSON pointer. `old` or `new` is left out where the key is not there. */
export interface Change {
  path: string;
  verb: "add" | "remove" | "change";
  old?: unknown;
  new?: unknown;
}

/** One class, and its own bounds. */
export interface ClassAccount {
  class: "metric" | "bulk" | "event" | "recording";
  bytes: number;
  oldest: string | null;
  keep_days: number | null;
  keep_bytes: number | null;
}

/** How much of a class waits on the robot: accepted while the link was up (fresh) or down (backfill). */
export interface ClassDepth {
  name: string;
  fresh_bytes: number;
  backfill_bytes: number;
  samples: number;
  lost: number;
  disk_bytes: number;
  quota_bytes: number;
}

/** One event, CloudEvents 1.0. `id` is its place in the journal: the cursor behind which to go on. */
export interface CloudEvent {
  specversion: "1.0";
  id: string;
  source: string;
  type: string;
  subject?: string | null;
  time: string;
  datacontenttype: "application/json";
  gateway: string;
  data: Record<string, unknown>;
}

/** The files of a version's code, by path; of very many the first. */
export interface Code {
  version: string;
  files: CodeFile[];
  truncated: boolean;
}

/** A file of the code. */
export interface CodeFile {
  path: string;
  size_bytes: number;
}

/** A file's text; what is no text is shown as far as it is one. */
export interface CodeText {
  path: string;
  text: string;
  truncated: boolean;
}

/** A command and how far it is. Times are null until they came. */
export interface Command {
  id: string;
  robot: string;
  kind: string;
  request: unknown;
  state: "issued" | "delivered" | "running" | "done" | "failed" | "expired" | "cancelled";
  durable: boolean;
  issued_by: string;
  idempotency_key: string | null;
  timeout_s: number;
  issued: string;
  expires: string | null;
  delivered: string | null;
  running: string | null;
  ended: string | null;
  code: string;
  message: string;
  result: unknown;
}

/** A page, newest first; `next` is the `before` of the page after it. */
export interface CommandList {
  commands: Command[];
  next: string | null;
}

/** `reserved`: at most so many calls run at a time, null: no bound of its own. `warm`: workers that are kept. */
export interface Concurrency {
  reserved: number | null;
  warm: number;
}

/**
 * What arrived since this gateway started; `lost` samples were declared by gaps.
 *
 * Of a robot that sends more than its quota `over_quota` live samples were dropped; `put_off`: how often it was told
 * to send the others later.
 */
export interface Counts {
  samples: number;
  bytes: number;
  duplicates: number;
  gaps: number;
  lost: number;
  over_quota: number;
  put_off: number;
}

/** How a node ended, with its last words. */
export interface Crash {
  at: string | null;
  reason: string;
  pid: number | null;
  ran_s: number | null;
  version: string;
  argv: string[];
  env: Record<string, string>;
  lines: string[];
}

/** The newest first. */
export interface Crashes {
  crashes: Crash[];
}

/** One finding of the last check. */
export interface DamageAccount {
  object: string | null;
  robot: string | null;
  topic: string | null;
  start: string | null;
  end: string | null;
  what: string;
}

/** What could not be delivered. `payload` is what its target would have got, as text, cut at 16 KiB. */
export interface DeadLetter {
  id: string;
  kind: string;
  target: string;
  happening: string;
  robot: string;
  code: string;
  message: string;
  attempts: number;
  tries: number;
  redrives: number;
  born: string;
  ended: string;
  payload: string | null;
  truncated: boolean;
}

/** The newest first; `next` is the `before` of the next page, null at the end. `total` is of all that there are. */
export interface DeadLetterList {
  dead_letters: DeadLetter[];
  total: number;
  next: string | null;
}

/** A report for people; its parts may change. */
export interface Debug {
  gateway: string;
  store: string;
  checks: Record<string, string>;
  draining: boolean;
  process: Record<string, unknown>;
  settings: Record<string, string>;
  numbers: Record<string, number>;
  robots: Record<string, number>;
  tasks: (Record<string, unknown>)[];
}

/** A declared loss: the numbers `from` to `to` of a stream were accepted, or given, and are stored nowhere. */
export interface DeclaredGap {
  topic: string | null;
  class: "event" | "metric" | "bulk" | "live" | null;
  stream: number;
  backfill: boolean;
  epoch: string;
  from: number;
  to: number;
  count: number;
  reason: string;
  lost_from: string | null;
  lost_to: string | null;
  declared: string;
}

/** One thing that is not as desired: state, version, nice, absent, extra; and why, in words. */
export interface Difference {
  what: string;
  desired: unknown;
  reported: unknown;
  why: string;
}

/** How many are gone for good. */
export interface Dropped {
  dropped: number;
}

/** The rule would have fired. */
export interface DryFiring {
  at: string;
  happening: string;
  type: string;
  robot: string;
  group: string;
  targets: DryPayload[];
}

/** What a target would have got. */
export interface DryPayload {
  id: string;
  kind: string;
  payload: unknown;
}

/** `truncated`: there was more to look at, or to tell, than a dry run may; counts are then of what was looked at. */
export interface DryRunResult {
  scanned: number;
  matched: number;
  fired: number;
  errors: number;
  error: string;
  truncated: boolean;
  firings: DryFiring[];
}

/** A publisher, a subscription, a service's server or client. */
export interface Endpoint {
  /** full name; empty: a node outside the robot's namespace */
  node: string;
  type: string;
  type_hash: string;
  /** as rmw_zenoh writes it */
  qos: string;
}

/** 32 bytes to sign, base64url; whom the signature is for, and for how long. */
export interface EnrolChallenge {
  nonce: string;
  audience: string;
  valid_s: number;
}

/**
 * A robot's certificate with what goes above it, in PEM, and where it connects; `grpc_port` 0: over HTTP alone.
 *
 * `vouchers` are certificates by which earlier roots confirm those that follow them; mostly there are none.
 */
export interface Enrolment {
  robot: string;
  fleet: string;
  certificate: string;
  chain: string;
  roots: string;
  vouchers: string;
  not_after: string;
  now: string;
  grpc_port: number;
  grpc_tls: boolean;
}

/** A token without its secret. */
export interface EnrolmentToken {
  id: string;
  robot: string;
  made: string;
  made_by: string;
  expires: string;
  used: string | null;
  used_by: string;
}

/** The newest first. */
export interface EnrolmentTokenList {
  tokens: EnrolmentToken[];
  next: string | null;
}

/**
 * A page of events. `lost` is how many behind the cursor are not kept any more.
 *
 * Behind `after` the oldest come first, and `next` is always there: ask again with it. Else the newest come first,
 * and `next` is the `before` of the page of older ones, null where there is none.
 */
export interface EventList {
  events: CloudEvent[];
  next: string | null;
  lost: number;
}

/** How events for it are tried; the last three are ARNs, or empty. */
export interface EventSettings {
  most_retries: number;
  most_age_s: number;
  on_success: string;
  on_failure: string;
  dead_letter: string;
}

/** An event source mapping: topics of robots that call it in batches. */
export interface EventSource {
  uuid: string;
  source: string;
  qualifier: string;
  enabled: boolean;
  batch_size: number;
  window_s: number;
  most_retries: number;
  most_age_s: number;
  bisect: boolean;
  report_failures: boolean;
  parallel: number;
  on_failure: string;
  result: string;
}

/** One command for each robot that was named, or why that robot got none. */
export interface FleetCommands {
  commands: Command[];
  refused: Record<string, Record<string, string>>;
  robots: string[];
}

/** By what a robot recognises its fleet: `roots` in PEM, and the pins that enrolment tokens carry. */
export interface FleetRoots {
  fleet: string;
  roots: string;
  pins: string[];
}

/** A function, as `$LATEST` is. `runtime` is what was asked for, `interpreter` what it runs on here. */
export interface Function {
  name: string;
  arn: string;
  description: string;
  runtime: string;
  interpreter: string;
  handler: string;
  state: string;
  reason: string;
  timeout_s: number;
  memory_mb: number;
  disk_mb: number;
  code_sha256: string;
  code_bytes: number;
  modified: string;
  versions: number;
  aliases: Alias[];
  triggers: Trigger[];
  concurrency: Concurrency;
  stats: Stats;
}

/** With what belongs to it. Values of `environment` are shown to who may change functions, and empty for others. */
export interface FunctionDetail {
  name: string;
  arn: string;
  description: string;
  runtime: string;
  interpreter: string;
  handler: string;
  state: string;
  reason: string;
  timeout_s: number;
  memory_mb: number;
  disk_mb: number;
  code_sha256: string;
  code_bytes: number;
  modified: string;
  versions: number;
  aliases: Alias[];
  triggers: Trigger[];
  concurrency: Concurrency;
  stats: Stats;
  environment: Record<string, string>;
  layers: string[];
  published: PublishedVersion[];
  event_invoke: EventSettings;
  mappings: EventSource[];
}

/** By name; `next` is the `after` of the next page, null at the end. */
export interface FunctionList {
  functions: Function[];
  next: string | null;
}

/** One line; `request_id` is empty for what was written between two calls. */
export interface FunctionLogLine {
  cursor: number;
  at: string;
  request_id: string;
  version: string;
  text: string;
}

/** Lines that the gateway has in memory, the oldest first; `next` is the `before` of the page before it. */
export interface FunctionLogPage {
  lines: FunctionLogLine[];
  next: number | null;
}

/** One minute of a function. */
export interface FunctionMinute {
  at: string;
  invocations: number;
  errors: number;
  throttles: number;
  p95_ms: number | null;
}

/** The newest declared losses, newest first. */
export interface GapList {
  gaps: DeclaredGap[];
}

/** Which gateway this is, and its gRPC ports: where robots connect, and where programs do. */
export interface GatewayState {
  gateway: string;
  version: string;
  robots_port: number;
  programs_port: number;
}

/** A goal and how it stands. */
export interface Goal {
  goal: string;
  robot: string;
  action: string;
  type: string;
  status: "accepted" | "executing" | "canceling" | "succeeded" | "canceled" | "aborted" | "rejected" | "lost";
  ended: boolean;
  /** false while the robot has no link: it goes on there */
  reachable: boolean;
  begun: string;
  /** who sent it through this gateway; empty: through another one */
  by: string;
  /** the newest */
  feedback: Record<string, unknown> | null;
  result: Record<string, unknown> | null;
  /** why it is as it is, where that needs saying */
  message: string;
  /** messages of feedback that a newer one replaced on the robot */
  skipped: number;
}

/** The goals of a robot, the newest first. */
export interface GoalList {
  goals: Goal[];
  next: string | null;
}

/** An action, and the nodes that serve and use it. */
export interface GraphAction {
  action: string;
  type: string;
  servers: string[];
  clients: string[];
}

/** The graphs of robots. */
export interface GraphList {
  robots: RobotGraph[];
  next: string | null;
}

/** A service, and who serves and calls it. */
export interface GraphService {
  service: string;
  type: string;
  type_hash: string;
  /** that serve it */
  nodes: string[];
  servers: Endpoint[];
  clients: Endpoint[];
}

/** A topic, and who uses it. */
export interface GraphTopic {
  topic: string;
  types: string[];
  publishers: Endpoint[];
  subscribers: Endpoint[];
}

/** The robots that have a label of this value; `selector` names them wherever one may be given. */
export interface Group {
  label: string;
  value: string;
  selector: string;
  robots: number;
  online: number;
}

/** Every value of every label of robots in scope, by label and value. */
export interface GroupList {
  groups: Group[];
  next: string | null;
}

/** A CloudEvents 1.0 document. */
export interface Happening {
  specversion: string;
  id: string;
  source: string;
  type: string;
  time: string;
  datacontenttype: string;
  subject?: string | null;
  data: unknown;
}

/** The oldest first; `next` is the `after` of the next page, null at the end. */
export interface HappeningList {
  happenings: Happening[];
  next: string | null;
}

/** The process answers. */
export interface Health {
  status: "ok";
}

/** What is stored of a robot; `first` and `last` are over all topics, null without any. */
export interface History {
  topics: StoredTopicState[];
  series: number;
  first: string | null;
  last: string | null;
}

/** A hook without its secret; `path` is where its webhooks go, `source` and `type` are those of its happenings. */
export interface Hook {
  name: string;
  description: string;
  auth: "signature" | "bearer";
  robot: string;
  path: string;
  source: string;
  type: string;
  made: string;
  made_by: string;
  last_used: string | null;
  accepted: number;
  refused: number;
}

/** By name; `next` is the `after` of the next page, null at the end. */
export interface HookList {
  hooks: Hook[];
  next: string | null;
}

/** With its secret, which nobody is shown again. */
export interface HookMade {
  name: string;
  description: string;
  auth: "signature" | "bearer";
  robot: string;
  path: string;
  source: string;
  type: string;
  made: string;
  made_by: string;
  last_used: string | null;
  accepted: number;
  refused: number;
  secret: string;
}

/** A secret, shown this once. */
export interface HookSecret {
  secret: string;
}

/** By robot. */
export interface IdentityList {
  identities: RobotIdentity[];
  next: string | null;
}

/** The newest message of each topic at an instant. */
export interface InstantMessages {
  t_ms: number;
  messages: StoredMessage[];
  missing: MissingTopic[];
  gaps: Loss[];
}

/** A call that is over; `log` is its last 4 KiB, where one may see them. */
export interface Invocation {
  id: string;
  request_id: string;
  function: string;
  version: string;
  qualifier: string;
  kind: "request" | "event" | "mapping" | "test" | "robot";
  robot: string;
  status: "ok" | "error" | "timeout" | "throttled";
  error_type: string;
  error_message: string;
  began: string;
  duration_ms: number;
  init_ms: number;
  max_memory_mb: number;
  log: string;
}

/** The newest first; `next` is the `before` of the next page, null at the end. */
export interface InvocationList {
  invocations: Invocation[];
  next: string | null;
}

/** What came of a call. `payload` is JSON where it is some, else text. An event has its `request_id` alone. */
export interface Invoked {
  request_id: string;
  version?: string;
  status: "ok" | "error" | "timeout" | "accepted" | "dry";
  payload?: unknown;
  error_type?: string;
  duration_ms?: number;
  init_ms?: number;
  max_memory_mb?: number;
  log?: string;
}

/** Who drives. */
export interface LeaseState {
  holder: string;
  expires_in_s: number;
}

/** A managed node's state, what the twin wants of it, and where it may go from there. */
export interface Lifecycle {
  robot: string;
  node: string;
  managed: boolean;
  state: string;
  wanted: string | null;
  transitions: string[];
}

/** The same after it; `success`: the node made the transition, or with a dry run: it could. */
export interface LifecycleChanged {
  robot: string;
  node: string;
  managed: boolean;
  state: string;
  wanted: string | null;
  transitions: string[];
  dry_run: boolean;
  success: boolean;
  revision: number | null;
}

/** The agent's connection. From `transport` on it is what the agent said last. */
export interface Link {
  session: number;
  rtt_ms: number | null;
  outbox_bytes: number;
  outbox_samples: number;
  bytes_per_s: number;
  transport: string;
  gateway: string;
  budget_bytes_per_s: number | null;
  sent_bytes_per_s: number;
  reconnects: number;
  classes: ClassDepth[];
  disk_free_bytes: number;
  clock_offset_ms: number;
  forks: number;
  epochs: number;
  black_box: BlackBox | null;
}

/** One line; `at_ns` is text, as no browser counts so far. */
export interface LogLine {
  at: string | null;
  at_ns: string;
  text: string;
}

/** Lines, oldest first, and the cursor to go on with in the same direction. */
export interface LogPage {
  lines: LogLine[];
  cursor: string;
  more: boolean;
}

/** Samples that are not stored; `topic` null: metric rows, or not known. */
export interface Loss {
  from_ms: number;
  to_ms: number;
  count: number;
  reason: string;
  topic: string | null;
}

/** Why a message is not shown as JSON. */
export interface MessageError {
  code: string;
  message: string;
}

/** Messages in order of their stamps; `next` is the cursor of the page after, null at the end. */
export interface MessagePage {
  messages: StoredMessage[];
  gaps: Loss[];
  next: string | null;
}

/**
 * The asked pieces in the asked order, and what is missing of the robot's metric rows in this time.
 *
 * A gap is [from_ms, to_ms, how many rows, reason].
 */
export interface MetricRange {
  series: SeriesPiece[];
  gaps: ([number, number, number, string])[];
}

/** A topic without a message to show. */
export interface MissingTopic {
  topic: string;
  reason: "not_stored" | "too_old" | "damaged" | "purged" | "too_large";
  nearest_ms: number | null;
}

/** A new key. `key` is what goes behind "Authorization: Bearer"; it and `secret` are told this once. */
export interface NewApiKey {
  id: string;
  name: string;
  user: string;
  role: "viewer" | "operator" | "admin";
  robots: string[];
  scopes: string[];
  created: string;
  expires: string | null;
  used: string | null;
  secret: string;
  key: string;
}

/** The whole token, told this once, and the command that uses it. */
export interface NewEnrolmentToken {
  id: string;
  robot: string;
  made: string;
  made_by: string;
  expires: string;
  used: string | null;
  used_by: string;
  token: string;
  command: string;
}

/** A topic's newest message: heard just now, or stored. `error` says why there is no message to show. */
export interface NewestMessage {
  topic: string;
  type: string;
  class: "event" | "metric" | "bulk" | "live";
  seq: number;
  stamp_ms: number;
  source: "live" | "stored";
  message: Record<string, unknown> | null;
  error?: MessageError | null;
}

/**
 * One node of one robot: desired and reported. `state` is the reported one; `holder` has a migratable one's lease.
 *
 * `wanted` is running, stopped, standby (another robot runs it) or absent (the twin does not name it).
 */
export interface Node {
  robot: string;
  name: string;
  ros_name: string;
  online: boolean;
  state: string;
  wanted: string;
  in_step: boolean;
  differs: Difference[];
  in_own: boolean;
  desired: Record<string, unknown> | null;
  reported: ReportedNode | null;
  reported_at: string | null;
  holder: string | null;
}

/** Nodes of many robots; `more`: there are further ones than are listed. */
export interface NodeList {
  nodes: Node[];
  more: boolean;
}

/**
 * What became of a verb at one robot.
 *
 * pending: the twin has it, the robot does it when it gets it; `told`: the robot itself has done it.
 */
export interface NodeResult {
  robot: string;
  node: string;
  verb: string;
  dry_run: boolean;
  outcome: "done" | "pending" | "failed";
  told: boolean;
  changed: boolean;
  revision: number | null;
  changes: Change[];
  code: string;
  message: string;
}

/** The same, robot by robot. */
export interface NodeResults {
  verb: string;
  node: string;
  dry_run: boolean;
  robots: number;
  done: number;
  results: NodeResult[];
}

/** How the update of a node's bundle stands. */
export interface NodeUpdate {
  state: string;
  version: string;
  code: string;
  message: string;
}

/** The object store by the states of the ledger; `bytes` of the stored ones. */
export interface ObjectsAccount {
  where: string;
  stored: number;
  bytes: number;
  uploading: number;
  doomed: number;
}

/** Done. */
export interface Ok {
  ok: true;
}

/** The public keys of the gateway's roles, as an offline folder takes them. */
export interface OnlineKeys {
  keys: Record<string, Record<string, unknown>>;
}

/** One parameter. `desired` is there where the twin names it. Whole numbers beyond 2^53 are text. */
export interface Parameter {
  name: string;
  type: string;
  value: unknown;
  desired?: unknown;
  description: string;
  constraints: string;
  read_only: boolean;
  dynamic_typing: boolean;
  integer_range: Bounds | null;
  floating_point_range: Bounds | null;
}

/** What became of one value. */
export interface ParameterResult {
  name: string;
  successful: boolean;
  reason: string;
}

/** A node's parameters, by name; `node` is its full ROS name. */
export interface Parameters {
  robot: string;
  node: string;
  parameters: Parameter[];
}

/** What became of each; `revision` is the twin's where that has changed. */
export interface ParametersChanged {
  robot: string;
  node: string;
  dry_run: boolean;
  results: ParameterResult[];
  revision: number | null;
}

/** What goes of a class for one reason. */
export interface PlanItem {
  class: "metric" | "bulk" | "event" | "recording";
  why: "age" | "class_size" | "store_size";
  count: number;
  bytes: number;
  oldest: string;
  newest: string;
}

/** The workers of one version. */
export interface Pool {
  function: string;
  version: string;
  entry: string;
  workers: number;
  busy: number;
  starting: number;
  waiting: number;
  calls: number;
  cold_starts: number;
  failures: number;
  memory_mb: number;
  init_error: string;
}

/**
 * An error, RFC 9457; `code` is stable and listed in docs/reference/errors.md.
 *
 * `holder` is who drives, with the code lease_taken; `retry_after_s` comes with the status 429,
 * `path` where a part of a document is wrong, and says which.
 */
export interface Problem {
  type: string;
  title: string;
  status: number;
  code: string;
  detail: string;
  holder?: string | null;
  retry_after_s?: number | null;
  path?: string | null;
}

/** What the sign-in page offers; nulls where there is no provider. */
export interface Provider {
  name: string | null;
  url: string | null;
}

/** The newest version of each role. */
export interface Published {
  roles: Record<string, number>;
}

/** One that never changes. */
export interface PublishedVersion {
  version: string;
  description: string;
  code_sha256: string;
  modified: string;
}

/** Whether the gateway can do its work, check by check: "ok" or what is wrong. */
export interface Ready {
  status: "ready" | "not ready";
  checks: Record<string, string>;
  notes: Record<string, string>;
}

/** It is stored; `duplicate`: it had come before, and does nothing again. */
export interface Received {
  id: string;
  duplicate: boolean;
}

/** A clip of a robot's black box. `start` to `end` was asked, `first` to `last` is what the robot had of it. */
export interface Recording {
  id: string;
  robot: string;
  state: "requested" | "cutting" | "transferring" | "stored" | "failed";
  start: string;
  end: string;
  first: string | null;
  last: string | null;
  topics: string[];
  requested: string;
  size_bytes: number;
  received_bytes: number;
  messages: number;
  sha256: string | null;
  code: string;
  message: string;
  url: string | null;
}

/** The newest first; `next` is the `before` of the next page, null at the end. */
export interface RecordingList {
  recordings: Recording[];
  next: string | null;
}

/** How many are delivered again. */
export interface Redriven {
  redriven: number;
}

/** How far a replay is: `seen` happenings were looked at, and `put` of them given to the function. */
export interface Replay {
  id: string;
  function: string;
  state: "running" | "done" | "stopped" | "failed";
  start: string;
  until: string;
  seen: number;
  put: number;
  message: string;
}

/** Those under way first, then the newest. */
export interface ReplayList {
  replays: Replay[];
}

/** What the robot says of a node. `safe_stop`: of a critical one that died, how the robot's stop went. */
export interface ReportedNode {
  state: string;
  why: string;
  pid: number | null;
  restarts: number;
  since: string | null;
  last_exit: string;
  version: string;
  waits_for: string[];
  lease_id: string;
  nice: number | null;
  quarantined: boolean;
  crashes: number;
  safe_stop: string;
  update: NodeUpdate | null;
}

/** What the robot said last. `applied` is the revision that it lives by, 0 its own settings. */
export interface ReportedTwin {
  at: string;
  revision: number;
  applied: number;
  state: "applied" | "applying" | "confirming" | "reverted" | "refused";
  code: string;
  message: string;
  values: Record<string, unknown>;
}

/** What the next purge would delete. */
export interface RetentionPlan {
  items: PlanItem[];
  bytes: number;
  gaps: number;
}

/** One robot; `latest` holds at most 64 series. */
export interface Robot {
  id: string;
  namespace: string;
  hostname: string;
  state: "online" | "offline";
  since: string;
  last_seen: string;
  agent_version: string;
  labels: Record<string, string>;
  link: Link;
  channels: number;
  counts: Counts;
  lease: LeaseState | null;
  latest: Record<string, Value>;
  alerts: RobotAlerts;
}

/** What one robot takes. */
export interface RobotAccount {
  robot: string;
  bytes: number;
}

/** A robot's alerts that are not resolved and not quiet; `error` and `warning` are some of the `open` ones. */
export interface RobotAlerts {
  open: number;
  error: number;
  warning: number;
}

/** One certificate of a robot. */
export interface RobotCertificate {
  serial: string;
  how: "token" | "renewal" | "grace";
  issued: string;
  not_after: string;
  revoked: string | null;
}

/** A robot's part of the ROS graph, as its agent told it last; revision 0: nothing was told yet. */
export interface RobotGraph {
  robot: string;
  revision: number;
  nodes: string[];
  topics: GraphTopic[];
  services: GraphService[];
  actions: GraphAction[];
  /** nodes and endpoints beyond what a robot may tell */
  left_out: number;
}

/** A robot's identity; `alarm` says what looks like a copy of the robot. */
export interface RobotIdentity {
  robot: string;
  state: "active" | "revoked";
  enrolled: string;
  revoked: string | null;
  reason: string;
  alarm: string;
  alarm_at: string | null;
  certificates: RobotCertificate[];
}

/** A page of the robots that ever connected; `next` is the `after` of the page behind it. */
export interface RobotList {
  robots: Robot[];
  next: string | null;
}

/** One robot's nodes, and how the robot stands to its twin. */
export interface RobotNodes {
  robot: string;
  online: boolean;
  namespace: string;
  revision: number;
  applied: number;
  in_step: boolean;
  nodes: Node[];
}

/** A rollout; `counts` are robots by state. */
export interface Rollout {
  id: string;
  state: "running" | "paused" | "halted" | "done" | "aborted";
  reason: string;
  kind: "agent" | "node";
  node: string;
  bundle: string;
  version: string;
  selector: string;
  max_failure_rate: number;
  health_s: number;
  steady_s: number;
  offline_s: number;
  give_up_s: number;
  robots: number;
  wave: number;
  waves: Wave[];
  counts: Record<string, number>;
  created: string;
  created_by: string;
  changed: string;
  dry_run: boolean;
}

/** With its robots, in the order of their turns. */
export interface RolloutDetail {
  id: string;
  state: "running" | "paused" | "halted" | "done" | "aborted";
  reason: string;
  kind: "agent" | "node";
  node: string;
  bundle: string;
  version: string;
  selector: string;
  max_failure_rate: number;
  health_s: number;
  steady_s: number;
  offline_s: number;
  give_up_s: number;
  robots: number;
  wave: number;
  waves: Wave[];
  counts: Record<string, number>;
  created: string;
  created_by: string;
  changed: string;
  dry_run: boolean;
  members: RolloutRobot[];
}

/** The newest rollouts, newest first. */
export interface RolloutList {
  rollouts: Rollout[];
  next: string | null;
}

/** One robot of it; `wave` is 0 before its turn. */
export interface RolloutRobot {
  robot: string;
  state: "waiting" | "starting" | "updating" | "done" | "failed" | "unreached";
  wave: number;
  since: string;
  reason: string;
}

/** A rule as it is stored; URLs of webhooks are whole for who may change rules only. */
export interface Rule {
  name: string;
  description?: string;
  enabled?: boolean;
  pattern?: Record<string, unknown> | null;
  until?: Record<string, unknown> | null;
  topic?: Record<string, unknown> | null;
  metric?: Record<string, unknown> | null;
  schedule?: Record<string, unknown> | null;
  when?: Record<string, unknown> | null;
  event_format?: string;
  targets?: (Record<string, unknown>)[];
  revision: number;
  changed: string;
  maker: RuleMaker;
  stats: RuleStats;
  next_fire: string | null;
}

/** One change; `what` is created, changed, enabled, disabled or deleted. */
export interface RuleChange {
  revision: number;
  what: string;
  by: string;
  at: string;
  document: Record<string, unknown>;
}

/** Whether a document can be a rule. */
export interface RuleChecked {
  ok: boolean;
  faults: RuleFault[];
}

/** What is wrong, and where, like "targets[0].url". */
export interface RuleFault {
  path: string;
  message: string;
}

/** The newest first; `next` is the `before` of the next page, null at the end. */
export interface RuleHistory {
  entries: RuleChange[];
  next: number | null;
}

/** By name; `next` is the `after` of the next page, null at the end. */
export interface RuleList {
  rules: Rule[];
  next: string | null;
}

/** Who made it, with the role and robots of that time: more the rule may not do, or know. */
export interface RuleMaker {
  name: string;
  role: string;
  robots: string[];
}

/** What it did since it was made, at all gateways. `groups` are those that it remembers something of. */
export interface RuleStats {
  matched: number;
  fired: number;
  errors: number;
  last_fired: string | null;
  last_error: string;
  last_error_at: string | null;
  groups: number;
}

/**
 * Where functions run here. `level` is the sandbox, `reasons` say of each level "ok" or why it is not to be had;
 * both are found out at the first call. `trouble` is why no function runs.
 */
export interface Runtime {
  on: boolean;
  started: boolean;
  trouble: string;
  level: string;
  require: string;
  reasons: Record<string, string>;
  entry: string;
  interpreter: string;
  runtimes: string[];
  workers: number;
  most_workers: number;
  memory_mb: number;
  pools: Pool[];
}

/** When a rule fires by itself. */
export interface Schedule {
  rule: string;
  expression: string;
  timezone: string;
  misfire: "skip" | "once" | "all";
  enabled: boolean;
  next: string | null;
  last: string | null;
}

/** By rule; `next` is the `after` of the next page, null at the end. */
export interface ScheduleList {
  schedules: Schedule[];
  next: string | null;
}

/** Its next times. */
export interface ScheduleTimes {
  times: string[];
}

/** The robot's series by name. */
export interface SeriesList {
  series: SeriesState[];
  next: string | null;
}

/** Columns; rows as they are have count 1, buckets more. */
export interface SeriesPiece {
  name: string;
  stamp_ms: number[];
  mean: number[];
  min: number[];
  max: number[];
  count: number[];
}

/** One stored series. */
export interface SeriesState {
  name: string;
  topic: string;
  field: string;
  samples: number;
  latest: Value | null;
}

/** A series: it is learned while `seen` is below `of` samples; the newest score, and what is expected now. */
export interface SeriesWatch {
  series: string;
  seen: number;
  of: number;
  score: number;
  low: number | null;
  high: number | null;
}

/** The services of a robot, by name. */
export interface ServiceList {
  services: GraphService[];
  next: string | null;
}

/** A link that signs `user` in once; nobody can look it up again. */
export interface SignInLink {
  user: string;
  url: string;
  token: string;
  expires: string;
}

/** The newest signed document of a role. */
export interface SignedRole {
  role: string;
  version: number;
  expires: string;
  online: boolean;
}

/**
 * Nobody is told of alerts that match; empty `robots` and `causes` (patterns) match all.
 *
 * `up_to` is the highest severity that it silences: "warning" lets errors through.
 */
export interface Silence {
  id: string;
  robots: string[];
  causes: string[];
  up_to: "info" | "warning" | "error";
  from: string;
  until: string;
  by: string;
  reason: string;
}

/** Those that are not over, the newest first. */
export interface SilenceList {
  silences: Silence[];
  next: string | null;
}

/** What a robot says: `missing` topics were announced, and of them nothing came and nothing is stored. */
export interface Snapshot {
  robot: string;
  time: string;
  online: boolean;
  topics: NewestMessage[];
  missing: string[];
  metrics: Record<string, Value>;
}

/** A stage, in nanoseconds of the gateway's wall clock since the epoch. */
export interface Span {
  /** bus, tap, outbox, uplink, link, ingest, fanout, store */
  name: string;
  start_ns: number;
  end_ns: number;
}

/**
 * A function over a window, as this gateway saw it; `running`, `iterator_age_s`, `waiting` and `dead_letters` are
 * of now. `iterator_age_s` is how long the oldest message of its event source mappings has been waiting.
 */
export interface Stats {
  window_s: number;
  invocations: number;
  errors: number;
  throttles: number;
  cold_starts: number;
  running: number;
  p50_ms: number | null;
  p95_ms: number | null;
  p99_ms: number | null;
  iterator_age_s: number | null;
  waiting: number;
  dead_letters: number;
  series: FunctionMinute[];
}

/** What is stored, how fast it grows, and what is damaged. */
export interface StoreAccount {
  total_bytes: number;
  keep_bytes: number;
  disk_free_bytes: number | null;
  growth_bytes_per_day: number | null;
  days_until_bound: number | null;
  days_until_full: number | null;
  classes: ClassAccount[];
  robots: RobotAccount[];
  tables: TableAccount[];
  objects: ObjectsAccount;
  damaged: DamageAccount[];
  checked: string | null;
}

/** One message: `message` or, as it was published, `cdr` in base64. */
export interface StoredMessage {
  topic: string;
  type: string;
  stamp: string;
  stamp_ms: number;
  seq: number;
  epoch: string;
  class: "event" | "metric" | "bulk" | "live";
  message?: Record<string, unknown> | null;
  error?: MessageError | null;
  cdr?: string | null;
}

/** What is stored of one topic under one type and class; `bytes` are those of the messages. */
export interface StoredTopicState {
  topic: string;
  type: string;
  class: "event" | "metric" | "bulk" | "live";
  samples: number;
  bytes: number;
  first: string;
  last: string;
}

/** One table of the database. */
export interface TableAccount {
  table: string;
  rows: number;
  bytes: number;
}

/** They are stored; those of known ids, `duplicates`, were before. */
export interface Taken {
  ids: string[];
  duplicates: number;
}

/** A template as it is stored. */
export interface Template {
  name: string;
  selector: string;
  priority: number;
  revision: number;
  author: string;
  at: string;
  reason: string;
  document: Record<string, unknown>;
}

/** What a change of a template did, or would do, to the robots that it reaches. */
export interface TemplateChange {
  dry_run: boolean;
  template: Template;
  robots: number;
  changed: number;
  results: TwinChange[];
}

/** One change of a template; `changes` of its document are those against the entry before. */
export interface TemplateEntry {
  name: string;
  selector: string;
  priority: number;
  revision: number;
  author: string;
  at: string;
  reason: string;
  document: Record<string, unknown>;
  removed: boolean;
  changes: Change[];
}

/** The newest first; `more` older ones had no room in this answer. */
export interface TemplateHistory {
  entries: TemplateEntry[];
  more: number;
}

/** In the order in which they are laid over each other. */
export interface TemplateList {
  templates: Template[];
  next: string | null;
}

/** A bearer for viewers' sockets: `ws://…/foxglove?token=TICKET`. */
export interface Ticket {
  ticket: string;
  expires: string;
}

/** Messages and metric rows by bucket of `width_ms`. */
export interface Timeline {
  start_ms: number;
  end_ms: number;
  width_ms: number;
  messages: number[];
  rows: number[];
  gaps: Loss[];
}

/** One topic; rates, messages, dropped, publishers and subscribers are the agent's, the rest the gateway's. */
export interface Topic {
  channel: number;
  topic: string;
  type: string;
  type_hash: string;
  encoding: string;
  class: "event" | "metric" | "bulk" | "live";
  forward: boolean;
  qos: string;
  rate_hz: number;
  bytes_per_s: number;
  messages: number;
  dropped: number;
  thinned: number;
  publishers: number;
  subscribers: number;
  received: number;
  received_bytes: number;
  lost: number;
  last_stamp_ms: number | null;
  demand_hz: number | null;
  history_hz: number;
}

/** What the robot announced. */
export interface TopicList {
  topics: Topic[];
  next: string | null;
}

/** One followed sample; its stages touch, so their durations add up. */
export interface Trace {
  /** as in W3C Trace Context */
  trace_id: string;
  robot: string;
  topic: string;
  seq: number;
  /** samples that came in the same batch */
  batch_samples: number;
  batch_bytes: number;
  /** the sample's stamp, on the gateway's clock */
  start_ns: number;
  /** from there to the later of viewers and row */
  total_ns: number;
  /** the gateway's clock less the robot's */
  clock_offset_ns: number;
  /** whether a clock was so wrong that it had to yield */
  clock_adjusted: boolean;
  spans: Span[];
  class: string;
}

/** The newest first. */
export interface Traces {
  traces: Trace[];
}

/** What calls a function; `title` says it in words. */
export interface Trigger {
  kind: "rule" | "schedule" | "mapping";
  id: string;
  title: string;
  enabled: boolean;
}

/** One robot's twin. `own` on top of the templates makes `desired`; `behind`: from what it lives by to that. */
export interface Twin {
  robot: string;
  revision: number;
  edition: number;
  in_step: boolean;
  own: Record<string, unknown>;
  desired: Record<string, unknown>;
  templates: string[];
  labels: Record<string, string>;
  own_labels: Record<string, string>;
  problem: string;
  author: string;
  at: string | null;
  reason: string;
  confirm_within_s: number;
  reported: ReportedTwin | null;
  behind: Change[];
}

/** One robot's twin in one line. `in_step`: it lives by what is desired. */
export interface TwinBrief {
  robot: string;
  revision: number;
  edition: number;
  in_step: boolean;
  state: string;
  applied: number;
  code: string;
  message: string;
  templates: string[];
  labels: Record<string, string>;
  problem: string;
}

/** What an edit did, or would do: to the robot's own document and to the whole that it gets. */
export interface TwinChange {
  robot: string;
  dry_run: boolean;
  revision: number;
  edition: number;
  changed: boolean;
  changes: Change[];
  own_changes: Change[];
  own_labels: Record<string, string>;
  /** changes beyond those that are listed */
  more: number;
}

/** One change of a robot's desired state; `changes` are those against the entry before. */
export interface TwinEntry {
  revision: number;
  edition: number;
  at: string;
  author: string;
  reason: string;
  changes: Change[];
  own: Record<string, unknown>;
  desired: Record<string, unknown>;
}

/** The newest first; `more` older ones had no room in this answer. */
export interface TwinHistory {
  entries: TwinEntry[];
  more: number;
}

/** Twins by robot. */
export interface TwinList {
  twins: TwinBrief[];
  next: string | null;
}

/** The same of many robots. */
export interface TwinsChange {
  dry_run: boolean;
  robots: number;
  changed: number;
  results: TwinChange[];
}

/** A named value; it is not on the wire. */
export interface TypeConstant {
  name: string;
  type: string;
  value: boolean | number | string | null;
}

/** A message's fields, in their order, and its constants. */
export interface TypeDefinition {
  fields: TypeField[];
  constants: TypeConstant[];
}

/** One field; `capacity` is the n of `T[n]` and `T[<=n]`, `string_bound` that of `string<=n`, else 0. */
export interface TypeField {
  name: string;
  /** a primitive, or the full name of a message */
  type: string;
  array: "" | "fixed" | "bounded" | "unbounded";
  capacity: number;
  string_bound: number;
  /** null: zero, empty text, an empty list */
  default: boolean | number | string | (boolean | number | string | null)[] | null;
}

/** A type: what is encoded of it (`parts`), and every message that those are made of. */
export interface TypeShape {
  type: string;
  type_hash: string;
  /** as in its .msg, .srv or .action file, without comments */
  text: string;
  parts: Record<string, string>;
  definitions: Record<string, TypeDefinition>;
}

/** What robots can be given; `trouble`: why this gateway cannot sign again what ends soon, "" if it can. */
export interface UpdateList {
  roles: SignedRole[];
  bundles: Bundle[];
  trouble: string;
}

/** What may leave the robot and what does; `bytes_per_s` null is no limit. */
export interface Uplink {
  bytes_per_s: number | null;
  sent_bytes_per_s: number;
}

/** A user; `external`: they sign in elsewhere. */
export interface User {
  id: string;
  name: string;
  role: "viewer" | "operator" | "admin";
  robots: string[];
  disabled: boolean;
  has_password: boolean;
  external: boolean;
  created: string;
  signed_in: string | null;
}

/** Everybody, by name. */
export interface UserList {
  users: User[];
  next: string | null;
}

/** A series' newest row. */
export interface Value {
  stamp_ms: number;
  value: number | null;
}

/** What is watched of a robot, by name of the series. */
export interface Watch {
  series: SeriesWatch[];
  next: string | null;
}

/** One wave and how far it is. */
export interface Wave {
  wave: number;
  size: number;
  in_flight: number;
  done: number;
  failed: number;
}

/** Nothing is taken. */
export type None = Record<never, never>;

/** Every operation by its method and its path below /api/v1. */
export interface Operations {
  /** Have a check be as it comes. */
  "DELETE /alert-checks/{check_id}": { path: { check_id: string }; query: None; body: undefined; answer: AlertCheck };
  /** Take back a durable command that has not left for its robot. */
  "DELETE /commands/{command_id}": { path: { command_id: string }; query: None; body: undefined; answer: Command };
  /** Drop dead letters for good. */
  "DELETE /dead-letters": { path: None; query: { id?: string[] | null; kind?: string; target?: string; all?: boolean }; body: undefined; answer: Dropped };
  /** Take back a token that no robot has used. */
  "DELETE /enrolment-tokens/{token_id}": { path: { token_id: string }; query: None; body: undefined; answer: Ok };
  /** Delete a function with its versions and aliases; events for it become dead letters. */
  "DELETE /functions/{name}": { path: { name: string }; query: None; body: undefined; answer: unknown };
  /** Delete an alias. */
  "DELETE /functions/{name}/aliases/{alias}": { path: { name: string; alias: string }; query: None; body: undefined; answer: unknown };
  /** Back to the version that the alias had before. */
  "DELETE /functions/{name}/aliases/{alias}/canary": { path: { name: string; alias: string }; query: None; body: undefined; answer: Canary };
  /** Take a hook away: nothing comes in by it any more. */
  "DELETE /hooks/{hook}": { path: { hook: string }; query: None; body: undefined; answer: unknown };
  /** Revoke a key for ever. */
  "DELETE /keys/{key_id}": { path: { key_id: string }; query: None; body: undefined; answer: Ok };
  /** Delete a recording with its file; an unfinished one is given up, and its robot forgets it. */
  "DELETE /recordings/{recording_id}": { path: { recording_id: string }; query: None; body: undefined; answer: Ok };
  /** End one; what it put is delivered all the same. */
  "DELETE /replays/{replay_id}": { path: { replay_id: string }; query: None; body: undefined; answer: Replay };
  /** Take the node away from the robot, also where a template brings it. */
  "DELETE /robots/{robot_id}/nodes/{node}": { path: { robot_id: string; node: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: undefined; answer: TwinChange };
  /** Take a rule away. What it set off is delivered all the same. */
  "DELETE /rules/{name}": { path: { name: string }; query: None; body: undefined; answer: unknown };
  /** End it now. */
  "DELETE /silences/{silence_id}": { path: { silence_id: string }; query: None; body: undefined; answer: Silence };
  /** Take a template away; robots go on with what is left. */
  "DELETE /templates/{name}": { path: { name: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: undefined; answer: TemplateChange };
  /** Delete a user with their sessions and keys. */
  "DELETE /users/{name}": { path: { name: string }; query: None; body: undefined; answer: Ok };
  /** Every check as it is now, in the table's order. */
  "GET /alert-checks": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: AlertCheckList };
  /** The routes that name no robot out of one's scope, in the file's order. */
  "GET /alert-routes": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: AlertRouteList };
  /** The newest alerts, newest first; with `from` and `until` those that were not resolved at some time in between. */
  "GET /alerts": { path: None; query: { state?: ("open" | "acknowledged" | "resolved")[] | null; severity?: ("info" | "warning" | "error")[] | null; robot?: string[] | null; cause?: string[] | null; q?: string; from?: string; until?: string; quiet?: boolean | null; limit?: number; before?: string; fields?: string }; body: undefined; answer: AlertList };
  /** How many alerts are not resolved. */
  "GET /alerts/counts": { path: None; query: None; body: undefined; answer: AlertCounts };
  /** One alert, with what was found and what was said. */
  "GET /alerts/{alert_id}": { path: { alert_id: string }; query: None; body: undefined; answer: AlertDetail };
  /** Rows, the newest first; only those of one action (a permission's name), or of one name. */
  "GET /audit": { path: None; query: { before?: number | null; limit?: number; action?: string; name?: string; fields?: string }; body: undefined; answer: AuditPage };
  /** Prove the whole chain, and compare the heads in the object store. One proof at a time; it reads every row. */
  "GET /audit/verify": { path: None; query: None; body: undefined; answer: AuditProof };
  /** Who asks, and what they may do. */
  "GET /auth/me": { path: None; query: None; body: undefined; answer: Account };
  /** Whether people sign in elsewhere, and what to write on the button. */
  "GET /auth/oidc": { path: None; query: None; body: undefined; answer: Provider };
  /** Where the provider sends the browser back: a session, and the dashboard; else the sign-in page, with a code. */
  "GET /auth/oidc/callback": { path: None; query: { code?: string; state?: string; error?: string }; body: undefined; answer: unknown };
  /** Send the browser to the provider. */
  "GET /auth/oidc/start": { path: None; query: None; body: undefined; answer: unknown };
  /** The newest commands, newest first. */
  "GET /commands": { path: None; query: { robot?: string; state?: "issued" | "delivered" | "running" | "done" | "failed" | "expired" | "cancelled" | null; issuer?: string; limit?: number; before?: string; fields?: string }; body: undefined; answer: CommandList };
  /** One command, and how far it is. */
  "GET /commands/{command_id}": { path: { command_id: string }; query: { wait_s?: number }; body: undefined; answer: Command };
  /** The newest dead letters, newest first; of robots out of scope there are none. */
  "GET /dead-letters": { path: None; query: { kind?: string; target?: string; code?: string; limit?: number; before?: string }; body: undefined; answer: DeadLetterList };
  /** One, with what its target would have got. */
  "GET /dead-letters/{letter_id}": { path: { letter_id: string }; query: None; body: undefined; answer: DeadLetter };
  /** Tasks, threads, memory, queues, settings without their secrets: what a bug report needs. */
  "GET /debug": { path: None; query: { format?: string }; body: undefined; answer: Debug };
  /** The fleet's roots, for a robot that compares them with the pin in its token before it believes anything. */
  "GET /enrol/roots": { path: None; query: None; body: undefined; answer: FleetRoots };
  /** The newest enrolment tokens, used and unused, of robots in one's scope. */
  "GET /enrolment-tokens": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: EnrolmentTokenList };
  /** What happened: a page as JSON; with `Accept: text/event-stream` what follows, for ever, as server-sent events. */
  "GET /events": { path: None; query: { kind?: string; robot?: string; after?: number | null; before?: number | null; limit?: number; fields?: string }; body: undefined; answer: EventList };
  /** Messages of some robots as one MCAP file, sorted by their stamps, with an index and an account of the losses. */
  "GET /export.mcap": { path: None; query: { robot: string[]; topic?: string[] | null; start?: string; end?: string }; body: undefined; answer: unknown };
  /** Every function, by name. */
  "GET /functions": { path: None; query: { q?: string; window_s?: number; limit?: number; after?: string }; body: undefined; answer: FunctionList };
  /** Where functions run here: the sandbox and why it is no stronger, workers, what they run on. */
  "GET /functions-runtime": { path: None; query: None; body: undefined; answer: Runtime };
  /** One function, with all that belongs to it. */
  "GET /functions/{name}": { path: { name: string }; query: { window_s?: number }; body: undefined; answer: FunctionDetail };
  /** The files of a version's code. */
  "GET /functions/{name}/code": { path: { name: string }; query: { version?: string }; body: undefined; answer: Code };
  /** One file's text, its beginning at least. */
  "GET /functions/{name}/code/text": { path: { name: string }; query: { path: string; version?: string }; body: undefined; answer: CodeText };
  /** The newest calls, newest first. Who does not see every robot sees those about robots in scope, without logs. */
  "GET /functions/{name}/invocations": { path: { name: string }; query: { status?: "ok" | "error" | "timeout" | "throttled" | ""; kind?: "request" | "event" | "mapping" | "test" | "robot" | ""; version?: string; robot?: string; limit?: number; before?: string }; body: undefined; answer: InvocationList };
  /** What a function printed: the newest lines that this gateway has in memory; with `Accept: text/event-stream` what */
  "GET /functions/{name}/logs": { path: { name: string }; query: { limit?: number; before?: number | null; after?: number | null }; body: undefined; answer: FunctionLogPage };
  /** What a client has to know that has only the gateway's address. */
  "GET /gateway": { path: None; query: None; body: undefined; answer: GatewayState };
  /** The graphs of the robots that one sees, and that told theirs; each with its robot's own names. */
  "GET /graph": { path: None; query: { selector?: string; limit?: number; after?: string; fields?: string }; body: undefined; answer: GraphList };
  /** The values of robots' labels, and how many robots have each. */
  "GET /groups": { path: None; query: { label?: string; limit?: number; after?: string; fields?: string }; body: undefined; answer: GroupList };
  /** What happened between two times, of robots in one's scope, the oldest first; events of the journal too. */
  "GET /happenings": { path: None; query: { start?: string; end?: string; type?: string[] | null; source?: string; robot?: string; limit?: number; after?: string }; body: undefined; answer: HappeningList };
  /** Every hook in one's scope, by name. */
  "GET /hooks": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: HookList };
  /** Every robot's identity and its certificates, of robots in one's scope. */
  "GET /identities": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: IdentityList };
  /** One's own keys, or for an admin everybody's, the newest first. A key sees none but as an admin. */
  "GET /keys": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: ApiKeyList };
  /** The nodes of every robot that the selector names and that one sees; of one state, or of one name. */
  "GET /nodes": { path: None; query: { selector?: string; state?: string; node?: string; limit?: number }; body: undefined; answer: NodeList };
  /** The newest recordings, newest first. */
  "GET /recordings": { path: None; query: { robot?: string; limit?: number; before?: string; fields?: string }; body: undefined; answer: RecordingList };
  /** One recording, and how far it is. */
  "GET /recordings/{recording_id}": { path: { recording_id: string }; query: None; body: undefined; answer: Recording };
  /** The recording's MCAP file, streamed; one byte range may be asked for, so that a download goes on. */
  "GET /recordings/{recording_id}/file.mcap": { path: { recording_id: string }; query: None; body: undefined; answer: unknown };
  /** Those under way, then the newest that ended. */
  "GET /replays": { path: None; query: None; body: undefined; answer: ReplayList };
  /** How far one is. */
  "GET /replays/{replay_id}": { path: { replay_id: string }; query: None; body: undefined; answer: Replay };
  /** The robots that ever connected and that one sees, by id. What a link brings is at most a second old. */
  "GET /robots": { path: None; query: { selector?: string; online?: boolean | null; q?: string; limit?: number; after?: string; fields?: string }; body: undefined; answer: RobotList };
  /** One robot. */
  "GET /robots/{robot_id}": { path: { robot_id: string }; query: None; body: undefined; answer: Robot };
  /** The robot's actions, by name. */
  "GET /robots/{robot_id}/actions": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: ActionList };
  /** The newest stored message of each topic at or before `t`: as the stream's records, or decoded. */
  "GET /robots/{robot_id}/at": { path: { robot_id: string }; query: { t: string; topic?: string[] | null; max_age?: string; format?: "records" | "json" }; body: undefined; answer: InstantMessages };
  /** The newest declared losses. */
  "GET /robots/{robot_id}/gaps": { path: { robot_id: string }; query: { limit?: number; fields?: string }; body: undefined; answer: GapList };
  /** The goals of the robot that this gateway knows, the newest first; ended ones for ten minutes. */
  "GET /robots/{robot_id}/goals": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: GoalList };
  /** How a goal stands, its newest feedback, and its result once there is one. */
  "GET /robots/{robot_id}/goals/{goal}": { path: { robot_id: string; goal: string }; query: None; body: undefined; answer: Goal };
  /** What is told of a goal, as server-sent events: how it stands, then `status`, `feedback`, and at last `result`. */
  "GET /robots/{robot_id}/goals/{goal}/feedback": { path: { robot_id: string; goal: string }; query: None; body: undefined; answer: unknown };
  /** A robot's part of the graph, as its agent told it last; it stays while the robot's link is away. */
  "GET /robots/{robot_id}/graph": { path: { robot_id: string }; query: None; body: undefined; answer: RobotGraph };
  /** Which topics are stored, how much of them, from when to when. */
  "GET /robots/{robot_id}/history": { path: { robot_id: string }; query: None; body: undefined; answer: History };
  /** Messages in order of their stamps, page by page. */
  "GET /robots/{robot_id}/messages": { path: { robot_id: string }; query: { topic?: string[] | null; start?: string; end?: string; limit?: number; cursor?: string; format?: "json" | "cdr"; order?: "asc" | "desc" }; body: undefined; answer: MessagePage };
  /** The robot's stored series. */
  "GET /robots/{robot_id}/metrics": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: SeriesList };
  /** Series between two times, and what was lost there. */
  "GET /robots/{robot_id}/metrics/range": { path: { robot_id: string }; query: { name: string[]; start?: string; end?: string; points?: number; method?: "buckets" | "lttb" }; body: undefined; answer: MetricRange };
  /** A robot's nodes: as they are to be, as the robot says they are, and why they differ. */
  "GET /robots/{robot_id}/nodes": { path: { robot_id: string }; query: None; body: undefined; answer: RobotNodes };
  /** One of them. */
  "GET /robots/{robot_id}/nodes/{node}": { path: { robot_id: string; node: string }; query: None; body: undefined; answer: Node };
  /** How the node ended the last times, with its last words; the newest first. */
  "GET /robots/{robot_id}/nodes/{node}/crashes": { path: { robot_id: string; node: string }; query: None; body: undefined; answer: Crashes };
  /** The node's lifecycle state and where it may go from there; `managed` is false for a node that has none. */
  "GET /robots/{robot_id}/nodes/{node}/lifecycle": { path: { robot_id: string; node: string }; query: { ros_name?: string }; body: undefined; answer: Lifecycle };
  /** A page of the node's log, from the robot's disk. */
  "GET /robots/{robot_id}/nodes/{node}/log": { path: { robot_id: string; node: string }; query: { cursor?: string; query?: string; backwards?: boolean; max_bytes?: number }; body: undefined; answer: LogPage };
  /** The node's newest lines and those that follow, as server-sent events `lines`; the last event is `end`. */
  "GET /robots/{robot_id}/nodes/{node}/log/tail": { path: { robot_id: string; node: string }; query: { cursor?: string; query?: string }; body: undefined; answer: unknown };
  /** The running node's parameters, with their types, rules and values. */
  "GET /robots/{robot_id}/nodes/{node}/parameters": { path: { robot_id: string; node: string }; query: { ros_name?: string }; body: undefined; answer: Parameters };
  /** The robot's services, by name. */
  "GET /robots/{robot_id}/services": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: ServiceList };
  /** The newest message of each topic, as it comes within a moment or else is stored, and the newest metrics. */
  "GET /robots/{robot_id}/snapshot": { path: { robot_id: string }; query: { topic?: string[] | null; wait_s?: number }; body: undefined; answer: Snapshot };
  /** How many messages and metric rows there are in each part of a range, and its losses. */
  "GET /robots/{robot_id}/timeline": { path: { robot_id: string }; query: { start?: string; end?: string; buckets?: number }; body: undefined; answer: Timeline };
  /** What the robot announced, by name. */
  "GET /robots/{robot_id}/topics": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: TopicList };
  /** What the robot is to be, what it says it is, and the difference. The ETag is for If-Match. */
  "GET /robots/{robot_id}/twin": { path: { robot_id: string }; query: None; body: undefined; answer: Twin };
  /** Who changed what, when and why; the newest first, at most 100 are kept. */
  "GET /robots/{robot_id}/twin/history": { path: { robot_id: string }; query: { limit?: number }; body: undefined; answer: TwinHistory };
  /** What a type is made of: as the robot announced it with a topic or told it, else as the library ships it. */
  "GET /robots/{robot_id}/types/{package}/{kind}/{name}": { path: { robot_id: string; package: string; kind: string; name: string }; query: None; body: undefined; answer: TypeShape };
  /** The robot's byte budget, as its agent said last. */
  "GET /robots/{robot_id}/uplink": { path: { robot_id: string }; query: None; body: undefined; answer: Uplink };
  /** The robot's series by name: which are learned still, and how odd each is now. */
  "GET /robots/{robot_id}/watch": { path: { robot_id: string }; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: Watch };
  /** A series and what was expected of it, by the robot's stamps, as far as the gateway remembers. */
  "GET /robots/{robot_id}/watch/band": { path: { robot_id: string }; query: { series: string; from?: string; to?: string }; body: undefined; answer: Band };
  /** The newest rollouts that have a robot in one's scope, the newest first. */
  "GET /rollouts": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: RolloutList };
  /** One rollout, with those of its robots that are in one's scope. */
  "GET /rollouts/{rollout_id}": { path: { rollout_id: string }; query: None; body: undefined; answer: RolloutDetail };
  /** Every rule that reaches no robot out of one's scope, by name. */
  "GET /rules": { path: None; query: { q?: string; limit?: number; after?: string; fields?: string }; body: undefined; answer: RuleList };
  /** One rule. */
  "GET /rules/{name}": { path: { name: string }; query: None; body: undefined; answer: Rule };
  /** Who changed a rule, and how, the newest first. */
  "GET /rules/{name}/history": { path: { name: string }; query: { limit?: number; before?: number | null }; body: undefined; answer: RuleHistory };
  /** When rules fire by themselves. */
  "GET /schedules": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: ScheduleList };
  /** Those that are not over and reach no robot out of one's scope; the one that ends first is the first. */
  "GET /silences": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: SilenceList };
  /** The account of the store; at most 10 s old. Robots out of scope are in its sums only. */
  "GET /store": { path: None; query: None; body: undefined; answer: StoreAccount };
  /** What the next purge would delete, and why; nothing is deleted by asking. */
  "GET /store/retention": { path: None; query: None; body: undefined; answer: RetentionPlan };
  /** Every template, in the order in which they are laid over each other. */
  "GET /templates": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: TemplateList };
  /** One template. */
  "GET /templates/{name}": { path: { name: string }; query: None; body: undefined; answer: Template };
  /** Who changed a template, when and why, also of one that is gone; the newest first. */
  "GET /templates/{name}/history": { path: { name: string }; query: { limit?: number }; body: undefined; answer: TemplateHistory };
  /** The newest samples that were followed from their robot to viewers and row, with the time of each stage. */
  "GET /traces": { path: None; query: { robot?: string; topic?: string; limit?: number }; body: undefined; answer: Traces };
  /** The desired document as JSON Schema. */
  "GET /twin/schema": { path: None; query: None; body: undefined; answer: unknown };
  /** Every robot that the selector names and that one sees: whether it lives by what is desired. */
  "GET /twins": { path: None; query: { selector?: string; limit?: number; after?: string; fields?: string }; body: undefined; answer: TwinList };
  /** Every bundle, the newest first, and how long what was signed counts. */
  "GET /updates": { path: None; query: None; body: undefined; answer: UpdateList };
  /** One bundle by its target path, such as nodes/lidar-node/1.2.0.zip. */
  "GET /updates/bundles/{path}": { path: { path: string }; query: None; body: undefined; answer: Bundle };
  /** A signed document, for robots: timestamp.json, or one by its version such as 3.targets.json. */
  "GET /updates/metadata/{file}": { path: { file: string }; query: None; body: undefined; answer: unknown };
  /** A bundle, for robots; one byte range may be asked for, so that a download goes on. */
  "GET /updates/targets/{file}": { path: { file: string }; query: None; body: undefined; answer: unknown };
  /** Everybody, by name. */
  "GET /users": { path: None; query: { limit?: number; after?: string; fields?: string }; body: undefined; answer: UserList };
  /** One user. The ETag is for If-Match. */
  "GET /users/{name}": { path: { name: string }; query: None; body: undefined; answer: User };
  /** Give every robot that the selector names labels; null takes one away. All of them, or none. */
  "PATCH /groups": { path: None; query: { selector: string; dry_run?: boolean; reason?: string }; body: { labels: Record<string, string | null> }; answer: TwinsChange };
  /** A merge patch of that node's row, for every robot named whose twin has it: all of them, or none. */
  "PATCH /nodes/{node}": { path: { node: string }; query: { selector: string; dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinsChange };
  /** Give the robot labels, over those that it says itself; null takes one away. Templates may follow. */
  "PATCH /robots/{robot_id}/labels": { path: { robot_id: string }; query: { dry_run?: boolean; reason?: string }; body: { labels: Record<string, string | null> }; answer: TwinChange };
  /** A merge patch of the node's row in the robot's own document; what it runs is an admin's to change. */
  "PATCH /robots/{robot_id}/nodes/{node}": { path: { robot_id: string; node: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinChange };
  /** Set parameters of the running node, each for itself; with `keep` they are the twin's as well. */
  "PATCH /robots/{robot_id}/nodes/{node}/parameters": { path: { robot_id: string; node: string }; query: { ros_name?: string; dry_run?: boolean; reason?: string }; body: { parameters: Record<string, unknown>; keep?: boolean }; answer: ParametersChanged };
  /** A JSON merge patch (RFC 7396) of the robot's own document. */
  "PATCH /robots/{robot_id}/twin": { path: { robot_id: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinChange };
  /** Change some of a rule's fields (JSON Merge Patch): it is its changer's from then on. */
  "PATCH /rules/{name}": { path: { name: string }; query: None; body: {  }; answer: Rule };
  /** A merge patch of the own documents of every robot that the selector names: all of them, or none. */
  "PATCH /twins": { path: None; query: { selector: string; dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinsChange };
  /** Change role, robots or password, or lock a user out. It counts at once, for open sockets within seconds. */
  "PATCH /users/{name}": { path: { name: string }; query: None; body: { role?: "viewer" | "operator" | "admin" | null; robots?: string[] | null; disabled?: boolean | null; password?: string | null }; answer: User };
  /** Send a notice that says that it is a test, and wait for what becomes of it. */
  "POST /alert-routes/{name}/test": { path: { name: string }; query: None; body: {  }; answer: AlertRouteTest };
  /** Somebody sees to it: it is not told again until it gets worse. */
  "POST /alerts/{alert_id}/acknowledge": { path: { alert_id: string }; query: None; body: { text?: string }; answer: Alert };
  /** Say who sees to it; "" is nobody. */
  "POST /alerts/{alert_id}/assign": { path: { alert_id: string }; query: None; body: { assignee: string }; answer: Alert };
  /** Ask the robot's black box for what it has around the alert's beginning; one clip that is on its way is enough. */
  "POST /alerts/{alert_id}/clip": { path: { alert_id: string }; query: None; body: {  }; answer: Recording };
  /** Say something to it. With an `Idempotency-Key` the same request says it once. */
  "POST /alerts/{alert_id}/comments": { path: { alert_id: string }; query: None; body: { text: string }; answer: AlertDetail };
  /** What was found is normal: teach it to whatever found it. */
  "POST /alerts/{alert_id}/normal": { path: { alert_id: string }; query: None; body: { text?: string }; answer: AlertNormal };
  /** It is over, whatever is found; what is found anew is another alert, or this one again within its cool-down. */
  "POST /alerts/{alert_id}/resolve": { path: { alert_id: string }; query: None; body: { text?: string }; answer: Alert };
  /** Tell nobody of the robot's alerts of this cause for a while. With an `Idempotency-Key` it begins once. */
  "POST /alerts/{alert_id}/silence": { path: { alert_id: string }; query: None; body: { for_s?: number; reason?: string }; answer: Silence };
  /** Nobody sees to it after all. */
  "POST /alerts/{alert_id}/unacknowledge": { path: { alert_id: string }; query: None; body: { text?: string }; answer: Alert };
  /** Have the browser drop a session's cookie that is not good any more; a good one stays, which `logout` ends. */
  "POST /auth/forget": { path: None; query: None; body: {  }; answer: Ok };
  /** Sign in by a one-time link; the answer sets the session's cookie. */
  "POST /auth/link": { path: None; query: None; body: { token: string }; answer: Account };
  /** A link that signs a user in once, within 15 minutes; for the first administrator where no name is given. */
  "POST /auth/links": { path: None; query: None; body: { name?: string }; answer: SignInLink };
  /** Sign in by name and password; the answer sets the session's cookie. */
  "POST /auth/login": { path: None; query: None; body: { name: string; password: string }; answer: Account };
  /** End the session that asks. */
  "POST /auth/logout": { path: None; query: None; body: {  }; answer: Ok };
  /** Set one's own password; one's other sessions end. */
  "POST /auth/password": { path: None; query: None; body: { old?: string; new: string }; answer: Ok };
  /** A ticket that opens the sockets of viewers (/foxglove, /rosbridge, /api/v1/stream) as `?token=`. */
  "POST /auth/tickets": { path: None; query: None; body: { robots?: string[] | null; role?: "viewer" | "operator" | "admin"; ttl_s?: number }; answer: Ticket };
  /** Judge a robot's stored rows again, beside what is judged now; nothing is changed. One at a time. */
  "POST /backtests": { path: None; query: None; body: { robot: string; series?: string[]; from?: string; to?: string; checks?: Record<string, { enabled?: boolean | null; low?: number | null; high?: number | null; for_s?: number | null; clear_s?: number | null; severity?: "info" | "warning" | "error" | null }>; detectors?: string[] }; answer: Backtest };
  /** Have every robot that a selector names do something: one command each, durable or not. */
  "POST /commands": { path: None; query: None; body: { kind: "publish" | "call_service" | "node_verb" | "read_log" | "save_recording" | "set_uplink"; request?: Record<string, unknown>; durable?: boolean; expires_s?: number; timeout_s?: number; sent_ns?: number; selector: string; dry_run?: boolean }; answer: FleetCommands };
  /** Deliver dead letters again, as if they had just been accepted. */
  "POST /dead-letters/redrive": { path: None; query: None; body: { ids?: string[]; kind?: string; target?: string; all?: boolean }; answer: Redriven };
  /** A robot's first certificate for its token; 200 for the answer to a request that was answered before. */
  "POST /enrol": { path: None; query: None; body: { token: string; robot: string; csr: string }; answer: Enrolment };
  /** What a renewal has to sign; the same for every robot, known or not. */
  "POST /enrol/challenge": { path: None; query: None; body: { robot: string }; answer: EnrolChallenge };
  /** The next certificate for a robot that proves to hold the old one's key, up to 30 days after that one's end. */
  "POST /enrol/renew": { path: None; query: None; body: { robot: string; nonce: string; certificate: string; csr: string; proof: string }; answer: Enrolment };
  /** Make a token that enrols one robot once. Its secret is in this answer and nowhere else. */
  "POST /enrolment-tokens": { path: None; query: None; body: { robot?: string; ttl_s?: number }; answer: NewEnrolmentToken };
  /** Call a function with the body, which is any JSON. That it fails is an answer: see `status`. */
  "POST /functions/{name}/invoke": { path: { name: string }; query: { qualifier?: string; kind?: "request" | "event" | "dry" }; body: undefined; answer: Invoked };
  /** Give a function what happened in a span once more, each happening once. */
  "POST /functions/{name}/replay": { path: { name: string }; query: None; body: { from: string; until?: string; pattern?: Record<string, unknown> | null; types?: string[]; qualifier?: string }; answer: Replay };
  /** Make a version of what `$LATEST` is; the one that there is, where nothing changed since. */
  "POST /functions/{name}/versions": { path: { name: string }; query: None; body: { description?: string }; answer: PublishedVersion };
  /** Something happened: it is stored, judged by the rules and in the queue when this is answered. All or none. */
  "POST /happenings": { path: None; query: None; body: { entries: ({ id?: string; type: string; source?: string; time?: string; robot?: string; detail?: Record<string, unknown> })[] }; answer: Taken };
  /** A hook, with its secret, which nobody is shown again. */
  "POST /hooks": { path: None; query: None; body: { name: string; description?: string; auth?: "signature" | "bearer"; robot?: string }; answer: HookMade };
  /** A webhook of somebody who has the hook's secret: any JSON, signed as Standard Webhooks has it, or with the secret */
  "POST /hooks/{hook}": { path: { hook: string }; query: None; body: {  }; answer: Received };
  /** Another secret, at once; shown this once. */
  "POST /hooks/{hook}/rotate": { path: { hook: string }; query: None; body: {  }; answer: HookSecret };
  /** Make a key that reaches no further than who asks. Its secret is in this answer and nowhere else. */
  "POST /keys": { path: None; query: None; body: { name: string; role: "viewer" | "operator" | "admin"; robots?: string[]; scopes?: string[]; expires_s?: number | null }; answer: NewApiKey };
  /** A verb for a node of every robot that the selector names. What robots make of it is told one by one. */
  "POST /nodes/{verb}": { path: { verb: "start" | "stop" | "restart" | "retry" | "signal" }; query: { dry_run?: boolean; reason?: string }; body: { signal?: number; selector: string; node: string }; answer: NodeResults };
  /** Begin a goal; answers when the server has taken it, with the goal's own path in `Location`. */
  "POST /robots/{robot_id}/actions/{action}": { path: { robot_id: string; action: string }; query: None; body: { type?: string; goal?: Record<string, unknown>; timeout_s?: number; lease_id?: string; sent_ns?: number }; answer: Goal };
  /** Have a robot do something. 200 when the command is over, however it ended; 202 while it is not. */
  "POST /robots/{robot_id}/commands": { path: { robot_id: string }; query: { wait_s?: number }; body: { kind: "publish" | "call_service" | "node_verb" | "read_log" | "save_recording" | "set_uplink"; request?: Record<string, unknown>; durable?: boolean; expires_s?: number; timeout_s?: number; sent_ns?: number }; answer: Command };
  /** Ask the server to stop the goal; whether it will. Nothing is asked of a goal that has ended. */
  "POST /robots/{robot_id}/goals/{goal}/cancel": { path: { robot_id: string; goal: string }; query: None; body: {  }; answer: Cancelled };
  /** Have the node make a transition; `success` is false where it stays what it is. */
  "POST /robots/{robot_id}/nodes/{node}/lifecycle": { path: { robot_id: string; node: string }; query: { ros_name?: string; dry_run?: boolean; reason?: string }; body: { transition: "configure" | "activate" | "deactivate" | "cleanup" | "shutdown"; keep?: boolean }; answer: LifecycleChanged };
  /** A verb for one node. What `start` and `stop` say lasts: a robot that is offline does it when it is back. */
  "POST /robots/{robot_id}/nodes/{node}/{verb}": { path: { robot_id: string; node: string; verb: "start" | "stop" | "restart" | "retry" | "signal" }; query: { dry_run?: boolean; reason?: string }; body: { signal?: number }; answer: NodeResult };
  /** Publish once; JSON, or CDR with topic, type, lease_id and sent_ns in the query. Answers after the agent's result. */
  "POST /robots/{robot_id}/publish": { path: { robot_id: string }; query: { topic?: string; type?: string; lease_id?: string; sent_ns?: number }; body: { topic: string; type?: string; message?: Record<string, unknown>; lease_id?: string; sent_ns?: number }; answer: Ok };
  /** Ask for a clip of the robot's black box. The robot may be offline: it is asked when it comes. */
  "POST /robots/{robot_id}/recordings": { path: { robot_id: string }; query: None; body: { last_s?: number | null; start?: string; end?: string; topics?: string[] }; answer: Recording };
  /** End a robot's identity: its links are cut now, on other gateways within seconds. */
  "POST /robots/{robot_id}/revoke": { path: { robot_id: string }; query: None; body: { reason: string }; answer: Ok };
  /** Call a service of the robot and wait for its response. */
  "POST /robots/{robot_id}/services/call": { path: { robot_id: string }; query: None; body: { service: string; type?: string; request?: Record<string, unknown>; timeout_s?: number; lease_id?: string; sent_ns?: number }; answer: CallResult };
  /** Call a service by its name, relative to the robot's namespace or full (`%2Fsim_1%2Freset`), and wait. */
  "POST /robots/{robot_id}/services/{service}": { path: { robot_id: string; service: string }; query: { type?: string; timeout_s?: number; lease_id?: string; sent_ns?: number }; body: { type?: string; request?: Record<string, unknown>; timeout_s?: number; lease_id?: string; sent_ns?: number }; answer: CallResult };
  /** The same document under a new revision: for a robot that refused it or went back. */
  "POST /robots/{robot_id}/twin/retry": { path: { robot_id: string }; query: { reason?: string; confirm_within_s?: number | null }; body: {  }; answer: TwinChange };
  /** Give the robot its own document of an earlier revision; templates stay as they are. */
  "POST /robots/{robot_id}/twin/revert": { path: { robot_id: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: { revision: number }; answer: TwinChange };
  /** Start a rollout to every robot in scope that the selector names; 200 and nothing done for a dry run. */
  "POST /rollouts": { path: None; query: None; body: { version: string; selector: string; node?: string; bundle?: string; waves?: string[]; max_failure_rate?: number; health_s?: number; steady_s?: number; offline_s?: number; give_up_s?: number; dry_run?: boolean }; answer: RolloutDetail };
  /** End it. Robots that were told keep what their twins say. */
  "POST /rollouts/{rollout_id}/abort": { path: { rollout_id: string }; query: None; body: { reason?: string }; answer: Rollout };
  /** Tell no further robot; those at it go on. */
  "POST /rollouts/{rollout_id}/pause": { path: { rollout_id: string }; query: None; body: { reason?: string }; answer: Rollout };
  /** Go on in spite of the failures so far; or with another version, from the first wave and for every robot. */
  "POST /rollouts/{rollout_id}/resume": { path: { rollout_id: string }; query: None; body: { version?: string }; answer: Rollout };
  /** Whether a document can be a rule, and else what is wrong with it; nothing is stored. */
  "POST /rules/check": { path: None; query: None; body: {  }; answer: RuleChecked };
  /** What a rule would have done in a time that is stored. It knows of robots in one's own scope, and does nothing. */
  "POST /rules/dry-run": { path: None; query: None; body: { name?: string; rule?: Record<string, unknown> | null; from?: string; until?: string; limit?: number }; answer: DryRunResult };
  /** Turn a rule off: it forgets what it waits for. */
  "POST /rules/{name}/disable": { path: { name: string }; query: None; body: {  }; answer: Rule };
  /** Turn a rule on; it stays its maker's. */
  "POST /rules/{name}/enable": { path: { name: string }; query: None; body: {  }; answer: Rule };
  /** A new secret that signs what a webhook's target sends, in place of the one before; shown this once. */
  "POST /rules/{name}/targets/{target}/secret": { path: { name: string; target: string }; query: None; body: {  }; answer: HookSecret };
  /** The next times of a schedule that somebody thinks of. */
  "POST /schedules/preview": { path: None; query: None; body: { expression: string; timezone?: string; count?: number }; answer: ScheduleTimes };
  /** Tell nobody of what matches. One of the whole fleet needs `alerts.manage`, others a scope that covers them. */
  "POST /silences": { path: None; query: None; body: { robots: string[]; causes?: string[]; up_to?: "info" | "warning" | "error"; for_s?: number; reason?: string }; answer: Silence };
  /** The template as it was at an earlier revision, also of one that is gone; with what becomes of each robot. */
  "POST /templates/{name}/revert": { path: { name: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: { revision: number }; answer: TemplateChange };
  /** Take a bundle in; robots can have it once it is named by signed targets. */
  "POST /updates/bundles": { path: None; query: { group?: string }; body: undefined; answer: Bundle };
  /** Publish what was signed offline. All of it is taken, or nothing is. */
  "POST /updates/metadata": { path: None; query: None; body: { roots?: string[]; targets?: string | null; groups?: Record<string, string> }; answer: Published };
  /** The public keys that a root has to name for this store, made when they are first asked for. */
  "POST /updates/online-keys": { path: None; query: None; body: { fresh?: boolean }; answer: OnlineKeys };
  /** Hand a version out no more, at once; robots that run it keep it until they are told otherwise. */
  "POST /updates/withdrawals": { path: None; query: None; body: { path: string; reason?: string }; answer: Bundle };
  /** Make a user; without a password they sign in by a link. With an Idempotency-Key the same request makes one. */
  "POST /users": { path: None; query: None; body: { name: string; role: "viewer" | "operator" | "admin"; robots?: string[]; password?: string }; answer: User };
  /** Have a check be another for every robot, from now on; what is left out stays, and a null bound is none. */
  "PUT /alert-checks/{check_id}": { path: { check_id: string }; query: None; body: { enabled?: boolean | null; low?: number | null; high?: number | null; for_s?: number | null; clear_s?: number | null; severity?: "info" | "warning" | "error" | null }; answer: AlertCheck };
  /** Make a function, or change what the body names of it. */
  "PUT /functions/{name}": { path: { name: string }; query: None; body: { zip?: string | null; handler?: string | null; runtime?: string | null; timeout_s?: number | null; memory_mb?: number | null; disk_mb?: number | null; environment?: Record<string, string> | null; description?: string | null; layers?: string[] | null; reserved?: number | null; warm?: number | null; event_invoke?: { most_retries?: number | null; most_age_s?: number | null; on_success?: string | null; on_failure?: string | null; dead_letter?: string | null } | null; publish?: boolean; alias?: string }; answer: FunctionDetail };
  /** Let a name lead to a version, and maybe to another one now and then. */
  "PUT /functions/{name}/aliases/{alias}": { path: { name: string; alias: string }; query: None; body: { version: string; description?: string | null; weights?: Record<string, number> }; answer: Alias };
  /** Let an alias lead to a new version now and then; it is rolled back by itself where too many calls fail. */
  "PUT /functions/{name}/aliases/{alias}/canary": { path: { name: string; alias: string }; query: None; body: { version: string; weight?: number; error_rate?: number; least_invocations?: number; for_s?: number; step?: number }; answer: Canary };
  /** Take in a zip file as the function's code. */
  "PUT /functions/{name}/code": { path: { name: string }; query: { handler?: string; runtime?: string; publish?: boolean; alias?: string }; body: undefined; answer: FunctionDetail };
  /** Give the robot this node, or this row of it, whatever templates say. */
  "PUT /robots/{robot_id}/nodes/{node}": { path: { robot_id: string; node: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinChange };
  /** Another own document; null in it takes away what templates say. */
  "PUT /robots/{robot_id}/twin": { path: { robot_id: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: Record<string, unknown>; answer: TwinChange };
  /** Give the robot another byte budget. Answers when its agent has taken it and keeps it. */
  "PUT /robots/{robot_id}/uplink": { path: { robot_id: string }; query: None; body: { bytes_per_s: number | null }; answer: Uplink };
  /** Add a rule, or put another in its place: it is its maker's from then on. If-Match "0" adds only. */
  "PUT /rules/{name}": { path: { name: string }; query: None; body: { name: string; description?: string; enabled?: boolean; pattern?: Record<string, unknown> | null; until?: Record<string, unknown> | null; topic?: Record<string, unknown> | null; metric?: Record<string, unknown> | null; schedule?: Record<string, unknown> | null; when?: Record<string, unknown> | null; event_format?: string; targets?: (Record<string, unknown>)[] }; answer: Rule };
  /** Add a template, or put another in its place; with what becomes of every robot that it changes. */
  "PUT /templates/{name}": { path: { name: string }; query: { dry_run?: boolean; reason?: string; confirm_within_s?: number | null }; body: { selector: string; document: Record<string, unknown>; priority?: number }; answer: TemplateChange };
}
