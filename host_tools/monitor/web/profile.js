// Depth along a line as a chart: the surface, its uncertainty as a band, gaps as gaps.
import { roundStep } from "./map_store.js";

const SVG = "http://www.w3.org/2000/svg";

function add(parent, tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

/** Runs of samples with a value. */
function runs(samples) {
  const found = [];
  let run = null;
  for (const sample of samples) {
    if (!sample.cell) run = null;
    else if (run) run.push(sample);
    else found.push((run = [sample]));
  }
  return found;
}

/** Draws into `box`, in place of what is there; `onPoint(place or null)` follows the pointer along the chart, which stays
 * where it was when the chart is drawn again. */
export function drawProfile(box, samples, onPoint) {
  const width = Math.max(box.clientWidth || 520, 240), height = 150, left = 58, right = 10, top = 10, bottom = 24;
  const known = samples.filter((sample) => sample.cell);
  box.replaceChildren();
  const svg = add(box, "svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "Depth along the line from A to B" });
  if (!known.length) {
    add(svg, "text", { x: width / 2, y: height / 2, "text-anchor": "middle", class: "axis" }, "Nothing of this line is surveyed");
    return;
  }
  const length = samples[samples.length - 1].alongM;
  let low = Math.min(...known.map((s) => s.cell.depthM - s.cell.sigmaM)), high = Math.max(...known.map((s) => s.cell.depthM + s.cell.sigmaM));
  const pad = Math.max((high - low) * 0.08, 0.05);
  low -= pad;
  high += pad;
  const x = (alongM) => left + ((width - left - right) * alongM) / Math.max(length, 1e-9);
  const y = (depthM) => top + ((height - top - bottom) * (depthM - low)) / (high - low);
  const stepY = roundStep((high - low) / 3.5), stepX = roundStep(length / (width < 420 ? 3 : 6));
  const shallowest = Math.ceil(low / stepY) * stepY;
  for (let depth = shallowest; depth <= high; depth += stepY) {
    add(svg, "line", { x1: left, x2: width - right, y1: y(depth), y2: y(depth), class: "grid" });
    add(svg, "text", { x: left - 6, y: y(depth) + 4, "text-anchor": "end", class: "axis" }, `${depth.toFixed(stepY < 1 ? (stepY < 0.1 ? 2 : 1) : 0)}${depth === shallowest ? " m" : ""}`);
  }
  for (let along = 0; along <= length; along += stepX) {
    add(svg, "text", { x: x(along), y: height - 6, "text-anchor": "middle", class: "axis" }, `${along.toFixed(stepX < 1 ? 1 : 0)}${along === 0 ? " m" : ""}`);
  }
  for (const run of runs(samples)) {
    const upper = run.map((s) => `${x(s.alongM)},${y(s.cell.depthM - s.cell.sigmaM)}`);
    const lower = run.map((s) => `${x(s.alongM)},${y(s.cell.depthM + s.cell.sigmaM)}`).reverse();
    add(svg, "polygon", { points: [...upper, ...lower].join(" "), class: "band" });
    add(svg, "polyline", { points: run.map((s) => `${x(s.alongM)},${y(s.cell.depthM)}`).join(" "), class: "depth" });
  }
  add(svg, "text", { x: left + 2, y: top + 8, class: "end" }, "A");
  add(svg, "text", { x: width - right - 2, y: top + 8, "text-anchor": "end", class: "end" }, "B");
  const cursor = add(svg, "line", { x1: 0, x2: 0, y1: top, y2: height - bottom, class: "cursor", visibility: "hidden" });
  const value = add(svg, "text", { x: 0, y: top + 8, class: "value" });
  const show = (share) => {
    const sample = samples[Math.round(share * (samples.length - 1))];
    const at = sample && x(sample.alongM);
    cursor.setAttribute("visibility", sample ? "visible" : "hidden");
    value.textContent = !sample ? "" : sample.cell ? `${sample.cell.depthM.toFixed(2)} m at ${sample.alongM.toFixed(1)} m` : "not surveyed";
    if (!sample) return;
    cursor.setAttribute("x1", at);
    cursor.setAttribute("x2", at);
    value.setAttribute("x", at + (at > width / 2 ? -6 : 6));
    value.setAttribute("text-anchor", at > width / 2 ? "end" : "start");
  };
  const point = (share) => {
    box.pointedAt = share;
    show(share);
    onPoint(samples[Math.round(share * (samples.length - 1))] ?? null);
  };
  svg.addEventListener("pointermove", (event) => {
    const rect = svg.getBoundingClientRect();
    const px = ((event.clientX - rect.left) / rect.width) * width - left;
    point(Math.min(Math.max(px / (width - left - right), 0), 1));
  });
  svg.addEventListener("pointerleave", () => point(NaN));
  show(box.pointedAt ?? NaN);
}
