// Finds elements as a user does. Runs before the scripts of every page.

// Browsers do not offer this over http from another machine.
delete Crypto.prototype.randomUUID;

window.find = {
  /** The accessible name of a control. */
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
  /** The text of a label without that of its control. */
  own(label, control) {
    const walk = (node) => (node === control ? "" : node.nodeType === Node.TEXT_NODE ? node.data : node.nodeName === "DATALIST" ? "" : [...node.childNodes].map(walk).join(" "));
    return walk(label).replace(/\s+/g, " ").trim();
  },
  isShown: (element) => element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length > 0,
  /** The visible field with this label, or else with a label that begins so. */
  field(label) {
    const all = [...document.querySelectorAll("input, select, textarea")].filter(find.isShown);
    return all.find((one) => find.name(one) === label) ?? all.find((one) => find.name(one).startsWith(label));
  },
  /** The visible button or link with this name, in the open dialog if there is one. */
  control(name) {
    const dialog = document.querySelector("dialog[open]");
    return [...(dialog ?? document).querySelectorAll("button, a, summary")].filter(find.isShown).find((one) => find.name(one) === name);
  },
  /** The card with this heading. */
  card: (title) => [...document.querySelectorAll("section")].find((one) => one.querySelector("h2")?.textContent === title),
  /** The data of the plot in a card, once it is drawn. */
  plot: (title) => {
    const plot = find.card(title)?.querySelector(".plot:not([hidden])");
    return plot?.data?.map(({ type, mode, name, x, y, z, error_x, error_y, customdata, fill }) => ({ type, mode, name, x, y, z, customdata, fill, up: error_y?.array, down: error_y?.arrayminus, right: error_x?.array, left: error_x?.arrayminus }));
  },
  /** Rows of the table whose caption begins so, as text. */
  rows: (caption) => {
    const table = [...document.querySelectorAll("table")].find((one) => one.caption?.textContent.startsWith(caption));
    return table && [...table.tBodies[0].rows].map((row) => [...row.cells].map((cell) => cell.textContent));
  },
  /** Scrolls to an element: x, y, width, height. */
  place(element) {
    element.scrollIntoView({ block: "center", behavior: "instant" });
    const { x, y, width, height } = element.getBoundingClientRect();
    return [x, y, width, height];
  },
  /** Whether an element is enabled and not covered. */
  isFree(element) {
    if (!element || element.disabled) return false;
    const [x, y, width, height] = find.place(element), there = document.elementFromPoint(x + width / 2, y + height / 2);
    return there !== null && (element.contains(there) || there.contains(element));
  },
};
