/* The page: views, take-aways, and one loop that draws what is shown. */

const VIEWS = facts.isTube ? { tube: "Tube", heart: "Heart", data: "Data" } : { tube: "Model", data: "Data" };
const viewElements = {};

async function begin() {
  if (typeof WebAssembly !== "object" || typeof BigInt !== "function") {
    document.getElementById("main").append(make("p.alert", { role: "alert" }, "This browser has no WebAssembly, which this page computes with. Firefox, Chrome, Edge and Safari of the last years have it."));
    return;
  }
  const opened = fromLink(location.hash);
  state = opened.state;
  document.getElementById("title").textContent = pageTitle();
  document.getElementById("view-keys").textContent = Object.keys(VIEWS).map((_, i) => i + 1).join(", ");
  theme();
  engine = await Engine.load(bytes);
  header();
  listeners.push(changed);
  addEventListener("hashchange", () => {
    if (location.hash === link()) return;
    const found = fromLink(location.hash);
    if (found.problem) notice(found.problem);
    adopt(found.state);
  });
  shown(state.view);
  if (opened.problem) notice(opened.problem);
  requestAnimationFrame(frame);
}

/* The plant's name and the effects in its model. */
function pageTitle() {
  const effects = facts.tube.effects.map(plainName).join(", ");
  return `${facts.isTube ? "Tubular DEA" : facts.tube.name} lab${effects ? ` · with ${effects}` : ""}`;
}

/* The whole page in another state. */
function adopt(next) {
  state = next;
  T.head = 0;
  theme();
  shown(state.view);
  for (const view of Object.keys(viewElements)) change(view);
}

function header() {
  const tabs = document.getElementById("tabs");
  for (const [view, name] of Object.entries(VIEWS))
    tabs.append(make(`button#tab-${view}`, { type: "button", role: "tab", "aria-controls": `view-${view}`, onclick: () => { change("view", (s) => { s.view = view; }); } }, name));
  tabs.addEventListener("keydown", (event) => {
    const names = Object.keys(VIEWS), step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = names[(names.indexOf(state.view) + step + names.length) % names.length];
    change("view", (s) => { s.view = next; });
    document.getElementById(`tab-${next}`).focus();
  });
  const click = (id, run) => document.getElementById(id).addEventListener("click", run);
  click("copy-link", () => { history.replaceState(null, "", link()); copy(location.href, "The link"); });
  click("copy-command", () => copy(command(), "The command"));
  click("copy-python", () => copy(python(), "The Python text"));
  click("save-model", () => {
    save("model.json", new Blob([modelFile()], { type: "application/json" }));
    notice(`model.json is saved. Its FMUs: ${buildCommand()}`, { name: "Copy command", run: () => copy(buildCommand(), "The command") });
  });
  click("units", () => change("units", (s) => { s.si = !s.si; }));
  click("theme", () => change("theme", (s) => { s.theme = dark() ? "light" : "dark"; }));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => change("theme"));
  addEventListener("keydown", (event) => {
    const view = event.ctrlKey && event.altKey && Object.keys(VIEWS)[Number(event.key) - 1];
    if (view) change("view", (s) => { s.view = view; });
    if (event.key === " " && state.view === "tube" && !event.target.closest("button, input, select, summary, textarea, a")) {
      event.preventDefault();
      playing(!T.playing);
    }
  });
}

const dark = () => document.documentElement.dataset.theme === "dark";

function theme() {
  const wanted = state.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  document.documentElement.dataset.theme = wanted;
  document.documentElement.style.colorScheme = wanted;
  document.getElementById("theme").textContent = wanted === "dark" ? "Light" : "Dark";
  for (const plot of Object.values(plots)) plot.restyle();
}

/* A view is made when it is first shown. */
function shown(view) {
  const main = document.getElementById("main");
  if (!viewElements[view]) {
    viewElements[view] = { tube: tubeView, heart: heartView, data: dataView }[view]();
    main.append(viewElements[view]);
    change(view);
  }
  for (const [name, element] of Object.entries(viewElements)) element.hidden = name !== view;
  for (const name of Object.keys(VIEWS)) {
    const tab = document.getElementById(`tab-${name}`);
    tab.setAttribute("aria-selected", String(name === view));
    tab.tabIndex = name === view ? 0 : -1;
  }
}

const remember = (() => {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(() => { if (!(state.view === "tube" && live())) history.replaceState(null, "", link()); }, 400);
  };
})();

function changed(what) {
  if (what === "view") shown(state.view);
  if (what === "theme") { theme(); redrawAll(); }
  if (what === "units") {
    document.getElementById("units").setAttribute("aria-pressed", String(state.si));
    redrawAll();
  }
  if (what === "tube" && viewElements.tube) tubeChanged();
  if (what === "heart" && viewElements.heart) heartChanged();
  if (what === "data" && viewElements.data) dataChanged();
  remember();
}

function redrawAll() {
  for (const element of Object.values(viewElements)) refreshAll(element);
  T.stale = true;
  if (viewElements.heart) drawHeart();
  if (viewElements.data) drawData();
}

/* One loop; its own time and the time between frames are kept for those who measure. */
const frames = { work: [], gap: [], last: 0 };

function frame(now) {
  const begun = performance.now();
  if (state.view === "tube") tubeFrame(now);
  frames.work.push(performance.now() - begun);
  if (frames.last) frames.gap.push(now - frames.last);
  frames.last = now;
  if (frames.work.length > 600) { frames.work.shift(); frames.gap.shift(); }
  if (!window.lab.firstPlot && Object.values(plots).some((plot) => plot.mine)) window.lab.firstPlot = performance.now();
  requestAnimationFrame(frame);
}

window.lab = { facts, D, fineUnit, pageTitle, compute, pacing, heartValues, follow, H, readExperiment, takeFiles, dataValues, plots, frames, get state() { return state; }, get engine() { return engine; }, T, change, command, python, link, modelFile, adopt, defaults, merged, Latest };
begin();
