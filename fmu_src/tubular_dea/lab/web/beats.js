/* What a run means for heart and tube, as cosim/beats.py has it; and how a heart is paced, as cosim/heartbeats.py. */

function rWaveRows(run) {
  const phase = run.values["heart.phase"], rows = [];
  for (let i = 0; i < run.rows; i++) {
    const cycle = Math.floor(phase[i] + 1e-5);
    if (i === 0 || cycle > Math.floor(phase[i - 1] + 1e-5)) rows.push(i);
  }
  return rows;
}

/* The whole beats of a run, from R wave to R wave, both included. */
function wholeBeats(run) {
  const rows = rWaveRows(run);
  return rows.slice(0, -1).map((a, k) => {
    const b = rows[k + 1], values = {};
    for (const name in run.values) values[name] = run.values[name].subarray(a, b + 1);
    return { time: run.time.subarray(a, b + 1), values };
  });
}

/* Every index of cosim/beats.py by its name; one that a beat does not have is left out. */
function measureBeat(beat, told) {
  const { time, values: v } = beat, last = time.length - 1, period = time[last] - time[0];
  const volume = v["heart.ventricular_volume"], pressure = v["heart.aortic_pressure"], inside = v["heart.ventricular_pressure"];
  const out = ejection(time, v["heart.aortic_flow"], told.ejecting), valley = volume.indexOf(smallest(volume));
  const full = largest(volume.subarray(0, valley + 1)), stroke = full - volume[valley];
  const work = v["heart.ventricular_work"][last] - v["heart.ventricular_work"][0];
  const mean = integral(time, pressure, time[0], time[last]) / period;
  const figures = {
    stroke_volume: stroke, cardiac_output: stroke / period, ejection_fraction: stroke / full, stroke_work: work,
    cardiac_power_output: mean * stroke / period, end_diastolic_volume: full,
    end_diastolic_pressure: straight(time, pressure, out ? out[0] : time[0]),
    peak_aortic_pressure: largest(pressure.filter((_, i) => time[i] <= (out ? out[1] : time[last]))),
    mean_aortic_pressure: mean,
    electrical_energy: electrical(v), mechanical_energy: v["heart.tube_work"][0] - v["heart.tube_work"][last],
    largest_field: largest(v["tube.electric_field"]), smallest_margin: smallest(v["tube.snap_through_margin"]),
  };
  if (!out) return figures;
  const [opened, closed] = out, early = told.early * (time[last] - closed);
  const demanded = integral(time, inside, time[0], closed);
  const offered = integral(time, pressure.map((p, i) => p - inside[i]), closed, time[last]);
  return Object.assign(figures, {
    stroke_work_per_stroke_volume: work / stroke,
    pressure_volume_area: work + straight(time, v["heart.ventricular_energy"], closed),
    peak_diastolic_pressure: largest(pressure.filter((_, i) => time[i] >= closed)),
    early_diastolic_pressure: integral(time, pressure, closed, closed + early) / early,
    tension_time_index: demanded, diastolic_pressure_time_index: offered, subendocardial_viability_ratio: offered / demanded,
  });
}

/* When the aortic valve opened and closed; null where it never did. */
function ejection(time, flow, least) {
  const over = (i) => flow[i] - least > 0;
  let first = 0, last = flow.length - 1;
  while (first < flow.length && !over(first)) first++;
  while (last >= 0 && !over(last)) last--;
  if (last < 0 || last === flow.length - 1) return null;
  const crossing = (i) => time[i] + (time[i + 1] - time[i]) * (flow[i] - least) / (flow[i] - flow[i + 1]);
  return [first > 0 ? crossing(first - 1) : time[0], crossing(last)];
}

/* A value between rows. */
function straight(time, values, t) {
  let i = 1;
  while (i < time.length - 1 && time[i] < t) i++;
  return values[i - 1] + (values[i] - values[i - 1]) * (t - time[i - 1]) / (time[i] - time[i - 1]);
}

/* Of `values` over time between two times, straight between rows. */
function integral(time, values, from, to) {
  let sum = 0, t = from, value = straight(time, values, from);
  for (let i = 0; i < time.length && time[i] < to; i++) {
    if (!(time[i] > from)) continue;
    sum += (value + values[i]) / 2 * (time[i] - t);
    [t, value] = [time[i], values[i]];
  }
  return sum + (value + straight(time, values, to)) / 2 * (to - t);
}

/* What became of the assisted run beside the one without, as cosim/course.py has it. */
function follow(without, assisted, told) {
  const fates = fatesOf(assisted, told), judged = judgedOf(fates, told);
  const spreads = (run) => {
    const whole = wholeBeats(run);
    return spreadsOf(judged.filter((i) => i < whole.length).map((i) => measureBeat(whole[i], told)), told);
  };
  const end = (name) => assisted.values[`scheduler.${name}`][assisted.rows - 1];
  return {
    fates, judged, without: spreads(without), with: spreads(assisted), counted: Object.fromEntries(told.counts.map((n) => [n, end(n)])),
    vetoCause: end("veto_cause"), largestField: largest(assisted.values["tube.electric_field"]), smallestMargin: smallest(assisted.values["tube.snap_through_margin"]),
  };
}

function fatesOf(run, told) {
  const rows = rWaveRows(run), v = (name, i) => run.values[`scheduler.${name}`][i];
  return rows.slice(0, -1).map((a, k) => {
    const b = rows[k + 1], risen = (name) => v(name, b) > v(name, a);
    const during = (name) => { for (let i = a + 1; i <= b; i++) if (v(name, i) > 0.5) return true; return false; };
    const happened = { vetoed: during("veto"), assisted: risen("assisted_beats"), skipped: risen("skipped_pulses"),
                       "after a lost rhythm": during("lost"), learning: v("state", a + 1) === 0 };
    return told.fates.slice(0, -1).find((fate) => happened[fate]) ?? told.fates[told.fates.length - 1];
  });
}

function judgedOf(fates, told) {
  const places = (keep) => fates.flatMap((f, i) => keep(f) ? [i] : []), assisted = places((f) => f === "assisted");
  if (assisted.length) return assisted.length > told.settling ? assisted.slice(told.settling) : assisted;
  const learned = places((f) => f !== "learning");
  return learned.length ? learned : fates.map((_, i) => i);
}

function spreadsOf(measured, told) {
  const spreads = {};
  for (const { name, worse } of told.figures) {
    const values = measured.map((m) => m[name]).filter((value) => value !== undefined);
    if (!values.length) continue;
    const mean = values.reduce((a, b) => a + b, 0) / values.length;
    const deviation = Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / values.length);
    spreads[name] = { mean, sd: deviation, worst: worse > 0 ? largest(values) : smallest(values), beats: values.length };
  }
  return spreads;
}

function largest(values) {
  let best = -Infinity;
  for (const value of values) if (value > best) best = value;
  return best;
}

function smallest(values) {
  let best = Infinity;
  for (const value of values) if (value < best) best = value;
  return best;
}

function electrical(v) {
  const voltage = v["scheduler.voltage"], charge = v["tube.charge"];
  let sum = 0;
  for (let i = 0; i + 1 < voltage.length; i++) sum += (voltage[i + 1] + voltage[i]) / 2 * (charge[i + 1] - charge[i]);
  return sum;
}

/* The signal `pace` [Hz] that makes the ventricle beat at `times` [s]; the first R wave is at time 0. */
function paceOf(times, stop) {
  const n = times.length, time = [], value = [];
  const rates = times.map((t, i) => 1 / ((i + 1 < n ? times[i + 1] : 2 * t - times[i - 1]) - t));
  times.forEach((t, i) => {
    const begin = t - times[0];
    if (begin >= stop) return;
    if (time.length) { time.push(begin); value.push(rates[i - 1]); }
    time.push(begin);
    value.push(rates[i]);
  });
  time.push(stop);
  value.push(value[value.length - 1]);
  return { time, value };
}
