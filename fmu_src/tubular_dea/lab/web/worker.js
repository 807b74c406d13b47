/* Long work, off the page's own thread, one job after the other. */

let engine = null, facts = null, loading = null;
const waiting = [], passive = { key: "", run: null };

onmessage = ({ data }) => {
  if (data.start) {
    facts = data.start.facts;
    loading = Engine.load(data.start.bytes).then((loaded) => { engine = loaded; });
    return;
  }
  if (waiting.push(data) === 1) loading.then(() => setTimeout(work));
};

function work() {
  const job = waiting[0], { kind } = job;
  try {
    const begun = performance.now(), result = JOBS[kind](job);
    postMessage({ kind, number: job.number, result, took: performance.now() - begun });
  } catch (problem) {
    postMessage({ kind, number: job.number, problem: String(problem.message ?? problem) });
  }
  waiting.shift();
  if (waiting.length) setTimeout(work);
}

const JOBS = { heart: assist, cell, data: fitted };

/* Without and with assist; the run without is kept as long as the heart and the tube stay the same. */
function assist(job) {
  const without = withoutAssist(job), run = coupled(job, job.values);
  return { without: shownRun(without, job.wanted), with: shownRun(run, job.wanted), course: course(without, run) };
}

function withoutAssist(job) {
  const values = { ...job.values, "scheduler.voltage_on": 0 };
  const key = JSON.stringify([Object.entries(values).filter(([n]) => !n.startsWith("scheduler.")), job.pace, job.variable]);
  if (passive.key !== key) {
    Object.assign(passive, { key, run: coupled(job, values) });
  }
  return passive.run;
}

/* At fixed steps, or (for the map) at as long ones as the error lets be: as the command's --variable. */
function coupled(job, values) {
  const { step, longest, tolerance } = facts.heart;
  return job.variable ? engine.coupled(facts.heart, values, job.pace, job.stop, longest, tolerance) : engine.coupled(facts.heart, values, job.pace, job.stop, step);
}

/* Figures over the assisted beats; null where a run ended early. */
function course(without, run) {
  return without.reason || run.reason ? null : follow(without, run, facts.heart);
}

/* The signals that the page draws. */
function shownRun(run, wanted) {
  return { time: run.time, rows: run.rows, reason: run.reason, beats: rWaveRows(run),
           values: Object.fromEntries(wanted.map((name) => [name, run.values[name]])) };
}

/* One cell of the map: its figures alone. */
function cell(job) {
  const run = coupled(job, job.values), found = course(withoutAssist(job), run);
  return { at: job.at, without: found?.without, with: found?.with, vetoes: found?.counted.vetoes ?? 0, reason: run.reason };
}

/* Recorded drives through the model with all effects; what was loaded at its start begins at equilibrium, and what begins
   where no input tells, there. */
function fitted(job) {
  const { curve } = facts.all;
  return job.experiments.map((e) => {
    const values = { ...job.values, ...e.own, ...(e.start === "equilibrium" && curve ? { [curve.switch]: 1 } : {}) };
    return engine.trajectory("all", facts.all, values, e.drive, e.time, { maxSteps: 100000 });
  });
}
