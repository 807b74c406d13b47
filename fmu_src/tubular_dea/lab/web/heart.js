/* The view Heart: a patient, the tube in the aorta, and when it fires; without and with assist. */

const WANTED = ["heart.ventricular_volume", "heart.ventricular_pressure", "heart.aortic_pressure", "tube.radial_displacement",
  "tube.electric_field", "tube.snap_through_margin", "scheduler.voltage", "scheduler.veto", "scheduler.predicted_rr"];
const SHOWN_BEATS = 3;
const H = { result: null, asked: "", plots: {} };
const CAUSES = { 1: "the field", 2: "the margin to snap-through", 3: "field and margin" };

const TITLES = { snap_through_margin: "margin", radial_displacement: "displacement", electric_field: "field", aortic_pressure: "pressure" };
const partFacts = (name) => {
  const [part, variable] = name.split("."), p = facts.heart.parts[part];
  return { title: TITLES[variable], ...p.parameters.find((q) => q.name === variable) ?? p.outputs.find((q) => q.name === variable) };
};

/* The value of a parameter before it was changed by hand, in its customary unit. */
function heartBase(name) {
  const patient = facts.heart.patients[state.heart.patient], q = declared("heart", name), [part, variable] = name.split(".");
  return ((part === "heart" ? patient[variable] : undefined) ?? q.value ?? 0) / q.factor;
}

const heartValue = (name) => state.heart.set[name] ?? heartBase(name);

/* All start values in SI, as `tubular-dea assist` sets them. */
function heartValues() {
  const values = {};
  for (const [name, value] of Object.entries(facts.heart.patients[state.heart.patient])) if (name !== "heart_rate") values[`heart.${name}`] = value;
  for (const q of facts.heart.parts.tube.parameters) values[`tube.${q.name}`] = q.value ?? 0;
  values["tube.start_at_equilibrium"] = 1;
  values["scheduler.voltage_on"] = assistVoltage() * declared("heart", "scheduler.voltage_on").factor;
  for (const [name, value] of Object.entries(state.heart.set)) if (name !== "heart.heart_rate") values[name] = value * declared("heart", name).factor;
  return values;
}

const assistVoltage = () => state.heart.set["scheduler.voltage_on"] ?? 5.5; // as the command's default

/* R times [s] of an irregular rhythm; null where the heart keeps its own. */
function rTimes() {
  const { rhythm, beats } = state.heart, rr = 60 / heartValue("heart.heart_rate");
  if (rhythm === "regular") return null;
  if (rhythm === "recorded") return facts.heart.rTimes;
  let seed = 7;
  const chance = () => { seed = (seed * 16807) % 2147483647; return seed / 2147483647; };
  const intervals = Array.from({ length: beats + 3 }, (_, i) => ({
    premature: i === 7 ? 0.6 : i === 8 ? 1.4 : 1,
    bigeminy: i < 5 ? 1 : i % 2 ? 0.65 : 1.35,
    fibrillation: 0.7 + 0.6 * chance(),
    pause: i === 7 ? 2.2 : 1,
  }[rhythm] * rr));
  let t = 0;
  return [0, ...intervals.map((interval) => Number((t += interval).toFixed(4)))];
}

/* Pace and end of the run, as `tubular-dea assist` has them. */
function pacing() {
  const times = rTimes(), beats = times ? Math.min(state.heart.beats, times.length - 2) : state.heart.beats, rate = heartValue("heart.heart_rate") * RATE.factor;
  if (times) {
    const stop = times[beats] - times[0] + 0.05;
    return { pace: paceOf(times, stop), stop };
  }
  const stop = (beats + 0.05) / rate;
  return { pace: { time: [0, stop], value: [rate, rate] }, stop };
}

function heartView() {
  H.latest = new Latest("heart", (result, job) => { H.result = result; H.job = job; H.took = H.latest.took; drawHeart(); });
  const timing = { on: "scheduler.on_fraction", off: "scheduler.off_fraction" };
  H.ecg = new Ecg({
    get: () => ({ on: heartValue(timing.on), off: heartValue(timing.off), limits: Object.fromEntries(Object.entries(timing).map(([k, n]) => [k, [declared("heart", n).minimum, declared("heart", n).maximum]])) }),
    set: ({ on, off }) => change("heart", (s) => { s.heart.set[timing.on] = on; s.heart.set[timing.off] = off; }),
  });
  for (const [id, title, height] of [["loop", "Pressure and volume of the left ventricle", 330], ["beats", "Pressures of the last beats", 260], ["moves", "Displacement of the tube"], ["pulses", "Voltage"], ["strain", "Field, and its limit"], ["margin", "Margin to snap-through, and its limit"]])
    H.plots[id] = new Plot({ id, title, height: height ?? 180, sync: id === "loop" ? null : "heart" });
  H.words = make("div#heart-told", { role: "status" });
  H.table = make("div.scroll", { tabindex: "0", role: "region", "aria-label": "Indices over the assisted beats" });
  H.map = new BenefitMap();
  H.side = make("div.side", {}, narrow(3, patientPanel()), narrow(2, assistPanel()), narrow(4, rhythmPanel()));
  const p = (id) => H.plots[id].element;
  const told = make("section.panel", { "aria-label": "Indices" }, make("h2", {}, "Without and with assist"), H.words, H.table);
  H.stage = make("div.stage", {}, narrow(0, H.ecg.element), make("div.column", {}, narrow(1, p("loop")), narrow(6, H.map.element)), make("div.column", {}, narrow(5, told)),
    narrow(7, p("beats")), p("moves"), p("pulses"), p("strain"), p("margin"));
  return make("div#view-heart.view", { role: "tabpanel", "aria-labelledby": "tab-heart" }, H.side, H.stage);
}

function heartField(name, label, range = null) {
  const q = { ...declared("heart", name), key: name, label };
  if (range) q.span = range;
  return parameterFields("heart", [q], (d) => name === "scheduler.voltage_on" ? 5.5 : heartBase(d.key))[0];
}

function patientPanel() {
  const names = Object.fromEntries(Object.keys(facts.heart.patients).map((n) => [n, n]));
  const main = ["heart.heart_rate", "heart.E_max", "heart.R", "heart.C", "heart.filling_pressure"];
  const rest = facts.heart.parts.heart.parameters.map((q) => `heart.${q.name}`).filter((n) => !main.includes(n));
  return make("div.panel", {}, make("h2", {}, "Patient"),
    choice("Patient", names, () => state.heart.patient, (name) => change("heart", (s) => {
      s.heart.patient = name;
      for (const key of Object.keys(s.heart.set)) if (key.startsWith("heart.")) delete s.heart.set[key];
    }), "patient"),
    heartField(main[0], "heart rate", [40, 180]), heartField(main[1], "contractility (E_max)"), heartField(main[2], "resistance (R)"),
    heartField(main[3], "compliance (C)"), heartField(main[4], "filling pressure"),
    make("details", {}, make("summary", {}, "All of heart and arteries"), ...rest.map((n) => heartField(n, n.split(".")[1]))));
}

function assistPanel() {
  const main = ["voltage_on", "on_fraction", "off_fraction"], others = facts.heart.parts.scheduler.parameters.filter((q) => !main.includes(q.name)).map((q) => `scheduler.${q.name}`);
  const tube = facts.heart.parts.tube.parameters.filter((q) => q.name !== "start_at_equilibrium").map((q) => `tube.${q.name}`);
  const reset = make("button#reset-heart", { type: "button", onclick: () => change("heart", (s) => { s.heart.set = {}; }) }, "Reset all");
  return make("div.panel", {}, make("div.row", {}, make("h2", {}, "Assist"), reset), heartField("scheduler.voltage_on", "voltage", [0, 10]),
    heartField("scheduler.on_fraction", "on, of the beat", [-0.5, 1]), heartField("scheduler.off_fraction", "off, of the beat", [0, 1.5]),
    make("details", {}, make("summary", {}, "Limits, rules and amplifier"), ...others.map((n) => heartField(n, n.split(".")[1]))),
    make("details", {}, make("summary", {}, "The tube"), ...tube.map((n) => heartField(n, n.split(".")[1]))));
}

function rhythmPanel() {
  H.rhythms = Object.entries(RHYTHMS).map(([id, text]) => make(`button#rhythm-${id}`, { type: "button", onclick: () => change("heart", (s) => { s.heart.rhythm = id; }) }, text));
  const beats = field({ name: "beats", unit: "1", shown: "1", factor: 1, minimum: 5, maximum: 60, type: "Integer", nominal: 12, description: "Beats to run" },
    { label: "beats", get: () => state.heart.beats, set: (v) => change("heart", (s) => { s.heart.beats = v; }), range: [5, 40] });
  return make("div.panel", {}, make("h2", {}, "Rhythm"), make("div.row", { role: "group", "aria-label": "Rhythm" }, ...H.rhythms), beats);
}

function heartChanged() {
  const { pace, stop } = pacing(), values = heartValues(), asked = JSON.stringify([values, pace]);
  H.rhythms.forEach((button) => button.setAttribute("aria-pressed", String(button.id === `rhythm-${state.heart.rhythm}`)));
  refreshAll(H.side);
  H.ecg.place();
  H.map.changed();
  if (asked === H.asked) { drawHeart(); return; }
  H.asked = asked;
  H.latest.ask({ values, pace, stop, wanted: WANTED, asked });
}

/* Drawing ------------------------------------------------------------------------------------------------------ */

function drawHeart() {
  if (!H.result) return;
  const { without, with: assisted } = H.result;
  tellHeart(without, assisted);
  if (!assisted.rows || !without.rows) return;
  H.ecg.show(assisted);
  drawLoops(without, assisted);
  const n = Math.min(SHOWN_BEATS, assisted.beats.length - 1), from = assisted.beats[assisted.beats.length - 1 - n], start = assisted.time[from];
  const x = { q: TIME, values: assisted.time.subarray(from, assisted.rows).map((t) => t - start) };
  const s = (name, extra) => ({ name: "", q: partFacts(name), values: assisted.values[name].subarray(from, assisted.rows), ...extra });
  const base = (name, extra) => ({ name: "", q: partFacts(name), values: resampled(without.time, without.values[name], assisted.time.subarray(from, assisted.rows)), ...extra });
  const flat = (q, value) => ({ name: "limit", q, values: x.values.map(() => value), colour: "--c1", dash: [5, 4] });
  const grey = { colour: "--muted", width: 1.25 };
  H.plots.beats.lines(x, [base("heart.aortic_pressure", { name: "aorta, without", ...grey }), s("heart.aortic_pressure", { name: "aorta, with", colour: "--c1" }),
    base("heart.ventricular_pressure", { name: "ventricle, without", dash: [4, 3], ...grey }), s("heart.ventricular_pressure", { name: "ventricle, with", colour: "--c2" })]);
  H.plots.moves.lines(x, [base("tube.radial_displacement", { name: "without", ...grey }), s("tube.radial_displacement", { name: "with", colour: "--c3" })]);
  H.plots.pulses.lines(x, [s("scheduler.voltage", { colour: "--c2" })]);
  H.plots.strain.lines(x, [s("tube.electric_field", { name: "field", colour: "--c4" }), flat(partFacts("tube.electric_field"), heartValue("scheduler.field_limit") * partFacts("scheduler.field_limit").factor)]);
  H.plots.margin.lines(x, [s("tube.snap_through_margin", { name: "margin", colour: "--c3" }), flat(partFacts("tube.snap_through_margin"), heartValue("scheduler.margin_limit") * partFacts("scheduler.margin_limit").factor)]);
  H.map.draw();
}

/* Values at other times, straight between those there are. */
function resampled(time, values, wanted) {
  let k = 1;
  return wanted.map((t) => {
    while (k < time.length - 1 && time[k] < t) k++;
    const part = (t - time[k - 1]) / (time[k] - time[k - 1]);
    return part > 1 + 1e-9 ? NaN : values[k - 1] + part * (values[k] - values[k - 1]);
  });
}

function drawLoops(without, assisted) {
  const curves = [["without", without, "--muted", [4, 3]], ["with", assisted, "--c1", []]].filter(([, run]) => run.beats.length > 1).map(([name, run, colour, dash]) => {
    const [a, b] = run.beats.slice(-2);
    return { name: `${name} assist`, colour, dash, x: run.values["heart.ventricular_volume"].subarray(a, b + 1), y: run.values["heart.ventricular_pressure"].subarray(a, b + 1) };
  });
  H.plots.loop.loops({ ...partFacts("heart.ventricular_volume"), title: "volume" }, { ...partFacts("heart.ventricular_pressure"), title: "pressure" }, curves);
}

function tellHeart(without, assisted) {
  const reason = assisted.reason || without.reason, { course } = H.result;
  const words = reason ? `The run did not end: ${reason}.` : verdict(course);
  const took = Number.isFinite(H.took) ? `Computed in ${show(H.took, 2)} ms.` : "";
  if (words !== H.told) {
    H.told = words;
    H.words.replaceChildren(make(reason ? "p.alert" : course.counted.vetoes ? "p.alert.soft" : "p", {}, words));
  }
  H.table.replaceChildren(...(course ? [indices(course), make("p.note", {}, `${counts(course)} ${took}`)] : []));
}

/* What cosim/course.py says of the same run. */
function verdict(course) {
  const asked = course.fates.filter((f) => f !== "learning"), number = (fate) => asked.filter((f) => f === fate).length, helped = number("assisted");
  let why = facts.heart.fates.filter((f) => f !== "assisted" && number(f)).map((f) => `${number(f)} ${f}`).join(", ");
  if (course.counted.vetoes) why += ` (the scheduler refused the voltage ${course.counted.vetoes} times, last because of ${CAUSES[course.vetoCause] ?? "a limit"})`;
  if (!asked.length) return "Not assisted: the run ended before the rhythm was learned; run more beats.";
  if (!helped) return `Not assisted: none of ${asked.length} beats after learning had a whole pulse: ${why}.`;
  const name = "stroke_work_per_stroke_volume", a = course.without[name], b = course.with[name], rise = a && b ? 100 * (b.mean / a.mean - 1) : NaN;
  const effect = !a || !b ? "None of them ejected blood." : Math.abs(rise) < 0.05 ? "The heart did not benefit: stroke work per stroke volume did not change by 0.1 %." : rise >= 0 ? `The heart did not benefit: stroke work per stroke volume rose by ${rise.toFixed(1)} %.` : `Stroke work per stroke volume was ${(-rise).toFixed(1)} % lower than without.`;
  return helped === asked.length ? `Assisted: all ${helped} beats after learning. ${effect}` : `Partly assisted: ${helped} of ${asked.length} beats after learning; ${why}. ${effect}`;
}

function counts(course) {
  const c = course.counted, told = [["pulses", c.pulses], ["premature beats", c.premature_beats], ["skipped", c.skipped_pulses], ["withdrawn", c.withdrawn_pulses], ["vetoes", c.vetoes], ["times the rhythm was lost", c.dropouts]].filter(([, n]) => n);
  const settled = course.fates.filter((f) => f === "assisted").length - course.judged.length === facts.heart.settling;
  return `Means over ${course.judged.length} beats${settled ? `, from the ${facts.heart.settled} assisted on` : ""}. ${course.fates.length} whole beats: ${told.map(([what, n]) => `${n} ${what}`).join(", ") || "no pulse"}.`;
}

/* The figures over the assisted beats, in customary units or in SI. */
function indices(course) {
  const rows = facts.heart.figures.filter((f) => course.with[f.name] || course.without[f.name]).map((f) => {
    const scale = state.si ? 1 : 1 / f.factor, unit = state.si ? f.si : f.unit, a = course.without[f.name], b = course.with[f.name];
    const alike = a && b && a.mean * b.mean > 0 && Math.abs(b.mean / a.mean) > 0.1 && Math.abs(b.mean / a.mean) < 10;
    const change = !a || !b ? "" : alike ? `${signed(100 * (b.mean / a.mean - 1), 1)} %` : signed((b.mean - a.mean) * scale, 2);
    return [`${f.label}${unit === "1" ? "" : ` [${unit}]`}`, a ? show(a.mean * scale) : "-", b ? show(b.mean * scale) : "-", change];
  });
  const cell = (tag) => (text) => make(tag, tag === "th" ? { scope: "col" } : {}, text);
  return make("table#indices", {}, make("thead", {}, make("tr", {}, ...["mean over the beats", "without", "with", "change"].map(cell("th")))),
    make("tbody", {}, ...rows.map(([name, ...cells]) => make("tr", {}, make("th", { scope: "row" }, name), ...cells.map(cell("td"))))));
}

const signed = (value, digits) => `${value >= 0 ? "+" : ""}${value.toFixed(digits)}`.replace(/^[+-](0(\.0*)?)$/, "$1");

/* Take-away ---------------------------------------------------------------------------------------------------- */

function heartSettings() {
  return Object.entries(state.heart.set).filter(([name]) => name !== "scheduler.voltage_on" && !(name === "heart.heart_rate" && rTimes())).map(([name, value]) => {
    const q = declared("heart", name);
    return `--set ${shell(name, q.type === "Boolean" ? value > 0.5 : value, q.shown)}`;
  });
}

function heartCommand() {
  const times = rTimes(), voltage = partFacts("scheduler.voltage_on");
  const line = ["tubular-dea assist", `--patient ${quote(state.heart.patient)}`, `--voltage ${assistVoltage()}${voltage.shown}`, `--beats ${state.heart.beats}`, `--step ${facts.heart.step}`,
    ...modelOption(), ...(times ? ["--r-times r_times.txt"] : []), ...heartSettings(), "--out assisted"].join(" ");
  return times ? `cat > r_times.txt <<'END'\n${times.join("\n")}\nEND\n${line}` : line;
}

function heartPython() {
  const times = rTimes(), values = heartValues(), settings = Object.fromEntries(Object.entries(values).filter(([n]) => n.startsWith("scheduler.") || n === "tube.start_at_equilibrium" || state.heart.set[n] !== undefined));
  const patient = JSON.stringify(state.heart.patient), rate = heartValue("heart.heart_rate") * RATE.factor;
  if (!times && state.heart.set["heart.heart_rate"] !== undefined) settings["heart.heart_rate"] = rate;
  return [
    "import tubular_dea as td", "",
    `settings = ${pythonDictionary(settings)}`,
    `helped = td.assist(${patient}, beats=${state.heart.beats}, settings=settings, step=${facts.heart.step},`,
    `    tube=${facts.modelFile ? pythonModel() : "td.tube()"}${times ? `, r_times=[${times.join(", ")}]` : ""})`,
    'print("\\n".join(helped.lines()))', 'helped.plot().savefig("loops.png")', "",
  ].join("\n");
}
