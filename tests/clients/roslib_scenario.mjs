// npm roslib, unmodified, against the gateway's rosbridge: a line of JSON a step, checked by test_rosbridge_clients.py.
const [modules, url] = process.argv.slice(2);
const ROSLIB = await import(`${modules}/roslib/dist/RosLib.js`);

const say = (step, value) => console.log(JSON.stringify({ [step]: value ?? null }));
const lines = (await import("node:readline")).createInterface({ input: process.stdin })[Symbol.asyncIterator]();
const told = (start) => new Promise((resolve, reject) => start(resolve, (error) => reject(new Error(String(error)))));

const ros = new ROSLIB.Ros({ url });
ros.on("error", (error) => console.error("error", error));
ros.on("status", (status) => console.error("status", JSON.stringify(status)));
await new Promise((resolve) => ros.on("connection", resolve));

// -- looking
say("topics", await told((ok, bad) => ros.getTopics(ok, bad)));
say("services", await told((ok, bad) => ros.getServices(ok, bad)));
say("nodes", await told((ok, bad) => ros.getNodes(ok, bad)));
say("node", await told((ok, bad) => ros.getNodeDetails("/sim_1/base", ok, bad)));
say("actions", await told((ok, bad) => ros.getActionServers(ok, bad)));
say("topic_type", await told((ok, bad) => ros.getTopicType("/sim_1/chatter", ok, bad)));
say("service_type", await told((ok, bad) => ros.getServiceType("/sim_1/add", ok, bad)));
say("of_type", await told((ok, bad) => ros.getTopicsForType("std_msgs/msg/String", ok, bad)));
say("raw_types", (await told((ok, bad) => ros.getTopicsAndRawTypes(ok, bad))).typedefs_full_text.length);
const defs = await told((ok, bad) => ros.getMessageDetails("sensor_msgs/msg/LaserScan", ok, bad));
say("typedef", ros.decodeTypeDefs(defs));
say("request", (await told((ok, bad) => ros.getServiceRequestDetails("example_interfaces/srv/AddTwoInts", ok, bad))).typedefs);

// -- topics, in every compression
// What was sent for the subscription before is on its way still, and comes to this one: `fits` tells them apart.
const first = (name, messageType, options, fits = () => true) =>
  new Promise((resolve) => {
    const topic = new ROSLIB.Topic({ ros, name, messageType, ...options });
    topic.subscribe((message) => {
      if (!fits(message)) return;
      topic.unsubscribe();
      resolve(message);
    });
  });
say("chatter", await first("/sim_1/chatter", "std_msgs/String"));
const scan = (options, fits) => first("/sim_1/scan", "sensor_msgs/msg/LaserScan", options, fits);
const shown = (message) => ({
  ranges: Array.from(message.ranges).slice(0, 4).map((value) => (Number.isFinite(value) ? value : null)),
  count: message.ranges.length,
  max: message.range_max,
});
say("plain", shown(await scan()));
say("throttled", shown(await scan({ throttle_rate: 50, queue_length: 1 })));
say("png", shown(await scan({ compression: "png" })));
const typed = await scan({ compression: "cbor" }, (message) => ArrayBuffer.isView(message.ranges));
say("cbor", { ...shown(typed), kind: typed.ranges.constructor.name });
const raw = await scan({ compression: "cbor-raw" }, (message) => "bytes" in message);
say("cbor_raw", { size: raw.bytes.length, secs: raw.secs });
say(
  "fragments",
  await new Promise((resolve) => {
    const listen = (message) => {
      if (!Array.isArray(message.msg.ranges)) return;
      ros.off("/sim_1/scan", listen);
      ros.callOnConnection({ op: "unsubscribe", topic: "/sim_1/scan" });
      resolve(shown(message.msg));
    };
    ros.on("/sim_1/scan", listen);
    ros.callOnConnection({ op: "subscribe", topic: "/sim_1/scan", fragment_size: 100 });
  }),
);

// -- publishing
const echo = new ROSLIB.Topic({ ros, name: "/sim_1/echo", messageType: "std_msgs/String" });
for (let number = 0; number < 20; number++) echo.publish({ data: `js ${number}` });
say("published");
await lines.next();

// -- services, both ways
const add = new ROSLIB.Service({ ros, name: "/sim_1/add", serviceType: "example_interfaces/AddTwoInts" });
say("sum", await told((ok, bad) => add.callService({ a: 2, b: 40 }, ok, bad)));
const nobody = new ROSLIB.Service({ ros, name: "/sim_1/nobody", serviceType: "std_srvs/Trigger" });
say("refused", await new Promise((resolve) => nobody.callService({}, () => resolve("answered"), resolve, 3)));
const mine = new ROSLIB.Service({ ros, name: "/sim_1/js_add", serviceType: "example_interfaces/AddTwoInts" });
await mine.advertise((request, response) => {
  response.sum = request.a + request.b + 1000;
  return true;
});
say("serving");
await lines.next();
await mine.unadvertise();

// -- actions, both ways
const count = new ROSLIB.Action({ ros, name: "/sim_1/count", actionType: "example_interfaces/action/Fibonacci" });
const run = (goal, begun) =>
  new Promise((resolve) => {
    const feedback = [];
    const id = count.sendGoal(
      goal,
      (result) => resolve({ result, feedback: feedback.length }),
      (values) => {
        feedback.push(values);
        if (begun) begun(id);
      },
      (failure) => resolve({ failure: String(failure), feedback: feedback.length }),
    );
  });
say("goal", await run({ order: 8 }));
say("cancelled", await run({ order: 1000 }, (id) => count.cancelGoal(id)));
const own = new ROSLIB.Action({ ros, name: "/sim_1/js_count", actionType: "example_interfaces/action/Fibonacci" });
own.advertise(
  (goal, id) => {
    own.sendFeedback(id, { sequence: [1] });
    if (goal.order < 100) setTimeout(() => own.setSucceeded(id, { sequence: [goal.order] }), 50);
  },
  (id) => own.setCanceled(id, { sequence: [7] }),
);
say("working");
await lines.next();
own.unadvertise();

// -- parameters
say("params", (await told((ok, bad) => ros.getParams(ok, bad))).filter((name) => name.endsWith(":speed")));
const speed = new ROSLIB.Param({ ros, name: "/sim_1/base:speed" });
say("speed", await told((ok, bad) => speed.get(ok, bad)));
await told((ok, bad) => speed.set(2.5, ok, bad));
say("faster", await told((ok, bad) => speed.get(ok, bad)));
say("unknown", await new Promise((ok) => new ROSLIB.Param({ ros, name: "/sim_1/base:no" }).get(() => ok("there"), ok)));

// -- statuses
ros.setStatusLevel("info");
const status = new Promise((resolve) => ros.on("status:mine", resolve));
ros.callOnConnection({ op: "publish", id: "mine", topic: "/sim_1/echo", msg: { wrong: 1 } });
say("status", await status);
ros.close();
say("done");
process.exit(0);
