/** Why a sign-in at an identity provider failed, in words. */

const WORDS: Record<string, string> = {
  oidc_denied: "nobody signed in there.",
  oidc_state: "this sign-in was too old, or began in another browser. Try again.",
  oidc_code: "this sign-in was used up already. Try again.",
  oidc_token: "what the provider said does not hold. An admin has to look at it.",
  oidc_role: "none of your groups has a role here. Ask an admin.",
  oidc_disabled: "your account is disabled here. Ask an admin.",
  provider_unavailable: "the provider does not answer. Try again later.",
  too_many_requests: "too many attempts. Wait a minute, then try again.",
};

/** A sentence for a code of the address, which anybody may have written: one that is not known has a general one. */
export const signInErrorText = (code: string | null) =>
  code && `Single sign-on did not work: ${Object.hasOwn(WORDS, code) ? WORDS[code] : "you were not let in. Try again, or ask an admin."}`;
