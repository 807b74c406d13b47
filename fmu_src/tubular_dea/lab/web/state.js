/* Everything the page shows follows from `state`: plain values, in customary units, and what is not the default is the link. */

const facts = JSON.parse(document.getElementById("facts").textContent);
const SPEC = { kind: "hand", level: 0, low: 0, high: 1, at: 1, until: 3, from: 0, to: 1, rate: 75, on: 0.05, off: 0.38 };
const KINDS = { hand: "by hand", step: "step", ramp: "ramp", beat: "beat" };
const RHYTHMS = {
  regular: "Regular", premature: "One premature beat", bigeminy: "Bigeminy", fibrillation: "Atrial fibrillation", pause: "Pause",
  ...(facts.heart?.rTimes.length ? { recorded: "As recorded" } : {}),
};

function defaults() {
  const inputs = Object.fromEntries(facts.tube.inputs.map((q) => {
    const typical = Number((q.nominal / q.factor).toPrecision(2));
    return [q.name, { ...SPEC, kind: "step", high: typical, level: typical, until: 4 }];
  }));
  if (facts.isTube) {
    Object.assign(inputs.pressure, { kind: "ramp", high: 95, level: 95, low: 0 });
    Object.assign(inputs.voltage, { kind: "step", high: 5.5, level: 0, at: 2, until: 4 });
  }
  const state = {
    view: "tube", si: false, theme: "",
    tube: { inputs, stop: 5, set: {}, record: null, setting: "" },
    heart: { patient: "failing", set: {}, beats: 12, rhythm: "regular", index: "stroke_work_per_stroke_volume" },
    data: { set: {}, on: [], shown: "", over: "", setting: "" },
  };
  return merged(state, facts.state, "");
}

/* `changes` on top of `base`, which has every name there is; what does not fit is an error that names it. */
function merged(base, changes, path) {
  const out = { ...base };
  for (const [name, value] of Object.entries(changes ?? {})) {
    const at = path ? `${path}.${name}` : name;
    if (FREE.has(path) || FREE.has(at)) out[name] = checkedFree(at, value);
    else if (!(name in base)) throw new Error(`${at} is not known here`);
    else if (base[name] !== null && typeof base[name] === "object") out[name] = merged(base[name], value, at);
    else if (typeof value !== typeof base[name] || (typeof value === "number" && !Number.isFinite(value)))
      throw new Error(`${at}: expected a ${typeof base[name]} but found ${JSON.stringify(value)}`);
    else out[name] = value;
  }
  return out;
}

/* Parts with names of their own: parameter values, effects that are on, and what was recorded by hand. */
const FREE = new Set(["tube.set", "heart.set", "data.set", "tube.record", "data.on"]);

function checkedFree(at, value) {
  const numbers = (list) => Array.isArray(list) && list.every(Number.isFinite);
  if (at === "data.on" && Array.isArray(value) && value.every((id) => (facts.effects ?? []).some((e) => e.id === id))) return value;
  if (at === "tube.record" && value === null) return value;
  if (at === "tube.record" && numbers(value?.time) && facts.tube.inputs.every((q) => numbers(value[q.name]) && value[q.name].length === value.time.length) && value.time.length > 1)
    return value;
  if (/^(tube|heart|data)\.set$/.test(at) && value && typeof value === "object") {
    for (const [name, number] of Object.entries(value)) {
      const q = declared(at.split(".")[0], name);
      if (!q) throw new Error(`there is no parameter ${name}`);
      const problem = outOfBounds(q, number);
      if (problem) throw new Error(`${name}: ${problem}`);
    }
    return value;
  }
  throw new Error(`${at}: found ${JSON.stringify(value).slice(0, 60)}`);
}

/* The declaration of a parameter of a view. */
function declared(view, name) {
  if (view === "heart") {
    const [part, parameter] = name.split(".");
    return facts.heart?.parts[part]?.parameters.find((p) => p.name === parameter) ?? (name === "heart.heart_rate" ? RATE : undefined);
  }
  return (view === "data" ? facts.all ?? facts.tube : facts.tube).parameters.find((p) => p.name === name);
}

const RATE = { name: "heart_rate", unit: "Hz", shown: "1/min", factor: 1 / 60, description: "Beats a minute", minimum: 0.3, maximum: 5, type: "Real", nominal: 1.25 };

/* In words, what is wrong with a value in the customary unit; "" for nothing. */
function outOfBounds(q, value) {
  if (!Number.isFinite(value)) return "expected a number";
  const si = value * q.factor, slack = 1e-12 * Math.max(Math.abs(q.minimum ?? 0), Math.abs(q.maximum ?? 0));
  if ((q.minimum !== null && si < q.minimum - slack) || (q.maximum !== null && si > q.maximum + slack)) return `expected ${within(q)}`;
  if (q.type !== "Real" && value !== Math.round(value)) return "expected a whole number";
  return "";
}

/* The bounds of a quantity that has any. */
function within(q) {
  const low = bound(q, q.minimum, ""), high = bound(q, q.maximum, "");
  return `${!high ? `at least ${low}` : !low ? `at most ${high}` : `${low} to ${high}`}${unitText(q)}`;
}

/* What differs from `base`, and nothing else. */
function difference(base, value) {
  const out = {};
  for (const name of Object.keys(value)) {
    const a = base[name], b = value[name];
    if (JSON.stringify(a) === JSON.stringify(b)) continue;
    const nested = b !== null && typeof b === "object" && !Array.isArray(b) && a !== null && typeof a === "object" && name !== "set";
    out[name] = nested ? difference(a, b) : b;
  }
  return out;
}

function link() {
  const changes = difference(defaults(), state);
  if (!Object.keys(changes).length) return "#";
  const bytes = new TextEncoder().encode(JSON.stringify(changes));
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return `#s=${btoa(text).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

/* The state of a link; the default, and what is wrong in `problem`, where it cannot be read. */
function fromLink(hash) {
  if (!hash || hash === "#") return { state: defaults(), problem: "" };
  try {
    if (!hash.startsWith("#s=")) throw new Error("it does not begin with #s=");
    const text = atob(hash.slice(3).replaceAll("-", "+").replaceAll("_", "/"));
    const changes = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(Uint8Array.from(text, (c) => c.charCodeAt(0))));
    return { state: checkedChoices(merged(defaults(), changes, "")), problem: "" };
  } catch (problem) {
    return { state: defaults(), problem: `This link cannot be read (${problem.message}); the page shows its default.` };
  }
}

function checkedChoices(s) {
  const one = (what, value, of) => {
    if (!of.includes(value)) throw new Error(`${what}: expected one of ${of.join(", ")} but found ${JSON.stringify(value)}`);
  };
  one("view", s.view, facts.isTube ? ["tube", "heart", "data"] : ["tube", "data"]);
  one("theme", s.theme, ["", "light", "dark"]);
  for (const [name, spec] of Object.entries(s.tube.inputs)) one(name, spec.kind, Object.keys(KINDS));
  if (!(s.tube.stop > 0 && s.tube.stop <= 600)) throw new Error("stop: expected up to 600 s");
  if (!facts.isTube) return s;
  one("patient", s.heart.patient, Object.keys(facts.heart.patients));
  one("rhythm", s.heart.rhythm, Object.keys(RHYTHMS));
  one("index", s.heart.index, facts.heart.figures.map((f) => f.name));
  if (!(Number.isInteger(s.heart.beats) && s.heart.beats >= 5 && s.heart.beats <= 60)) throw new Error("beats: expected 5 to 60");
  return s;
}

let state = null;
const listeners = [];

/* Change the state and tell everybody: `what` names the part that changed. */
function change(what, edit) {
  edit?.(state);
  for (const listen of listeners) listen(what);
}
