/* Units as model/units.py reads them, with its own tables. */

const words = facts.vocabulary;
const byCase = new Map();
for (const name of Object.keys(words.units)) byCase.set(name.toLowerCase(), [...(byCase.get(name.toLowerCase()) ?? []), name]);

class ReadError extends Error {}
class UnitError extends Error {}

function parseUnit(text) {
  const plain = plainUnit(text), single = namedUnit(plain);
  if (single) return single;
  let value = { factor: 1, exponents: [...words.units["1"][1]], offset: 0 };
  plain.split("/").forEach((product, k) => {
    for (const name of product.toLowerCase() in words.alsoUnits ? [product] : product.split(/\.(?!\d)|(?<!\d)\./)) {
      const [unit, exponent] = unitPower(name.trim(), text), power = k ? -exponent : exponent;
      value = { factor: value.factor * unit.factor ** power, exponents: value.exponents.map((e, i) => e + power * unit.exponents[i]), offset: 0 };
    }
  });
  return value;
}

function isUnit(text) {
  try { parseUnit(text); return true; } catch { return false; }
}

/* `values` in `unit` as they are in `expected`; a zero may be another. */
function convertedUnit(values, unit, expected) {
  const given = parseUnit(unit), wanted = parseUnit(expected), same = given.exponents.join() === wanted.exponents.join();
  if (!same) throw new UnitError(`expected a unit like ${repr(expected)} but was given ${repr(unit)}`);
  const factor = given.factor / wanted.factor;
  return given.offset === wanted.offset ? values.map((v) => v * factor) : values.map((v) => (v * given.factor + (given.offset - wanted.offset)) / wanted.factor);
}

function plainUnit(text) {
  let plain = Array.from(text.normalize("NFKC"), (c) => words.signs[c] ?? c).join("").trim().replaceAll("..", "");
  while (/^[([]/.test(plain) && /[)\]]$/.test(plain) && !/[()]/.test(plain.slice(1, -1))) plain = plain.slice(1, -1).trim();
  plain = plain.replace(/^\[|\]$/g, "").trim().replace(/\s*([()])\s*/g, "$1");
  plain = withoutBrackets(plain.replace(/\s*([/.])\s*|\s+/g, (_, mark) => mark || ".")).replace(/\)+$/, "");
  return plain.startsWith("/") ? `1${plain}` : plain;
}

/* Products and quotients in brackets, the innermost first, multiplied out: a/(b/c).d is c.a/b.d. */
function withoutBrackets(text) {
  for (let group; (group = /\(([^()]*)\)/.exec(text)); ) {
    const before = text.slice(0, group.index), after = text.slice(group.index + group[0].length);
    const [above, ...below] = group[1].split("/"), begin = before.lastIndexOf("(") + 1; // of what is around it
    if (/^[-0-9A-Za-z%]/.test(after) || (before && !"/.(".includes(before.at(-1)))) break;
    if (before.slice(begin).includes("/")) {
      text = before.slice(0, begin) + below.map((one) => `${one}.`).join("") + before.slice(begin) + (above || "1") + after;
    } else {
      let end = 0;
      for (let open = 0; end < after.length && (open += { "(": 1, ")": -1 }[after[end]] ?? 0) >= 0; ) end++;
      text = before + (above || "1") + after.slice(0, end) + below.map((one) => `/${one}`).join("") + after.slice(end);
    }
  }
  return text;
}

function unitPower(name, text) {
  const unit = namedUnit(name);
  if (unit) return [unit, 1];
  const match = /^([A-Za-z%]+)(-?\d+(?:\.\d+)?)$/.exec(name), base = match && namedUnit(match[1]);
  if (base && Math.abs(Number(match[2])) <= 9) return [base, Number(match[2])];
  const close = closeMatches(name.toLowerCase(), [...byCase.keys()], 3, 0.6).flatMap((lower) => byCase.get(lower)).slice(0, 3);
  const hint = close.length ? `did you mean ${close.join(", ")}?` : "as in Pa.s, mL/min, kV or degC";
  throw new UnitError(`cannot read the unit ${repr(text)}: expected a known unit or a combination; ${hint}`);
}

function namedUnit(name) {
  if (Object.hasOwn(words.units, name)) { const [factor, exponents, offset] = words.units[name]; return { factor, exponents, offset }; }
  if (Object.hasOwn(words.joinedUnits, name)) return parseUnit(words.joinedUnits[name]);
  if (Object.hasOwn(words.alsoUnits, name.toLowerCase())) return parseUnit(words.alsoUnits[name.toLowerCase()]);
  const same = byCase.get(name.toLowerCase()) ?? [];
  return same.length === 1 ? namedUnit(same[0]) : null;
}

/* Python's difflib.get_close_matches: the same matches, in the same order. */
function closeMatches(word, list, n, cutoff) {
  return list.map((other) => ({ other, ratio: similarity(other, word) })).filter((m) => m.ratio >= cutoff)
    .sort((a, b) => b.ratio - a.ratio || (a.other < b.other ? 1 : -1)).slice(0, n).map((m) => m.other);
}

function similarity(a, b) {
  const matches = (a0, a1, b0, b1) => { // the longest common stretch, then left and right of it
    let best = [a0, b0, 0];
    for (let i = a0; i < a1; i++) for (let j = b0; j < b1; j++) {
      let k = 0;
      while (i + k < a1 && j + k < b1 && a[i + k] === b[j + k]) k++;
      if (k > best[2]) best = [i, j, k];
    }
    const [i, j, k] = best;
    return k ? k + matches(a0, i, b0, j) + matches(i + k, a1, j + k, b1) : 0;
  };
  return a.length + b.length ? 2 * matches(0, a.length, 0, b.length) / (a.length + b.length) : 1;
}

/* Python's repr of a text, and its format "g". */
function repr(text) {
  const mark = text.includes("'") && !text.includes('"') ? '"' : "'";
  const inner = Array.from(text, (c) => {
    if (c === "\\" || c === mark) return `\\${c}`;
    const known = { "\n": "\\n", "\r": "\\r", "\t": "\\t" }[c];
    if (known) return known;
    const code = c.codePointAt(0);
    if (code < 32 || code === 127 || (code >= 128 && code < 161) || code === 173) return `\\x${code.toString(16).padStart(2, "0")}`;
    if (/^[\p{C}\p{Z}]$/u.test(c) && c !== " ") return code < 65536 ? `\\u${code.toString(16).padStart(4, "0")}` : `\\U${code.toString(16).padStart(8, "0")}`;
    return c;
  }).join("");
  return `${mark}${inner}${mark}`;
}

function g(value, digits = 6) {
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e").map((part, k) => k ? Number(part) : part);
  if (exponent < -4 || exponent >= digits) return `${mantissa.replace(/\.?0+$/, "")}e${exponent < 0 ? "-" : "+"}${String(Math.abs(exponent)).padStart(2, "0")}`;
  const fixed = value.toFixed(Math.max(0, digits - 1 - exponent));
  return fixed.includes(".") ? fixed.replace(/\.?0+$/, "") : fixed;
}
