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

/** Puts new content into an element, and leaves it alone where nothing would change, so that focus and selection stay. */
export function fill(element, ...children) {
  const next = h("div", {}, ...children);
  if (element.innerHTML !== next.innerHTML || next.querySelector("button, select, input, a")) {
    const focused = element.contains(document.activeElement) && document.activeElement.id;
    element.replaceChildren(...next.childNodes);
    if (focused) document.getElementById(focused)?.focus();
  }
  return element;
}

/** Tells a screen reader what happened, and shows it for a moment. */
export function say(text) {
  const said = document.getElementById("said");
  said.textContent = text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => (said.textContent = ""), 6000);
}
