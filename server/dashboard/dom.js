// Elements from code: text is always text, never markup.

function build(create, name, attributes, children) {
  const element = create(name);
  for (const [key, value] of Object.entries(attributes ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style") Object.entries(value).forEach(([name, to]) => element.style.setProperty(name, to));
    else element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** An HTML element; attributes that begin with `on` are listeners, `style` is an object. */
export function h(name, attributes, ...children) {
  return build((tag) => document.createElement(tag), name, attributes, children);
}

/** An SVG element, likewise. */
export function svg(name, attributes, ...children) {
  return build((tag) => document.createElementNS("http://www.w3.org/2000/svg", tag), name, attributes, children);
}

/** Text of the schema, where `names` stand in backquotes. */
export const prose = (text) => text.split("`").map((part, i) => (i % 2 ? h("code", {}, part) : part));

/** What an element is known by from one drawing to the next. */
const known = (element) => element?.id || element?.getAttribute("href") || (element?.tagName === "BUTTON" && element.textContent);

/** Puts new content into an element. What had the focus has it again, where it is there again. */
export function fill(element, ...children) {
  const focused = element.contains(document.activeElement) ? known(document.activeElement) : null;
  const next = h("div", {}, ...children);
  // Nothing to draw: nothing is lost either.
  if (element.innerHTML === next.innerHTML && !next.querySelector("button, input, select")) return element;
  element.replaceChildren(...next.childNodes);
  if (focused) [...element.querySelectorAll("a, button, input, select, summary")].find((one) => known(one) === focused)?.focus({ preventScroll: true });
  return element;
}

/** Makes new content only when `key` is another than the last time: menus stay open, and inputs as they are. */
export function fillOnce(element, key, make) {
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  fill(element, make());
}

/** Tells a screen reader what happened, and shows it for a moment. */
export function say(text) {
  const said = document.getElementById("said");
  said.textContent = text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => (said.textContent = ""), 6000);
}
