// The compiled TypeScript client against a real gateway: node typescript_client.mjs <dist folder> <url> <key>
import assert from "node:assert/strict";
import { pathToFileURL } from "node:url";

const [, , folder, url, key] = process.argv;
const { GatewayClient, GatewayError } = await import(pathToFileURL(`${folder}/index.js`).href);
const gateway = new GatewayClient({ url, key });

const { robots } = await gateway.call("GET /robots");
assert.deepEqual(robots.map(({ id }) => id), ["sim_1"]);
const at = { path: { robot_id: "sim_1" } };
assert.equal((await gateway.call("GET /robots/{robot_id}", at)).namespace, "/sim_1");
const shape = await gateway.call("GET /robots/{robot_id}/types/{package}/{kind}/{name}", { path: { ...at.path, package: "std_msgs", kind: "msg", name: "String" } });
assert.deepEqual(shape.parts, { message: "std_msgs/msg/String" });
const body = { topic: "chatter", type: "std_msgs/msg/String", message: { data: "from TypeScript" } };
assert.deepEqual(await gateway.call("POST /robots/{robot_id}/publish", { ...at, body }), { ok: true });
assert.ok((await gateway.call("GET /commands", { query: { robot: "sim_1", limit: 5 } })).commands.length <= 5);

const refused = async (asked) => {
  const error = await asked.then(() => assert.fail("it was not refused"), (one) => one);
  assert.ok(error instanceof GatewayError, String(error));
  return [error.status, error.code];
};
assert.deepEqual(await refused(gateway.call("GET /robots/{robot_id}", { path: { robot_id: "nobody else" } })), [404, "unknown_robot"]);
assert.deepEqual(await refused(new GatewayClient({ url, key: "mrk_wrong" }).call("GET /robots")), [401, "bad_credentials"]);

let asked = 0;
const busy = new GatewayClient({ url, key, fetch: async (...given) => (asked++ < 2 ? new Response('{"code": "too_many", "retry_after_s": 0.01}', { status: 429 }) : fetch(...given)) });
assert.equal((await busy.call("GET /robots")).robots.length, 1);
assert.equal(asked, 3);
asked = 0;
assert.deepEqual(await refused(busy.call("POST /robots/{robot_id}/publish", { ...at, body })), [429, "too_many"]);
console.log("all well");
