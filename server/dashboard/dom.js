// @ts-check
// HTML and SVG elements from code. Text is always text, never markup.

/**
 * @template {Element} E
 * @param {E} element @param {Attributes | null | undefined} attributes @param {Child[]} children
 */
function build(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === "function") element.addEventListener(key.slice(2), value);
    else if (typeof value === "object") {
      const { style } = /** @type {ElementCSSInlineStyle} */ (/** @type {unknown} */ (element));
      for (const [name, text] of Object.entries(value)) style.setProperty(name, text);
    } else element.setAttribute(key, value === true ? "" : String(value));
  }
  const flat = /** @type {(Node | string)[]} */ (/** @type {any[]} */ (children).flat(Infinity));
  const shown = flat.filter((child) => child !== null && child !== undefined && typeof child !== "boolean");
  element.append(...shown);
  return element;
}

/**
 * Makes an HTML element. An attribute `onclick` is a listener of `click`; `style` is an object.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} name @param {Attributes | null} [attributes] @param {...Child} children
 */
export function h(name, attributes, ...children) {
  return build(document.createElement(name), attributes, children);
}

/**
 * Makes an SVG element in the same way.
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} name @param {Attributes | null} [attributes] @param {...Child} children
 */
export function svg(name, attributes, ...children) {
  return build(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

/**
 * Renders text with names in backquotes as code.
 * @param {string} text
 */
export const withCode = (text) => text.split("`").map((part, i) => (i % 2 ? h("code", {}, part) : part));

/**
 * Identifies an element across two drawings.
 * @param {Element | null} element
 */
const identity = (element) => element?.id || element?.getAttribute("href") || (element?.tagName === "BUTTON" && element.textContent);

/**
 * Replaces the content of an element and keeps the focus where the focused element comes back.
 * @param {HTMLElement} element @param {...Child} children
 */
export function fill(element, ...children) {
  const focused = element.contains(document.activeElement) ? identity(document.activeElement) : null;
  const next = h("div", {}, ...children);
  // Equal content stays, with the reader's selection. Buttons and inputs are replaced: their listeners may differ.
  if (element.innerHTML === next.innerHTML && !next.querySelector("button, input, select")) return element;
  element.replaceChildren(...next.childNodes);
  const focusable = /** @type {NodeListOf<HTMLElement>} */ (element.querySelectorAll("a, button, input, select, summary"));
  if (focused) [...focusable].find((one) => identity(one) === focused)?.focus({ preventScroll: true });
  return element;
}

/**
 * Replaces the content only when `key` has changed: open menus stay open, and inputs keep their text.
 * @param {HTMLElement} element @param {string} key @param {() => Child} make
 */
export function fillIfChanged(element, key, make) {
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  fill(element, make());
}

/** @type {ReturnType<typeof setTimeout> | undefined} */
let announcement_timer;

/**
 * Announces a message to screen readers and shows it for six seconds.
 * @param {string} text
 */
export function announce(text) {
  const status = /** @type {HTMLElement} */ (document.getElementById("announcement"));
  status.textContent = text;
  clearTimeout(announcement_timer);
  announcement_timer = setTimeout(() => (status.textContent = ""), 6000);
}
