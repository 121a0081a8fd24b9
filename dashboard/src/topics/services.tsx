/** The services that the robot's nodes offer, each with the form that calls it. */

import { useSignal } from "@preact/signals";
import { TextField } from "../admin/fields";
import type { GraphService, RobotGraph } from "../api/introspect";
import type { Robot } from "../api/types";
import { relativeTopic, typeWord } from "../ui/format";
import { place, setParam } from "../ui/url";
import { CallForm } from "./call_form";

/** What every node has and no person calls by hand. */
const PLUMBING = /\/(describe_parameters|get_parameters|get_parameter_types|list_parameters|set_parameters|set_parameters_atomically|get_type_description)$/;

export function Services({ robot, graph, wanted }: { robot: Robot; graph: RobotGraph | null; wanted: string }) {
  const all = useSignal(false);
  const offered = (graph?.services ?? []).filter(({ servers }) => servers.length > 0);
  const shown = offered.filter(({ service }) => (all.value || !PLUMBING.test(service)) && service.toLowerCase().includes(wanted));
  const hidden = offered.filter(({ service }) => PLUMBING.test(service)).length;
  const chosen = place.value.params.get("service");
  return (
    <section class="services" aria-labelledby="services-title">
      <header class="section-head">
        <h2 id="services-title">Services <small>{offered.length > 0 ? shown.length : ""}</small></h2>
        {hidden > 0 && <label class="check"><input type="checkbox" checked={all.value} onChange={(event) => (all.value = event.currentTarget.checked)} /> parameter services too</label>}
      </header>
      {offered.length === 0 ? <AnyService robot={robot} /> : (
        <ul class="service-list">
          {shown.map((service) => <ServiceRow key={service.service} robot={robot} service={service} open={service.service === chosen} />)}
        </ul>
      )}
    </section>
  );
}

function ServiceRow({ robot, service: { service, type, servers }, open }: { robot: Robot; service: GraphService; open: boolean }) {
  return (
    <li data-service={service}>
      <div class="service-head">
        <button type="button" class="node-name mono" aria-expanded={open} onClick={() => setParam("service", open ? "" : service)}>{relativeTopic(service, robot.namespace)}</button>
        <span class="sub" title={type}>{typeWord(type)}</span>
        <span class="sub service-of">{servers.map(({ node }) => relativeTopic(node, robot.namespace)).join(", ")}</span>
      </div>
      {open && <CallForm key={service} robot={robot} service={service} type={type} />}
    </li>
  );
}

/** Of a robot whose agent does not tell which there are: by its name and type. */
function AnyService({ robot }: { robot: Robot }) {
  const name = useSignal("");
  const type = useSignal("");
  const asked = useSignal<{ service: string; type: string } | null>(null);
  return (
    <div class="service-any">
      <p class="hint">Which services there are, this robot's agent does not tell. One is called by its name and type.</p>
      <form class="fields" onSubmit={(event) => { event.preventDefault(); asked.value = { service: name.value.trim(), type: type.value.trim() }; }}>
        <TextField label="Service" mono required placeholder={`${robot.namespace.replace(/\/$/, "")}/…`} value={name.value} onInput={(text) => (name.value = text)} />
        <TextField label="Type" mono required placeholder="std_srvs/srv/Trigger" value={type.value} onInput={(text) => (type.value = text)} />
        <button class="button" disabled={!name.value.trim() || !/^\w+\/srv\/\w+$/.test(type.value.trim())}>Fill in…</button>
      </form>
      {asked.value && <CallForm key={`${asked.value.service} ${asked.value.type}`} robot={robot} service={asked.value.service} type={asked.value.type} />}
    </div>
  );
}
