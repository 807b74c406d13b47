/* How a text lays out its table and what stands above it, as recordings/layout.py, heading.py and head.py. */

const DELIMITERS = ["\t", ";", ",", "|", ""], DELIMITER_NAMES = { "\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", "": "spaces" };
const COMMENT = /^\s*(?:#(?!(?:n\/?a|nv|num!|value!|div\/0!|ref!|null!|name\?)[\s,;|])|[%!]|\/\/|rem\s)/i;
const CLEARLY = 0.95;

class Layout {
  constructor(delimiter, width, kinds) { Object.assign(this, { delimiter, width, kinds }); }

  row(line) { return splitCells(line, this.delimiter); }

  isData(row) {
    if (!row.length || row.slice(this.width).some(Boolean)) return false;
    let found = 0;
    for (let i = 0; i < Math.min(row.length, this.kinds.length); i++) {
      if (this.kinds[i] !== "number" && this.kinds[i] !== "clock") continue;
      const value = isValue(row[i], this.delimiter);
      if (!value && !isMissing(row[i])) return false;
      found += value;
    }
    return found > 0 && row.length > Math.floor(this.width / 2);
  }

  isMostlyData(row) {
    const wanted = indicesOf(this.kinds, (kind) => kind === "number" || kind === "clock");
    const found = wanted.filter((i) => i < row.length && isValue(row[i], this.delimiter)).length;
    return found > wanted.length / 2 || (found === wanted.length - 1 && found > 0 && row.length === this.width);
  }
}

/* One line of CSV with quotes; null where it is not strictly that and `strict` is asked for. */
function quotedCells(line, delimiter, strict = false) {
  const cells = [];
  let i = 0;
  for (;;) {
    while (line[i] === " ") i++;
    let cell = "";
    if (line[i] === '"') {
      for (i++; i < line.length; i++) {
        if (line[i] !== '"') cell += line[i];
        else if (line[i + 1] === '"') { cell += '"'; i++; } else break;
      }
      if (i >= line.length && strict) return null;
      i++;
      if (strict && i < line.length && line[i] !== delimiter) return null;
    }
    while (i < line.length && line[i] !== delimiter) cell += line[i++];
    cells.push(cell);
    if (i >= line.length) return cells;
    i++;
  }
}

function splitCells(line, delimiter) {
  if (line.includes('"')) {
    if (delimiter) return quotedCells(line, delimiter).map((c) => c.trim());
    return (line.match(/"[^"]*"|\S+/g) ?? []).map((c) => c.replace(/^"+|"+$/g, ""));
  }
  return delimiter ? line.split(delimiter).map((c) => c.trim()) : spaced(line);
}

const spaced = (line) => line.trim() ? line.trim().split(/\s+/) : [];

function isValue(cell, delimiter) {
  if (!cell || !/^[\d\-+−.,]/.test(cell)) return false;
  if (cell.includes(" ") && !["\t", ";", "|"].includes(delimiter) && !isClock(cell) && !hasUnit(cell)) return false;
  return numberIn(cell, ".") !== null || numberIn(cell, ",") !== null || isClock(cell) || DATE.test(cell) || hasUnit(cell);
}

function sniffed(lines) {
  const filled = lines.filter((line) => line.trim()), step = Math.max(1, Math.floor(filled.length / words.sample));
  let tried = filled.filter((line, i) => i >= Math.floor(step / 2) && (i - Math.floor(step / 2)) % step === 0 && !COMMENT.test(line));
  if (!tried.length) tried = filled.slice(0, words.sample);
  const tabs = tried.filter((line) => line.includes("\t")).length > 0.5 * tried.length;
  let found = (tabs ? DELIMITERS.slice(0, -1) : DELIMITERS).map((delimiter) => {
    const rows = tried.map((line) => splitCells(line, delimiter)).filter((row) => row.length);
    return { delimiter, rows, ...layoutScore(rows, delimiter) };
  });
  let best = Math.max(...found.map((f) => f.score));
  if (best <= 0) return null;
  const wide = found.filter((f) => f.width > 1 && f.score > best / 2);
  if (wide.length) found = wide;
  best = Math.max(...found.map((f) => f.score));
  const clear = found.find((f) => f.score >= CLEARLY * best && f.width > 1 && f.delimiter);
  const tidy = (f) => Math.round(f.score * 1e6);
  const { width, delimiter, rows } = clear ?? found.reduce((a, b) => tidy(b) > tidy(a) || (tidy(b) === tidy(a) && b.width > a.width) ? b : a);
  const tabular = rows.filter((row) => row.length === width && valueShare(row, delimiter) > 0.5);
  return new Layout(delimiter, width, Array.from({ length: width }, (_, i) => kindOf(tabular.map((row) => row[i]), delimiter)));
}

function layoutScore(rows, delimiter) {
  const byLength = new Map();
  for (const row of rows) byLength.set(row.length, (byLength.get(row.length) ?? 0) + valueShare(row, delimiter));
  let width = 0, score = 0;
  for (const [length, sum] of byLength) if (width === 0 || sum > score || (sum === score && length > width)) [width, score] = [length, sum];
  return { score: score / Math.max(rows.length, 1), width };
}

function valueShare(row, delimiter) {
  const filled = row.filter(Boolean), values = filled.filter((c) => isValue(c, delimiter)).length;
  return values ? (values + filled.filter(isMissing).length) / filled.length : 0;
}

function kindOf(column, delimiter) {
  const filled = column.filter((c) => !isMissing(c));
  if (!filled.length) return column.some(Boolean) ? "number" : "empty";
  if (filled.filter(isClock).length > 0.5 * filled.length) return "clock";
  return filled.filter((c) => isValue(c, delimiter) && !DATE.test(c)).length > 0.3 * filled.length ? "number" : "text";
}

/* Headings ----------------------------------------------------------------------------------------------------- */

const BRACKETS = [/^(.*?)\s*\[([^\]]*)\]/, /^(.*?)\s*\(([^()]*(?:\([^()]*\))?[^()]*)\)/, /^(.*?)\s*\{([^}]*)\}/, /^(.*?)\s*<([^>]*)>/];
const UNIT_WAYS = [/^([^/]+?)\s*\/\s*(.+)$/, /^(.+?)\s+in\s+(.+)$/, /^(.+?)(?:\s*,\s*|\s*;\s*|\s*:\s*|[\s_.-]+)([^\s_,;:\d.-][^\s_,;:]*)$/];

function headingParts(heading) {
  const plain = heading.trim().replace(/^["']+|["']+$/g, "").trim().split(/\s+/).join(" ");
  const bracketed = BRACKETS.map((way) => way.exec(plain)).find(Boolean);
  if (bracketed?.[1]) return [headingName(bracketed[1]), bracketed[2].trim()];
  for (const way of UNIT_WAYS) {
    const match = way.exec(plain);
    if (match && isUnit(match[2])) return [headingName(match[1]), match[2].trim().replace(/^\(/, "").replace(/\)$/, "")];
  }
  return [headingName(plain), ""];
}

function headingName(text) {
  return text.trim().replace(/^["'#]+|["'#]+$/g, "").toLowerCase().replace(/[\s_\-./]+/g, "_").replace(/^[_:,;]+|[_:,;]+$/g, "");
}

function isUnitCell(cell) {
  const plain = cell.trim().replace(/^[[\](){}<>"' ]+|[[\](){}<>"' ]+$/g, "");
  return ["", "-", "--"].includes(plain) || isUnit(plain) || isForm(plain);
}

function unitIn(cell) {
  let plain = cell.trim().replace(/^["' ]+|["' ]+$/g, "");
  while (plain && "[({<".includes(plain[0]) && "])}>".includes(plain.at(-1))) plain = plain.slice(1, -1).trim();
  return plain === "-" || plain === "--" || isForm(plain) ? "" : plain;
}

/* How times of a clock are written, as hh:mm:ss: they have no unit. */
const FORM = /^(?=.*([dmyhs])\1)[dmyhs]{1,4}(?:[:./\- T,]+(?:[dmyhs]{1,4}|f{1,6}|0{1,6}|x{1,6}))+$/i;

function isForm(text) {
  return FORM.test(text) && !isUnit(text);
}

/* The head ----------------------------------------------------------------------------------------------------- */

const PREFIX = /\s*(?:#+|%+|\/\/+|!+|\*+|;+(?=\s)|rem\s)\s*/i, LABEL = /^(?:[xy]_?)?(?:units?|einheit(?:en)?|unité|dimension)(?:[ _]?(?:label|name))?s?[:=]?$/i;
const WORD = /^[\p{L}_]{3}/u; // what begins a label rather than a number with a mistake in it
const COLUMN = /"[^"]*"|[^\s[({]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)|\{[^}]*\}))?/g;

function headOf(lines, layout, names) {
  const begin = firstNumbers(lines, layout), rows = [];
  for (let i = 0; i < begin; i++) {
    const cells = headCells(lines[i], layout);
    if (cells.length) rows.push([i, cells]);
  }
  let units = rows.filter(([, c]) => areUnits(c)).map(([i, c]) => [i, c.map((cell, k) => k === 0 && LABEL.test(cell) ? "" : unitIn(cell))]);
  let candidates = rows.filter(([, c]) => !c.some((x) => isValue(x, layout.delimiter)) && !areUnits(c));
  if (!candidates.length && units.length) {
    candidates = rows.filter(([i]) => i === units[0][0]);
    units = units.slice(1);
  }
  if (!candidates.length) candidates = rows.filter(([, c]) => c.length === layout.width && !isValue(c[0], layout.delimiter));
  candidates = candidates.filter(([, c]) => c.length >= layout.width || areHeadings(c, names));
  if (!candidates.length) candidates = shiftedHeadings(lines, layout, begin, names);
  const apt = ([i, c]) => [c.filter((x) => names.has(headingParts(x)[0])).length, c.length >= layout.width ? 1 : 0, c.filter(Boolean).length, i];
  const more = (a, b) => { for (let k = 0; k < a.length; k++) if (a[k] !== b[k]) return a[k] > b[k]; return false; };
  const chosen = candidates.reduce((a, b) => !a || more(apt(b), apt(a)) ? b : a, null) ?? [-1, []];
  const unitRow = units.reduce((a, b) => !a || Math.abs(b[0] - chosen[0]) < Math.abs(a[0] - chosen[0]) ? b : a, null) ?? [-1, []];
  let first = begin;
  for (let i = chosen[0] + 1; i < begin; i++) { const row = layout.row(lines[i]); if (layout.isMostlyData(row) && !WORD.test(row[0])) { first = i; break; } }
  return { first: first + 1, headings: chosen[1], units: unitRow[1], headingLine: chosen[0] + 1, unitLine: unitRow[0] + 1 };
}

/* Headings of all columns but the first, which only counts the rows. */
function shiftedHeadings(lines, layout, begin, names) {
  const counted = lines.slice(begin).filter((line) => line.trim()).slice(0, 3).map((line) => layout.row(line)[0]);
  if (counted.length < 3 || !counted.every((c) => /^\d+$/.test(c)) || Number(counted[2]) !== Number(counted[0]) + 2) return [];
  return lines.slice(0, begin).map((line, i) => [i, splitCells(line, layout.delimiter)]).filter(([, c]) => c.length === layout.width - 1 && areHeadings(c, names)).map(([i, c]) => [i, ["", ...c]]);
}

const areHeadings = (cells, names) => cells.map(headingParts).some(([name, unit]) => names.has(name) || isUnit(unit));

function headColumn(head, i) {
  const heading = head.headings[i] ?? "", row = head.units[i] ?? "";
  let [name, unit] = headingParts(heading);
  if (row && unit && !heading.includes("[") && !heading.includes("(")) name = headingName(heading);
  return [name, row || unit, heading];
}

function firstNumbers(lines, layout) {
  const data = dataLines(lines, layout);
  let first = data.next().value ?? [0, 0];
  while (first[1] > 1) first = data.next().value ?? [first[0], 1];
  return first[0];
}

function* dataLines(lines, layout) {
  let before = -1, since = 0;
  for (let i = 0; i < lines.length; i++) {
    if (!lines[i].trim()) continue;
    since++;
    if (COMMENT.test(lines[i]) || !layout.isData(layout.row(lines[i]))) continue;
    if (before >= 0) yield [before, Math.min(since, 2)];
    [before, since] = [i, 0];
  }
  if (before >= 0) yield [before, 1];
}

function headCells(line, layout) {
  const at = PREFIX.exec(line), plain = at && at.index === 0 ? line.slice(at[0].length) : line;
  const ways = [splitCells(line, layout.delimiter), splitCells(plain, layout.delimiter)];
  if (!layout.delimiter) ways.push(plain.trim().split(/\s{2,}|\t/), (plain.match(COLUMN) ?? []).map((c) => c.replace(/^"+|"+$/g, "")));
  for (const delimiter of DELIMITERS) if (delimiter) ways.push(splitCells(plain, delimiter));
  for (const cells of ways) while (cells.length > layout.width && !cells.at(-1)) cells.pop();
  const fitting = ways.find((cells) => cells.length === layout.width);
  if (fitting) return fitting;
  return ways[1].length > 1 && layout.delimiter ? ways[1] : [];
}

function areUnits(cells) {
  const rest = cells.length && LABEL.test(cells[0]) ? cells.slice(1) : cells;
  return rest.filter(unitIn).length >= Math.min(2, cells.length) && rest.every(isUnitCell);
}
