/* Plots: uPlot for axes, zoom and lines over x; curves that turn back (loops, trails) are drawn on top of its axes. */

const COLOURS = ["--c1", "--c2", "--c3", "--c4", "--c5"];
const plots = {};

/* How wide the numbers beside an axis are, and its label: in SI units 80 000 000 V/m. */
const roomFor = (u, texts) => Math.max(64, 22 + 7.5 * Math.max(0, ...(texts ?? []).map((t) => String(t).length)));

/* A figure with a title, a chart, a key and its take-aways. `options`: id, title, height, describe. */
class Plot {
  constructor({ id, title, height = 210, sync = null, caption = "", wide = false }) {
    Object.assign(this, { id, title, height, sync, series: [], x: null, curves: [], mine: null, ranges: {} });
    this.chart = make("div.chart", { role: "img", "aria-label": title });
    this.key = make("ul.key");
    this.caption = make("figcaption", {}, caption);
    const tool = (name, run) => make("button", { type: "button", id: `${id}-${name.toLowerCase()}`, "aria-label": `${name} of ${title}`, onclick: run }, name);
    this.element = make(`figure#plot-${id}.plot.panel${wide ? ".wide" : ""}`, {},
      make("div.head", {}, make("h3", {}, title), make("div.tools", {}, tool("CSV", () => this.saveCsv()), tool("PNG", () => this.savePng()))),
      this.chart, this.key, this.caption);
    plots[id] = this;
    new ResizeObserver(() => this.resize()).observe(this.chart);
  }

  /* Lines over a common, ascending x. `x`: {q, values}; `series`: [{name, q, values, colour, dash, width}]. */
  lines(x, series) {
    this.x = x;
    this.series = series;
    this.curves = [];
    const shape = JSON.stringify([state.si, x.q.name, series.map((s) => [s.name, s.colour, s.dash])]);
    const data = [scaled(x), ...series.map(scaled)];
    if (shape !== this.shape || !this.mine) this.build(shape, data);
    else this.mine.setData(data, !this.zoomed);
  }

  /* Curves that need not be functions of x, each {name, x, y, colour, dash, width, dot}; axes from `range`. */
  loops(x, y, curves, range = null) {
    this.x = { q: x, values: [] };
    this.series = [{ name: "", q: y, values: [] }];
    this.curves = curves;
    this.wanted = range ?? rangeOf(curves, unitOf(x).factor, unitOf(y).factor);
    const shape = JSON.stringify([state.si, x.name, y.name, "loops"]);
    const { x: [a, b] } = this.wanted;
    if (shape !== this.shape || !this.mine) this.build(shape, [[a, b], [null, null]]);
    else if (!this.zoomed) this.mine.setData([[a, b], [null, null]]);
    else this.mine.redraw();
    this.writeKey(curves);
  }

  build(shape, data) {
    this.mine?.destroy();
    this.shape = shape;
    this.zoomed = false;
    const free = this.curves.length > 0, first = this.series[0];
    const ink = () => css("--muted"), grid = { stroke: () => css("--grid"), width: 1 };
    const text = (q) => `${q.title ?? plainName(q.name)}${unitText(q) ? ` [${unitText(q).trim()}]` : ""}`;
    const fits = (label) => Math.max(9, Math.min(12, (this.height - 52) / (0.56 * label.length))); // px, beside the axis
    const axis = (q) => ({ stroke: ink, grid, ticks: grid, label: text(q), labelSize: 18, labelFont: `${fits(text(q))}px system-ui, sans-serif`, font: "11px system-ui, sans-serif" });
    const options = {
      width: Math.max(180, this.chart.clientWidth || 480), height: this.height, legend: { show: false },
      cursor: { drag: { x: true, y: free, setScale: true }, sync: this.sync ? { key: this.sync } : undefined, points: { size: 6 } },
      scales: { x: { time: false, range: free ? () => this.wanted.x : undefined }, y: { range: free ? () => this.wanted.y : (u, low, high) => roomy(low, high) } },
      axes: [{ ...axis(this.x.q), size: 34 }, { ...axis(first.q), size: roomFor }],
      series: [{}, ...this.series.map((s, i) => ({ label: s.name, stroke: () => css(s.colour ?? COLOURS[i % COLOURS.length]), width: s.width ?? 1.75, dash: s.dash, points: { show: false }, spanGaps: false }))],
      hooks: { draw: [(u) => this.drawCurves(u)], setCursor: [(u) => this.readOut(u)], setSelect: [() => { this.zoomed = true; }] },
    };
    if (free) { // a drag sets both scales; a double click goes back
      options.scales.x.range = (u, low, high) => this.zoomed ? [low, high] : this.wanted.x;
      options.scales.y.range = (u, low, high) => this.zoomed ? [low, high] : this.wanted.y;
    }
    this.mine = new uPlot(options, data, this.chart);
    this.mine.over.addEventListener("dblclick", () => { this.zoomed = false; this.mine.setData(this.mine.data); });
    this.head = make("div.head-line");
    this.head.hidden = true;
    this.mine.over.append(this.head);
    this.writeKey(free ? this.curves : this.series);
  }

  writeKey(list) {
    const names = list.filter((s) => s.name);
    const text = JSON.stringify(names.map((s) => [s.name, s.colour, s.dot]));
    if (text === this.keyText) return;
    this.keyText = text;
    this.readings = names.map(() => make("output", {}, ""));
    this.key.replaceChildren(...names.map((s, i) => {
      const mark = make(s.dot ? "i.dot" : s.dash?.length ? "i.dash" : "i");
      mark.style.color = `var(${s.colour ?? COLOURS[list.indexOf(s) % COLOURS.length]})`;
      return make("li", {}, mark, `${s.name} `, this.readings[i]);
    }));
  }

  readOut(u) {
    if (this.curves.length || !this.readings) return;
    const i = u.cursor.idx;
    this.series.filter((s) => s.name).forEach((s, k) => {
      this.readings[k].textContent = i === null || i === undefined ? "" : `${show(u.data[1 + this.series.indexOf(s)][i])}${unitText(s.q)}`;
    });
  }

  drawCurves(u) {
    if (!this.curves.length) return;
    const { ctx, bbox } = u, fx = unitOf(this.x.q).factor, fy = unitOf(this.series[0].q).factor, px = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const c of this.curves) {
      ctx.strokeStyle = ctx.fillStyle = css(c.colour);
      ctx.lineWidth = (c.width ?? 2) * px;
      ctx.setLineDash((c.dash ?? []).map((d) => d * px));
      const at = (i) => [u.valToPos(c.x[i] / fx, "x", true), u.valToPos(c.y[i] / fy, "y", true)];
      ctx.beginPath();
      for (let i = 0, pen = false; i < c.x.length; i++) {
        const [a, b] = at(i), drawn = pen;
        pen = Number.isFinite(b); // a gap lifts the pen
        if (c.dot === 1) ctx.rect(a - 0.75 * px, b - 0.75 * px, 1.5 * px, 1.5 * px); // a cloud of points
        else if (c.dot) { ctx.moveTo(a + c.dot * px, b); ctx.arc(a, b, c.dot * px, 0, 7); }
        else if (pen) ctx[drawn ? "lineTo" : "moveTo"](a, b);
      }
      if (c.dot) ctx.fill(); else ctx.stroke();
    }
    ctx.restore();
  }

  /* The line that shows the present time. */
  at(value) {
    if (!this.mine) return;
    this.head.hidden = !Number.isFinite(value);
    this.head.style.height = "100%";
    this.head.style.transform = `translateX(${this.mine.valToPos(value / unitOf(this.x.q).factor, "x")}px)`;
  }

  describe(text) {
    if (this.described === text) return;
    this.described = text;
    this.chart.setAttribute("aria-label", `${this.title}. ${text}`);
  }

  resize() {
    const width = this.chart.clientWidth;
    if (this.mine && width > 0 && width !== this.mine.width) this.mine.setSize({ width, height: this.height });
  }

  restyle() {
    this.keyText = "";
    this.writeKey(this.curves.length ? this.curves : this.series);
    this.mine?.redraw(false);
  }

  /* Everything in the plot as a table in SI units. */
  csv() {
    const head = (q, name) => `${name} [${q.unit}]`;
    if (!this.curves.length) {
      const columns = [this.x, ...this.series], rows = [columns.map((c) => head(c.q, c.name ?? c.q.name)).join(",")];
      for (let i = 0; i < this.x.values.length; i++) rows.push(columns.map((c) => c.values[i] ?? "").join(","));
      return `${rows.join("\n")}\n`;
    }
    const rows = [`curve,${head(this.x.q, this.x.q.name)},${head(this.series[0].q, this.series[0].q.name)}`];
    for (const c of this.curves) for (let i = 0; i < c.x.length; i++) rows.push(`${c.name},${c.x[i]},${c.y[i]}`);
    return `${rows.join("\n")}\n`;
  }

  saveCsv() {
    save(`${this.id}.csv`, new Blob([this.csv()], { type: "text/csv" }));
  }

  savePng() {
    savePicture(this.mine.root.querySelector("canvas"), this.title, this.curves.length ? this.curves : this.series, this.id);
  }
}

function scaled(s) {
  const { factor } = unitOf(s.q);
  return factor === 1 ? s.values : Float64Array.from(s.values, (v) => v / factor);
}

/* A range with some room; one that shows a constant as a line in the middle, not as noise. */
function roomy(low, high) {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const least = 1e-6 * Math.max(Math.abs(low), Math.abs(high)) || 1e-12, span = Math.max(high - low, least);
  return [low - 0.06 * span, high + 0.08 * span];
}

function rangeOf(curves, fx, fy) {
  const all = (axis) => curves.flatMap((c) => [smallest(c[axis]), largest(c[axis])]).filter(Number.isFinite);
  const within = (values, f) => values.length ? roomy(Math.min(...values) / f, Math.max(...values) / f) : [0, 1];
  return { x: within(all("x"), fx), y: within(all("y"), fy) };
}

function save(name, blob) {
  const anchor = make("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(anchor);
  anchor.click();
  anchor.remove();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10000);
}

/* A canvas with its title and key on the page's own paper. */
function savePicture(canvas, title, list, id) {
  const px = devicePixelRatio, out = document.createElement("canvas"), ctx = out.getContext("2d");
  out.width = canvas.width;
  out.height = canvas.height + 52 * px;
  ctx.fillStyle = css("--paper");
  ctx.fillRect(0, 0, out.width, out.height);
  ctx.drawImage(canvas, 0, 52 * px);
  ctx.fillStyle = css("--ink");
  ctx.font = `600 ${14 * px}px system-ui, sans-serif`;
  ctx.fillText(title, 10 * px, 20 * px);
  ctx.font = `${12 * px}px system-ui, sans-serif`;
  let at = 10 * px;
  list.filter((s) => s.name).forEach((s) => {
    ctx.fillStyle = css(s.colour ?? COLOURS[list.indexOf(s) % COLOURS.length]);
    ctx.fillRect(at, 36 * px, 16 * px, 3 * px);
    ctx.fillStyle = css("--ink");
    ctx.fillText(s.name, at + 21 * px, 41 * px);
    at += ctx.measureText(s.name).width + 40 * px;
  });
  out.toBlob((blob) => save(`${id}.png`, blob), "image/png");
}
