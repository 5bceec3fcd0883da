// @ts-check
// Signing in where the server has tokens. The token becomes a cookie that no script can read.

import { h } from "./dom.js";

/** Key of local storage: whether this browser has signed in before. Only the server knows whether the session is still valid. */
const SIGNED_IN = "signed in";

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
  const dialog = h("dialog", { "aria-labelledby": "sign-in", onclose: () => void dialog.remove() },
    h("form", { onsubmit: submit }, h("h2", { id: "sign-in" }, had_session ? "The token is no longer valid" : "This server needs a token"),
      h("p", {}, "To get one, run ", h("code", {}, "roost token create --scope submit"), " on the server. Scope ", h("code", {}, "read"), " is enough to view."),
      h("p", {}, h("label", { class: "field" }, "Token", token)), errors, h("button", { class: "main" }, "Sign in")));
  document.body.append(dialog);
  dialog.showModal();
}

/**
 * Adds a button to sign out, where this browser has signed in.
 * @param {HTMLElement} header
 */
export function addSignOut(header) {
  if (localStorage.getItem(SIGNED_IN) === null) return;
  header.append(h("button", { type: "button", onclick: async () => {
    await fetch("/dashboard/session", { method: "DELETE" });
    localStorage.removeItem(SIGNED_IN);
    location.reload();
  } }, "Sign out"));
}
