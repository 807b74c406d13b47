/* What is seen, as a command and as Python that compute it again. */

const quote = (text) => /^[\w./:=+-]+$/.test(text) ? text : `"${text}"`;
const shell = (name, value, unit) => quote(`${name}=${value}${unit === "1" ? "" : unit}`);

/* Options that name the declaration: the plant's file, and the model that the page was made from. */
const plantOption = () => facts.plantFile ? [`--plant ${quote(facts.plantFile)}`] : [];
const modelOption = () => facts.modelFile ? [`--model ${quote(facts.modelFile)}`] : [];

function command() {
  if (state.view === "heart") return heartCommand();
  return state.view === "data" ? dataCommand() : tubeCommand();
}

/* The model that the page was made from, in Python. */
function pythonModel() {
  if (facts.modelFile) return `td.load(${JSON.stringify(facts.modelFile)}${facts.plantFile ? `, ${JSON.stringify(facts.plantFile)}` : ""})`;
  return facts.plantFile ? `td.load_plant(${JSON.stringify(facts.plantFile)})` : "td.tube()";
}

function python() {
  if (state.view === "heart") return heartPython();
  return state.view === "data" ? dataPython() : tubePython();
}

/* Tube --------------------------------------------------------------------------------------------------------- */

function inWords(name, spec, stop) {
  const { shown } = inputFacts(name), unit = shown === "1" ? "" : ` ${shown}`;
  if (spec.kind === "step") return `step ${spec.low} ${spec.high}${unit} at ${spec.at}${spec.until < stop ? ` until ${spec.until}` : ""}`;
  if (spec.kind === "ramp") return `ramp ${spec.low} ${spec.high}${unit} from ${spec.from} to ${spec.to}`;
  return null; // beats and what was done by hand go as a table
}

/* Options that set what differs from the model as it is in its file. */
function setOptions(view, model) {
  const values = parameterValues(view, model);
  return model.parameters.filter((q) => values[q.name] !== (q.value ?? 0)).map((q) =>
    `--set ${state[view].set[q.name] !== undefined && q.type !== "Boolean" ? shell(q.name, state[view].set[q.name], q.shown) : shell(q.name, q.type === "Boolean" ? Boolean(values[q.name]) : values[q.name], q.unit)}`);
}

/* Breakpoints as a file. `simulate` would keep a held input until the next row: where one moves on a straight line, the
   row at its end stands there twice, up to which all inputs are straight. */
function tableOf(drive) {
  const names = facts.tube.inputs.map((q) => q.name), held = facts.bench.inputs.filter((s) => s.held).map((s) => s.name);
  const straight = (i) => i > 0 && drive.time[i] > drive.time[i - 1] && drive.time[i] !== drive.time[i + 1] && held.some((name) => drive.inputs[name][i] !== drive.inputs[name][i - 1]);
  const head = ["time [s]", ...facts.tube.inputs.map((q) => `${q.name} [${q.unit}]`)].join(",");
  return [head, ...Array.from(drive.time, (t, i) => Array(straight(i) ? 2 : 1).fill([t, ...names.map((name) => drive.inputs[name][i])].join(","))).flat()].join("\n");
}

function tubeCommand() {
  const { stop, drive, run } = T.result, interval = stop / (run.time.length - 1);
  const texts = Object.entries(state.tube.inputs).map(([name, spec]) => [name, inWords(name, spec, stop)]);
  const options = [...plantOption(), ...modelOption(), ...setOptions("tube", facts.tube), `--interval ${interval}`, "--out run"];
  if (texts.every(([, text]) => text))
    return `tubular-dea simulate ${texts.map(([name, text]) => facts.isTube ? `--${name} "${text}"` : `--input "${name}=${text}"`).join(" ")} --stop ${stop} ${options.join(" ")}`;
  return `cat > inputs.csv <<'END'\n${tableOf(drive)}\nEND\ntubular-dea simulate --inputs inputs.csv ${options.join(" ")}`;
}

function pythonDictionary(values) {
  return `{${Object.entries(values).map(([name, value]) => `"${name}": ${value}`).join(", ")}}`;
}

function tubePython() {
  const { stop, drive, run } = T.result, values = parameterValues("tube");
  const changed = Object.fromEntries(facts.tube.parameters.filter((q) => values[q.name] !== (q.value ?? 0)).map((q) => [q.name, values[q.name]]));
  return [
    "import tubular_dea as td", "", `model = ${pythonModel()}`,
    `inputs = td.Protocol.of([${Array.from(drive.time).join(", ")}],`,
    ...facts.tube.inputs.map((q) => `    ${q.name}=[${Array.from(drive.inputs[q.name]).join(", ")}],`), ")",
    `run = td.simulate(model, inputs, interval=${stop / (run.time.length - 1)}, parameters=${pythonDictionary(changed)})`,
    ...(facts.isTube ? ['print(f"{1e3 * run[\'radial_displacement\'].max():.4f} mm at most")'] : ["print(run)"]),
    'run.plot().savefig("run.png")', "",
  ].join("\n");
}

/* How the FMU of what is seen is made from the saved model.json. */
const buildCommand = () => ["tubular-dea build", ...plantOption(), "--model model.json", "--out build"].join(" ");

/* model.json, as close-loop writes it. */
function modelFile() {
  const model = state.view === "data" ? facts.all ?? facts.tube : facts.tube, values = state.view === "data" ? dataValues() : parameterValues("tube");
  const effects = state.view === "data" ? [...facts.tube.effects, ...state.data.on.filter((id) => !facts.tube.effects.includes(id))] : model.effects;
  const own = new Set((facts.effects ?? []).filter((e) => !effects.includes(e.id)).flatMap((e) => e.parameters));
  const parameters = Object.fromEntries(model.parameters.filter((q) => !own.has(q.name)).map((q) => [q.name, { value: values[q.name], unit: q.unit, description: q.description }]));
  return `${JSON.stringify({ format: 1, model: model.name, plant: facts.plantFile, note: "from the page", effects, parameters }, null, 2)}\n`;
}

/* The clipboard where the browser lets us; else a text to copy by hand. */
async function copy(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    notice(`${what} is copied.`);
  } catch {
    const area = make("textarea", { rows: "5", cols: "60", readonly: "", "aria-label": what }, text);
    notice(`${what}: copy it from here.`);
    document.getElementById("notice").append(area);
    area.select();
  }
  window.lab.copied = text;
}
