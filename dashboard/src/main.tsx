/** Wires the page: one stream, one decode worker, the clock, the address, and the view. */

import { render } from "preact";
import { openSocket } from "./api/client";
import { refresh, shutOut } from "./api/session";
import { startMoment } from "./history/moment";
import { now, startClock } from "./live/age";
import DecodeWorker from "./live/media/decode.worker?worker";
import { Decoder, onDemand } from "./live/media/decoder";
import { followFleet } from "./live/fleet";
import { followSession } from "./live/rights";
import { Stream } from "./live/stream";
import { LiveContext } from "./ui/context";
import "./styles/style.css";
import "./styles/history.css";
import { startTheme } from "./ui/theme";
import { BACK_KEY, startRouting } from "./ui/url";
import { App } from "./views/app";

const stream = new Stream(() => openSocket("/stream"));
const decoder = new Decoder(onDemand(() => new DecodeWorker()));

startTheme();
startClock();
startRouting();
if (sessionStorage.getItem(BACK_KEY)) void import("./ui/return_url").then(({ returnFromSignIn }) => returnFromSignIn());
startMoment();
followFleet(stream);
followSession(stream);
stream.start();
void refresh();
addEventListener("focus", () => shutOut.peek() && void refresh()); // perhaps another tab has signed in
render(
  <LiveContext.Provider value={{ stream, decoder, past: null, at: now }}>
    <App />
  </LiveContext.Provider>,
  document.getElementById("app")!,
);
