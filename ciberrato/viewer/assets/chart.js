// The entropy curve: bits on the left, probabilities on the right, cycles below.

import { svg } from "./svg.js";

const WIDTH = 300;
const HEIGHT = 128;
const LEFT = 22;
const RIGHT = 26;
const TOP = 18;
const BOTTOM = 18;

function text(x, y, content, anchor, className = "") {
  const element = svg("text", { x, y, "text-anchor": anchor, class: className });
  element.textContent = content;
  return element;
}

/** Steps: a belief holds until the next one. */
function steps(points) {
  return points.map(([x, y], i) => (i ? `H${x.toFixed(1)}V${y.toFixed(1)}` : `M${x.toFixed(1)} ${y.toFixed(1)}`)).join("");
}

/** Draw the curves of a series of [time, entropy, peak, truth]; gives where a time is. */
export function drawCurve(container, series, cells, span) {
  const [first, last] = [Math.min(span[0], series[0]?.[0] ?? 0), Math.max(span[1], span[0] + 1)];
  const top = Math.max(1, Math.ceil(Math.log2(Math.max(2, cells))));
  const x = (time) => LEFT + ((time - first) / (last - first)) * (WIDTH - LEFT - RIGHT);
  const bits = (value) => HEIGHT - BOTTOM - (value / top) * (HEIGHT - TOP - BOTTOM);
  const share = (value) => HEIGHT - BOTTOM - value * (HEIGHT - TOP - BOTTOM);
  const hold = (points) => (points.length ? [...points, [x(last), points[points.length - 1][1]]] : points);
  const entropy = series.map(([time, value]) => [x(time), bits(value)]);
  const peak = series.map(([time, , value]) => [x(time), share(value)]);
  const truth = series.filter((row) => row[3] !== null).map((row) => [x(row[0]), share(row[3])]);
  const half = (TOP + HEIGHT - BOTTOM) / 2;
  const now = svg("path", { class: "now", d: "" });
  const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": "Entropy and probabilities over time" },
    svg("path", { class: "axis", d: `M${LEFT} ${TOP}V${HEIGHT - BOTTOM}H${WIDTH - RIGHT}V${TOP}M${LEFT} ${half}H${WIDTH - RIGHT}` }),
    text(LEFT - 5, TOP + 4, String(top), "end"), text(LEFT - 5, HEIGHT - BOTTOM, "0", "end"),
    text(WIDTH - RIGHT + 5, TOP + 4, "1", "start"), text(WIDTH - RIGHT + 5, HEIGHT - BOTTOM, "0", "start"),
    text(LEFT, HEIGHT - 4, String(first), "start"), text(WIDTH - RIGHT, HEIGHT - 4, String(last), "end"),
    text(LEFT, 9, "entropy, bits", "start", "key-entropy"), text(truth.length ? 176 : WIDTH - RIGHT, 9, "best cell", truth.length ? "end" : "end", "key-peak"),
    ...(truth.length ? [text(WIDTH - RIGHT, 9, "true cell", "end", "key-truth")] : []),
    svg("path", { class: "entropy", d: steps(hold(entropy)) }), svg("path", { class: "peak", d: steps(hold(peak)) }),
    svg("path", { class: "truth", d: steps(hold(truth)) }), now);
  container.replaceChildren(picture);
  return (time) => now.setAttribute("d", `M${x(Math.min(last, Math.max(first, time))).toFixed(1)} ${TOP}V${HEIGHT - BOTTOM}`);
}
