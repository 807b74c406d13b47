/* The ECG with the pulses on it: the beginning and the end of the pulse can be dragged, or moved with the arrow keys. */

class Ecg {
  constructor({ get, set }) {
    Object.assign(this, { get, set, times: [], window: [0, 1], run: null });
    this.canvas = make("canvas", { role: "img", "aria-label": "ECG of the last beats, with voltage and vetoes" });
    this.handles = { on: this.handle("on", "Pulse begins"), off: this.handle("off", "Pulse ends") };
    this.box = make("div.ecg", {}, this.canvas, this.handles.on, this.handles.off);
    this.words = make("figcaption");
    this.element = make("figure#ecg.plot.panel.wide", {}, make("div.head", {}, make("h3", {}, "When the tube fires: drag the two handles on the ECG")), this.box,
      make("ul.key", {}, ...[["--ink", "ECG (drawn from the R waves)"], ["--c2", "voltage"], ["--c1", "veto"]].map(([colour, text]) => {
        const mark = make("i");
        mark.style.borderTopColor = `var(${colour})`;
        return make("li", {}, mark, text);
      })), this.words);
    new ResizeObserver(() => this.draw()).observe(this.box);
  }

  handle(which, label) {
    const element = make(`div#handle-${which}.handle`, { role: "slider", tabindex: "0", "aria-label": label, "aria-valuenow": "0" });
    element.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 0.005, ArrowUp: 0.005, ArrowLeft: -0.005, ArrowDown: -0.005, PageUp: 0.05, PageDown: -0.05 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.move(which, this.get()[which] + step);
    });
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      const go = (e) => {
        const box = this.box.getBoundingClientRect(), [a, b] = this.window;
        this.move(which, (a + (e.clientX - box.left) / box.width * (b - a) - this.beat.at) / this.beat.length);
      };
      const done = () => { element.removeEventListener("pointermove", go); element.removeEventListener("pointerup", done); };
      element.addEventListener("pointermove", go);
      element.addEventListener("pointerup", done);
    });
    return element;
  }

  move(which, value) {
    const { on, off, limits } = this.get(), [low, high] = limits[which];
    const tidy = Math.round(200 * Math.min(high, Math.max(low, value))) / 200;
    this.set(which === "on" ? { on: Math.min(tidy, off - 0.01), off } : { on, off: Math.max(tidy, on + 0.01) });
    this.place();
  }

  /* `run` is what the worker sent of the assisted run. */
  show(run) {
    this.run = run;
    const rows = run.beats, n = rows.length, first = rows[Math.max(0, n - 5)];
    this.times = rows.map((i) => run.time[i]);
    this.window = [run.time[first] - 0.15 * (run.time[rows[n - 1]] - run.time[first]) / 4, run.time[run.rows - 1]];
    const k = Math.max(0, n - 3);
    this.beat = { at: this.times[k], length: run.values["scheduler.predicted_rr"][rows[k]] || this.times[k + 1] - this.times[k] };
    this.draw();
  }

  place() {
    if (!this.beat) return;
    const { on, off, limits } = this.get(), [a, b] = this.window;
    for (const [which, part] of [["on", on], ["off", off]]) {
      const element = this.handles[which], t = this.beat.at + part * this.beat.length;
      element.style.left = `clamp(.8rem, ${100 * (t - a) / (b - a)}%, 100% - .8rem)`; // one beyond the beats drawn stays in reach
      element.setAttribute("aria-valuenow", String(part));
      element.setAttribute("aria-valuemin", String(limits[which][0]));
      element.setAttribute("aria-valuemax", String(limits[which][1]));
      element.setAttribute("aria-valuetext", `${show(1e3 * part * this.beat.length, 3)} ms after R, ${show(100 * part, 3)} % of the beat`);
    }
    this.words.textContent = `On ${show(1e3 * on * this.beat.length, 3)} ms and off ${show(1e3 * off * this.beat.length, 3)} ms after the R wave (${show(100 * on, 3)} and ${show(100 * off, 3)} % of the predicted beat); the valve or the next R may end it sooner.`;
  }

  draw() {
    this.place();
    if (!this.run || !this.box.clientWidth) return;
    const px = devicePixelRatio, w = this.box.clientWidth, h = this.canvas.clientHeight, ctx = this.canvas.getContext("2d");
    this.canvas.width = w * px;
    this.canvas.height = h * px;
    ctx.scale(px, px);
    const [a, b] = this.window, { time, values } = this.run, x = (t) => (t - a) / (b - a) * w;
    const from = Math.max(0, time.findIndex((t) => t >= a)), highest = Math.max(1, largest(values["scheduler.voltage"]));
    ctx.fillStyle = css("--c1");
    ctx.globalAlpha = 0.22;
    for (let i = from, begun = NaN; i < this.run.rows; i++) { // each stretch of refusal in one piece
      const refused = values["scheduler.veto"][i] > 0.5 && i + 1 < this.run.rows;
      if (refused && Number.isNaN(begun)) begun = time[i];
      if (refused || Number.isNaN(begun)) continue;
      ctx.fillRect(x(begun), 0, Math.max(1, x(time[i]) - x(begun)), h);
      begun = NaN;
    }
    ctx.fillStyle = css("--c2");
    ctx.globalAlpha = 0.35;
    ctx.beginPath();
    ctx.moveTo(x(time[from]), h);
    for (let i = from; i < this.run.rows; i++) ctx.lineTo(x(time[i]), h - 0.42 * h * values["scheduler.voltage"][i] / highest);
    ctx.lineTo(w, h);
    ctx.fill();
    ctx.globalAlpha = 1;
    ctx.strokeStyle = css("--ink");
    ctx.lineWidth = 1.4;
    ctx.beginPath();
    for (let k = 0; k <= w; k++) ctx.lineTo(k, h * (0.62 - 0.5 * this.lead(a + k / w * (b - a))));
    ctx.stroke();
  }

  /* A lead II as it might be: P, QRS and T as bells about the R waves. */
  lead(t) {
    let sum = 0;
    this.times.forEach((r, k) => {
      const rr = (this.times[k + 1] ?? 2 * r - (this.times[k - 1] ?? r - 0.8)) - r, late = 0.32 * Math.sqrt(rr);
      const bell = (at, width, height) => height * Math.exp(-0.5 * ((t - r - at) / width) ** 2);
      sum += bell(-0.17, 0.022, 0.12) + bell(-0.025, 0.008, -0.12) + bell(0, 0.01, 1) + bell(0.028, 0.01, -0.2) + bell(late, 0.045, 0.26);
    });
    return sum;
  }
}
