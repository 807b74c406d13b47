/* The view Data: recordings, the model driven by what was recorded, what is left, and effects that may explain it. */

const D = { experiments: [], refused: [], runs: null, before: null, plots: {}, version: 0, sent: -1 };

/* Parameter values in SI: by hand, and of the effects that are on. */
function dataValues() {
  const values = parameterValues("data", facts.all);
  Object.assign(values, facts.geometry);
  for (const effect of facts.effects) {
    if (!state.data.on.includes(effect.id)) continue;
    for (const name of effect.parameters) values[name] = state.data.set[name] !== undefined ? state.data.set[name] * declared("data", name).factor : effect.on[name] ?? effect.typical[name];
  }
  for (const [name, value] of Object.entries(state.data.set)) values[name] = value * declared("data", name).factor;
  return values;
}

/* Held inputs jump at their samples, the others run straight between them. */
function recordedDrive(e) {
  const held = bench.inputs.filter((s) => s.held).map((s) => s.name), time = [], inputs = Object.fromEntries(bench.inputs.map((s) => [s.name, []]));
  for (let i = 0; i < e.time.length; i++) {
    if (i > 0 && held.some((n) => e.inputs[n][i] !== e.inputs[n][i - 1])) {
      time.push(e.time[i]);
      for (const name in inputs) inputs[name].push(e.inputs[name][held.includes(name) ? i - 1 : i]);
    }
    time.push(e.time[i]);
    for (const name in inputs) inputs[name].push(e.inputs[name][i]);
  }
  return { time, inputs };
}

async function takeFiles(files) {
  for (const file of files) take(file.name, new Uint8Array(await file.arrayBuffer()));
  D.version++;
  change("data", (s) => { if (!D.experiments.some((e) => e.name === s.data.shown)) s.data.shown = D.experiments[0]?.name ?? ""; });
}

function take(name, raw) {
  D.experiments = D.experiments.filter((e) => e.file !== name);
  D.refused = D.refused.filter((r) => r.name !== name);
  try {
    const e = readExperiment(name, raw, facts.geometry);
    D.experiments.push({ ...e, drive: recordedDrive(e) });
  } catch (problem) {
    if (!(problem instanceof ReadError)) throw problem;
    D.refused.push({ name, reason: problem.message });
  }
}

function dataView() {
  D.latest = new Latest("data", (runs) => { D.runs = runs; drawData(); });
  for (const [name, text] of Object.entries(facts.recordings)) take(name, new TextEncoder().encode(text));
  for (const [id, title, height, wide] of [["overlay", "Record and model", 260, true], ["residual", "Residual: record less model", 200, true], ["over", "Residual over another quantity", 260], ["drive", "Recorded input", 260]])
    D.plots[id] = new Plot({ id, title, height, wide, sync: id === "over" ? null : "data" });
  const shown = { ...Object.fromEntries([...facts.all.states, ...facts.all.inputs, ...facts.all.outputs].map((q) => [q.name, plainName(q.name)])) };
  D.over = facts.isTube ? "lambda_2" : facts.all.states[0]?.name ?? facts.all.inputs[0].name;
  D.driveName = facts.all.inputs.at(-1).name;
  D.plots.over.element.querySelector(".head").after(choice("Over", shown, () => state.data.over || D.over, (name) => change("data", (s) => { s.data.over = name; }), "residual-over"));
  D.plots.drive.element.querySelector(".head").after(choice("Input", Object.fromEntries(facts.all.inputs.map((q) => [q.name, plainName(q.name)])), () => D.driveName, (name) => { D.driveName = name; drawData(); }, "drive-name"));
  D.stage = make("div.stage", {}, narrow(0, dropPanel()), ...["overlay", "residual", "over", "drive"].map((id, k) => narrow(k < 2 ? 1 : 5, D.plots[id].element)));
  D.side = make("div.side", {}, narrow(2, fitPanel()), narrow(3, effectsPanel()));
  if (!state.data.shown) state.data.shown = D.experiments[0]?.name ?? "";
  return make("div#view-data.view", { role: "tabpanel", "aria-labelledby": "tab-data" }, D.side, D.stage);
}

function dropPanel() {
  const input = make("input#files", { type: "file", multiple: true, accept: ".csv,.txt,.dat,.tsv,.asc,.prn,.lvm,.log,.tab" });
  input.addEventListener("change", () => { takeFiles(input.files); });
  const zone = make("div#drop.drop", {}, make("p", {}, make("label", { for: "files" }, "Drop recordings here, or choose files: "), input), make("p.note", {}, `One experiment a file, headed like ${bench.header}; they stay in this page.`));
  zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
  zone.addEventListener("dragleave", () => zone.classList.remove("over"));
  zone.addEventListener("drop", (event) => { event.preventDefault(); zone.classList.remove("over"); takeFiles(event.dataTransfer.files); });
  D.list = make("div.scroll", { tabindex: "0", role: "region", "aria-label": "Recordings" });
  D.problems = make("div", { role: "alert" });
  return make("div.panel.wide", {}, make("h2", {}, "Recordings"), zone, D.problems, D.list);
}

function fitPanel() {
  const effects = new Set(facts.effects.flatMap((e) => e.parameters)), own = facts.all.parameters.filter((q) => !effects.has(q.name));
  const reset = make("button#reset-data", { type: "button", onclick: () => change("data", (s) => { s.data.set = {}; s.data.on = []; }) }, "Reset all");
  const tunable = own.filter((q) => q.tunable), fixed = own.filter((q) => !q.tunable && q.name !== facts.all.curve?.switch);
  D.score = make("div", { role: "status" });
  return make("div.panel", {}, make("div.row", {}, make("h2", {}, "Fit by hand"), reset), D.score, ...(facts.settings.length ? [settingChoice("data")] : []),
    make("details", { open: true }, make("summary", {}, "Identified parameters"), ...parameterFields("data", tunable, baseOf("data"))),
    make("details", {}, make("summary", {}, "Geometry and start"), ...parameterFields("data", fixed, baseOf("data"))));
}

function effectsPanel() {
  const panel = make("div.panel", {}, make("h2", {}, "Effects"), make("p.note", {}, facts.effects.length ? "Switch one on and move its slider: what is left shows what it does." : "The plant declares no effects of its own."));
  for (const channel of new Set(facts.effects.map((e) => e.channel)))
    panel.append(make("details", { open: channel === facts.effects[0].channel }, make("summary", {}, channel), ...facts.effects.filter((e) => e.channel === channel).map(effectRow)));
  return panel;
}

function effectRow(effect) {
  const inModel = facts.tube.effects.includes(effect.id), body = make("div"), usual = (q) => ((inModel ? q.value : undefined) ?? effect.on[q.name] ?? effect.typical[q.name]) / q.factor;
  const fields = () => effect.parameters.filter((name) => inModel || !(name in effect.on)).map((name) => {
    const q = declared("data", name), at = usual(q);
    return parameterFields("data", [{ ...q, span: effectSpan(q, at) }], usual)[0];
  });
  const fill = () => {
    const on = inModel || state.data.on.includes(effect.id);
    if (on && !body.childNodes.length) body.append(...fields());
    if (!on) body.replaceChildren();
  };
  D.refills = [...(D.refills ?? []), fill];
  const box = inModel ? make("p", {}, `${plainName(effect.id)} (in the model)`) : check(plainName(effect.id), () => state.data.on.includes(effect.id), (on) => change("data", (s) => {
    s.data.on = on ? [...s.data.on, effect.id] : s.data.on.filter((id) => id !== effect.id);
    if (!on) for (const name of effect.parameters) delete s.data.set[name];
  }), { id: `effect-${effect.id}` });
  fill();
  return make("div.effect", {}, box, make("small", {}, effect.summary), body);
}

/* A slider from nearly nothing to ten times the usual size, or to as much the other way. */
function effectSpan(q, usual) {
  const size = Math.abs(usual) || q.nominal / q.factor, low = q.minimum === null ? -Infinity : q.minimum / q.factor, high = q.maximum === null ? Infinity : q.maximum / q.factor;
  return low < 0 ? [Math.max(low, -4 * size), Math.min(high, 4 * size)] : [Math.max(low, low > 0 ? size / 30 : 0), Math.min(high, (low > 0 ? 30 : 4) * size)];
}

function dataChanged() {
  D.refills?.forEach((fill) => fill());
  refreshAll(D.side);
  refreshAll(D.stage);
  D.problems.replaceChildren(...D.refused.map((r) => make("p.alert", {}, r.reason)));
  if (!D.experiments.length) { D.runs = null; drawData(); return; }
  if (D.sent !== D.version) D.before = null;
  D.sent = D.version;
  const experiments = D.experiments.map((e) => ({ time: e.time, drive: e.drive, start: e.start, own: ownStart(e) })), base = compared(), values = dataValues();
  D.same = JSON.stringify(base) === JSON.stringify(values);
  if (!D.before) new Latest("data", (runs) => { D.before = runs; drawData(); }, D.latest).ask({ values: base, experiments });
  D.latest.ask({ values, experiments });
}

/* Where a recording of the closed loop begins, as the fit found it, but for what was set by hand. */
function ownStart(e) {
  return Object.fromEntries(Object.entries(facts.own[e?.name] ?? {}).filter(([name]) => state.data.set[name] === undefined));
}

/* What the model is compared with: before the closed loop where the page comes from one, else as it opened. */
function compared() {
  const values = Object.fromEntries(facts.all.parameters.map((q) => [q.name, q.value ?? 0]));
  return { ...values, ...facts.settings[0]?.values, ...facts.geometry };
}

/* RMSE, fit in percent and residual of one run; over the samples that were recorded and reached. */
function score(e, run, output) {
  const y = e.outputs[output], model = run.values[output], left = y.map((v, i) => i < run.rows ? v - model[i] : NaN), seen = indicesOf(Array.from(left), Number.isFinite);
  const mean = seen.reduce((a, i) => a + y[i], 0) / seen.length, square = seen.reduce((a, i) => a + left[i] ** 2, 0);
  return { left, n: seen.length, square, rmse: Math.sqrt(square / seen.length), fit: 100 * (1 - Math.sqrt(square / seen.reduce((a, i) => a + (y[i] - mean) ** 2, 0))) };
}

/* A length in the unit that suits its size [m]; anything else as it is shown. */
function fineUnit(q, size) {
  if (q.unit !== "m") return q;
  const [shown, factor] = size < 1e-3 ? ["um", 1e-6] : size < 0.1 ? ["mm", 1e-3] : ["m", 1];
  return { ...q, shown, factor };
}

function drawData() {
  drawList();
  const k = Math.max(0, D.experiments.findIndex((e) => e.name === state.data.shown)), e = D.experiments[k], run = D.runs?.[k];
  if (!e || !run || run.time.length !== e.time.length) return;
  const output = Object.keys(e.outputs)[0], q = signalFacts(output, facts.all), fine = { ...D.unit, title: "left over" };
  const now = score(e, run, output), base = D.before?.[k]?.time.length === e.time.length ? score(e, D.before[k], output) : null, x = { q: TIME, values: e.time };
  const changed = base && !D.same;
  const cutAt = (values, r) => values.map((v, i) => i < r.rows ? v : NaN);
  D.plots.overlay.lines(x, [{ name: "record", q, values: e.outputs[output], colour: "--ink", width: 1.25 }, ...(changed ? [{ name: "model before", q, values: cutAt(D.before[k].values[output], D.before[k]), colour: "--c1", dash: [4, 3] }] : []), { name: "model", q, values: cutAt(run.values[output], run), colour: "--c2" }]);
  D.plots.residual.lines(x, [...(changed ? [{ name: "before", q: fine, values: base.left, colour: "--c1", width: 1 }] : []), { name: changed ? "now" : "left over", q: fine, values: now.left, colour: "--c2", width: 1.25 }]);
  const over = signalFacts(state.data.over || D.over, facts.all), along = run.values[over.name] ?? e.inputs[over.name];
  if (!along) return; // a run that was asked for before: the next one has this quantity, and is drawn then
  const cloud = (left) => { const at = indicesOf(Array.from(left), (v, i) => Number.isFinite(v) && Number.isFinite(along[i])); return { x: Float64Array.from(at, (i) => along[i]), y: Float64Array.from(at, (i) => left[i]) }; };
  D.plots.over.loops(over, fine, [...(changed ? [{ name: "before", colour: "--c1", dot: 1, ...cloud(base.left) }] : []), { name: changed ? "now" : "left over", colour: "--c2", dot: 1, ...cloud(now.left) }]);
  const input = facts.all.inputs.find((i) => i.name === D.driveName);
  D.plots.drive.lines(x, [{ name: "", q: input, values: e.inputs[input.name], colour: "--c3" }]);
  D.plots.overlay.describe(`${e.name}: RMSE ${amount(fine, now.rmse)}, fit ${show(now.fit, 4)} %.`);
}

function drawList() {
  if (!D.experiments.length) { D.list.replaceChildren(make("p.note", {}, "No recording yet.")); D.score.replaceChildren(); return; }
  let square = 0, n = 0;
  const scores = D.experiments.map((e, k) => D.runs?.[k]?.time.length === e.time.length ? score(e, D.runs[k], Object.keys(e.outputs)[0]) : null);
  const unit = D.unit = fineUnit(signalFacts(Object.keys(D.experiments[0].outputs)[0], facts.all), largest(scores.map((s) => s?.rmse ?? 0)));
  const rows = D.experiments.map((e, k) => {
    const run = D.runs?.[k], output = Object.keys(e.outputs)[0], s = scores[k];
    if (s) { square += s.square; n += s.n; }
    const pick = make("button", { type: "button", "aria-pressed": String(e.name === state.data.shown), onclick: () => change("data", (st) => { st.data.shown = e.name; }) }, e.name);
    const told = [`${e.time.length} samples`, Object.keys(ownStart(e)).length ? "starts where the fit found it" : e.start === "rested" ? "starts rested" : "starts loaded: taken at equilibrium", ...(facts.thinned[e.file] ? [`one sample of ${facts.thinned[e.file]}`] : []), ...(e.unused.length ? [`not used: ${e.unused.join(", ")}`] : []), ...e.remarks, ...(run?.reason ? [`the model ended at ${show(run.reached)} s: ${run.reason}`] : [])].join("; ");
    return make("tr", {}, make("th", { scope: "row" }, pick), make("td", {}, s ? amount(unit, s.rmse) : "-"), make("td", {}, s ? `${show(s.fit, 4)} %` : "-"), make("td", {}, amount(unit, noiseLevel(e.outputs[output].filter(Number.isFinite)), 3)), make("td.note", {}, told));
  });
  D.list.replaceChildren(make("table#recordings", {}, make("thead", {}, make("tr", {}, ...["experiment", "RMSE", "fit", "noise, about", "understood"].map((t) => make("th", { scope: "col" }, t)))), make("tbody", {}, ...rows)));
  const before = D.before && !D.same ? total(D.before) : null;
  D.score.replaceChildren(make("p", {}, n ? `All together: RMSE ${amount(unit, Math.sqrt(square / n))}${before ? `, before ${amount(unit, before)}. Files are compared as they were recorded; a report's errors are smaller, as each file's zeros and gains are fitted there` : ""}.` : "Computing ..."));
}

function total(runs) {
  const scores = D.experiments.map((e, k) => score(e, runs[k], Object.keys(e.outputs)[0]));
  return Math.sqrt(scores.reduce((a, s) => a + s.square, 0) / scores.reduce((a, s) => a + s.n, 0));
}

/* Take-away ---------------------------------------------------------------------------------------------------- */

function shownExperiment() {
  return D.experiments.find((e) => e.name === state.data.shown) ?? D.experiments[0];
}

function dataCommand() {
  const e = shownExperiment();
  if (!e) return ["tubular-dea lab", ...plantOption(), ...modelOption(), "--data DATA --out lab.html"].join(" ");
  const own = ownStart(e), atRest = e.start === "equilibrium" && facts.all.curve && !(facts.all.curve.switch in own) ? { [facts.all.curve.switch]: true } : {};
  const begins = Object.entries({ ...atRest, ...own }).map(([name, value]) => ` --set ${name}=${value}`).join("");
  return [`cat > model.json <<'END'\n${modelFile()}END`, `cat > inputs.csv <<'END'\n${tableOf(e.drive)}\nEND`,
    `tubular-dea simulate ${[...plantOption(), "--model model.json"].join(" ")} --inputs inputs.csv --interval ${Number(median(e.time.subarray(1).map((t, i) => t - e.time[i])).toPrecision(6))}${begins} --out run`].join("\n");
}

function dataPython() {
  const e = shownExperiment(), effects = [...facts.tube.effects, ...state.data.on], values = dataValues();
  const own = new Set(facts.effects.filter((f) => !effects.includes(f.id)).flatMap((f) => f.parameters));
  const added = new Set(facts.effects.filter((f) => state.data.on.includes(f.id)).flatMap((f) => f.parameters)); // else of usual size; what was identified is in no plant
  const changed = Object.fromEntries(facts.all.parameters.filter((q) => added.has(q.name) || (!own.has(q.name) && (facts.modelFile || values[q.name] !== (q.value ?? 0)))).map((q) => [q.name, values[q.name]]));
  Object.assign(changed, ownStart(e));
  if (e?.start === "equilibrium" && facts.all.curve) changed[facts.all.curve.switch] = 1;
  const plant = facts.plantFile ? `, ${JSON.stringify(facts.plantFile)}` : "", name = JSON.stringify(e?.name ?? "NAME");
  return [
    "import numpy as np", "import tubular_dea as td", "",
    `data = td.read_recordings(${JSON.stringify(facts.data || "FOLDER")}${plant})`,
    `experiment = data[${name}]`,
    `model = td.add_effects(data.plant, ${JSON.stringify(effects)})`,
    `run = td.simulate(model, data.protocol(${name}), times=experiment.time,`,
    `    parameters=${pythonDictionary(changed)})`,
    "for name, recorded in experiment.outputs.items():", "    left = recorded - run[name]",
    '    print(f"{name}: RMSE {1e6 * np.sqrt(np.nanmean(left**2)):.3f} um")', "",
  ].join("\n");
}
