/* A table as a recording of the plant, in SI units, or refused: as identify/columns.py, sampling.py, data.py and checks.py. */

const bench = facts.bench;
const ALSO_TIME = facts.vocabulary.alsoTime, TRIGGER = "trigger";

/* SI units by heading. */
function benchSignals() {
  const units = { time: "s" };
  for (const s of bench.inputs) units[s.name] = s.unit;
  for (const o of bench.outputs) for (const heading of Object.keys(o.columns)) units[heading] = o.unit;
  return { ...units, [TRIGGER]: "" };
}

/* One experiment from a file; a ReadError in the words of the command line, but for what can be done about columns. */
function readExperiment(path, raw, geometry = {}) {
  const table = readTable(path, raw, new Set(Object.keys(benchSignals()))), columns = assigned(table);
  if (table.lines.length < bench.leastSamples) throw new ReadError(`${path}: too few samples: ${table.lines.length} lines of numbers; expected at least ${bench.leastSamples}`);
  const taken = sampling(table, columns.time.values, Object.entries(columns).filter(([n]) => n !== "time").map(([, c]) => c.values));
  const pick = (values) => Float64Array.from(taken.kept, (i) => values[i]), lines = taken.kept.map((i) => table.lines[i]);
  const zero = columns.time.column.clock ? taken.time[0] : 0, time = taken.time.map((t) => t - zero), inputs = {}, outputs = {};
  checkTime(table, lines, time);
  for (const s of bench.inputs) inputs[s.name] = filled(path, time, pick(columns[s.name].values), s);
  for (const s of bench.inputs) refuse(path, [...wrongUnit(inputs[s.name], s.name, s, lines, columns[s.name].column.unit), ...standstill(inputs[s.name], s.name, lines, asWritten(s.unit, columns[s.name].column.unit), [largest], s).map((said) => `${said}; ${s.name} = 0 below [noise] in bench.toml says that it was commanded, and not measured`)]);
  const there = bench.outputs.map((o) => Object.keys(o.columns).find((name) => name in columns)).filter((h) => h && finite(columns[h].values).length), still = there.filter((h) => isConstant(finite(pick(columns[h].values)))), idle = [];
  for (const o of bench.outputs) {
    const heading = Object.keys(o.columns).find((name) => name in columns);
    if (!heading) continue;
    if (!o.required && (still.includes(heading) || !there.includes(heading))) {
      idle.push(`${heading} ${still.includes(heading) ? "stands still" : "has no number"} here, and is not used`);
      continue;
    }
    const recorded = pick(columns[heading].values), parameter = o.columns[heading];
    const rest = parameter ? geometry[parameter] ?? valueAtRest(parameter) : 0;
    refuse(path, outputFindings(recorded, o, lines, heading, rest, columns[heading].column.unit, still.includes(heading) && still.length < there.length));
    outputs[o.name] = recorded.map((v) => v - rest);
  }
  const told = bench.inputs.filter((s) => columns[s.name].column.name !== headingName(s.name)).map((s) => `${s.name} is read from ${columns[s.name].column.shown}, the only column in a unit of its kind`);
  for (const o of bench.outputs)
    for (const name of Object.keys(o.columns).filter((n) => columns[n] && columns[n].column.name !== headingName(n)))
      told.push(columns[name].times === 1 ? `${name} is read from ${columns[name].column.shown}, the only column ${isWorded(name, columns[name].column) ? "with that in its heading" : "in a unit of its kind"}` : `${name} is ${columns[name].times} times ${columns[name].column.shown}`);
  const unused = table.columns.filter((c) => !Object.values(columns).some((a) => a.column.number === c.number) && c.heading).map((c) => c.heading);
  return { name: path.replace(/\.[^.]*$/, ""), file: path, time, inputs, outputs, start: startOf(time, inputs, outputs), format: table.format, unused, remarks: [...table.remarks, ...told, ...taken.remarks, ...idle] };
}

function refuse(path, findings) {
  if (findings.length) throw new ReadError(`${path}, ${findings[0]}`);
}

/* Columns ------------------------------------------------------------------------------------------------------ */

function assigned(table) {
  const units = benchSignals(), columns = {};
  for (const name of Object.keys(units)) {
    const column = headed(table, name, units[name]);
    if (column) columns[name] = column;
  }
  for (const { name } of bench.inputs) {
    const column = columns[name] ?? onlyIn(table, units[name], columns);
    if (column) columns[name] = column;
  }
  const times = {};
  for (const o of bench.outputs) {
    const headings = Object.keys(o.columns);
    if (headings.some((name) => columns[name])) continue;
    const multiple = multipleIn(table, o), found = wordedIn(table, headings, units, columns) ?? multiple ?? bySize(table, o, columns);
    if (found) columns[found[0]] = found[1];
    if (found && found === multiple) times[found[0]] = found[2];
  }
  const missing = ["time", ...bench.inputs.map((s) => s.name)].filter((name) => !columns[name]);
  if (missing.length) throw new ReadError(whatIsMissing(table, columns, units, missing));
  for (const o of bench.outputs) {
    const headings = Object.keys(o.columns), there = headings.filter((name) => columns[name]);
    if (there.length > 1 || (o.required && !there.length)) {
      const only = there.length ? undefined : onlyIn(table, o.unit, columns);
      throw new ReadError(`${table.headingPlace}: expected one column ${wantedHeadings(o, units)} but found ${table.headings};${only ? noSize(only, o) : ""} write that heading where it belongs, and nowhere else`);
    }
  }
  return Object.fromEntries(Object.entries(columns).map(([name, column]) => [name, inSi(table, name, column, units[name], times[name] ?? 1)]));
}

function wantedHeadings(o, units) {
  return Object.keys(o.columns).map((n) => `'${n} [${units[n]}]'`).join(" or ");
}

/* Alternatives for a message, cut where they are many (recordings/table.py). */
function either(texts, most = words.few) {
  return [...texts.slice(0, most), ...(texts.length > most ? [`one of ${texts.length - most} more`] : [])].join(" or ");
}

/* All that a file lacks at once, and how it can be given. */
function whatIsMissing(table, columns, units, [name, ...others]) {
  const lacking = bench.outputs.filter((o) => o.required && !Object.keys(o.columns).some((h) => columns[h]));
  const also = [...others.map((n) => `'${n} [${units[n]}]'`), ...lacking.map((o) => wantedHeadings(o, units))];
  const alike = allIn(table, units[name], columns), said = [`column '${name} [${units[name]}]' is missing`, `found ${table.headings}`];
  const each = name === "time" ? "; where every signal has its own, take that of an output" : "";
  if (alike.length > 1) said.push(`it may be ${either(alike.map((c) => `${c.heading} (column ${c.number})`))}${each}`);
  if (name === "time") said.push("if there are no times, give [sampling] rate in bench.toml");
  else if (!alike.length) said.push(`if there was none, add a column '${name} [${units[name]}]' of zeros`);
  if (also.length) said.push(`missing too: ${also.join(" and ")}`);
  return `${table.headingPlace}: ${said.join("; ")}; if it has another heading, write '${name} [${units[name]}]' there`;
}

/* Why the only column that an output may be was not taken for it. */
function noSize(column, o) {
  const rest = Object.values(o.columns).find(Boolean);
  if (!rest) return "";
  const size = facts.tube.parameters.find((p) => p.name === rest), whole = convertedUnit([size.value], size.unit, column.unit)[0];
  const middle = median(finite(column.values)), { atRest, grown } = facts.vocabulary.sizes;
  const many = Object.entries(o.multiples).find(([, [, m]]) => atRest < middle / whole / m && middle / whole / m < grown);
  const share = many ? `, but may be a ${many[0]}: [${g(1 / many[1][1])} ${column.unit}] halves it` : "";
  return ` the middle reading of ${column.shown}, ${g(middle, 4)} ${column.unit}, is neither that of ${rest} (${g(whole)} ${column.unit}) nor of its change${share};`;
}

function headed(table, name, unit) {
  let found = table.columns.filter((c) => c.name === headingName(name));
  if (found.length > 1) { // as f and F
    const exact = found.filter((c) => c.heading.replace(/^["' ]+/, "").startsWith(name));
    if (exact.length) found = exact;
  }
  if (!found.length && name === "time") found = timesOf(table.columns);
  if (found.length > 1) { // as time t and temperature T
    const fitting = found.filter((c) => mayBeIn(c, unit));
    if (fitting.length) found = fitting;
  }
  if (found.length > 1) throw new ReadError(`${table.headingPlace}: column ${repr(name)} appears twice; expected it once: rename what is no ${name}`);
  return found[0];
}

function isWorded(name, column) {
  return headingName(name).split("_").every((word) => column.name.split("_").includes(word));
}

/* The heading of an output that is in that of one column alone, as radius in "Laser radius (mm)", and the column. */
function wordedIn(table, headings, units, columns) {
  const taken = new Set(Object.values(columns).map((c) => c.number)), fitting = [];
  for (const c of table.columns.filter((c) => !taken.has(c.number) && c.unit && !c.problem))
    for (const name of headings)
      if (isWorded(name, c) && isIn(c.unit, units[name])) fitting.push([name, c]);
  fitting.sort((a, b) => b[0].length - a[0].length);
  return new Set(fitting.map(([, c]) => c.number)).size === 1 ? fitting[0] : undefined;
}

function valueAtRest(parameter) {
  return facts.tube.parameters.find((p) => p.name === parameter).value;
}

/* The only column of a required output's kind, under the heading that its numbers say: with the value at rest or without. */
function bySize(table, o, columns) {
  const only = o.required ? onlyIn(table, o.unit, columns) : undefined, headings = Object.keys(o.columns);
  if (!only || headings.length === 1) return only && [headings[0], only];
  const kept = headings.filter((h) => o.columns[h]), without = headings.find((h) => !o.columns[h]);
  if (kept.length !== 1 || !without) return undefined;
  const middle = median(finite(convertedUnit(only.values, only.unit, o.unit))) / valueAtRest(o.columns[kept[0]]), { atRest, grown, changed } = facts.vocabulary.sizes;
  if (atRest < middle && middle < grown) return [kept[0], only];
  return Math.abs(middle) < changed ? [without, only] : undefined;
}

/* The column of what is a multiple of an output, as a diameter is of a radius: heading of the output, column, times. */
function multipleIn(table, o) {
  const there = [];
  for (const c of table.columns.filter((c) => c.unit && !c.problem))
    for (const [name, [heading, multiple]] of Object.entries(o.multiples))
      if (isWorded(name, c)) there.push([heading, c, 1 / multiple]);
  return there.length === 1 ? there[0] : undefined;
}

/* The columns left that are in a unit of an input's kind, whatever their headings; and the only one. */
function allIn(table, unit, columns) {
  const taken = new Set(Object.values(columns).map((c) => c.number));
  return table.columns.filter((c) => !taken.has(c.number) && c.unit && !c.problem && isIn(c.unit, unit));
}

function onlyIn(table, unit, columns) {
  const alike = allIn(table, unit, columns);
  return alike.length === 1 ? alike[0] : undefined;
}

function isIn(unit, expected) {
  try {
    convertedUnit([1], unit, expected);
  } catch {
    return false;
  }
  return true;
}

/* Whether a column has a unit of that kind, or none that is told. */
function mayBeIn(column, unit) {
  return !column.unit || isIn(column.unit, unit);
}

/* The column that must be the time: by another usual name, as the only one with it in its name, or a clock's. */
function timesOf(all) {
  const columns = all.filter((c) => c.clock || mayBeIn(c, "s"));
  const also = ALSO_TIME.map((word) => columns.filter((c) => c.name === word)).find((list) => list.length);
  if (also) return also;
  const named = columns.filter((c) => c.name.split("_").some((part) => part === "time" || part === "zeit")), clocks = columns.filter((c) => c.clock);
  return [named, clocks].find((list) => list.length === 1) ?? [];
}

/* Whether times are a spreadsheet's dates: days since 1900 (here of the years 2000 to 2100) that move by far less than one. */
function serialDays(values) {
  return values.every((v) => v > 36526 && v < 73051) && values[values.length - 1] - values[0] < 1;
}

function inSi(table, name, column, expected, times) {
  if (column.problem) throw new ReadError(`${table.path}, ${column.problem}`);
  if (name === TRIGGER) return { column, values: column.values };
  if (!column.unit) {
    const wanted = name === "time" && serialDays(column.values) ? "d" : expected;
    throw new ReadError(`${table.headingPlace}: column ${column.shown} names no unit; write it as '${name} [${wanted}]'`);
  }
  try {
    return { column, values: convertedUnit(column.values.map((v) => v * times), column.unit, expected), times };
  } catch (problem) {
    throw new ReadError(`${table.headingPlace}, column ${column.shown}: ${problem.message}`);
  }
}

/* Times -------------------------------------------------------------------------------------------------------- */

function sampling(table, time, values) {
  const refusal = (i, said) => new ReadError(`${table.path}, line ${table.lines[i]}, column 'time': ${said}`);
  const gone = time.findIndex((t) => !Number.isFinite(t)), remarks = [];
  if (gone >= 0) throw refusal(gone, "expected a number but found none");
  const rows = [time, ...values], same = (i) => i > 0 && rows.every((r) => r[i] === r[i - 1] || (Number.isNaN(r[i]) && Number.isNaN(r[i - 1])));
  const kept = indicesOf(Array.from(time), (_, i) => !same(i));
  if (kept.length < time.length) remarks.push(`${time.length - kept.length} duplicate rows left out`);
  let there = Float64Array.from(kept, (i) => time[i]);
  for (let i = 0; i + 1 < there.length; i++) {
    if (there[i + 1] >= there[i]) continue;
    const repeated = table.remarks.some((r) => r.includes("headings repeated"));
    const split = repeated ? "split the file where its headings are repeated" : "give each experiment a file of its own";
    const said = `expected ascending times but ${g(there[i + 1])} s follows ${g(there[i])} s; sort the lines, or ${split}`;
    throw refusal(kept[i + 1], said);
  }
  const even = evenTimes(there), equal = indicesOf(Array.from(there), (t, i) => i > 0 && t === there[i - 1]);
  if (even) {
    remarks.push(`rounded times, replaced by even ones: ${g(1 / (even[1] - even[0]))} Hz`);
    there = even;
  } else if (equal.length && there[there.length - 1] > there[0]) {
    remarks.push(`repeated times, spread evenly up to the next: ${some(equal.map((i) => `line ${table.lines[kept[i]]}`), 5)}`);
    there = spreadTimes(there);
  }
  return { time: there, kept, remarks };
}

/* The even times that a coarse clock has rounded; null where it is even as it is, or has gaps. */
function evenTimes(time) {
  const n = time.length, counts = new Map();
  for (let i = 0; i + 1 < n; i++) { const step = Math.round((time[i + 1] - time[i]) * 1e9) / 1e9; counts.set(step, (counts.get(step) ?? 0) + 1); }
  if (counts.size < 2 || 1 - Math.max(...counts.values()) / (n - 1) < words.uneven) return null;
  const tick = clockTick(time);
  const mean = (n - 1) / 2, middle = time.reduce((a, t) => a + t, 0) / n;
  let cross = 0, square = 0;
  for (let i = 0; i < n; i++) { cross += (i - mean) * (time[i] - middle); square += (i - mean) ** 2; }
  const slope = cross / square;
  for (const digits of [1, 2, 3, 4, 5, 12]) { // the roundest rate that explains the times
    const step = slope > 0 ? 1 / Number((1 / slope).toPrecision(digits)) : 0;
    if (step > 0 && span(time.map((t, i) => t - step * i)) <= words.rounded * tick) return time.map((_, i) => time[0] + step * i);
  }
  return null;
}

/* The decimal that the later half of the times is written to; 0 where they have more than nine. */
function clockTick(time) {
  const late = time.subarray(Math.floor(time.length / 2));
  for (let digits = 0; digits < 10; digits++) {
    const scale = 10 ** digits;
    if (largest(late.map((t) => Math.abs(t * scale - Math.round(t * scale)))) < words.whole) return 1 / scale;
  }
  return 0;
}

function spreadTimes(time) {
  const first = indicesOf(Array.from(time), (t, i) => i === 0 || t !== time[i - 1]), count = first.map((f, k) => (first[k + 1] ?? time.length) - f);
  const gaps = first.map((f, k) => k + 1 < first.length ? time[first[k + 1]] - time[f] : NaN), last = gaps.length - 1;
  gaps[last] = gaps[last - 1] / count[last - 1] * count[last];
  const out = new Float64Array(time.length);
  first.forEach((f, k) => { for (let i = 0; i < count[k]; i++) out[f + i] = time[f] + gaps[k] / count[k] * i; });
  return out;
}

function median(values) {
  const sorted = Float64Array.from(values).sort(), half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

function checkTime(table, lines, time) {
  const n = time.length, span = time[n - 1] - time[0], step = median(time.subarray(1).map((t, i) => t - time[i]));
  if (span >= bench.shortest && !(step > (bench.coarsest ?? Infinity))) return;
  const label = span < bench.shortest ? "s labelled ms" : "ms labelled s";
  throw new ReadError(`${table.path}, lines ${lines[0]} to ${lines[n - 1]}, column 'time': ${g(span)} s in steps of ${g(step)} s; expected at least ${g(bench.shortest)} s in steps of at most ${g(bench.coarsest ?? Infinity)} s: ${label}?`);
}

/* Signals ------------------------------------------------------------------------------------------------------ */

/* An input with its gaps closed. */
function filled(path, time, values, signal) {
  const there = indicesOf(Array.from(values), Number.isFinite), n = values.length;
  if (there.length < Math.max(2, Math.floor(n / 2))) throw new ReadError(`${path}, column ${repr(signal.name)}: expected numbers but more than half of the lines have none`);
  let k = 0;
  return values.map((v, i) => {
    if (Number.isFinite(v)) return v;
    while (k + 1 < there.length && there[k + 1] <= i) k++;
    const a = there[k], b = there[k + 1];
    if (i < a || signal.held || b === undefined) return values[a];
    return values[a] + (values[b] - values[a]) * (time[i] - time[a]) / (time[b] - time[a]);
  });
}

const span = (values) => largest(values) - smallest(values);
const steps = (values) => values.subarray(1).map((v, i) => Math.abs(v - values[i]));

function thirds(values) {
  return Float64Array.from({ length: Math.max(0, values.length - 3) }, (_, i) => values[i + 3] - 3 * values[i + 2] + 3 * values[i + 1] - values[i]);
}

/* White noise on a slow signal. */
function noiseLevel(values) {
  return values.length < 8 ? 0 : 1.4826 * median(thirds(values).map((v) => Math.abs(v) / Math.sqrt(20)));
}

function resolution(values) {
  const moved = steps(values).filter((s) => s > 0);
  return moved.length ? smallest(moved) : 0;
}

function farthest(values) {
  let at = 0;
  values.forEach((v, i) => { if (Math.abs(v) > Math.abs(values[at])) at = i; });
  return at;
}

/* The units that numbers under a label may have been in instead, those that make the most usual size first. */
function likelyUnits(size, signal, label) {
  const { usual, told, fromUsual } = words.labels, at = (unit) => convertedUnit(convertedUnit([size], signal.unit, label), unit, signal.unit)[0];
  const low = Math.max(signal.least, signal.usual / fromUsual), high = Math.min(signal.most ?? Infinity, signal.least ? Infinity : signal.usual * fromUsual);
  const possible = (usual[signal.unit] ?? []).filter((unit) => unit !== label && low <= at(unit) && at(unit) <= high);
  const units = possible.sort((a, b) => Math.abs(Math.log(at(a) / signal.usual)) - Math.abs(Math.log(at(b) / signal.usual))).slice(0, told);
  return units.length ? `${either(units)} labelled ${label}` : "another unit, or a divider or gain left out";
}

function wrongUnit(values, name, signal, lines, label) {
  const at = farthest(values), size = Math.abs(values[at]), wide = span(values), written = asWritten(signal.unit, label);
  let noise = noiseLevel(values);
  if (steps(values).filter((s) => s > 0).length >= words.standstill) noise = Math.max(noise, resolution(values));
  const what = `line ${lines[at]}, column ${repr(name)}: the largest value is ${written(values[at])}; expected`;
  if (size > (signal.most ?? Infinity)) {
    const least = values.reduce((a, b) => Math.min(a, b)), absolute = signal.unit === "Pa" && words.air[0] < least && least < words.air[1];
    if (!absolute) return [`${what} at most ${written(signal.most)}: ${likelyUnits(size, signal, label)}?`];
    return [`${what} at most ${written(signal.most)}: an absolute pressure, with the air's? If so, ${name}=COLUMN[1 ${label} from ${written(values[0]).split(" ")[0]}] in --columns is right`];
  }
  if (size > 0 && size < signal.least && wide > words.structure * noise && size > 0.02 * signal.least) return [`${what} at least ${written(signal.least)}: ${likelyUnits(size, signal, label)}?`];
  return [];
}

const finite = (values) => values.filter(Number.isFinite);

function isConstant(values) {
  const noise = noiseLevel(values), mean = values.reduce((a, b) => a + b, 0) / values.length;
  const deviation = Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / values.length);
  return span(values) === 0 || (span(values) <= 12 * noise && deviation <= 1.5 * noise);
}

/* The faults of an output, which `rests` where another one moves. */
function outputFindings(recorded, signal, lines, name, rest, label, rests) {
  const seen = indicesOf(Array.from(recorded), Number.isFinite), values = Float64Array.from(seen, (i) => recorded[i]), there = seen.map((i) => lines[i]);
  if (seen.length < bench.leastSamples) return [`column ${repr(name)}: too few samples: ${seen.length} numbers in ${recorded.length} rows; expected at least ${bench.leastSamples}${seen.length < recorded.length ? "; leave the experiment out" : ""}`];
  const found = wrongUnit(values, name, signal, there, label);
  const noise = noiseLevel(values);
  if (!rests && isConstant(values))
    found.push(`lines ${there[0]} to ${there[there.length - 1]}, column ${repr(name)}: a constant record (${g(values.reduce((a, v) => a + v, 0) / values.length)}${noise > 0 ? ` beside noise of ${g(noise, 3)}` : ""}) contains no information; expected one in which the output moves`);
  const written = asWritten(signal.unit, label);
  if (!rests) found.push(...standstill(values, name, there, written, [largest, smallest]), ...quietStop(values, name, there, written));
  const parameter = Object.values(signal.columns).find(Boolean);
  if (signal.rest !== null && parameter) found.push(...belowRest(values, name, there, rest, signal, parameter, label));
  return found;
}

/* Runs of equal values that a noisy sensor never gives, as [first, last]. */
function stillRuns(values) {
  const found = [];
  for (let begin = 0; begin < values.length;) {
    let end = begin;
    while (end + 1 < values.length && values[end + 1] === values[begin]) end++;
    if (end - begin + 1 >= words.standstill) found.push([begin, end]);
    begin = end + 1;
  }
  return found;
}

function isNoisy(values) {
  const step = steps(values), top = largest(values), low = smallest(values);
  const free = Array.from(step, (s, i) => s > 0 || (values[i + 1] !== low && values[i + 1] !== top));
  for (const [begin, end] of stillRuns(values)) free.fill(false, begin, end);
  const others = indicesOf(free, Boolean);
  if (others.filter((i) => step[i] > 0).length < words.lively * others.length) return false;
  const [noise, left] = [3, words.order].map((order) => differing(values, order));
  if (left < words.smooth * noise) return false; // a command
  return noise > Math.max(words.quiet * span(values), words.coarse * resolution(values));
}

/* The noise of which differences of that order speak, over samples that all differ; 0 where these are few. */
function differing(values, order) {
  let rest = Float64Array.from(values), binomial = 1;
  for (let k = 1; k <= order; k++) [rest, binomial] = [rest.subarray(1).map((v, i) => v - rest[i]), binomial * (order + k) / k];
  const moves = steps(values).map((s) => (s > 0 ? 1 : 0));
  const moving = indicesOf(Array.from(rest), (_, i) => moves.subarray(i, i + order).every(Boolean));
  return moving.length < words.standstill ? 0 : 1.4826 * median(moving.map((i) => Math.abs(rest[i]))) / Math.sqrt(binomial);
}

/* A value (SI) in the unit of a file, as words. */
const asWritten = (unit, label) => (value) => `${g(convertedUnit([value], unit, label)[0])} ${label}`;

const LEFT_OUT = "empty these cells or leave the experiment out";

function standstill(values, name, lines, written, stops, driven = null) {
  if (!isNoisy(values)) return [];
  const found = [];
  for (const extreme of stops.map((stop) => stop(values))) {
    const there = indicesOf(Array.from(values), (v) => v === extreme);
    if (there.length >= Math.max(words.standstill, words.saturated * values.length))
      found.push(`line ${lines[there[0]]}, column ${repr(name)}: the sensor is saturated: ${there.length} of ${values.length} samples read ${written(extreme)}; ${LEFT_OUT}`);
  }
  let steps = 0;
  for (let i = 1; i < values.length; i++) if (values[i] !== values[i - 1]) steps++;
  if (steps < 0.1 * values.length) return found; // a coarse monitor may well stand still
  for (const [begin, end] of stillRuns(values)) {
    const off = driven && (driven.held || begin === 0 || end === values.length - 1);
    if (values[begin] === 0 && off) continue;
    found.push(`lines ${lines[begin]} to ${lines[end]}, column ${repr(name)}: the sensor is frozen: ${end - begin + 1} equal values ${written(values[begin] + 0)}; ${LEFT_OUT}`);
  }
  return found;
}

/* A run at an extreme with far less noise than elsewhere. */
function quietStop(values, name, lines, written) {
  const found = [], overall = noiseLevel(values);
  if (overall <= words.coarse * resolution(values)) return found;
  for (const [side, which] of [[1, "largest"], [-1, "least"]]) {
    const turned = values.map((v) => side * v), extreme = largest(turned), runs = [];
    const noise = Math.max(overall, noiseLevel(values.filter((_, i) => turned[i] < extreme - words.away * span(values))));
    for (let begin = 0; begin < turned.length; begin++) {
      let end = begin;
      while (end < turned.length && turned[end] >= extreme - words.band * noise) end++;
      if (end - begin >= words.standstill) runs.push([begin, end]);
      begin = end;
    }
    const count = runs.reduce((n, [begin, end]) => n + end - begin, 0);
    if (!runs.length || count < words.saturated * values.length) continue;
    const quiet = median(runs.map(([begin, end]) => noiseLevel(values.subarray(begin, end)))), short = (v) => written(Number(v.toPrecision(3)));
    const elsewhere = noiseLevel(values.filter((_, i) => !runs.some(([begin, end]) => begin <= i && i < end)));
    if (quiet < words.quieter * elsewhere)
      found.push(`line ${lines[runs[0][0]]}, column ${repr(name)}: the sensor is saturated: ${count} of ${values.length} samples are at the ${which} reading, ${short(side * extreme)}, with noise of ${short(quiet)} where it is ${short(elsewhere)} elsewhere; ${LEFT_OUT}`);
  }
  return found;
}

function belowRest(values, name, lines, rest, signal, parameter, label) {
  const q = facts.tube.parameters.find((p) => p.name === parameter), smooth = Array.from({ length: values.length - 8 }, (_, i) => values.subarray(i, i + 9).reduce((a, v) => a + v / 9, 0));
  const lowest = smooth.indexOf(smallest(smooth));
  if (smooth[lowest] >= rest - 0.05 * q.value) return [];
  const wanted = Object.entries(signal.columns).slice(0, 2).map(([heading, p]) => `a ${repr(heading)} that starts at ${p ? q.name : 0}`).join(" or ");
  const [low, high, zero] = convertedUnit([smooth[lowest], largest(smooth), rest], q.unit, label), change = Object.keys(signal.columns).find((h) => !signal.columns[h]) ?? Object.keys(signal.columns)[0];
  const from = zero - high >= high - low ? " from READING_AT_REST" : zero ? ` from ${g(zero)}` : "";
  const turned = zero - low > high - zero ? `; if it counts the other way, write ${change} = "COLUMN [-1 ${label}${from}]" below [columns] there` : "";
  return [`line ${lines[lowest + 4]}, column ${repr(name)}: ${g(low, 4)} ${label} is below the ${name} at rest, ${g(zero)} ${label}; expected ${wanted}, or set ${q.name} in bench.toml${turned}`];
}

/* Rested, or moved already under load: then at equilibrium, as near as the page can tell (identify/start.py). */
function startOf(time, inputs, outputs) {
  const [name, values] = Object.entries(outputs)[0] ?? [], output = bench.outputs.find((o) => o.name === name);
  if (!facts.tube.curve || !output || output.rest === null || !bench.inputs.some((s) => beginsOff(time, inputs[s.name], s.zero))) return "rested";
  const seen = indicesOf(Array.from(values), Number.isFinite);
  return beginsOff(Float64Array.from(seen, (i) => time[i]), Float64Array.from(seen, (i) => values[i] - output.rest), output.zero) ? "equilibrium" : "rested";
}

/* Whether a signal is clearly not zero at its first sample, by the straight line through the first of them. */
function beginsOff(time, values, zero) {
  const n = words.first;
  if (time.length < n) return false;
  const t = Array.from(time.subarray(0, n), (v) => v - time[0]), y = Array.from(values.subarray(0, n)), sum = (list) => list.reduce((a, v) => a + v, 0);
  const middle = sum(t) / n, mean = sum(y) / n, square = sum(t.map((v) => (v - middle) ** 2));
  const slope = sum(t.map((v, i) => (v - middle) * (y[i] - mean))) / square, start = mean - slope * middle;
  const variance = sum(y.map((v, i) => (v - start - slope * t[i]) ** 2)) / (n - 2), error = Math.sqrt(variance * (1 / n + middle ** 2 / square));
  const sorted = Float64Array.from(values, Math.abs).sort(), place = 0.99 * (sorted.length - 1), low = Math.floor(place);
  const high = sorted[low] + (sorted[Math.min(low + 1, sorted.length - 1)] - sorted[low]) * (place - low);
  return Math.abs(start) > Math.max(words.clearly * error, zero > 0 ? words.zeros * zero : words.faint * high);
}
