"use strict";
// Draws precomputed frames: sliders select a frame, the pointer picks its points.

const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const REACH = 14; // largest distance of a picked point, in pixels
const LEAD = 6; // advantage of a marker over a line, in pixels
const element = (id) => document.getElementById(id);

// --- numbers -------------------------------------------------------------------------------

// Columns of a stored table: 32-bit differences from the first value.
const arrays = data.arrays.map((stored) => {
  let columns = null;
  return () => {
    if (columns) return columns;
    const bytes = Uint8Array.from(atob(stored.text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    columns = stored.first.map((first, k) =>
      Float64Array.from({ length: stored.rows }, (_, row) =>
        first + view.getFloat32(4 * (k * stored.rows + row), true)));
    return columns;
  };
});

const shown = (value, digits = 6) => String(Number(value.toPrecision(digits))).replaceAll("-", "−");

// About `count` ticks at 1, 2 or 5 times a power of ten.
function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) || 10);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
    found.push({ value: k * step, text: shown(k * step, 10) });
  }
  return found;
}

// --- descriptions of table rows ------------------------------------------------------------

function wordAt(table, row) {
  let word = "";
  for (const [start, text] of table.words) if (start <= row) word = text;
  return word;
}

function spectrum(columns, first, count, row) {
  const words = [];
  for (let k = 0; k < count; k += 1) {
    const [re, im] = [columns[first + k][row], columns[first + count + k][row]];
    if (Number.isNaN(re)) continue;
    if (im === 0) words.push(shown(re));
    else if (im > 0) words.push(`${shown(re)} ± ${shown(im)}i`);
  }
  return words.length ? `λ = ${words.join(", ")}` : "";
}

function rowText(table, row) {
  const columns = arrays[table.array]();
  const lines = table.lines.map((group) =>
    group.map((k) => `${table.names[k]} = ${shown(columns[k][row])}`).join(", "));
  lines.push(spectrum(columns, table.names.length, table.eigenvalues, row), wordAt(table, row));
  return lines.filter((line) => line).join("\n");
}

function rowCall(table, row) {
  const columns = arrays[table.array]();
  if (table.kind === "run") return `run(${columns[0][row]})`;
  const values = table.quoted.map((name, k) => `${name}: ${columns[k][row]}`);
  return `diagram.nearest(**{${values.join(", ")}})`;
}

// --- drawing -------------------------------------------------------------------------------

function make(tag, attributes, parent, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.append(node);
  return node;
}

// Outlines of markers about (0, 0), of radius 1.
function polygon(corners, turn, inner = 1) {
  const count = inner === 1 ? corners : 2 * corners;
  const points = Array.from({ length: count }, (_, k) => {
    const angle = turn + (2 * Math.PI * k) / count;
    const radius = k % 2 && inner !== 1 ? inner : 1;
    return `${(radius * Math.sin(angle)).toFixed(3)} ${(-radius * Math.cos(angle)).toFixed(3)}`;
  });
  return `M${points.join("L")}Z`;
}
const PLUS = "M-.33-1H.33V-.33H1V.33H.33V1H-.33V.33H-1V-.33H-.33Z";
const CROSS = "M-.9-.45L-.45-.9L0-.45L.45-.9L.9-.45L.45 0L.9.45L.45.9L0 .45L-.45.9L-.9.45L-.45 0Z";
const SHAPES = {
  o: "M0-1A1 1 0 1 1-.001-1Z", s: "M-.85-.85H.85V.85H-.85Z", D: polygon(4, 0), "^": polygon(3, 0),
  v: polygon(3, Math.PI), P: PLUS, X: CROSS, "*": polygon(5, 0, 0.4), p: polygon(5, 0),
  h: polygon(6, 0), "8": polygon(8, Math.PI / 8), H: polygon(6, Math.PI / 6), "<": polygon(3, -Math.PI / 2),
  ">": polygon(3, Math.PI / 2), d: "M0-1L.6 0L0 1L-.6 0Z", x: "M-.8-.8L.8.8M-.8.8L.8-.8",
  "|": "M0-1V1", "+": "M-1 0H1M0-1V1", 1: "M0 0V1M0 0L-.87-.5M0 0L.87-.5",
  2: "M0 0V-1M0 0L-.87 .5M0 0L.87 .5", 3: "M0 0H-1M0 0L.5-.87M0 0L.5 .87", 4: "M0 0H1M0 0L-.5-.87M0 0L-.5 .87",
  $a$: "M.6-.6V.7M.6 .05A.6.6 0 1 1 .599 .04", $c$: "M.6-.6A.85.85 0 1 0 .6 .6",
  $g$: "M.6-.8V.6A.6.5 0 0 1-.6 .7M.6-.2A.6.6 0 1 1 .599-.21",
  $s$: "M.6-.7C-.9-1.3-.9 0 0 0S.9 1.2-.6 .8",
};

function marker(look, x, y, parent) {
  const size = 0.95 * look.size;
  const open = "x|+1234".includes(look.marker) || look.marker[0] === "$";
  return make("path", {
    d: SHAPES[look.marker], transform: `translate(${x} ${y}) scale(${size})`,
    fill: open ? "none" : look.filled ? look.color : "#fff",
    stroke: open || !look.filled ? look.color : "#fff",
    "stroke-width": (look.filled && !open ? 0.8 : 1.2) / size,
  }, parent);
}

function stroke(look) {
  const width = 1.35 * look.width;
  return {
    fill: "none", stroke: look.color, "stroke-width": width, "stroke-opacity": look.opacity,
    "stroke-dasharray": look.dash.map((part) => part * width).join(" "), "stroke-linejoin": "round",
  };
}

// Limits of one axis: those of the frame, or the range of the data with a margin.
function limits(panel, axis) {
  if (axis === "x" && panel.over) return panel.over;
  let [low, high] = [Infinity, -Infinity];
  const take = (value) => {
    if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
  };
  for (const line of panel.lines) {
    arrays[line.tableOf.array]()[line[axis]].subarray(line.start, line.stop).forEach(take);
  }
  for (const mark of panel.marks) mark.points.forEach((at) => take(at[axis === "x" ? 0 : 1]));
  if (low > high) return [0, 1];
  const flat = high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1e-300);
  const margin = flat ? 0.1 * Math.abs(low) || 1 : 0.05 * (high - low);
  return axis === "x" && panel.x === "t" ? [low, high] : [low - margin, high + margin];
}

function drawPanel(panel, holder, tall) {
  const width = Math.max(holder.clientWidth, 240);
  const height = Math.round(tall ? Math.min(Math.max(0.8 * width, 300), 520) : Math.max(0.42 * width, 190));
  const box = { left: 58, right: width - 12, top: 14, bottom: height - 44 };
  const svg = make("svg", {
    viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${panel.names[1]} over ${panel.names[0]}`,
  });
  const [x0, x1] = limits(panel, "x");
  const [y0, y1] = limits(panel, "y");
  const toX = (value) => box.left + ((value - x0) / (x1 - x0)) * (box.right - box.left);
  const toY = (value) => box.bottom - ((value - y0) / (y1 - y0)) * (box.bottom - box.top);
  const clip = `clip-${Math.random().toString(36).slice(2)}`;
  make("rect", {
    x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top,
  }, make("clipPath", { id: clip }, make("defs", {}, svg)));
  const ink = make("g", { "clip-path": `url(#${clip})` }, svg);
  const names = [];
  for (const band of panel.bands) drawBand(band, { toX, toY, box }, ink, names);
  const places = [];
  for (const line of panel.lines) places.push(drawLine(line, toX, toY, ink));
  if (panel.now !== undefined) {
    make("path", { d: `M${toX(panel.now)} ${box.top}V${box.bottom}`, ...stroke(data.looks.now) }, ink);
  }
  for (const mark of panel.marks) {
    const at = { points: [], lead: LEAD };
    for (const [x, y, text, call, label] of mark.points) {
      const [px, py] = [toX(x), toY(y)];
      marker(data.looks[mark.look], px, py, ink);
      at.points.push({ x: px, y: py, about: () => ({ text, call }) });
      if (label) names.push([label, px + (px > box.right - 40 ? -8 : 8), py - 8, px > box.right - 40 ? "end" : "start", ""]);
    }
    places.push(at);
  }
  for (const [text, x, y, anchor, kind] of names) {
    make("text", { x, y, "text-anchor": anchor, class: kind }, svg, text);
  }
  drawFrame(panel, { x0, x1, y0, y1, toX, toY, box, height }, svg);
  holder.replaceChildren(svg);
  return { svg, places, width, panel, x: [x0, x1], y: [y0, y1], box };
}

function drawLine(line, toX, toY, parent) {
  const columns = arrays[line.tableOf.array]();
  const points = [];
  const jumps = new Set(line.tableOf.jumps);
  let [path, gaps, pen, last] = ["", "", "M", ""];
  for (let row = line.start; row < line.stop; row += 1) {
    const [x, y] = [toX(columns[line.x][row]), toY(columns[line.y][row])];
    // the line is broken at values that are not finite or far outside
    if (!(Math.abs(x) < 1e6 && Math.abs(y) < 1e6)) { pen = "M"; continue; }
    const place = `${x.toFixed(2)} ${y.toFixed(2)}`;
    if (pen === "L" && jumps.has(row)) {
      gaps += `M${last}L${place}`;
      pen = "M";
    }
    path += pen + place;
    [pen, last] = ["L", place];
    points.push({ x, y, about: () => ({ text: rowText(line.tableOf, row), call: rowCall(line.tableOf, row) }) });
  }
  const look = data.looks[line.look];
  make("path", { d: path || "M0 0", class: line.look, ...stroke(look) }, parent);
  if (gaps) make("path", { d: gaps, class: "reset", ...stroke({ ...look, ...data.looks.reset }) }, parent);
  return { points, lead: 0 };
}

function drawBand(band, { toX, toY, box }, parent, names) {
  const { fills, color } = data.looks.bands;
  const across = band.axis === "x";
  const [from, to] = across ? [box.left, box.right] : [box.bottom, box.top];
  const inside = (place) => Math.min(Math.max(place, Math.min(from, to)), Math.max(from, to));
  const edges = [from, ...band.levels.map((level) => inside(across ? toX(level) : toY(level))), to];
  for (let k = 0; k + 1 < edges.length; k += 1) {
    const [low, high] = [Math.min(edges[k], edges[k + 1]), Math.max(edges[k], edges[k + 1])];
    const fill = fills[(edges.length - 2 - k) % fills.length];
    make("rect", across
      ? { x: low, y: box.top, width: high - low, height: box.bottom - box.top, fill }
      : { x: box.left, y: low, width: box.right - box.left, height: high - low, fill }, parent);
    if (high - low > 18 && band.names[k]) {
      names.push(across
        ? [band.names[k], (low + high) / 2, box.top + 14, "middle", "faint"]
        : [band.names[k], box.right - 6, (low + high) / 2 + 4, "end", "faint"]);
    }
  }
  for (const edge of edges.slice(1, -1)) {
    const d = across ? `M${edge} ${box.top}V${box.bottom}` : `M${box.left} ${edge}H${box.right}`;
    make("path", { d, stroke: color, "stroke-width": 0.8 }, parent);
  }
}

function drawFrame(panel, { x0, x1, y0, y1, toX, toY, box, height }, svg) {
  const line = { fill: "none", stroke: "#1a1a1a", "stroke-width": 0.9 };
  make("path", { d: `M${box.left} ${box.top}H${box.right}V${box.bottom}H${box.left}Z`, ...line }, svg);
  for (const tick of ticks(x0, x1, (box.right - box.left) / 65)) {
    make("path", { d: `M${toX(tick.value)} ${box.bottom}v4`, ...line }, svg);
    make("text", { x: toX(tick.value), y: box.bottom + 17, "text-anchor": "middle" }, svg, tick.text);
  }
  for (const tick of ticks(y0, y1, (box.bottom - box.top) / 32)) {
    make("path", { d: `M${box.left} ${toY(tick.value)}h-4`, ...line }, svg);
    make("text", { x: box.left - 7, y: toY(tick.value) + 4, "text-anchor": "end" }, svg, tick.text);
  }
  const name = { class: "axis-name", "text-anchor": "middle" };
  make("text", { x: (box.left + box.right) / 2, y: height - 8, ...name }, svg, panel.names[0]);
  const middle = (box.top + box.bottom) / 2;
  make("text", { x: 13, y: middle, transform: `rotate(-90 13 ${middle})`, ...name }, svg, panel.names[1]);
}

function drawLegend(panels) {
  const used = new Set();
  for (const panel of panels) {
    for (const part of [...panel.lines, ...panel.marks]) used.add(part.look);
    if (panel.now !== undefined) used.add("now");
  }
  element("legend").replaceChildren(...Object.keys(data.looks).filter((key) => used.has(key)).map((key) => {
    const look = data.looks[key];
    const svg = make("svg", { width: 30, height: 14 });
    if (look.marker) marker(look, 15, 7, svg);
    else make("path", { d: "M1 7H29", ...stroke(look) }, svg);
    const entry = document.createElement("span");
    entry.append(svg, look.label);
    return entry;
  }));
}

// --- the pointer ---------------------------------------------------------------------------

// The drawn point nearest to the pointer, if it is near enough.
function nearest(drawn, event) {
  const frame = drawn.svg.getBoundingClientRect();
  const scale = drawn.width / frame.width;
  const [x, y] = [(event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale];
  let best = null;
  let least = Infinity;
  for (const { points, lead } of drawn.places) {
    for (const point of points) {
      const distance = Math.hypot(point.x - x, point.y - y);
      if (distance <= REACH && distance - lead < least) [best, least] = [point, distance - lead];
    }
  }
  return best;
}

function hover(drawn, event) {
  const found = nearest(drawn, event);
  const tip = element("tip");
  tip.hidden = !found;
  if (!found) return;
  tip.textContent = found.about().text;
  const right = event.clientX + 16 + tip.offsetWidth > document.documentElement.clientWidth;
  const left = right ? Math.max(event.clientX - tip.offsetWidth - 12, 4) : event.clientX + 14;
  tip.style.left = `${left + window.scrollX}px`;
  tip.style.top = `${Math.max(event.clientY - tip.offsetHeight - 10, 4) + window.scrollY}px`;
}

function choose(drawn, event) {
  const found = nearest(drawn, event);
  if (!found) return;
  const { text, call } = found.about();
  state.chosen = { text, call };
  drawn.svg.querySelector(".ring")?.remove();
  make("circle", {
    cx: found.x, cy: found.y, r: 8, class: "ring", fill: "none", stroke: "#d55e00", "stroke-width": 2,
  }, drawn.svg);
  showCall();
}

function showCall() {
  const { frame, chosen } = state;
  element("chosen").textContent = chosen ? chosen.text : "Hover over a curve to see its values; click to select a point.";
  const point = chosen ? `\npoint = ${chosen.call}` : "";
  element("call").textContent = `${data.source}\n${frame.call}${point}`;
}

function copy() {
  document.getSelection().selectAllChildren(element("call"));
  const done = navigator.clipboard?.writeText(element("call").textContent);
  // if the browser denies access to the clipboard, the text is at least selected
  (done || Promise.reject()).catch(() => document.execCommand("copy"));
}

// --- frames --------------------------------------------------------------------------------

const state = { frame: null, drawn: [], chosen: null, at: data.sliders.map((slider) => slider.at) };

function show() {
  // the last slider varies fastest in the order of the frames
  const index = data.sliders.reduce((sum, slider, k) => sum * slider.values.length + state.at[k], 0);
  state.frame = data.frames[index];
  state.chosen = null;
  element("outcomes").textContent = state.frame.outcomes.join(" ");
  for (const panel of state.frame.panels) {
    for (const line of panel.lines) line.tableOf = state.frame.tables[line.table];
  }
  draw();
  showCall();
}

function draw() {
  const { panels } = state.frame;
  const holder = element("panels");
  holder.className = panels.length < 2 ? "single" : "";
  const main = panels.findIndex((panel) => panel.over);
  const holders = panels.map((_, k) => {
    const part = document.createElement("div");
    part.className = k === main ? "main" : "";
    return part;
  });
  holder.replaceChildren(...holders);
  element("tip").hidden = true;
  state.drawn = panels.map((panel, k) => {
    const drawn = drawPanel(panel, holders[k], k === main);
    drawn.svg.addEventListener("pointermove", (event) => hover(drawn, event));
    drawn.svg.addEventListener("pointerleave", () => { element("tip").hidden = true; });
    drawn.svg.addEventListener("click", (event) => choose(drawn, event));
    return drawn;
  });
  drawLegend(panels);
}

function addSlider(slider, k) {
  const label = document.createElement("label");
  const name = document.createElement("i");
  const input = document.createElement("input");
  const output = document.createElement("output");
  name.textContent = slider.label;
  Object.assign(input, { type: "range", min: 0, max: slider.values.length - 1, step: 1, value: slider.at });
  const showValue = () => {
    const text = shown(slider.values[state.at[k]], 5);
    output.textContent = text;
    input.setAttribute("aria-valuetext", `${slider.label} = ${text}`);
  };
  input.addEventListener("input", () => {
    state.at[k] = Number(input.value);
    showValue();
    show();
  });
  showValue();
  label.append(name, input, output);
  element("sliders").append(label);
}

element("equations").textContent = data.equations;
data.sliders.forEach(addSlider);
element("copy").addEventListener("click", copy);
let width = 0;
new ResizeObserver(() => {
  // redraw only after a change of width
  if (document.body.clientWidth !== width) {
    width = document.body.clientWidth;
    draw();
  }
}).observe(document.body);
show();
