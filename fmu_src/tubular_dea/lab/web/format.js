/* Numbers and units as people read them, and small pieces of HTML. */

function show(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "-";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

/* The unit in use, and what one of it is in SI. */
function unitOf(q) {
  return state?.si ? { name: q.unit, factor: 1 } : { name: q.shown, factor: q.factor };
}

function unitText(q) {
  const { name } = unitOf(q);
  return name === "1" ? "" : ` ${name}`;
}

function bound(q, value, none) {
  return value === null || value === undefined ? none : show(value / unitOf(q).factor, 6);
}

/* "95 mmHg" of a value in SI. */
function amount(q, si, digits = 4) {
  return `${show(si / unitOf(q).factor, digits)}${unitText(q)}`;
}

function plainName(name) {
  return name.replaceAll("_", " ");
}

/* A text that may go on in the next line after _, / and a point, not inside a word. */
function breakable(text) {
  return text.split(/(?<=[_/.])/).flatMap((part, i) => i ? [make("wbr"), part] : [part]);
}

/* make("p.note#id", {attributes}, ...children) */
function make(what, attributes = {}, ...children) {
  const [, tag, id, classes] = /^([a-z0-9]+)(?:#([\w-]+))?((?:\.[\w-]+)*)$/.exec(what);
  const element = document.createElement(tag);
  if (id) element.id = id;
  if (classes) element.className = classes.slice(1).replaceAll(".", " ");
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

/* The place of an element where there is but one column. */
function narrow(order, element) {
  element.style.setProperty("--narrow", String(order));
  return element;
}

function notice(text, action = null) {
  const place = document.getElementById("notice");
  place.replaceChildren();
  if (!text) return;
  place.append(make("span", {}, text));
  if (action) place.append(make("button", { type: "button", onclick: () => { notice(""); action.run(); } }, action.name));
  place.append(make("button", { type: "button", "aria-label": "Close this notice", onclick: () => notice("") }, "Close"));
}

function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/* `work` at most once a frame. */
function eachFrame(work) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; work(); });
  };
}
