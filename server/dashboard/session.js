// @ts-check
// Signing in where the server has tokens, with a token or with an identity provider. Either becomes a cookie that no script can read.

import { h } from "./dom.js";

/** Key of local storage: whether this browser has signed in before. Only the server knows whether the session is still valid. */
const SIGNED_IN = "signed in";

/**
 * Asks the server for the session of this browser, and for its identity provider.
 * @returns {Promise<{ provider: string | null, session: { user: string, project: string } | null }>}
 */
const readSession = async () => (await fetch("/dashboard/session")).json();

/** Opens the dialog that asks for a token, at most one at a time, and reloads the page after success. */
export function signIn() {
  if (document.querySelector("dialog[open] #sign-in")) return;
  const token = h("input", { type: "password", required: true, autocomplete: "current-password", size: 40, "aria-describedby": "sign-in-errors" });
  const errors = h("p", { id: "sign-in-errors", role: "alert" });
  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    const response = await fetch("/dashboard/session", { method: "POST", headers: { authorization: `Bearer ${token.value.trim()}` } });
    if (response.ok) {
      localStorage.setItem(SIGNED_IN, "yes");
      location.reload();
    } else {
      errors.textContent = (await response.json().catch(() => ({}))).detail ?? `The server answers ${response.status}.`;
    }
  };
  const had_session = localStorage.getItem(SIGNED_IN) !== null;
  const title = h("h2", { id: "sign-in" }, had_session ? "The token is no longer valid" : "This server needs a token");
  const by_provider = h("p", { hidden: true });
  readSession().then(({ provider }) => {
    if (!provider) return;
    title.textContent = had_session ? "The session has ended" : "This server needs a sign-in";
    by_provider.append(h("button", { type: "button", class: "main", onclick: () => location.assign("/dashboard/sign-in") }, `Sign in with ${provider}`));
    by_provider.hidden = false;
  }).catch(() => {});
  const dialog = h("dialog", { "aria-labelledby": "sign-in", onclose: () => void dialog.remove() },
    h("form", { onsubmit: submit }, title, by_provider,
      h("p", {}, "To get a token, run ", h("code", {}, "roost token create --scope submit"), " on the server. Scope ", h("code", {}, "read"), " is enough to view."),
      h("p", {}, h("label", { class: "field" }, "Token", token)), errors, h("button", { class: "main" }, "Sign in")));
  document.body.append(dialog);
  dialog.showModal();
}

/**
 * Adds the user and a button to sign out, where this browser has signed in.
 * @param {HTMLElement} header
 */
export async function addSignOut(header) {
  const { session } = await readSession();
  if (!session) return;
  localStorage.setItem(SIGNED_IN, "yes");
  const errors = h("span", { role: "alert" });
  header.append(h("span", { class: "dim user" }, session.user), h("button", { type: "button", onclick: async () => {
    const response = await fetch("/dashboard/session", { method: "DELETE" }).catch(() => null);
    if (!response?.ok) {
      errors.textContent = response ? `You are still signed in: the server answers ${response.status}.` : "You are still signed in: the server does not answer.";
      return;
    }
    localStorage.removeItem(SIGNED_IN);
    location.reload();
  } }, "Sign out"), errors);
}
