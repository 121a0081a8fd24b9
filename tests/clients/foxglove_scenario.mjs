// npm @foxglove/ws-protocol, Lichtblick's own client, unmodified, against the gateway: a line of JSON a step, for
// test_foxglove.py. node foxglove_scenario.mjs NODE_MODULES URL
import { createRequire } from "node:module";

const [modules, url] = process.argv.slice(2);
const require = createRequire(`${modules}/none.js`);
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");

const say = (step, value = null) => console.log(JSON.stringify({ [step]: value }));
const utf8 = (view) => new TextDecoder().decode(view);

const socket = new WebSocket(url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]);
const client = new FoxgloveClient({ ws: socket });
const waiting = [];
const kept = [];

// The next event of that kind that fits, those included that came already.
function next(kind, fits = () => true) {
  const at = kept.findIndex((item) => item.kind === kind && fits(item.value));
  if (at >= 0) return Promise.resolve(kept.splice(at, 1)[0].value);
  return new Promise((resolve) => waiting.push({ kind, fits, resolve }));
}

const KINDS = [
  "serverInfo", "advertise", "advertiseServices", "message", "time", "parameterValues", "serviceCallResponse",
  "serviceCallFailure", "connectionGraphUpdate", "fetchAssetResponse", "status",
];
for (const kind of KINDS) {
  client.on(kind, (value) => {
    const at = waiting.findIndex((item) => item.kind === kind && item.fits(value));
    if (at >= 0) waiting.splice(at, 1)[0].resolve(value);
    else if (kind !== "time" || !kept.some((item) => item.kind === "time")) kept.push({ kind, value });
  });
}
client.on("error", (error) => {
  console.error(error);
  process.exit(1);
});

const info = await next("serverInfo");
say("info", { name: info.name, capabilities: info.capabilities, protocol: socket.protocol });

const channels = await next("advertise", (found) => found.some((item) => item.topic === "/sim_1/chatter"));
const chatter = channels.find((item) => item.topic === "/sim_1/chatter");
say("channel", chatter);
const subscription = client.subscribe(chatter.id);
client.getParameters(["nothing"], "subscribed");
await next("parameterValues", (found) => found.id === "subscribed");
say("subscribed", subscription);
const sample = await next("message");
say("message", {
  subscription: sample.subscriptionId, time: String(sample.timestamp), data: Buffer.from(sample.data.buffer,
    sample.data.byteOffset, sample.data.byteLength).toString("hex"),
});
client.unsubscribe(subscription);
say("time", String((await next("time")).timestamp));

const orders = client.advertise({ topic: "/sim_1/orders", encoding: "json", schemaName: "std_msgs/msg/String" });
client.sendMessage(orders, new TextEncoder().encode('{"data": "from node"}'));

const services = await next("advertiseServices", (found) => found.some((item) => item.name === "/sim_1/base/resume"));
const resume = services.find((item) => item.name === "/sim_1/base/resume");
client.sendServiceCallRequest({
  serviceId: resume.id, callId: 12, encoding: "json", data: new DataView(new TextEncoder().encode("{}").buffer),
});
const answer = await next("serviceCallResponse");
say("service", { type: resume.type, call: answer.callId, encoding: answer.encoding, data: utf8(answer.data) });
client.sendServiceCallRequest({
  serviceId: 4000000, callId: 13, encoding: "json", data: new DataView(new TextEncoder().encode("{}").buffer),
});
say("failure", await next("serviceCallFailure"));

client.getParameters([], "all");
say("parameters", (await next("parameterValues", (found) => found.id === "all")).parameters);
client.setParameters([{ name: "/sim_1/base.speed", value: 3.5, type: "float64" }], "set");
say("set", (await next("parameterValues", (found) => found.id === "set")).parameters);
client.subscribeParameterUpdates(["/sim_1/base.speed"]);
say("watching");
say("news", (await next("parameterValues", (found) => found.id === undefined)).parameters[0].name);
client.unsubscribeParameterUpdates(["/sim_1/base.speed"]);

client.subscribeConnectionGraph();
const graph = await next("connectionGraphUpdate");
say("graph", { published: graph.publishedTopics, removed: graph.removedTopics });
client.unsubscribeConnectionGraph();

client.fetchAsset("package://arm/link.stl", 7);
const asset = await next("fetchAssetResponse");
say("asset", { request: asset.requestId, status: asset.status, data: utf8(asset.data) });
client.fetchAsset("package://arm/../secret.stl", 8);
say("no_asset", (await next("fetchAssetResponse")).status);

client.unadvertise(orders);
client.close();
