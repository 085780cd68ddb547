// The last seconds of some signals over time or another signal, on one canvas.

const COLOURS = ["--plot-1", "--plot-2", "--plot-3", "--plot-4"];

export const MOST = COLOURS.length;

/** @param {number[]} along  times [s], or values of a signal if over  @param {{name: string, values: number[]}[]} curves  at most MOST */
export function plot(canvas, along, curves, colour, over) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, height);
  if (along.length < 2) return;
  const [low, high] = ends(curves.flatMap((curve) => curve.values)), [from, to] = ends(along);
  const edge = { left: 58, right: 16, top: 8, bottom: 20 };
  const x = (t) => edge.left + ((width - edge.left - edge.right) * (t - from)) / (to - from);
  const y = (v) => height - edge.bottom - ((height - edge.top - edge.bottom) * (v - low)) / (high - low);
  Object.assign(c, { strokeStyle: colour("--line"), fillStyle: colour("--faint"), font: "11px system-ui", lineWidth: 1 });
  for (const v of ticks(low, high, 4)) label(c, short(v), [edge.left - 6, y(v)], [edge.left, y(v), width - edge.right, y(v)], "right");
  for (const t of ticks(from, to, 5)) label(c, over ? short(t) : `${short(t)} s`, [x(t), height - 8], [x(t), edge.top, x(t), height - edge.bottom], "center");
  curves.forEach((curve, i) => {
    Object.assign(c, { strokeStyle: colour(COLOURS[i]), lineWidth: 1.7, lineJoin: "round" });
    c.beginPath();
    curve.values.forEach((v, k) => (k ? c.lineTo(x(along[k]), y(v)) : c.moveTo(x(along[k]), y(v))));
    c.stroke();
    if (!over) return;
    c.fillStyle = c.strokeStyle;
    c.beginPath();
    c.arc(x(along.at(-1)), y(curve.values.at(-1)), 4, 0, 2 * Math.PI); // now
    c.fill();
  });
}

export const colourOf = (i) => COLOURS[i];

/** A number in a few letters. */
export function short(value) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(1).replace("e+", "e") : String(Number(value.toPrecision(4)));
}

/** The smallest and the largest finite value. */
function ends(values) {
  const seen = values.filter(Number.isFinite), [low, high] = [Math.min(...seen), Math.max(...seen)];
  const least = 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1e-3); // rounding is no signal
  return high - low < least ? [low - least, high + least] : [low, high];
}

/** Round numbers between two. */
function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((digit) => digit * power >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) found.push(Number((k * step).toPrecision(12)));
  return found;
}

function label(c, text, [tx, ty], [x0, y0, x1, y1], align) {
  Object.assign(c, { textAlign: align, textBaseline: "middle" });
  c.fillText(text, tx, ty);
  c.beginPath();
  c.moveTo(x0, y0);
  c.lineTo(x1, y1);
  c.stroke();
}
