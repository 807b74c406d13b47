/* The compiled models, called from JavaScript: arrays in, arrays out. Used by the page and by its worker. */
"use strict";

const NO_LIMIT = 2 ** 31 - 1; // of the steps in all: what C's long holds

const SOLVER_WORDS = {
  "-1": "there is no rest state to start at: the pressure is beyond the fold at this voltage; lower one of them, or do not start at equilibrium",
  2: "too many internal steps were needed",
  3: "no step size, however small, solves the equations",
  4: "the tube has burst: its stretch came to where the equations end",
};
const MASTER_DONE = 1, MASTER_WORDS = {
  2: "refused",
  3: "the coupling diverges",
  4: "the interface does not converge",
  5: "out of memory",
  6: "is not a finite number",
};

class Engine {
  static async load(bytes) {
    let memory = null; // the C library may ask for random bytes when it begins; for nothing else
    const random_get = (at, n) => { crypto.getRandomValues(new Uint8Array(memory.buffer, at, n)); return 0; };
    const { instance } = await WebAssembly.instantiate(bytes, { wasi_snapshot_preview1: { random_get } });
    memory = instance.exports.memory;
    instance.exports._initialize();
    return new Engine(instance.exports);
  }

  constructor(wasm) {
    this.wasm = wasm;
    this.held = [];
  }

  /* Memory for one call, given back by `release`. */
  place(bytes) {
    const at = this.wasm.malloc(Math.max(8, bytes));
    if (!at) throw new Error("out of memory");
    this.held.push(at);
    return at;
  }

  doubles(values) {
    const at = this.place(8 * values.length);
    new Float64Array(this.wasm.memory.buffer, at, values.length).set(values);
    return at;
  }

  integers(values) {
    const at = this.place(4 * values.length);
    new Int32Array(this.wasm.memory.buffer, at, values.length).set(values);
    return at;
  }

  floats(at, n) {
    return new Float64Array(this.wasm.memory.buffer, at, n).slice();
  }

  integer(at, i = 0) {
    return new Int32Array(this.wasm.memory.buffer, at, i + 1)[i];
  }

  release() {
    for (const at of this.held) this.wasm.free(at);
    this.held = [];
  }

  /* A trajectory by name, sampled at ascending `samples`; `facts` are those of the model `prefix`. */
  trajectory(prefix, facts, values, drive, samples, { tolerance = 1e-6, withFold = false, maxSteps = 200000 } = {}) {
    const parameters = facts.parameters.map((p) => values[p.name] ?? p.value ?? 0);
    const { times, places } = delayedSamples(facts, parameters, samples);
    const driven = delayedDrive(facts, parameters, drive);
    const nx = facts.states.length, ny = facts.outputs.length + 1, n = times.length;
    const x = this.place(8 * nx * n), y = this.place(8 * ny * n), counts = this.place(16), reached = this.place(8);
    try {
      const status = this.wasm[`${prefix}_kernel_trajectory`](
        this.doubles(parameters), driven.time.length, this.doubles(driven.time), this.doubles(driven.u), tolerance,
        maxSteps, NO_LIMIT, n, this.doubles(times), withFold ? 1 : 0, x, y, 0, 0, counts, reached);
      const end = this.floats(reached, 1)[0];
      return named(facts, samples, places, this.floats(x, nx * n), this.floats(y, ny * n), withFold, {
        status, reached: end, steps: this.integer(counts), reason: status ? SOLVER_WORDS[status] ?? `status ${status}` : "",
      });
    } finally {
      this.release();
    }
  }

  /* The equilibrium curve over `unknown` under inputs by name: load, slope, and the fold. */
  curve(prefix, facts, values, inputs, unknown) {
    const parameters = facts.parameters.map((p) => values[p.name] ?? p.value ?? 0);
    const u = facts.driven.map((name) => inputs[name] ?? inputs[facts.delays[name]?.of] ?? 0);
    const n = unknown.length, load = this.place(8 * n), slope = this.place(8 * n), fold = this.place(16);
    try {
      this.wasm[`${prefix}_kernel_curve`](this.doubles(u), this.doubles(parameters), n, this.doubles(unknown), load, slope, fold);
      const [place, top] = this.floats(fold, 2);
      return { load: this.floats(load, n), slope: this.floats(slope, n), fold: { unknown: place, load: top } };
    } finally {
      this.release();
    }
  }

  /* A run of the assisted heart from 0 to `stop`: signals by name over `time`. `values` by "part.parameter" in SI. */
  coupled(facts, values, pace, stop, step, variable = 0) {
    const set = [], numbers = [];
    for (const [name, value] of Object.entries(values)) {
      const [part, parameter] = name.split(".");
      const declared = facts.parts[part].parameters.find((p) => p.name === parameter);
      if (!declared) continue; // the paced heart has no rate of its own
      set.push(facts.order.indexOf(part), declared.reference, ["Real", "Integer", "Boolean"].indexOf(declared.type));
      numbers.push(value);
    }
    const width = 4 + facts.signals.length, capacity = Math.ceil(4 * stop / step) + 4000;
    const rows = this.place(8 * width * capacity), n = this.place(8), where = this.place(8);
    try {
      const status = this.wasm.coupled_run(numbers.length, this.integers(set), this.doubles(numbers),
        this.integers([pace.time.length]), this.doubles(pace.time), this.doubles(pace.value), stop, step, variable, rows, capacity, n, where);
      const count = this.integer(n), table = new Float64Array(this.wasm.memory.buffer, rows, width * count);
      const run = { time: column(table, 0, width, count), values: {}, rows: count, reason: "" };
      facts.signals.forEach((name, i) => { run.values[name] = column(table, 4 + i, width, count); });
      if (status !== MASTER_DONE) run.reason = this.coupledReason(facts, status, this.integer(where), run.time[count - 1] ?? 0);
      return run;
    } finally {
      this.release();
    }
  }

  coupledReason(facts, status, where, time) {
    if (status === 0) return `the run ended at ${time.toPrecision(4)} s: it needs more steps than there is room for`;
    if (status === 101) return "the initial values do not settle";
    const part = status >= 100 ? (status - 100) / 10 : where;
    if (status >= 100 || status === 2) {
      const at = this.wasm.coupled_said(part), bytes = new Uint8Array(this.wasm.memory.buffer, at, 2048);
      const said = new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
      return `${facts.order[part]} refused${status < 100 ? ` at ${time.toPrecision(4)} s` : ""}: ${said || "it gave no reason"}`;
    }
    return `the run ended at ${time.toPrecision(4)} s: ${facts.signals[where] ?? ""} ${MASTER_WORDS[status] ?? status}`;
  }
}

function column(table, place, width, n) {
  const values = new Float64Array(n);
  for (let i = 0; i < n; i++) values[i] = table[i * width + place];
  return values;
}

/* Delayed outputs are read earlier: `times` to sample at, and for each delayed output its places among them. */
function delayedSamples(facts, parameters, samples) {
  const by = [...new Set(Object.values(facts.delayed))];
  if (!by.length) return { times: samples, places: null };
  const value = (name) => parameters[facts.parameters.findIndex((p) => p.name === name)];
  const wanted = [samples, ...by.map((name) => Array.from(samples, (t) => Math.max(samples[0], t - value(name))))];
  const times = Float64Array.from(new Set(wanted.flatMap((list) => Array.from(list)))).sort();
  const at = new Map(Array.from(times, (t, i) => [t, i]));
  const places = { "": Array.from(samples, (t) => at.get(t)) };
  by.forEach((name, i) => { places[name] = wanted[i + 1].map((t) => at.get(t)); });
  return { times, places };
}

/* Rows of all driven inputs at breakpoints; a delayed input has the breakpoints of what it delays, later. */
function delayedDrive(facts, parameters, drive) {
  const delayed = Object.entries(facts.delays).map(([name, d]) => ({
    name, of: d.of, by: parameters[facts.parameters.findIndex((p) => p.name === d.by)],
  }));
  const plain = delayed.every((d) => !(d.by > 0));
  const time = plain ? drive.time : mergedTimes(drive.time, delayed.map((d) => d.by));
  const columns = facts.driven.map((name) => {
    const d = delayed.find((l) => l.name === name);
    const values = drive.inputs[d ? d.of : name];
    return plain ? values : sampled(drive.time, values, time, d ? d.by : 0);
  });
  const u = new Float64Array(time.length * columns.length);
  columns.forEach((values, k) => { for (let i = 0; i < time.length; i++) u[i * columns.length + k] = values[i]; });
  return { time, u };
}

const NEAR = 1e-9; // s, between breakpoints that are one

/* Breakpoints and their later selves, each of a jump twice, up to the end of the drive. Those nearer than NEAR to another
   fall on it, on one of the drive if there is one, as in protocol.py. */
function mergedTimes(time, delays) {
  const end = time[time.length - 1], own = new Set(time), marks = new Map();
  for (const delay of [0, ...delays])
    for (let i = 0; i < time.length; i++) {
      const t = time[i] + delay;
      if (t > end) break;
      const twice = (i > 0 && time[i - 1] === time[i]) || (i + 1 < time.length && time[i + 1] === time[i]);
      marks.set(t, Math.max(marks.get(t) ?? 1, twice ? 2 : 1));
    }
  const kept = [];
  for (const t of [...marks.keys()].sort((a, b) => a - b)) {
    const last = kept[kept.length - 1];
    if (!last || t - last.t > NEAR) { kept.push({ t, count: marks.get(t) }); continue; }
    last.count = Math.max(last.count, marks.get(t));
    if (own.has(t)) last.t = t;
  }
  return Float64Array.from(kept.flatMap(({ t, count }) => Array(count).fill(t)));
}

/* Values of a piecewise straight signal at `wanted` - delay; of two equal times the first is the left side. */
function sampled(time, values, wanted, delay) {
  const out = new Float64Array(wanted.length);
  for (let i = 0; i < wanted.length; i++) {
    const left = i + 1 < wanted.length && wanted[i + 1] === wanted[i];
    out[i] = valueAt(time, values, delay ? onBreakpoint(time, wanted[i] - delay) : wanted[i], left);
  }
  return out;
}

/* A time, or the breakpoint that it is nearer to than NEAR. */
function onBreakpoint(time, t) {
  let low = 0, high = time.length - 1; // the first breakpoint not before t
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < t) low = middle + 1; else high = middle;
  }
  const near = low > 0 && t - time[low - 1] < time[low] - t ? time[low - 1] : time[low];
  return Math.abs(near - t) < NEAR ? near : t;
}

function valueAt(time, values, t, left = false) {
  const n = time.length;
  if (t <= time[0] && (left || t < time[0])) return values[0];
  let low = 0, high = n; // the first breakpoint after t (or at it, on the left side)
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < t || (!left && time[middle] === t)) low = middle + 1; else high = middle;
  }
  if (low === 0) return values[0];
  if (low === n) return values[n - 1];
  const span = time[low] - time[low - 1];
  return span > 0 ? (values[low] - values[low - 1]) / span * (t - time[low - 1]) + values[low - 1] : values[low]; // as numpy.interp rounds
}

function named(facts, samples, places, x, y, withFold, run) {
  const nx = facts.states.length, ny = facts.outputs.length + 1, n = samples.length;
  run.time = samples;
  run.values = {};
  run.rows = n;
  const here = places ? places[""] : null;
  const fill = (table, width, k, rows) => {
    const out = new Float64Array(n);
    for (let i = 0; i < n; i++) out[i] = table[(rows ? rows[i] : i) * width + k];
    return out;
  };
  facts.states.forEach((q, k) => { run.values[q.name] = fill(x, nx, k, here); });
  facts.outputs.forEach((q, k) => {
    if (!withFold && facts.needFold.includes(q.name)) return;
    run.values[q.name] = fill(y, ny, k, places && facts.delayed[q.name] ? places[facts.delayed[q.name]] : here);
  });
  if (facts.curve && withFold) run.values[facts.curve.fold.name] = fill(y, ny, ny - 1, here);
  if (run.status) while (run.rows > 0 && samples[run.rows - 1] > run.reached) run.rows--;
  return run;
}
