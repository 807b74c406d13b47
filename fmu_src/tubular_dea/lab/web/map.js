/* Benefit over onset and voltage: 20 x 20 runs in workers of their own, with progress, and the present point. */

const SIDE = 20;

class BenefitMap {
  constructor() {
    Object.assign(this, { cells: null, pool: [], going: false, cursor: null, asked: "" });
    this.canvas = make("canvas#benefit", { tabindex: "0", role: "application", "aria-label": "Map of benefit: arrow keys move, Enter adopts the setting" });
    this.start = make("button#map-start.main", { type: "button", onclick: () => this.going ? this.cancel() : this.run() }, "Compute the map");
    this.progress = make("progress#map-progress", { max: SIDE * SIDE, value: 0, "aria-label": "Progress of the map" });
    this.progress.hidden = true;
    this.reading = make("p.note", { role: "status" }, `${SIDE} x ${SIDE} runs over the pulse's onset and voltage; the pulse keeps its length; steps as long as an error of 1e-4 lets them be.`);
    const indices = Object.fromEntries(facts.heart.figures.filter((f) => !["electrical_energy", "mechanical_energy", "largest_field", "smallest_margin"].includes(f.name)).map((f) => [f.name, f.label]));
    this.index = choice("Index", indices, () => state.heart.index, (name) => change("heart", (s) => { s.heart.index = name; }), "map-index");
    const tool = (name, run) => make("button", { type: "button", id: `map-${name.toLowerCase()}`, "aria-label": `${name} of the map of benefit`, onclick: run }, name);
    this.element = make("figure#plot-map.plot.panel", {}, make("div.head", {}, make("h3", {}, "Benefit over onset and voltage"), make("div.tools", {}, tool("CSV", () => this.saveCsv()), tool("PNG", () => savePicture(this.canvas, `${this.label()}, change in %`, [], "map")))),
      make("div.row", {}, this.index, this.start), this.progress, make("div.map", {}, this.canvas), this.reading);
    new ResizeObserver(() => this.draw()).observe(this.element);
    this.canvas.addEventListener("click", (event) => {
      const at = this.cellAt(event);
      if (at) { this.cursor = at; this.adopt(); }
    });
    this.canvas.addEventListener("pointermove", (event) => { const at = this.cellAt(event); if (at) this.read(at); });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /* Onset (of the beat) and voltage (kV) of a cell. */
  setting([i, j]) {
    const on = declared("heart", "scheduler.on_fraction"), length = heartValue("scheduler.off_fraction") - heartValue("scheduler.on_fraction");
    const low = Math.max(on.minimum, -0.25), high = Math.min(on.maximum, 0.45);
    const onset = Math.round(1000 * (low + (high - low) * i / (SIDE - 1))) / 1000;
    return { onset, off: Math.round(1000 * Math.min(declared("heart", "scheduler.off_fraction").maximum, onset + length)) / 1000, voltage: Math.round(1000 * (2 + 5.5 * j / (SIDE - 1))) / 1000 };
  }

  /* What the map is of; another patient makes it stale. */
  key_() {
    const { set, patient, rhythm, beats } = state.heart, length = heartValue("scheduler.off_fraction") - heartValue("scheduler.on_fraction");
    const rest = Object.entries(set).filter(([n]) => !["scheduler.on_fraction", "scheduler.off_fraction", "scheduler.voltage_on"].includes(n));
    return JSON.stringify([rest, patient, rhythm, beats, length.toFixed(3)]);
  }

  changed() {
    this.index.refresh();
    if (this.cells && this.asked !== this.key_()) { this.cancel(); this.cells = null; this.reading.textContent = "The heart, the rhythm or the pulse's length has changed: compute the map again."; }
    this.draw();
  }

  async run() {
    const begun = performance.now(), { pace, stop } = pacing(), base = heartValues();
    this.asked = this.key_();
    this.cells = new Map();
    this.going = true;
    this.start.textContent = "Cancel";
    this.progress.hidden = false;
    this.progress.value = 0;
    const left = Array.from({ length: SIDE * SIDE }, (_, k) => [(k * 7) % SIDE, Math.floor(k / SIDE)]);
    const workers = Math.min(4, Math.max(1, navigator.hardwareConcurrency || 2));
    this.pool = Array.from({ length: workers }, () => new Helper());
    const factor = declared("heart", "scheduler.voltage_on").factor, redraw = eachFrame(() => this.draw());
    await Promise.all(this.pool.map(async (helper) => {
      while (left.length && this.going) {
        const at = left.shift(), { onset, off, voltage } = this.setting(at);
        const values = { ...base, "scheduler.on_fraction": onset, "scheduler.off_fraction": off, "scheduler.voltage_on": voltage * factor };
        try {
          const { result } = await helper.ask("cell", { at, values, pace, stop, variable: true });
          this.cells?.set(at.join(), result);
        } catch (problem) {
          notice(`The map failed: ${problem.message}`);
          this.going = false;
        }
        this.progress.value = this.cells?.size ?? 0;
        redraw();
      }
    }));
    this.finish();
    this.seconds = (performance.now() - begun) / 1e3;
    if (this.cells?.size === SIDE * SIDE) this.best(this.seconds);
  }

  cancel() {
    if (!this.going) return;
    this.finish();
    this.reading.textContent = "Cancelled: the map is incomplete.";
  }

  finish() {
    this.going = false;
    this.start.textContent = "Compute the map";
    this.progress.hidden = true;
    for (const helper of this.pool) helper.stop();
    this.pool = [];
    this.draw();
  }

  label() {
    return facts.heart.figures.find((f) => f.name === state.heart.index).label;
  }

  /* The change of the index against no assist, in percent; NaN where the run failed. */
  benefit(cell) {
    const { without, with: assisted } = cell ?? {}, name = state.heart.index;
    return without?.[name] && assisted?.[name] ? 100 * (assisted[name].mean / without[name].mean - 1) : NaN;
  }

  best(seconds) {
    let found = null;
    const worse = facts.heart.figures.find((f) => f.name === state.heart.index).worse, bad = (key) => worse * this.benefit(this.cells.get(key));
    for (const [key, cell] of this.cells) if (!cell.vetoes && Number.isFinite(this.benefit(cell)) && (!found || bad(key) < bad(found))) found = key;
    if (!found) { this.reading.textContent = "Every setting was vetoed."; return; }
    const { onset, voltage } = this.setting(found.split(",").map(Number));
    this.reading.textContent = `Computed in ${show(seconds, 3)} s. Best ${this.label()}: ${show(this.benefit(this.cells.get(found)), 3)} % with the pulse on at ${show(100 * onset, 3)} % of the beat and ${show(voltage, 3)} kV. Outlined: the present point; crossed: vetoed.`;
  }

  read(at) {
    const cell = this.cells?.get(at.join()), { onset, voltage } = this.setting(at);
    if (cell) this.reading.textContent = `On at ${show(100 * onset, 3)} % of the beat, ${show(voltage, 3)} kV: ${this.label()} ${show(this.benefit(cell), 3)} %${cell.vetoes ? `, ${cell.vetoes} vetoes` : ""}${cell.reason ? `, ${cell.reason}` : ""}.`;
  }

  key(event) {
    const step = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "Enter" && this.cursor) this.adopt();
    if (!step) return;
    event.preventDefault();
    const clip = (v) => Math.min(SIDE - 1, Math.max(0, v)), [i, j] = this.cursor ?? this.nearest();
    this.cursor = [clip(i + step[0]), clip(j + step[1])];
    this.read(this.cursor);
    this.draw();
  }

  nearest() {
    const on = heartValue("scheduler.on_fraction"), low = this.setting([0, 0]), high = this.setting([SIDE - 1, SIDE - 1]);
    const place = (v, a, b) => Math.min(SIDE - 1, Math.max(0, Math.round((v - a) / (b - a) * (SIDE - 1))));
    return [place(on, low.onset, high.onset), place(assistVoltage(), low.voltage, high.voltage)];
  }

  adopt() {
    const { onset, off, voltage } = this.setting(this.cursor);
    change("heart", (s) => Object.assign(s.heart.set, { "scheduler.on_fraction": onset, "scheduler.off_fraction": off, "scheduler.voltage_on": voltage }));
  }

  frame() {
    const w = this.canvas.clientWidth, h = this.canvas.height / devicePixelRatio;
    return { left: 56, top: 6, width: w - 56 - 62, height: h - 42, w, h };
  }

  cellAt(event) {
    const box = this.canvas.getBoundingClientRect(), f = this.frame();
    const i = Math.floor((event.clientX - box.left - f.left) / f.width * SIDE), j = SIDE - 1 - Math.floor((event.clientY - box.top - f.top) / f.height * SIDE);
    return i >= 0 && i < SIDE && j >= 0 && j < SIDE ? [i, j] : null;
  }

  draw() {
    const px = devicePixelRatio, w = this.canvas.clientWidth, h = Math.round(Math.min(300, Math.max(220, 0.6 * w)));
    if (!w) return;
    this.canvas.width = w * px;
    this.canvas.height = h * px;
    this.canvas.style.height = `${h}px`;
    const ctx = this.canvas.getContext("2d"), f = this.frame(), a = f.width / SIDE, b = f.height / SIDE;
    ctx.scale(px, px);
    const values = [...(this.cells?.values() ?? [])].map((c) => this.benefit(c)).filter(Number.isFinite);
    const reach = Math.max(0.1, ...values.map(Math.abs));
    const at = ([i, j]) => [f.left + i * a, f.top + (SIDE - 1 - j) * b];
    for (const [key, cell] of this.cells ?? []) {
      const [x, y] = at(key.split(",").map(Number)), value = this.benefit(cell);
      ctx.fillStyle = Number.isFinite(value) ? shade(value / reach) : css("--grid");
      ctx.fillRect(x, y, a + 0.5, b + 0.5);
      if (!cell.vetoes && !cell.reason) continue;
      ctx.strokeStyle = css("--ink");
      ctx.lineWidth = 0.7;
      ctx.beginPath();
      ctx.moveTo(x + 2, y + 2); ctx.lineTo(x + a - 2, y + b - 2); ctx.moveTo(x + a - 2, y + 2); ctx.lineTo(x + 2, y + b - 2);
      ctx.stroke();
    }
    this.axes(ctx, f, reach);
    const outline = (cell, colour, width) => { const [x, y] = at(cell); ctx.strokeStyle = css(colour); ctx.lineWidth = width; ctx.strokeRect(x - 1, y - 1, a + 2, b + 2); };
    outline(this.nearest(), "--ink", 2);
    if (this.cursor && document.activeElement === this.canvas) outline(this.cursor, "--accent", 2);
  }

  axes(ctx, f, reach) {
    ctx.strokeStyle = css("--line");
    ctx.strokeRect(f.left, f.top, f.width, f.height);
    ctx.fillStyle = css("--muted");
    ctx.font = "11px system-ui, sans-serif";
    const first = this.setting([0, 0]), last = this.setting([SIDE - 1, SIDE - 1]);
    for (const part of [0, 0.5, 1]) {
      ctx.textAlign = "center";
      ctx.fillText(show(100 * (first.onset + part * (last.onset - first.onset)), 3), f.left + part * f.width, f.top + f.height + 14);
      ctx.textAlign = "right";
      ctx.fillText(show(first.voltage + part * (last.voltage - first.voltage), 3), f.left - 6, f.top + f.height * (1 - part) + 4);
    }
    ctx.textAlign = "center";
    ctx.fillText("pulse begins [% of the beat after R]", f.left + f.width / 2, f.top + f.height + 30);
    ctx.save();
    ctx.translate(10, f.top + f.height / 2);
    ctx.rotate(-Math.PI / 2);
    ctx.fillText("voltage [kV]", 0, 0);
    ctx.restore();
    if (!this.cells?.size) return;
    for (let k = 0; k < 60; k++) { ctx.fillStyle = shade(1 - 2 * k / 59); ctx.fillRect(f.left + f.width + 12, f.top + k * f.height / 60, 10, f.height / 60 + 1); }
    ctx.fillStyle = css("--muted");
    ctx.textAlign = "left";
    for (const part of [-1, 0, 1]) ctx.fillText(`${show(part * reach, 2)} %`, f.left + f.width + 25, f.top + f.height * (1 - part) / 2 + 4);
  }

  saveCsv() {
    const names = facts.heart.figures.map((f) => f.name), rows = [`onset [1],off [1],voltage [V],vetoes [1],${facts.heart.figures.map((f) => `${f.name} [${f.si}]`).join(",")}`];
    for (const [key, cell] of this.cells ?? []) {
      const { onset, off, voltage } = this.setting(key.split(",").map(Number));
      rows.push([onset, off, voltage * declared("heart", "scheduler.voltage_on").factor, cell.vetoes, ...names.map((n) => cell.with?.[n]?.mean ?? "")].join(","));
    }
    save("map.csv", new Blob([`${rows.join("\n")}\n`], { type: "text/csv" }));
  }
}

/* Blue for less, red for more, the paper's colour for no change. */
function shade(part) {
  const paper = document.documentElement.dataset.theme === "dark" ? [26, 35, 43] : [245, 247, 249];
  const end = part < 0 ? [20, 108, 190] : [196, 54, 34], s = Math.min(1, Math.abs(part)) ** 0.8;
  return `rgb(${paper.map((c, k) => Math.round(c + s * (end[k] - c))).join(" ")})`;
}
