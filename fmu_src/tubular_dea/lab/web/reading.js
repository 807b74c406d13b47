/* A text file as a table of columns, as recordings/text.py and encoding.py: any encoding, delimiter and decimal mark. */

class NoTableError extends ReadError {}

const shortened = (text, longest = 40) => repr(text.length <= longest ? text : `${text.slice(0, longest - 3)}...`);
const some = (texts, most = 12) => texts.slice(0, most).join(", ") + (texts.length > most ? ` and ${texts.length - most} more` : "");
const MARKS = [[[0xef, 0xbb, 0xbf], "utf-8", "UTF-8 with byte order mark"], [[0xff, 0xfe], "utf-16le", "UTF-16"], [[0xfe, 0xff], "utf-16be", "UTF-16"]];
const BINARY = [["MATLAB 5.0", "a MATLAB file"], ["MATLAB 7.3", "a MATLAB file"], ["\x89HDF", "an HDF5 file"], ["TDSm", "a TDMS file"], ["PAR1", "a Parquet file"]];
const UNSUPPORTED = [["PK\x03\x04", "a spreadsheet or an archive"], ["\xd0\xcf\x11\xe0", "an old spreadsheet"], ["\x1f\x8b", "a compressed file"], ["BZh", "a compressed file"],
  ["\xfd7zXZ", "a compressed file"], ["%PDF", "a PDF"], ["\x89PNG", "a picture"], ["TDSh", "a TDMS index; the data is in the .tdms file beside it"]];

/* The table in `raw` bytes; a ReadError names file, line and column. `names` are headings hoped for. */
function readTable(path, raw, names) {
  const start = String.fromCharCode(...raw.subarray(0, 20));
  const binary = BINARY.find(([mark]) => start.startsWith(mark)), unsupported = UNSUPPORTED.find(([mark]) => start.startsWith(mark));
  if (binary) throw new ReadError(`${path}: the page reads text; this is ${binary[1]}: open it with tubular-dea lab --data FOLDER`);
  if (unsupported) throw new ReadError(`${path}: expected a table as text, MATLAB, TDMS or Parquet file but found ${unsupported[1]}; export it as CSV`);
  const { text: whole, encoding } = decoded(path, raw), text = whole.replace(/\x1a+$/, "");
  if (!text.trim()) throw new ReadError(`${path}: expected headings and numbers but the file is empty`);
  let lines = text.replaceAll("\r\n", "\n").replaceAll("\r", "\n").split("\n");
  const layout = sniffed(lines);
  if (!layout) {
    const first = lines.findIndex((line) => line.trim());
    throw new NoTableError(`${path}, line ${first + 1}: expected rows of numbers below headings like 'time [s]' but no line holds numbers; found ${shortened(lines[first].trim())}`);
  }
  if (text.includes('"')) lines = joinedLines(path, lines, layout.delimiter);
  const head = headOf(lines, layout, names), body = bodyOf(lines, head, layout);
  const { found, kept, remarks } = columnsOf(path, body, head, layout);
  const rows = indicesOf(kept, Boolean), decimals = new Set(found.filter((n) => n.kind === "number").map((n) => n.decimal));
  const columns = found.map((n, i) => columnOf(i, n, head, body, kept, rows));
  const format = [`text (${encoding})`, DELIMITER_NAMES[layout.delimiter], ...(decimals.has(",") ? ["decimal commas"] : []), ...(head.headingLine ? [] : ["no headings"]), ...(head.unitLine ? [`units in line ${head.unitLine}`] : [])];
  return { path, columns, lines: rows.map((i) => body.lines[i]), remarks, headingLine: head.headingLine, format: format.join(", "),
           headings: columns.map((c) => c.heading || `(number ${c.number})`).join(", "), headingPlace: head.headingLine ? `${path}, line ${head.headingLine}` : path };
}

function decoded(path, raw) {
  for (const [mark, codec, name] of MARKS) if (mark.every((byte, i) => raw[i] === byte)) return { text: strictly(path, raw.subarray(mark.length), codec, name), encoding: name };
  const sample = raw.subarray(0, 4096), half = Math.floor(sample.length / 2), zeros = (odd) => sample.filter((byte, i) => i % 2 === odd && byte === 0).length;
  if (sample.includes(0)) {
    const codec = zeros(1) > 0.7 * half && zeros(0) < 0.05 * half ? "utf-16le" : zeros(0) > 0.7 * half && zeros(1) < 0.05 * half ? "utf-16be" : "";
    if (codec) return { text: strictly(path, raw, codec, "UTF-16"), encoding: "UTF-16" };
  }
  const allowed = new Set([7, 8, 9, 10, 11, 12, 13, 26, 27, 28, 29, 30, 31]), control = (byte) => byte < 32 && !allowed.has(byte);
  if (raw.subarray(0, 65536).some(control) || raw.includes(0)) {
    const at = raw.findIndex(control);
    throw new ReadError(`${path}, line ${raw.subarray(0, at).filter((b) => b === 10).length + 1}: cannot be read as a text file: expected characters but found the byte ${raw[at]}; export it as CSV, or give it the ending of its format`);
  }
  try {
    return { text: new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(raw), encoding: raw.some((b) => b > 127) ? "UTF-8" : "ASCII" };
  } catch {
    const undefined_ = raw.some((b) => [0x81, 0x8d, 0x8f, 0x90, 0x9d].includes(b));
    return undefined_ ? { text: Array.from(raw, (b) => String.fromCharCode(b)).join(""), encoding: "Latin-1" } : { text: new TextDecoder("windows-1252").decode(raw), encoding: "Windows-1252" };
  }
}

function strictly(path, raw, codec, name) {
  let text;
  try {
    text = new TextDecoder(codec, { fatal: true, ignoreBOM: true }).decode(raw);
  } catch {
    throw new ReadError(`${path}: cannot be read as a text file: expected ${name}, as its first bytes say, but some byte is none; save it as CSV in UTF-8`);
  }
  if (text.includes("\0")) throw new ReadError(`${path}: cannot be read as a text file: expected characters but found NUL; save it as CSV`);
  return text;
}

/* Lines whose quoted cell runs on, joined in the first of them. */
function joinedLines(path, lines, delimiter) {
  if (!delimiter) return lines;
  const out = [...lines], quotes = (line) => line.split('"').length - 1;
  for (let i = 0; i < out.length; i++) {
    if (quotes(out[i]) % 2 === 0) continue;
    let joined = false;
    for (let more = 0; more < Math.min(words.quoted, out.length - i) && !joined; more++) {
      const whole = out.slice(i, i + more + 1).join(" ");
      if (quotes(whole) % 2 && !quotedCells(whole, delimiter, true)) continue;
      out.splice(i, more + 1, whole, ...Array(more).fill(""));
      joined = true;
    }
    if (!joined) throw new ReadError(`${path}, line ${i + 1}: expected a closing quote within ${words.quoted} lines but found ${shortened(out[i].trim())}; close the quote or remove it`);
  }
  return out;
}

function bodyOf(lines, head, layout) {
  const numbers = [], cells = [], excess = [], width = head.headings.length || layout.width;
  for (let i = head.first - 1; i < lines.length; i++) {
    const line = lines[i];
    if (!line.trim() || COMMENT.test(line)) continue;
    const row = line.includes('"') ? splitCells(line, layout.delimiter) : layout.delimiter ? line.split(layout.delimiter) : spaced(line);
    if (row.length !== width) {
      while (row.length > width && !row.at(-1).trim()) row.pop();
      excess.push(row.length - width);
      while (row.length < width) row.push("");
      row.length = width;
    } else excess.push(0);
    numbers.push(i + 1);
    cells.push(row);
  }
  return { cells, lines: numbers, excess };
}

function columnsOf(path, body, head, layout) {
  const width = body.cells[0]?.length ?? 0, cells = Array.from({ length: width }, (_, k) => body.cells.map((row) => row[k]));
  let found = cells.map((c) => numbersIn(c));
  const ungrouped = (n) => n.kind === "number" && n.decimal === "" && n.values.some((v) => Math.abs(v) >= 1000); // by nobody
  if (found.some((n) => n.decimal === ",")) found = found.map((n, k) => n.decimal === "," ? n : numbersIn(cells[k], ","));
  else if (found.some((n) => n.decimal === ".")) found = found.map((n, k) => n.decimal === "." ? n : numbersIn(cells[k], "."));
  else if (found.some(ungrouped)) found = found.map((n, k) => n.kind === "text" ? numbersIn(cells[k], ",") : n); // so 12,345 of others has a decimal comma
  const kept = body.cells.map((_, i) => found.some((n) => Number.isFinite(n.values[i]))), total = kept.filter(Boolean).length;
  if (total > 0 && total < words.least) throw new NoTableError(`${path}, line ${head.first}: expected at least ${words.least} rows of numbers but found one`);
  if (!total || found.every((n) => n.bad.filter((i) => kept[i]).length > words.prose * total)) throw new NoTableError(`${path}, line ${head.first}: expected rows of numbers but found text`);
  const remarks = leftOut(body, kept, head), filled = [...kept], last = kept.lastIndexOf(true);
  const mayBeShort = (i) => shortRow(body, filled, i, layout);
  if (body.excess[last] < 0 && !mayBeShort(last)) {
    filled[last] = kept[last] = false;
    remarks.push(`line ${body.lines[last]}, the last one, is incomplete: left out`);
  }
  body.excess.forEach((excess, i) => {
    if (!excess || !filled[i] || (excess < 0 && mayBeShort(i))) return;
    throw new ReadError(`${path}, line ${body.lines[i]}: ${width + excess} cells below ${width} headings; expected one each between ${DELIMITER_NAMES[layout.delimiter]}${layout.delimiter === "," ? ": decimal commas?" : ""}; correct or remove the line`);
  });
  return { found, kept, remarks };
}

function shortRow(body, filled, i, layout) {
  const lacking = body.excess[i], width = body.cells[i].length, kinds = [...layout.kinds, ...Array(width).fill("empty")].slice(0, width);
  if (kinds.slice(lacking).every((kind) => kind === "text" || kind === "empty")) return true;
  const alike = body.excess.filter((e, k) => filled[k] && e === lacking).length;
  return Boolean(layout.delimiter) && alike >= Math.max(2, words.often * filled.filter(Boolean).length);
}

function leftOut(body, kept, head) {
  const repeated = [], texts = [];
  body.cells.forEach((cells, i) => {
    if (kept[i]) return;
    const row = cells.map((c) => c.trim());
    if (head.headings.length && row.slice(0, head.headings.length).join("\0") === head.headings.join("\0")) repeated.push(`line ${body.lines[i]}`);
    else if (!row.every(isMissing)) texts.push(`line ${body.lines[i]} ${shortened(row.filter(Boolean).join(" "))}`);
  });
  return [...(repeated.length ? [`headings repeated: ${some(repeated, 5)}`] : []), ...(texts.length ? [`without numbers, left out: ${some(texts, 5)}`] : [])];
}

function columnOf(i, found, head, body, kept, rows) {
  let [name, unit, heading] = headColumn(head, i);
  unit ||= found.unit ?? "";
  if (found.kind === "clock" || (name === "x_value" && !unit)) unit = "s";
  const column = { name, unit, heading, number: i + 1, clock: found.kind === "clock", values: Float64Array.from(rows, (r) => found.values[r]), problem: "" };
  column.shown = name ? repr(heading.trim().replace(/^["' ]+|["' ]+$/g, "").split(/\s*[[(/,]/)[0] || name) : `number ${i + 1}`;
  const bad = found.bad.find((r) => kept[r]);
  if (bad === undefined) return column;
  const cell = body.cells[bad][i].trim();
  const wanted = /^(inf|1\.#inf|∞)/.test(cell.replace(/^[+-]+/, "").toLowerCase()) ? "a finite number" : /^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$/.test(cell) ? "a finite number of a usual size (instruments mean an overload by 9.9e+37)" : found.decimal === "?" ? "a number that tells decimal from thousands marks" : found.kind === "clock" ? "a time like 13:07:30.234" : "a number";
  column.problem = `line ${body.lines[bad]}, column ${column.shown}: expected ${wanted} but found ${shortened(cell)}`;
  return column;
}
