// Signing in, where the server has tokens: the token goes into a cookie that no script can read.

import { h } from "./dom.js";

/** Whether this browser has signed in, which only the server knows for sure. */
const SIGNED_IN = "signed in";

/** Asks for a token, once, and begins anew with it. */
export function signIn() {
  if (document.querySelector("dialog[open] #sign-in")) return;
  const token = h("input", { type: "password", required: true, autocomplete: "current-password", size: 40, "aria-describedby": "sign-in-trouble" });
  const trouble = h("p", { id: "sign-in-trouble", role: "alert" });
  const submit = async (event) => {
    event.preventDefault();
    const response = await fetch("/dashboard/session", { method: "POST", headers: { authorization: `Bearer ${token.value.trim()}` } });
    if (response.ok) {
      localStorage.setItem(SIGNED_IN, "yes");
      location.reload();
    } else {
      trouble.textContent = (await response.json().catch(() => ({}))).detail ?? `The server answers ${response.status}.`;
    }
  };
  const was_in = localStorage.getItem(SIGNED_IN) !== null;
  const dialog = h("dialog", { "aria-labelledby": "sign-in", onclose: () => dialog.remove() },
    h("form", { onsubmit: submit }, h("h2", { id: "sign-in" }, was_in ? "The token is not valid any more" : "This server asks for a token"),
      h("p", {}, h("code", {}, "roost token create --scope submit"), " makes one on the server; scope ", h("code", {}, "read"), " is enough to look."),
      h("p", {}, h("label", { class: "field" }, "Token", token)), trouble, h("button", { class: "main" }, "Sign in")));
  document.body.append(dialog);
  dialog.showModal();
}

/** Puts a button to sign out into the header of who has signed in. */
export function signOut(header) {
  if (localStorage.getItem(SIGNED_IN) === null) return;
  header.append(h("button", { type: "button", onclick: async () => {
    await fetch("/dashboard/session", { method: "DELETE" });
    localStorage.removeItem(SIGNED_IN);
    location.reload();
  } }, "Sign out"));
}
