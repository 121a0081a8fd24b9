/** Wires the page: one stream, one decode worker, the clock, the address, and the view. */

import { render } from "preact";
import { socketUrl } from "./api/client";
import { startMoment } from "./history/moment";
import { now, startClock } from "./live/age";
import DecodeWorker from "./live/decode.worker?worker";
import { Decoder } from "./live/decoder";
import { followFleet } from "./live/fleet";
import { Stream } from "./live/stream";
import { LiveContext } from "./ui/context";
import "./ui/style.css";
import "./ui/history.css";
import { startTheme } from "./ui/theme";
import { startRouting } from "./ui/url";
import { App } from "./views/app";

const stream = new Stream(() => new WebSocket(socketUrl("/stream")));
const decoder = new Decoder(new DecodeWorker());

startTheme();
startClock();
startRouting();
startMoment();
followFleet(stream);
stream.start();
render(
  <LiveContext.Provider value={{ stream, decoder, past: null, at: now }}>
    <App />
  </LiveContext.Provider>,
  document.getElementById("app")!,
);
