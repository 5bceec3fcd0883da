// Parts of a page as a person finds them; every page of a test has this before its own scripts.

// Pages that come over http from another machine do not have it.
delete Crypto.prototype.randomUUID;

window.find = {
  /** What a control is called, as a screen reader says it. */
  name(element) {
    const labelledby = element.getAttribute("aria-labelledby")?.split(" ").map((id) => document.getElementById(id)?.textContent ?? "").join(" ");
    if (labelledby?.trim()) return labelledby.trim();
    if (element.getAttribute("aria-label")?.trim()) return element.getAttribute("aria-label").trim();
    const label = [...(element.labels ?? [])].map((one) => find.own(one, element)).join(" ").trim();
    if (label) return label;
    if (element.matches("button, a, summary, option, [role=button], [role=link]")) {
      const inside = element.textContent.trim() || [...element.querySelectorAll("img[alt], [aria-label]")].map((one) => one.alt ?? one.getAttribute("aria-label")).join(" ").trim();
      if (inside) return inside;
    }
    return "";
  },
  /** Text of a label without what stands in its control. */
  own(label, control) {
    const walk = (node) => (node === control ? "" : node.nodeType === Node.TEXT_NODE ? node.data : node.nodeName === "DATALIST" ? "" : [...node.childNodes].map(walk).join(" "));
    return walk(label).replace(/\s+/g, " ").trim();
  },
  isShown: (element) => element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length > 0,
  /** The shown field whose label begins so; exactly so before others. */
  field(label) {
    const all = [...document.querySelectorAll("input, select, textarea")].filter(find.isShown);
    return all.find((one) => find.name(one) === label) ?? all.find((one) => find.name(one).startsWith(label));
  },
  /** The shown button or link of that name. In front of others, of an open dialog. */
  control(name) {
    const dialog = document.querySelector("dialog[open]");
    return [...(dialog ?? document).querySelectorAll("button, a, summary")].filter(find.isShown).find((one) => find.name(one) === name);
  },
  /** The card of that heading. */
  card: (title) => [...document.querySelectorAll("section")].find((one) => one.querySelector("h2")?.textContent === title),
  /** The data of the plot in that card, once it is drawn. */
  plot: (title) => {
    const plot = find.card(title)?.querySelector(".plot:not([hidden])");
    return plot?.data?.map(({ type, mode, name, x, y, z, error_y, customdata, fill }) => ({ type, mode, name, x, y, z, customdata, fill, up: error_y?.array, down: error_y?.arrayminus }));
  },
  /** Rows of the table with a caption that begins so, cells as text. */
  rows: (caption) => {
    const table = [...document.querySelectorAll("table")].find((one) => one.caption?.textContent.startsWith(caption));
    return table && [...table.tBodies[0].rows].map((row) => [...row.cells].map((cell) => cell.textContent));
  },
  /** Where an element is: x, y, width, height. */
  place(element) {
    element.scrollIntoView({ block: "center", behavior: "instant" });
    const { x, y, width, height } = element.getBoundingClientRect();
    return [x, y, width, height];
  },
  /** Whether the pointer would meet it. */
  isFree(element) {
    if (!element || element.disabled) return false;
    const [x, y, width, height] = find.place(element), there = document.elementFromPoint(x + width / 2, y + height / 2);
    return there !== null && (element.contains(there) || there.contains(element));
  },
};
