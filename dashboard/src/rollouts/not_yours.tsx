/** In the place of what only admins may do here. */

import { session, signedIn } from "../api/session";
import { Link } from "../ui/parts";
import { here } from "../ui/url";

export function NotYours({ what }: { what: string }) {
  const who = session.value;
  return (
    <p class="may-not" data-may-not={what}>
      Admins may {what}{signedIn.value && who ? `; ${who.name} is ${who.role === "operator" ? "an" : "a"} ${who.role}` : ""}.
      {!signedIn.value && <Link href={`/signin?back=${encodeURIComponent(here())}`}>Sign in</Link>}
    </p>
  );
}
