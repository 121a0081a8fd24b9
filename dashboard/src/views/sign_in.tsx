/** Signing in: by name and password, by a one-time link, or at the fleet's identity provider. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { accountApi } from "../api/account";
import { ApiError, saidOf, waitWords } from "../api/client";
import { become, ended, session, shutOut, signedIn, stale, type Account } from "../api/session";
import "../styles/sign_in.css";
import { signInErrorText } from "../ui/sign_in_errors";
import { returnUrlFrom, leaveFor } from "../ui/return_url";
import { here, place, replace } from "../ui/url";
import { PasswordForm } from "./password";

/** Where to go afterwards: what `back` says on /signin; anywhere else this page only stands before another one. */
const backHref = () => (place.peek().path === "/signin" ? returnUrlFrom(place.peek().params.get("back")) : here());

export function SignInPage() {
  const link = useLink();
  const state = link.value;
  useEffect(() => {
    if (state === "" && signedIn.peek() && place.peek().path === "/signin") replace(backHref()); // nothing to do here
  }, [state, signedIn.value]);
  return (
    <section class="signin" data-signin={state || "form"}>
      <svg class="signin-mark" viewBox="0 0 24 24" aria-hidden="true"><path d="M3 20V6l9 8 9-8v14" /><circle cx="12" cy="5" r="2.4" /></svg>
      {state === "following" ? (
        <h1><span role="status">Signing you in…</span></h1>
      ) : state === "first" && session.value?.kind === "user" ? (
        <FirstPassword onDone={() => (link.value = "")} />
      ) : (
        <SignIn badLink={state === "stale"} onDone={() => (link.value = "")} />
      )}
    </section>
  );
}

type LinkState = "" | "following" | "stale" | "first";

/** Follow the one-time link that the address holds, if it does: its secret leaves the address before anything else. */
function useLink() {
  const state = useSignal<LinkState>(location.hash.length > 1 && location.pathname === "/signin" ? "following" : "");
  useEffect(() => {
    const follow = async () => {
      const token = location.hash.slice(1);
      if (!token || location.pathname !== "/signin") return;
      replace(here());
      state.value = "following";
      try {
        const { has_password } = await accountApi.link(token);
        state.value = has_password ? "" : "first";
      } catch (error) {
        state.value = error instanceof ApiError && error.code === "bad_credentials" ? "stale" : "";
      }
    };
    void follow();
    const again = () => void follow(); // pasted into a page that is here already
    addEventListener("hashchange", again);
    return () => removeEventListener("hashchange", again);
  }, []);
  return state;
}

function FirstPassword({ onDone }: { onDone: () => void }) {
  return (
    <>
      <h1>Welcome, {session.value!.name}</h1>
      <p class="signin-lead">
        You are signed in as {session.value!.role}. The link is used up: choose a password to sign in with from now on.
      </p>
      <PasswordForm later="Later" onDone={onDone} />
    </>
  );
}

function SignIn({ badLink, onDone }: { badLink: boolean; onDone: () => void }) {
  const refused = place.value.path === "/signin" && signInErrorText(place.value.params.get("refused"));
  return (
    <>
      <h1>Sign in</h1>
      {refused ? (
        <p class="signin-lead signin-stale" role="alert">{refused}</p>
      ) : badLink ? (
        <p class="signin-lead signin-stale" role="alert">
          This link is not good any more: it works once, within 15 minutes. Make another one with <code>metaros signin</code>.
        </p>
      ) : (
        <p class="signin-lead">{ended.value ? `The session of ${ended.value} has ended.` : shutOut.value ? "This gateway is for people it knows." : "Operators drive and record, admins also decide who may."}</p>
      )}
      <PasswordSignIn onDone={onDone} />
      <Provider />
      {shutOut.value && <AsViewer />}
      <p class="signin-foot">
        No password yet? An admin makes you a link, or on the gateway's machine: <code>metaros signin</code>
      </p>
    </>
  );
}

function PasswordSignIn({ onDone }: { onDone: () => void }) {
  const [name, password] = [useRef<HTMLInputElement>(null), useRef<HTMLInputElement>(null)];
  const problem = useSignal("");
  const busy = useSignal(false);
  const shown = useSignal(false);
  const wait = useCountdown();
  useEffect(() => (name.current!.value ? password : name).current!.focus(), []);
  const enter = async () => {
    busy.value = true;
    problem.value = "";
    try {
      await accountApi.login(name.current!.value.trim(), password.current!.value);
      onDone();
    } catch (error) {
      if (error instanceof ApiError && error.retryAfterS !== null) wait.begin(error.retryAfterS);
      else problem.value = error instanceof ApiError && error.code === "bad_credentials" ? "The name or the password is wrong." : saidOf(error);
      password.current?.select();
    }
    busy.value = false;
  };
  const show = () => {
    shown.value = !shown.value;
    password.current!.type = shown.value ? "text" : "password";
  };
  const left = wait.leftS.value;
  return (
    <form
      class="fields"
      onSubmit={(event) => {
        event.preventDefault();
        if (!busy.value && left === 0) void enter();
      }}
    >
      <label class="field">
        <span>Name</span>
        <input ref={name} type="text" name="username" autocomplete="username" autocapitalize="none" spellcheck={false} required maxLength={64} defaultValue={ended.peek()} />
      </label>
      <div class="field">
        <label for="signin-password">Password</label>
        <span class="with-eye">
          <input
            ref={password}
            id="signin-password"
            type="password"
            name="password"
            autocomplete="current-password"
            required
            maxLength={256}
            aria-invalid={problem.value !== ""}
            aria-describedby="signin-problem"
          />
          <button type="button" class="eye" aria-pressed={shown.value} aria-label="Show the password" onClick={show}>
            {shown.value ? "Hide" : "Show"}
          </button>
        </span>
      </div>
      <p class="problem" id="signin-problem" role="alert">
        {left > 0 ? `Too many attempts. Wait ${waitWords(wait.askedS.value)}, then try again.` : problem.value}
      </p>
      <button class="button button-main button-wide" aria-disabled={busy.value || left > 0 || undefined}>
        {left > 0 ? `Wait ${leftWords(left)}` : busy.value ? "Signing in…" : "Sign in"}
      </button>
    </form>
  );
}

/** "12 s", "3:07". */
const leftWords = (seconds: number) => (seconds < 60 ? `${seconds} s` : `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`);

/** Seconds until something may be tried again, counting down; `askedS`: how many they were at first. */
function useCountdown() {
  const leftS = useSignal(0);
  const askedS = useSignal(0);
  const untilMs = useRef(0);
  useEffect(() => {
    const timer = setInterval(() => {
      leftS.value = Math.max(0, Math.ceil((untilMs.current - performance.now()) / 1000));
    }, 250);
    return () => clearInterval(timer);
  }, []);
  const begin = (seconds: number) => {
    untilMs.current = performance.now() + seconds * 1000;
    leftS.value = Math.ceil(seconds);
    askedS.value = seconds;
  };
  return { leftS, askedS, begin };
}

/** The way on for whose session has ended where anybody may look. */
function AsViewer() {
  const viewer = useSignal<Account | null>(null);
  useEffect(() => {
    if (stale.peek()) accountApi.forget().then((found) => (viewer.value = found), () => {}); // then there is no way on
  }, []);
  if (!viewer.value) return null;
  return <button type="button" class="button button-wide" onClick={() => become(viewer.value!)}>Go on as a viewer</button>;
}

/** The way to an identity provider, where the gateway has one. */
function Provider() {
  const found = useSignal<{ name: string | null; url: string | null } | null>(null);
  useEffect(() => {
    accountApi.provider().then((provider) => (found.value = provider), () => {}); // then there is the password
  }, []);
  const { name, url } = found.value ?? { name: null, url: null };
  if (!url) return null;
  return (
    <>
      <p class="or"><span>or</span></p>
      <a class="button button-wide" href={url} onClick={() => leaveFor(backHref())}>Sign in with {name}</a>
    </>
  );
}
