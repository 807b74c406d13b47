/* The tube to scale: a section along its axis, both ends clamped, with the wall, its layers and the field. */

const SVG = "http://www.w3.org/2000/svg";

function svg(tag, attributes, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

class Drawing {
  constructor() {
    this.svg = svg("svg", { viewBox: "-32 -27 64 54", role: "img", "aria-label": "The tube to scale", width: "100%", style: "max-height: 17rem; display: block" });
    this.lumen = svg("path", { fill: "var(--lumen)" });
    this.walls = [svg("path", { fill: "var(--wall)", stroke: "var(--muted)", "stroke-width": ".15" }), svg("path", { fill: "var(--wall)", stroke: "var(--muted)", "stroke-width": ".15" })];
    this.layers = [0, 1].map(() => Array.from({ length: 16 }, () => svg("path", { fill: "none", "stroke-width": ".12" })));
    this.rest = svg("path", { fill: "none", stroke: "var(--muted)", "stroke-dasharray": "1 .8", "stroke-width": ".2" });
    this.scale = svg("g", {});
    this.text = svg("text", { x: "-31", y: "-24", style: "font-size: 2.2px" });
    this.svg.append(this.lumen, ...this.walls, ...this.layers.flat(), this.rest, this.scale, this.text);
    this.note = make("figcaption");
    this.element = make("figure#drawing.plot.panel", {}, make("div.head", {}, make("h3", {}, "The tube, to scale")), this.svg, this.note);
  }

  /* `g`: geometry in m; `s`: radius, thickness of the wall, field over its limit (0 to 1), number of layers. */
  draw(g, s) {
    const L = g.l_o * 1e3, r = g.r_o * 1e3, R = Math.min(s.radius * 1e3, 26), h = s.wall * 1e3, h0 = g.h_o * 1e3;
    const f = (v) => v.toFixed(3);
    this.lumen.setAttribute("d", `M${-L} ${-r}L0 ${f(-R)}L${L} ${-r}L${L} ${r}L0 ${f(R)}L${-L} ${r}Z`);
    this.rest.setAttribute("d", `M${-L} ${-r}L${L} ${-r}M${-L} ${r}L${L} ${r}`);
    [-1, 1].forEach((side, k) => {
      const line = (part) => { // at the part 0 (inside) to 1 (outside) of the wall's thickness about its middle
        const ends = r + (part - 0.5) * h0, middle = R + (part - 0.5) * h;
        return `M${-L} ${f(side * ends)}L0 ${f(side * middle)}L${L} ${f(side * ends)}`;
      };
      const inner = line(0), outer = line(1).replace("M", "L").split("L").slice(1).reverse().join("L");
      this.walls[k].setAttribute("d", `${inner}L${outer}Z`);
      this.layers[k].forEach((path, i) => {
        const n = Math.min(16, s.layers);
        path.style.display = i < n ? "" : "none";
        path.setAttribute("d", line((i + 0.5) / n));
        path.setAttribute("stroke", "var(--layer)");
        path.setAttribute("stroke-opacity", f(Math.min(1, 0.12 + 0.88 * s.field)));
        path.setAttribute("stroke-width", f(0.05 + 0.13 * Math.min(1.4, s.field)));
      });
    });
    if (!this.scale.childNodes.length) {
      this.scale.append(svg("path", { d: "M-31 24.5h10M-31 23.8v1.4M-21 23.8v1.4", stroke: "var(--ink)", "stroke-width": ".25", fill: "none" }));
      const words = svg("text", { x: "-20", y: "25.2", style: "font-size: 2.2px" });
      words.append("10 mm");
      for (const x of [-L, L]) this.scale.append(svg("path", { d: `M${x} ${-r - 2}v4M${x} ${r - 2}v4`, stroke: "var(--ink)", "stroke-width": ".8" }));
      this.scale.append(words);
    }
    this.text.textContent = s.words;
  }
}
