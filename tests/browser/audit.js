// Checks a page against accessibility guidelines (WCAG 2.2, AA): names, roles, order of headings, contrast. Returns a line for each fault.

window.audit = () => {
  const faults = new Set();
  const describe = (element) => `<${element.localName}${element.id ? ` id=${element.id}` : ""} class="${element.getAttribute("class") ?? ""}"> “${element.textContent.trim().slice(0, 30)}”`;
  const report = (fault, element) => faults.add(`${fault}: ${describe(element)}`);
  const all = (selector) => [...document.querySelectorAll(selector)].filter(find.isShown);

  // Names of controls and images.
  for (const one of all("button, a[href], input, select, textarea, summary, canvas, [tabindex], [role=img], [role=progressbar], dialog")) {
    if (one.id !== "main" && !one.closest(".js-plotly-plot .modebar") && !find.name(one)) report("has no name", one);
  }
  for (const one of all("img")) if (!one.hasAttribute("alt")) report("has no alt", one);
  for (const one of all("table")) if (!one.caption?.textContent.trim()) report("has no caption", one);
  for (const one of all("th")) if (!one.scope) report("has no scope", one);
  for (const one of all("th")) if (!one.textContent.trim()) report("has no text", one);
  for (const one of all("[role=progressbar]")) if (!(Number(one.ariaValueNow) >= 0 && Number(one.ariaValueNow) <= 100)) report("has no value", one);
  for (const one of all("[tabindex]")) if (one.tabIndex > 0) report("has a positive tabindex", one);
  for (const one of all("[onclick], .hit")) if (!one.matches("button, a, summary, .hit")) report("reacts to clicks and is not a button", one);
  const ids = [...document.querySelectorAll("[id]")].map((one) => one.id);
  for (const id of new Set(ids.filter((id, i) => ids.indexOf(id) !== i))) faults.add(`two elements have the id ${id}`);
  for (const one of all("[aria-describedby], [aria-labelledby], [list]")) {
    for (const id of ["aria-describedby", "aria-labelledby", "list"].flatMap((name) => one.getAttribute(name)?.split(" ") ?? [])) if (!document.getElementById(id)) report(`refers to the missing id ${id}`, one);
  }

  // The page as a whole.
  if (!document.documentElement.lang) faults.add("the page has no language");
  if (!document.title) faults.add("the page has no title");
  for (const [selector, count] of [["main", 1], ["header", 1], ["nav[aria-label]", 1], ["main h1", 1], ["[role=status][aria-live]", 1]]) {
    const found = document.querySelectorAll(selector).length;
    if (selector.startsWith("[") ? found < count : found !== count) faults.add(`${found} × ${selector}`);
  }
  let level = 0;
  for (const one of all("h1, h2, h3, h4")) {
    if (Number(one.localName[1]) > level + 1) report("skips a level of headings", one);
    level = Number(one.localName[1]);
  }

  // Contrast, from colours as the browser draws them.
  const pixel = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const cache = new Map();
  const rgba = (colour) => {
    if (!cache.has(colour)) {
      pixel.clearRect(0, 0, 1, 1);
      pixel.fillStyle = colour;
      pixel.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = pixel.getImageData(0, 0, 1, 1).data;
      cache.set(colour, [r, g, b, a / 255]);
    }
    return cache.get(colour);
  };
  const over = ([r, g, b, a], ground) => [r, g, b].map((x, i) => a * x + (1 - a) * ground[i]);
  const ground = (element) => {
    const under = element.parentElement ? ground(element.parentElement) : [255, 255, 255];
    return over(rgba(getComputedStyle(element).backgroundColor), under);
  };
  const light = (colour) => colour.map((x) => x / 255).map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4)).reduce((sum, x, i) => sum + x * [0.2126, 0.7152, 0.0722][i], 0);
  const contrast = (a, b) => {
    const [high, low] = [light(a), light(b)].sort((a, b) => b - a);
    return (high + 0.05) / (low + 0.05);
  };
  const opacity = (element) => (element ? Number(getComputedStyle(element).opacity) * opacity(element.parentElement) : 1);
  const needs = (minimum, colour, share, element, on, what) => {
    const [r, g, b, a] = rgba(colour);
    if (a === 0) return;
    const found = contrast(over([r, g, b, a * share], on), on);
    if (found < minimum) report(`${what} has a contrast of ${found.toFixed(2)}, less than ${minimum}`, element);
  };
  let texts = 0, marks = 0;
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const element = node.parentElement;
    if (!node.data.trim() || !find.isShown(element) || element.closest("option, :disabled, .skip")) continue;
    // plotly.js chooses black or white for text on coloured cells and bars.
    if (element.closest(".heatmaplayer, .barlayer")) continue;
    const style = getComputedStyle(element), is_svg = element instanceof SVGElement;
    needs(4.5, is_svg ? style.fill : style.color, opacity(element) * (is_svg ? Number(style.fillOpacity) : 1), element, ground(element), "text");
    texts += 1;
  }
  for (const one of all("input[placeholder]")) if (!one.value) needs(4.5, getComputedStyle(one, "::placeholder").color, 1, one, ground(one), "placeholder");
  for (const one of all(".state")) (marks++, needs(3, getComputedStyle(one, "::before").backgroundColor, 1, one, ground(one), "the dot"));
  for (const one of all(".bar span")) (marks++, needs(3, getComputedStyle(one).backgroundColor, 1, one, ground(one.parentElement.parentElement), "the bar"));
  for (const one of all("input:not([type=range], [type=checkbox]), select, textarea, main button:enabled:not(th button)")) (marks++, needs(3, getComputedStyle(one).borderTopColor, 1, one, ground(one.parentElement), "the edge"));
  for (const one of all(".scatterlayer .js-line, .scatterlayer .point, .coordinates path:not(.out), .coordinates .axis")) {
    const style = getComputedStyle(one), is_line = one.localName === "line" || style.fill === "none" || style.fillOpacity === "0";
    const colour = is_line ? style.stroke : style.fill, share = Number(is_line ? style.strokeOpacity : style.fillOpacity);
    if (Number.parseFloat(style.strokeWidth) === 0 && is_line) continue;
    marks += 1;
    needs(3, colour, share * opacity(one), one, ground(one.closest("section")), "a mark");
  }
  if (texts < 10) faults.add(`only ${texts} texts were checked`);
  return [...faults];
};
