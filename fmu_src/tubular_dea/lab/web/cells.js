/* From the cells of a column to numbers, as recordings/cells.py and recordings/clock.py: marks, gaps, times of day. */

const PLAIN = /^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?$/, FLOAT = /^[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan)$/i;
const SCPI = [9.9e37, 9.91e37], DAY = 86400;
const GROUPED = { ",": /^[-+]?[1-9]\d{0,2}(?:,\d{3})+$/, ".": /^[-+]?[1-9]\d{0,2}(?:\.\d{3})+$/ };
const GROUPS = { ".": /^[-+]?\d{1,3}([', ])\d{3}(?:\1\d{3})*(?:\.\d*)?(?:[eE][-+]?\d+)?$/, ",": /^[-+]?\d{1,3}(['. ])\d{3}(?:\1\d{3})*(?:,\d*)?(?:[eE][-+]?\d+)?$/ };
const LOOSE = { "−": "-", "’": "'", D: "e", d: "e", "\u00a0": " ", "\u202f": " ", "\u2009": " " };
const missingWords = new Set(words.missing);
const DATE_TEXT = "\\d{1,4}([-./])\\d{1,2}\\DATE\\d{1,4}", TIME_TEXT = "(?:(\\d{1,3}):)?(\\d{1,2}):(\\d{1,2}(?:[.,]\\d*|:\\d{3})?)\\s*([AaPp]\\.?[Mm]\\.?)?";
const DATE = new RegExp(`^${DATE_TEXT.replace("DATE", "1")}$`);
const CLOCK = new RegExp(`^(?:(${DATE_TEXT.replace("DATE", "2")})\\.?(?:T|,?\\s+))?${TIME_TEXT}\\s*(?:Z|UTC|GMT|[-+]\\d\\d:?\\d\\d)?$`);

const isClock = (cell) => cell.includes(":") && CLOCK.test(cell);
const loose = (cell) => Array.from(cell, (c) => LOOSE[c] ?? c).join("");

function isMissing(cell) {
  const plain = cell.trim().replace(/^["']+|["']+$/g, "").toLowerCase();
  return missingWords.has(plain) || (PLAIN.test(plain) && SCPI.includes(Math.abs(Number(plain.replaceAll("d", "e")))));
}

/* The number in a cell; null for anything else. */
function numberIn(cell, decimal = ".") {
  const mark = decimal === "," ? "," : ".", finite = (v) => Math.abs(v) < SCPI[0] ? v : null;
  if (mark === "." && PLAIN.test(cell) && !/[dD]/.test(cell)) return finite(Number(cell));
  let plain = loose(cell).trim();
  const grouped = decimal === "?" ? null : GROUPS[mark].exec(plain);
  if (grouped) plain = plain.replaceAll(grouped[1], "");
  else if (mark === "," && plain.includes(".")) return null;
  if (mark === ",") plain = plain.replaceAll(",", ".");
  return PLAIN.test(plain) ? finite(Number(plain.replace(/[dD]/, "e"))) : null;
}

const WITH_UNIT = /^[-+]?[\d.,]*\d[.,]?(?:[eE][-+]?\d+)?\s*([^\d\s.,;:+-][^,;:]*)$/;

/* Whether a cell is a number with a unit behind it. */
function hasUnit(cell) {
  const match = WITH_UNIT.exec(cell);
  return match !== null && isUnit(match[1]);
}

/* The unit that stands behind the number in most cells; "" for none. */
function saidUnit(cells) {
  const first = cells.slice(0, 200).filter((c) => !isMissing(c)).map((c) => c.trim()), counts = new Map();
  for (const cell of first) { const match = WITH_UNIT.exec(cell); if (match) counts.set(match[1], (counts.get(match[1]) ?? 0) + 1); }
  const [unit, count] = [...counts].reduce((a, b) => b[1] > a[1] ? b : a, ["", 0]);
  return count > first.length / 2 && isUnit(unit) ? unit : "";
}

/* {values, bad, kind, decimal} of a column; `hint` is the decimal mark of other columns. */
function numbersIn(cells, hint = "") {
  const quick = quickly(cells);
  if (quick && (hint !== "," || decimalMark(cells, hint) === ".")) return { values: quick, bad: [], kind: "number", decimal: cells.slice(0, 100).some((c) => c.includes(".")) ? "." : "" };
  const first = cells.slice(0, 200);
  if (cells.some((c) => c.includes(":")) && first.filter(isClock).length > 0.5 * first.filter(Boolean).length) {
    const gone = cells.map(isMissing), values = clockSeconds(cells, gone);
    return { values, bad: indicesOf(cells, (_, i) => Number.isNaN(values[i]) && !gone[i]), kind: "clock", decimal: "" };
  }
  const unit = saidUnit(cells);
  if (unit) return { ...numbersIn(cells.map((c) => c.trim().endsWith(unit) ? c.trim().slice(0, -unit.length) : c.trim()), hint), unit };
  const decimal = decimalMark(cells, hint);
  if (decimal === ",") {
    const again = quickly(cells.map((c) => c.includes(".") ? "x" : c.replaceAll(",", ".")));
    if (again) return { values: again, bad: [], kind: "number", decimal };
  }
  return slowly(cells, decimal);
}

const indicesOf = (list, keep) => { const out = []; list.forEach((item, i) => { if (keep(item, i)) out.push(i); }); return out; };

function quickly(cells) {
  const values = new Float64Array(cells.length);
  for (let i = 0; i < cells.length; i++) {
    const cell = cells[i].trim();
    if (!FLOAT.test(cell)) return null;
    values[i] = /nan/i.test(cell) ? NaN : Number(cell);
    if (Math.abs(values[i]) >= SCPI[0]) return null;
  }
  return values;
}

function slowly(cells, decimal) {
  const values = new Float64Array(cells.length).fill(NaN), bad = [];
  cells.forEach((cell, i) => {
    if (!cell) return;
    const value = numberIn(cell, decimal);
    if (value !== null) values[i] = value; else if (!isMissing(cell)) bad.push(i);
  });
  if (bad.length && bad.length > 0.9 * (bad.length + values.filter(Number.isFinite).length)) {
    const plain = cells.map((c) => c.trim().toLowerCase());
    if (plain.every((w) => w in words.truth || missingWords.has(w))) return { values: Float64Array.from(plain, (w) => words.truth[w] ?? NaN), bad: [], kind: "number", decimal: "" };
    return { values, bad, kind: "text", decimal: "" };
  }
  return { values, bad, kind: "number", decimal };
}

/* "." or ","; "?" where thousands look the same. */
function decimalMark(cells, hint = "") {
  let commas = [], points = [], small = false, large = false;
  for (const cell of cells) {
    const comma = cell.lastIndexOf(","), point = cell.lastIndexOf("."), bare = cell.replace(/^[-+]+/, "");
    if (comma >= 0 && point >= 0) return comma > point ? "," : ".";
    if (comma >= 0) commas.push(cell);
    else if (point >= 0) points.push(cell);
    else if (/^\d+$/.test(bare)) { large ||= bare.length > 3; small = true; }
  }
  if (commas.length && points.length) { commas = commas.filter((c) => !isMissing(c)); points = points.filter((c) => !isMissing(c)); }
  if (!commas.length && (hint !== "," || !points.length)) return ".";
  const [mark, other, there] = commas.length ? [",", ".", commas] : [".", ",", points];
  const several = () => there.some((c) => c.split(mark).length > 2);
  if (commas.length && points.length) {
    const groups = [commas.every((c) => GROUPED[","].test(c)), points.every((c) => GROUPED["."].test(c))].join();
    return { "true,false": ".", "false,true": ",", "true,true": "?" }[groups] ?? ".";
  }
  if (large || hint === mark || !there.every((c) => GROUPED[mark].test(c))) return hint === mark && several() ? other : mark;
  return small || (hint === other && mark === ",") || several() ? other : "?";
}

/* Seconds since the midnight before the first cell. */
function clockSeconds(cells, missing) {
  const times = new Float64Array(cells.length).fill(NaN), days = new Float64Array(cells.length), dates = new Map();
  cells.forEach((cell, i) => {
    const m = missing[i] ? null : CLOCK.exec(cell);
    if (!m) return;
    let hours = Number(m[3] ?? 0);
    if (m[6]) hours = hours % 12 + (/^p/i.test(m[6]) ? 12 : 0);
    times[i] = 3600 * hours + 60 * Number(m[4]) + Number(m[5].replace(",", ".").replace(":", "."));
    if (!m[1]) return;
    if (!dates.has(m[1])) dates.set(m[1], dayOf(m[1], dates.size));
    days[i] = dates.get(m[1]);
  });
  const first = dates.size ? Math.min(...dates.values()) : 0;
  let passed = 0, last = NaN;
  return times.map((t, i) => {
    if (Number.isNaN(t)) return t;
    if (!dates.size && t - last < -DAY / 2) passed++;
    last = t;
    return t + DAY * (days[i] - first + passed);
  });
}

function dayOf(date, following) {
  const [y, m, d] = date.split(/[-./]/).map(Number), made = new Date(Date.UTC(2000, m - 1, d));
  made.setUTCFullYear(y, m - 1, d);
  return y > 31 && m >= 1 && m <= 12 && made.getUTCMonth() === m - 1 && d >= 1 ? Math.round(made.getTime() / 864e5) : following;
}
