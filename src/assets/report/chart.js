// A number as short as it can be read.
function brief(x) {
  if (x === null || x === undefined) return "–";
  if (typeof x !== "number") return String(x);
  if (Number.isInteger(x) && Math.abs(x) < 1e6) return String(x);
  const size = Math.abs(x);
  return size !== 0 && (size < 1e-3 || size >= 1e6) ? x.toExponential(2).replace(/\.?0+e/, "e") : String(Number(x.toPrecision(4)));
}

// Round numbers from `low` to `high`, about `count` of them.
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(Number((k * step).toPrecision(12)));
  return found;
}

function logTicks(low, high) {
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const leads = last - first <= 2 ? [1, 2, 5] : [1];
  const found = [];
  for (let power = first; power <= last; power += 1) for (const lead of leads) found.push(Number(`${lead}e${power}`));
  return found.filter((x) => x >= low * 0.999 && x <= high * 1.001);
}

// An axis for `values`: a function from a value to its place between `from` and `to` in pixels, and its ticks. Texts stand side by
// side; positive numbers over more than a factor of `decades` stand by their logarithm.
function axis(values, from, to, count, decades = 30) {
  if (values.some((v) => typeof v !== "number")) {
    const names = [...new Set(values.map(String))].sort((a, b) => compare(a, b, 1));
    const at = (v) => from + (to - from) * (names.indexOf(String(v)) + 0.5) / names.length;
    return { at, ticks: names, texts: true };
  }
  let [low, high] = values.reduce(([l, h], v) => [Math.min(l, v), Math.max(h, v)], [Infinity, -Infinity]);
  if (!(low <= high)) [low, high] = [0, 1];
  if (low > 0 && high / low > decades) {
    const share = (v) => Math.log(v / low) / Math.log(high / low);
    return { at: (v) => from + (to - from) * share(v), ticks: logTicks(low, high) };
  }
  if (low === high) [low, high] = [low - Math.abs(low || 1) / 2, high + Math.abs(high || 1) / 2];
  return { at: (v) => from + (to - from) * (v - low) / (high - low), ticks: ticks(low, high, count) };
}

const LEFT = 62, RIGHT = 14, TOP = 26, BOTTOM = 40;

// A drawing with axes, to which marks are added.
function chart({ width, height, title, xs, ys, xLabel, label }) {
  const count = Math.max(2, Math.floor(width / 110));
  // marks at the ends stay clear of the border
  const x = axis(xs, LEFT + 8, width - RIGHT - 8, count), y = axis(ys, height - BOTTOM - 8, TOP + 6, 5);
  const text = (at, attributes, words) => shape("text", { x: at[0].toFixed(1), y: at[1].toFixed(1), ...attributes }, words);
  const drawing = shape("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label },
    text([LEFT, 14], { class: "title" }, title),
    text([width - RIGHT, height - 6], { "text-anchor": "end" }, xLabel),
    ...y.ticks.flatMap((t) => [
      shape("path", { class: "rule", d: `M${LEFT} ${y.at(t).toFixed(1)}H${width - RIGHT}` }),
      text([LEFT - 6, y.at(t) + 4], { "text-anchor": "end" }, brief(t))]),
    ...x.ticks.map((t) => text([x.at(t), height - BOTTOM + 16], { "text-anchor": "middle" }, x.texts ? String(t).slice(0, 14) : brief(t))));
  return { drawing, x, y, add: (name, attributes) => drawing.append(shape(name, attributes)) };
}

function place(x, y) {
  return `${x.toFixed(1)} ${y.toFixed(1)}`;
}

// Curves over epochs: `series` has a name, a class and a list of values, missing where null.
function curves({ width, title, epochs, series, best }) {
  const values = series.flatMap((s) => s.values.filter((v) => v !== null));
  const parts = chart({ width, height: 210, title, xs: epochs, ys: values, xLabel: "epoch",
    label: `${title}: ${series.map((s) => `${s.name} from ${brief(s.values[0])} to ${brief(s.values.at(-1))}`).join("; ")}` });
  for (const { values: list, kind } of series) {
    const path = list.map((v, i) => (v === null ? "" : `${i > 0 && list[i - 1] !== null ? "L" : "M"}${place(parts.x.at(epochs[i]), parts.y.at(v))}`));
    parts.add("path", { class: `line ${kind}`, d: path.join("") });
    if (list.length === 1 && list[0] !== null) parts.add("circle", { class: `line ${kind}`, cx: parts.x.at(epochs[0]), cy: parts.y.at(list[0]), r: 3 });
  }
  if (best !== null) parts.add("path", { class: "marker", "stroke-dasharray": "2 3", d: `M${parts.x.at(best).toFixed(1)} ${TOP}V${210 - BOTTOM}` });
  return parts.drawing;
}

