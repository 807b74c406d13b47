/* The view Tube: inputs over time, the response, the tube to scale, and where it stands on its equilibrium curve. */

const LONGEST_RECORD = 120, TRAIL = 2, SAMPLES = 1201, LIVE_SAMPLES = 601;
const POINTS_PER_BEAT = 32;
const T = { head: 0, playing: true, result: null, problem: "", last: 0, began: 0, frames: [], work: [], stale: true, fold: null };
const TIME = { name: "time", unit: "s", shown: "s", factor: 1 };

const inputFacts = (name) => facts.tube.inputs.find((q) => q.name === name);
const signalFacts = (name, model = facts.tube) => [...model.inputs, ...model.outputs, ...model.states].find((q) => q.name === name) ?? (model.curve?.fold.name === name ? model.curve.fold : undefined);
const live = () => Object.values(state.tube.inputs).some((spec) => spec.kind === "hand");

/* Values of a view's model in SI: the declared ones, those of the setting chosen, those changed by hand. */
function parameterValues(view, model = facts.tube) {
  const chosen = facts.settings.find((s) => s.name === state[view].setting)?.values ?? {};
  const values = Object.fromEntries(model.parameters.map((q) => [q.name, chosen[q.name] ?? q.value ?? 0]));
  for (const [name, value] of Object.entries(state[view].set)) values[name] = value * declared(view, name).factor;
  return values;
}

const baseOf = (view) => (q) => (facts.settings.find((s) => s.name === state[view].setting)?.values[q.name] ?? q.value ?? 0) / q.factor;

/* Inputs over time ------------------------------------------------------------------------------------------- */

/* Times and values (customary unit) of one input; an Error in words where they do not fit. */
function pieces(name, spec, stop) {
  const { kind, low, high, at, until, from, to } = spec;
  if (kind === "step") {
    const off = Math.min(until, stop);
    if (!(at >= 0 && at < off)) throw new Error(`${name}: the step is from ${show(at)} to ${show(until)} s; expected it to begin at 0 s or later, to end after that, and to begin before the run ends at ${show(stop)} s`);
    return off < stop ? { time: [0, at, at, off, off, stop], values: [low, low, high, high, low, low] } : { time: [0, at, at, off], values: [low, low, high, high] };
  }
  if (kind === "ramp") {
    if (!(from >= 0 && from < to && to <= stop)) throw new Error(`${name}: the ramp is from ${show(from)} to ${show(to)} s; expected it to begin at 0 s or later and to end after that, by the end of the run at ${show(stop)} s`);
    return { time: [0, ...(from > 0 ? [from] : []), to, ...(to < stop ? [stop] : [])], values: [low, ...(from > 0 ? [low] : []), high, ...(to < stop ? [high] : [])] };
  }
  if (kind === "beat") return beats(name, spec, stop);
  const record = state.tube.record;
  return record ? { time: record.time, values: record[name] } : { time: [0, stop], values: [spec.level, spec.level] };
}

function beats(name, spec, stop) {
  const period = 60 / spec.rate, time = [], values = [];
  if (!(spec.rate >= 10 && spec.rate <= 300)) throw new Error(`${name}: expected 10 to 300 beats a minute`);
  if (name !== "pressure" && !(spec.on >= 0 && spec.on < spec.off && spec.off <= 1)) throw new Error(`${name}: expected a pulse from 0 or later to at most 1, of the beat`);
  for (let k = 0; k * period < stop; k++) {
    const points = name === "pressure"
      ? Array.from({ length: POINTS_PER_BEAT }, (_, i) => [i / POINTS_PER_BEAT, spec.low + (spec.high - spec.low) * pulseShape(i / POINTS_PER_BEAT)])
      : [[0, spec.low], [spec.on, spec.low], [spec.on, spec.high], [spec.off, spec.high], [spec.off, spec.low]];
    for (const [part, value] of points) if ((k + part) * period < stop) { time.push((k + part) * period); values.push(value); }
  }
  time.push(stop);
  values.push(values[values.length - 1]);
  return { time, values };
}

/* An arterial pulse from 0 to 1 to 0: upstroke, peak, dicrotic notch, run-off. */
function pulseShape(part) {
  if (part < 0.15) return 0.5 - 0.5 * Math.cos(Math.PI * part / 0.15);
  if (part < 0.36) return 1 - 0.36 * ((part - 0.15) / 0.21) ** 2;
  if (part < 0.42) return 0.64 + 0.06 * Math.sin(Math.PI * (part - 0.36) / 0.06);
  return 0.64 * (Math.exp(-2.5 * (part - 0.42)) - Math.exp(-2.5 * 0.58)) / (1 - Math.exp(-2.5 * 0.58));
}

/* All inputs on common breakpoints (SI), a jump's twice: as tubular-dea's own protocols are. */
function tubeDrive(stop) {
  const parts = Object.fromEntries(Object.entries(state.tube.inputs).map(([name, spec]) => [name, pieces(name, spec, stop)]));
  const marks = [...new Set(Object.values(parts).flatMap((p) => Array.from(p.time)))].filter((t) => t <= stop).sort((a, b) => a - b);
  const jumps = new Set(Object.values(parts).flatMap((p) => Array.from(p.time).filter((t, i) => i > 0 && p.time[i - 1] === t)));
  const time = marks.flatMap((t) => jumps.has(t) ? [t, t] : [t]), inputs = {};
  for (const [name, part] of Object.entries(parts)) {
    const { factor } = inputFacts(name), values = Array.from(part.values, (v) => v * factor);
    inputs[name] = time.map((t, i) => valueAt(part.time, values, t, i + 1 < time.length && time[i + 1] === t));
  }
  return { time, inputs };
}

function recordNow(t) {
  const names = Object.keys(state.tube.inputs), levels = names.map((n) => state.tube.inputs[n].level);
  const record = state.tube.record;
  if (!record) {
    state.tube.record = { time: [0, 0.5], ...Object.fromEntries(names.map((n, i) => [n, [0, levels[i]]])) };
    T.head = Math.max(T.head, 0.5);
    return;
  }
  const n = record.time.length, tidy = Math.round(t * 1e4) / 1e4;
  if (tidy <= record.time[n - 1]) return;
  const same = names.every((name, i) => record[name][n - 1] === levels[i] && n > 1 && record[name][n - 2] === levels[i]);
  if (same) record.time[n - 1] = tidy; // nobody moved: the last level lasts
  else { record.time.push(tidy); names.forEach((name, i) => record[name].push(levels[i])); }
}

/* The response ------------------------------------------------------------------------------------------------- */

function compute() {
  const stop = live() ? state.tube.record?.time.at(-1) ?? 0.5 : state.tube.stop;
  try {
    const n = live() ? LIVE_SAMPLES : SAMPLES;
    const samples = Float64Array.from({ length: n }, (_, i) => Math.min(stop, i * (stop / (n - 1))));
    const values = parameterValues("tube"), drive = tubeDrive(stop);
    const run = engine.trajectory("tube", facts.tube, values, drive, samples, { withFold: Boolean(facts.tube.curve) });
    for (const q of facts.tube.inputs) run.values[q.name] = sampled(drive.time, drive.inputs[q.name], samples, 0);
    T.result = { run, drive, values, stop };
    T.problem = run.reason ? `The trajectory ended at ${show(run.reached)} s: ${run.reason}.` : "";
    T.crossed = crossing(run);
    T.refused = false;
  } catch (problem) {
    T.problem = `${problem.message}. What is shown is the last run that could be made.`;
    T.crossed = NaN;
    T.refused = true;
  }
  T.stage.classList.toggle("stale", T.refused);
  T.stale = false;
}

/* The first time the pressure passes the fold, or NaN. */
function crossing(run) {
  const margin = run.values.snap_through_margin;
  if (!margin) return NaN;
  for (let i = 0; i < run.rows; i++) if (margin[i] < 0) return run.time[i];
  return NaN;
}

function headIndex() {
  const { run, stop } = T.result;
  return Math.min(run.rows - 1, Math.max(0, Math.round(T.head / stop * (run.time.length - 1))));
}

/* What is shown ------------------------------------------------------------------------------------------------ */

function tubeView() {
  T.plots = {};
  const plot = (id, options) => (T.plots[id] = new Plot({ id, sync: "tube", ...options }));
  T.alert = make("div", { role: "alert" });
  T.side = make("div.side", {}, narrow(3, runPanel()), narrow(4, inputsPanel()), parameterPanel());
  T.stage = make("div.stage", {}, narrow(0, make("div.wide", {}, T.alert)));
  if (facts.isTube) {
    T.drawing = new Drawing();
    T.gauges = make("div#gauges", {});
    T.drawing.element.append(T.gauges);
    T.stage.append(narrow(1, T.drawing.element));
    T.curvePlot = new Plot({ id: "curve", title: "Pressure over stretch at the present voltage", height: 330 });
    T.stage.append(narrow(2, T.curvePlot.element));
  }
  for (const [id, title] of timePlots()) T.stage.append(narrow(5, plot(id, { title }).element));
  T.other = new Plot({ id: "other", title: "Any other signal", sync: "tube" });
  const signals = Object.fromEntries([...facts.tube.states, ...facts.tube.outputs].map((q) => [q.name, plainName(q.name)]));
  T.otherName = facts.isTube ? "tube_volume" : facts.tube.states[0]?.name ?? facts.tube.outputs[0].name;
  T.other.element.querySelector(".head").after(choice("Signal", signals, () => T.otherName, (name) => { T.otherName = name; drawTime(); }, "other-signal"));
  T.stage.append(T.other.element);
  return make("div#view-tube.view", { role: "tabpanel", "aria-labelledby": "tab-tube" }, T.side, T.stage);
}

function timePlots() {
  if (facts.isTube) return [["pressure", "Pressure, and where it would snap through"], ["voltage", "Voltage"], ["displacement", "Radial displacement"], ["field", "Electric field in the layers"]];
  return [...facts.tube.inputs, ...facts.tube.outputs].map((q) => [q.name, q.description || plainName(q.name)]);
}

function runPanel() {
  T.play = make("button#play.main", { type: "button", onclick: () => playing(!T.playing) }, "Pause");
  const restart = make("button#restart", { type: "button", onclick: () => { T.head = 0; state.tube.record = null; change("tube"); } }, "Restart");
  const back = make("button#step-back", { type: "button", onclick: stepBack }, "Step back");
  T.scrub = make("input#scrub", { type: "range", min: "0", max: "1000", step: "1", "aria-label": "Time shown" });
  T.scrub.addEventListener("input", () => { if (!live()) { playing(false); T.head = Number(T.scrub.value) / 1000 * T.result.stop; } });
  T.clock = make("output#clock", { "aria-label": "Time" });
  T.stop = field({ name: "stop", unit: "s", shown: "s", factor: 1, minimum: 0.1, maximum: 600, nominal: 5, type: "Real", description: "End of the run" },
    { label: "length of the run", get: () => state.tube.stop, set: (v) => change("tube", (s) => { s.tube.stop = v; }) });
  return make("div.panel", {}, make("h2", {}, "Run"), make("div.row", {}, T.play, restart, back, T.clock), T.scrub, T.stop);
}

function playing(on) {
  T.playing = on;
  T.play.textContent = on ? "Pause" : "Play";
  T.last = 0;
}

function inputsPanel() {
  const panel = make("div.panel", {}, make("h2", {}, "Inputs"));
  for (const q of facts.tube.inputs) {
    const body = make("div"), spec = () => state.tube.inputs[q.name];
    const put = (name) => (v) => change("tube", (s) => { s.tube.inputs[q.name][name] = v; });
    const kinds = choice("Course", KINDS, () => spec().kind, (kind) => {
      change("tube", (s) => { s.tube.inputs[q.name].kind = kind; s.tube.record = null; T.head = 0; });
      fill();
    }, `kind-${q.name}`);
    const reach = q.name === "pressure" ? [0, 200] : q.name === "voltage" ? [0, 10] : [-2 * q.nominal / q.factor, 3 * q.nominal / q.factor];
    const most = bench.inputs.find((s) => s.name === q.name)?.most ?? null; // of what a bench can be thought to give
    const reversed = (v) => facts.isTube && q.name === "voltage" && v < 0 ? `expected 0${unitText(q)} or more; the tube answers to its square, as to ${amount(q, -v * q.factor)}` : "";
    const level = (name, label) => field({ ...q, minimum: most && -most, maximum: most }, { label, get: () => spec()[name], set: put(name), range: reach, remark: reversed });
    const second = (name, label) => field({ ...TIME, name, minimum: 0, maximum: 600, type: "Real" }, { label, get: () => spec()[name], set: put(name) });
    const part = (name, label) => field({ name, unit: "1", shown: "1", factor: 1, minimum: 0, maximum: 1, type: "Real" }, { label, get: () => spec()[name], set: put(name), range: [0, 1] });
    const rate = () => field({ ...RATE, name: "rate", minimum: 10 / 60, maximum: 5 }, { label: "beats", get: () => spec().rate, set: put("rate"), range: [40, 180] });
    const fill = () => {
      const kind = spec().kind, pulse = q.name !== "pressure";
      body.dataset.kind = kind;
      body.replaceChildren(...{
        hand: () => [level("level", "level")],
        step: () => [level("low", "before"), level("high", "after"), second("at", "at"), second("until", "until")],
        ramp: () => [level("low", "low"), level("high", "high"), second("from", "from"), second("to", "to")],
        beat: () => [level("low", pulse ? "low" : "diastolic"), level("high", pulse ? "high" : "systolic"), rate(), ...(pulse ? [part("on", "on, of the beat"), part("off", "off, of the beat")] : [])],
      }[kind]());
    };
    T.refills = [...(T.refills ?? []), () => { if (body.dataset.kind !== spec().kind) fill(); }];
    fill();
    panel.append(make("fieldset", {}, make("legend", {}, plainName(q.name)), kinds, body));
  }
  return panel;
}

function parameterPanel() {
  const list = facts.tube.parameters, group = (name, some) => make("details", { open: name === "Elastomer" || name === "Tunable" }, make("summary", {}, name), ...parameterFields("tube", some, baseOf("tube")));
  const tunable = list.filter((q) => q.tunable), fixed = list.filter((q) => !q.tunable);
  const all = make("button#reset-parameters", { type: "button", onclick: () => change("tube", (s) => { s.tube.set = {}; }) }, "Reset all");
  const panel = make("div.panel", {}, make("div.row", {}, make("h2", {}, "Parameters"), all));
  if (facts.settings.length) panel.append(settingChoice("tube"));
  panel.append(group(facts.isTube ? "Elastomer" : "Tunable", tunable), group(facts.isTube ? "Geometry and start" : "Fixed", fixed));
  const csv = make("button#all-csv", { type: "button", onclick: () => save("tube.csv", new Blob([allSignals()], { type: "text/csv" })) }, "CSV of all signals");
  panel.append(make("div.row", {}, csv));
  return panel;
}

/* Before and after: the parameter values that a closed loop found, and those it began with. */
function settingChoice(view) {
  const names = Object.fromEntries([["", "as in the model"], ...facts.settings.map((s) => [s.name, s.name])]);
  return choice("Values", names, () => state[view].setting, (name) => change(view, (s) => { s[view].setting = name; s[view].set = {}; }), `setting-${view}`);
}

function allSignals() {
  const { run } = T.result, names = [...facts.tube.inputs.map((q) => q.name), ...Object.keys(run.values).filter((n) => !inputFacts(n))];
  const rows = [["time [s]", ...names.map((n) => `${n} [${signalFacts(n).unit}]`)].join(",")];
  for (let i = 0; i < run.rows; i++) rows.push([run.time[i], ...names.map((n) => run.values[n][i])].join(","));
  return `${rows.join("\n")}\n`;
}

/* Drawing ------------------------------------------------------------------------------------------------------ */

const cut = (values) => T.result.run.rows < values.length ? values.subarray(0, T.result.run.rows) : values;

function drawTime() {
  if (!T.result) return;
  const { run } = T.result, x = { q: TIME, values: cut(run.time) };
  const s = (name, extra = {}) => ({ name: "", q: signalFacts(name), values: cut(run.values[name]), ...extra });
  if (!facts.isTube) {
    for (const q of [...facts.tube.inputs, ...facts.tube.outputs]) T.plots[q.name].lines(x, [s(q.name, { colour: inputFacts(q.name) ? "--c2" : "--c1" })]);
  } else {
    const limit = fieldLimit();
    T.plots.pressure.lines(x, [s("pressure", { name: "pressure", colour: "--c2" }), s("snap_through_pressure", { name: "snap-through", colour: "--c1", dash: [5, 4] })]);
    T.plots.voltage.lines(x, [s("voltage", { colour: "--c2" })]);
    T.plots.displacement.lines(x, [s("radial_displacement", { colour: "--c3" })]);
    T.plots.field.lines(x, [s("electric_field", { name: "field", colour: "--c4" }), { name: "limit", q: signalFacts("electric_field"), values: cut(run.time).map(() => limit), colour: "--c1", dash: [5, 4] }]);
  }
  T.other.lines(x, [s(T.otherName, { colour: "--c5" })]);
  for (const plot of Object.values(T.plots).concat(T.other)) {
    const series = plot.series[0];
    plot.describe(`From ${amount(series.q, smallest(series.values))} to ${amount(series.q, largest(series.values))} over ${show(T.result.stop)} s.`);
  }
}

const schedulerValue = (name) => facts.heart.parts.scheduler.parameters.find((p) => p.name === name).value;
const fieldLimit = () => schedulerValue("field_limit");
const marginLimit = () => schedulerValue("margin_limit");

/* The equilibrium curve at the present voltage, split where its slope turns; kept while nothing moves it. */
function curveNow(voltage) {
  const key = JSON.stringify([voltage, T.result.values]);
  if (T.curveKey === key) return T.curveNow;
  const { lower, upper } = facts.tube.curve, from = Math.max(lower, 0.98), to = Math.min(upper, 2.3), n = 320;
  const unknown = Float64Array.from({ length: n }, (_, i) => from + (to - from) * i / (n - 1));
  const found = engine.curve("tube", facts.tube, T.result.values, { voltage }, unknown);
  const part = (keep) => ({ x: unknown, y: found.load.map((p, i) => keep(found.slope[i]) || (i > 0 && keep(found.slope[i - 1])) ? p : NaN) });
  T.curveKey = key;
  T.curveNow = { stable: part((s) => s > 0), unstable: part((s) => s <= 0), fold: found.fold, highest: largest(found.load) };
  return T.curveNow;
}

function drawHead() {
  if (!T.result || !T.result.run.rows) return;
  const { run, values, stop } = T.result, i = headIndex(), v = (name) => run.values[name][i];
  T.clock.textContent = `${run.time[i].toFixed(2)} s of ${show(stop)} s`;
  if (document.activeElement !== T.scrub) T.scrub.value = String(Math.round(1000 * Math.min(1, T.head / stop)));
  for (const plot of [...Object.values(T.plots), T.other]) plot.at(live() ? NaN : run.time[i]);
  if (!facts.isTube) return;
  const limit = fieldLimit(), share = Math.abs(v("electric_field")) / limit;
  T.drawing.draw(values, { radius: v("radius"), wall: values.h_o / (v("lambda_1") * v("lambda_2")), field: share, layers: values.n_layers,
    words: `radius ${amount(signalFacts("radius"), v("radius"))}, wall ${show(1e3 * values.h_o / (v("lambda_1") * v("lambda_2")), 3)} mm` });
  T.drawing.note.textContent = `Section along the axis, ends clamped; dashed: at rest; the ${show(values.n_layers)} lines in the wall are its active layers, drawn stronger as the field approaches its limit.`;
  const c = curveNow(v("voltage")), from = Math.max(0, run.time.findIndex((t) => t >= run.time[i] - TRAIL));
  T.curvePlot.loops({ ...signalFacts("lambda_2"), title: "hoop stretch lambda_2" }, signalFacts("pressure"), [
    { name: "stable", colour: "--c3", ...c.stable },
    { name: "unstable", colour: "--c1", dash: [5, 4], ...c.unstable },
    { name: "fold", colour: "--c1", x: [c.fold.unknown], y: [c.fold.load], dot: 5 },
    { name: "last 2 s", colour: "--c5", width: 1.5, x: run.values.lambda_2.subarray(from, i + 1), y: run.values.pressure.subarray(from, i + 1) },
    { name: "now", colour: "--c2", x: [v("lambda_2")], y: [v("pressure")], dot: 6 },
  ], { x: [0.97, Math.max(2.0, Math.min(2.3, 1.05 * largest(run.values.lambda_2.subarray(0, run.rows))))], y: [0, 200 * inputFacts("pressure").factor / unitOf(inputFacts("pressure")).factor] });
  drawGauges(v, limit, c);
}

function drawGauges(v, limit) {
  const margin = v("snap_through_margin"), near = marginLimit(), fold = v("snap_through_pressure");
  const critical = criticalVoltage(v("pressure"));
  const gauge = (label, share, text, level) => ({ label, share, text, level });
  const voltage = Math.abs(v("voltage"));
  const rows = [
    gauge("Field", Math.abs(v("electric_field")) / limit, `${amount(signalFacts("electric_field"), Math.abs(v("electric_field")) < 1e-9 * limit ? 0 : v("electric_field"), 3)} of ${amount(signalFacts("electric_field"), limit, 3)}`, null),
    gauge("Pressure", v("pressure") / fold, margin < 0 ? "beyond the fold" : `${amount(signalFacts("pressure"), margin, 3)} to the fold`, margin < 0 ? "over" : margin < near ? "near" : "ok"),
    gauge("Voltage", critical > 0 ? voltage / critical : 1, critical > 0 ? `snaps at ${amount(inputFacts("voltage"), critical, 3)}` : "snaps without any", null),
  ];
  T.gaugeRows ??= rows.map((r) => {
    const bar = make("i"), out = make("output"), row = make("div.gauge", {}, make("span", {}, r.label), make("div.bar", { role: "meter", "aria-label": r.label, "aria-valuemin": "0", "aria-valuemax": "100" }, bar), out);
    T.gauges.append(row);
    return { row, bar, out };
  });
  rows.forEach((r, k) => {
    const { row, bar, out } = T.gaugeRows[k], share = Math.max(0, r.share);
    row.dataset.level = r.level ?? (share >= 1 ? "over" : share > 0.85 ? "near" : "ok");
    bar.style.width = `${Math.min(100, 100 * share).toFixed(1)}%`;
    bar.parentElement.setAttribute("aria-valuenow", String(Math.round(Math.min(100, 100 * share))));
    out.textContent = r.text;
  });
}

/* The voltage at which the fold comes down to `pressure`; 0 where it is below it without any voltage. */
function criticalVoltage(pressure, spare = 0) {
  const key = JSON.stringify([Math.round(pressure / 50), spare, T.result.values]);
  if (T.criticalKey === key) return T.critical;
  const fold = (voltage) => engine.curve("tube", facts.tube, T.result.values, { voltage }, []).fold.load;
  let low = 0, high = 20e3;
  if (fold(0) <= pressure + spare) high = 0;
  for (let i = 0; i < 18 && high > 0; i++) {
    const middle = (low + high) / 2;
    if (fold(middle) > pressure + spare) low = middle; else high = middle;
  }
  T.criticalKey = key;
  T.critical = high;
  return high;
}

/* Bursting, and back from it ---------------------------------------------------------------------------------- */

function tellProblem() {
  const beyond = Number.isFinite(T.crossed), text = beyond
    ? `At ${show(T.crossed)} s the pressure passes the snap-through fold: the tube runs away there.${T.problem ? ` ${T.problem}` : ""}`
    : T.problem;
  if (T.told === text) return;
  T.told = text;
  T.alert.replaceChildren();
  if (!text) return;
  const offer = !T.refused && (beyond || T.result?.run.status) ? make("button#undo-burst", { type: "button", onclick: stepBack }, live() ? "Step back" : "Step back to a safe voltage") : "";
  T.alert.append(make("p.alert", {}, text, " ", offer));
}

/* By hand: to before the tube ran away (or one second back). Else: to a voltage that leaves a margin. */
function stepBack() {
  if (live()) return rewind(Math.max(0.5, Math.min(Number.isFinite(T.crossed) ? T.crossed - 0.5 : Infinity, (state.tube.record?.time.at(-1) ?? 0.5) - 1)));
  if (!facts.isTube || !(Number.isFinite(T.crossed) || T.result?.run.status)) { T.head = Math.max(0, T.head - 1); return; }
  const pressure = largest(T.result.drive.inputs.pressure), safe = Math.floor(criticalVoltage(pressure, marginLimit()) / 50) * 50 / inputFacts("voltage").factor;
  const q = inputFacts("pressure"), highest = Math.floor((engine.curve("tube", facts.tube, T.result.values, { voltage: 0 }, []).fold.load - marginLimit()) / q.factor);
  change("tube", (s) => {
    const spec = s.tube.inputs.voltage;
    if (safe > 0) for (const name of ["level", "low", "high"]) spec[name] = Math.min(spec[name], safe);
    else for (const name of ["level", "low", "high"]) s.tube.inputs.pressure[name] = Math.min(s.tube.inputs.pressure[name], highest);
  });
}

function rewind(t) {
  const record = state.tube.record;
  if (!record) return;
  const n = Math.max(2, record.time.findIndex((x) => x > t) < 0 ? record.time.length : record.time.findIndex((x) => x > t));
  for (const name of Object.keys(record)) record[name] = record[name].slice(0, n);
  record.time[n - 1] = Math.min(record.time[n - 1], t);
  for (const name of Object.keys(state.tube.inputs)) if (state.tube.inputs[name].kind === "hand") state.tube.inputs[name].level = record[name][n - 1];
  T.head = record.time[n - 1];
  playing(false);
  change("tube");
}

/* Every frame -------------------------------------------------------------------------------------------------- */

function tubeFrame(now) {
  const passed = T.last ? Math.min(0.1, (now - T.last) / 1e3) : 0;
  T.last = now;
  if (T.playing && live()) {
    T.head += passed;
    if (T.head > LONGEST_RECORD) { playing(false); notice(`${LONGEST_RECORD} s are recorded, the longest that the page can keep. Restart to continue.`); }
    else { recordNow(T.head); T.stale = true; }
  } else if (T.playing && T.result) T.head = (T.head + passed) % T.result.stop;
  const draw = T.stale;
  if (draw) compute();
  if (draw && live() && T.playing && (Number.isFinite(T.crossed) || T.result?.run.status)) playing(false);
  if (draw) { drawTime(); tellProblem(); }
  drawHead();
}

function tubeChanged() {
  T.stale = true;
  T.refills.forEach((refill) => refill());
  T.stop.hidden = live();
  refreshAll(T.side);
}
