/* Fields: a number with its unit, a slider, bounds in words and a way back. */

let fieldNumber = 0;

/* `q` declares the quantity; `get` and `set` are in its customary unit; `range` is what the slider spans; `remark`
   says what a value that is taken means, "" for nothing. What somebody types is never written over while he types. */
function field(q, { label, get, set, reset = null, range = null, hint = "", remark = () => "" }) {
  const id = `f${++fieldNumber}`, whole = q.type !== "Real", text = label ?? plainName(q.name);
  const unit = make(`span#${id}-unit.unit`), problem = make(`p#${id}-problem.problem`, { hidden: true, "aria-live": "polite" });
  const number = make(`input#${id}`, { type: "number", step: "any", "data-name": q.name, "aria-describedby": `${id}-unit ${id}-problem` });
  const slider = range && make("input", { type: "range", "aria-label": `${text}, slider`, "data-slider": q.name, min: "0", max: "1000", step: "1" });
  const span = range && sliderSpan(range, whole);
  const written = () => String(Number((get() * q.factor / unitOf(q).factor).toPrecision(7)));
  const say = (words, soft = false) => { problem.textContent = words; problem.hidden = !words; problem.classList.toggle("soft", soft); };
  const invalid = (on) => number.setAttribute("aria-invalid", String(on));
  let typing = false, before = null, typed = "", kept = ""; // the value before somebody typed; as what he typed, or what was kept instead, is written
  const show_ = () => {
    const value = get(), now = written();
    unit.replaceChildren(...breakable(q.type === "Boolean" ? "" : unitText(q).trim()));
    if (!typing && (document.activeElement !== number || now !== typed)) {
      number.value = now;
      invalid(false);
      if (now !== kept) say(remark(value), true);
    }
    if (slider && document.activeElement !== slider) slider.value = String(Math.round(1000 * span.place(value)));
    slider?.setAttribute("aria-valuetext", `${show(value * q.factor / unitOf(q).factor)}${unitText(q)}`);
    if (back) back.disabled = Math.abs(value - reset()) <= 1e-12 * Math.abs(value);
  };
  const take = (value) => {
    const wrong = outOfBounds(q, value), known = before ?? get();
    kept = "";
    if (!wrong || get() !== known) set(wrong ? known : value);
    if (!wrong) show_();
    typed = written();
    invalid(Boolean(wrong));
    say(wrong || remark(value), !wrong);
  };
  number.addEventListener("input", () => {
    before ??= get();
    typing = true;
    take(number.value.trim() === "" ? NaN : customary(q, Number(number.value)));
    typing = false;
  });
  const leave = () => {
    const wrong = number.getAttribute("aria-invalid") === "true", found = number.value ? `${number.value}${unitText(q)}: ` : "", told = problem.textContent;
    before = null;
    typed = "";
    if (wrong) kept = written();
    show_();
    if (wrong) say(`${found}${told}; ${kept}${unitText(q)} is kept`);
  };
  for (const kind of ["change", "blur"]) number.addEventListener(kind, leave);
  slider?.addEventListener("input", () => take(span.value(Number(slider.value) / 1000)));
  const back = reset && make("button.reset", { type: "button", "aria-label": `Reset ${text}`, title: "Reset", onclick: () => take(reset()) }, "↺");
  const element = make("div.field", {}, make("label", { for: id, title: hint || q.description || "" }, ...breakable(text)), make("span.entry", {}, number, unit, back), slider, problem);
  element.refresh = show_;
  queueMicrotask(show_);
  return element;
}

/* A number typed in the unit in use, in the customary one: exactly as typed where they are the same. */
function customary(q, value) {
  return state.si ? value * 1 / q.factor : value;
}

/* A slider's way along `range` [low, high]; by ratios where both are positive and far apart. */
function sliderSpan([low, high], whole) {
  const ratio = low > 0 && high / low > 50;
  const tidy = (v) => whole ? Math.round(v) : Number(v.toPrecision(4));
  return ratio
    ? { place: (v) => Math.log(Math.min(high, Math.max(low, v)) / low) / Math.log(high / low), value: (s) => tidy(low * (high / low) ** s) }
    : { place: (v) => (Math.min(high, Math.max(low, v)) - low) / (high - low), value: (s) => Math.round(tidy(low + s * (high - low)) * 1e9) / 1e9 };
}

/* Where a slider of a parameter ends: around its declared value, within its bounds. */
function sliderRange(q, value) {
  const size = Math.abs(value) || q.nominal / q.factor;
  let low = value > 0 ? 0.4 * value : value < 0 ? 2 * value : -size, high = value > 0 ? 2 * value : value < 0 ? 0 : size;
  if (q.minimum !== null) low = Math.max(low, q.minimum / q.factor);
  if (q.maximum !== null) high = Math.min(high, q.maximum / q.factor);
  return high > low ? [low, high] : [low, low + size];
}

function choice(label, options, get, set, id) {
  const list = make(`select#${id}`, { onchange: () => set(list.value) }, ...Object.entries(options).map(([value, text]) => make("option", { value }, text)));
  const element = make("div.row", {}, make("label", { for: id }, label), list);
  element.refresh = () => { list.value = get(); };
  queueMicrotask(element.refresh);
  return element;
}

function check(label, get, set, { id = `f${++fieldNumber}`, name = "" } = {}) {
  const box = make("input", { id, type: "checkbox", "data-name": name, onchange: () => set(box.checked) });
  const element = make("div.check", {}, box, make("label", { for: id }, label));
  element.refresh = () => { box.checked = get(); };
  queueMicrotask(element.refresh);
  return element;
}

/* All parameters of `view` in groups that open; `set` holds what differs from `base()` (customary units). */
function parameterFields(view, list, base) {
  const key = (q) => q.key ?? q.name;
  return list.map((q) => {
    const start = () => base(q), set = () => state[view].set;
    const put = (value) => change(view, (s) => {
      if (Math.abs(value - start()) <= 1e-12 * Math.abs(value)) delete s[view].set[key(q)];
      else s[view].set[key(q)] = value;
    });
    if (q.type === "Boolean")
      return check(plainName(q.name), () => (set()[key(q)] ?? start()) > 0.5, (on) => put(on ? 1 : 0), { name: q.name });
    return field(q, { label: q.label ?? q.name, get: () => set()[key(q)] ?? start(), set: put, reset: start, range: q.span ?? sliderRange(q, start()), hint: `${q.description}${q.source ? ` (${q.source})` : ""}` });
  });
}

function refreshAll(element) {
  for (const child of element.querySelectorAll(".field, .row, .check")) child.refresh?.();
}
