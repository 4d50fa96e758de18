// The page: takes what the link says into map, scene, overlay and panels, and what the pilot does into them.
import { Link } from "./link.js";
import { MapStore, roundStep, TILE_SIDE } from "./map_store.js";
import { Overlay } from "./overlay.js";
import { drawProfile } from "./profile.js";
import { SeafloorScene } from "./scene.js";
import * as words from "./words.js";

const $ = (id) => document.getElementById(id);
const EXAGGERATIONS = [1, 1.5, 2, 3, 5, 7, 10, 15, 20];
const MODES = ["depth", "uncertainty", "age", "slope"];
const SLOPES = [5, 10, 20, 30, 45, 60]; // degrees that the colours may end at
const FRESH_S = 3; // cells that changed within this belong to the beam of now

const page = {
  connected: false, state: null, store: null, epoch: -1, stale: null, track: new Float32Array(0),
  tool: "inspect", points: [], hover: null, marker: null, aim: false, follow: false, fitted: false, userMoved: false,
  mode: "depth", exaggeration: 2, contours: "auto", obstacles: false, obstacleM: NaN, fresh: [], dirty: true,
  depthFromM: NaN, depthToM: NaN, drawnMs: 0, costMs: 0,
};
const calm = matchMedia("(prefers-reduced-motion: reduce)");

let scene;
try {
  scene = new SeafloorScene($("scene"), () => { page.dirty = true; });
} catch (error) {
  showEmpty("The seafloor cannot be drawn", `${error.message} Health and messages work all the same.`);
  $("tools").inert = $("display").inert = true;
}
const overlay = scene && new Overlay($("overlay"), scene);
const link = new Link();
// For the browser's console, and for tests.
window.leadline = { page, scene, link };

// --- What comes

link.addEventListener("open", () => {
  page.connected = true;
  page.epoch = -1; // another life of the monitor counts from the beginning, and everything comes anew
  page.complete = false;
  showState();
});
link.addEventListener("closed", () => { page.connected = false; showState(); });
link.addEventListener("quiet", showState);
link.addEventListener("palettes", ({ detail }) => { scene?.setPalettes(detail); page.palettes = detail; });
link.addEventListener("state", ({ detail }) => {
  page.state = detail;
  if (page.follow && vehicle()) scene?.lookAt(vehicle());
  showState();
  // What is read stays true while the map changes and time goes on.
  if (page.obstacles) showObstacles();
  if (page.store && page.points.length) showReadout();
  // Drawn anew only when it would look different: batteries are on board.
  const here = JSON.stringify([detail.vehicle?.pose, detail.vehicle?.beams, vehicle()?.silent, page.mode === "age" && nowS()]);
  page.dirty ||= page.drawnHere !== here;
  page.drawnHere = here;
});
link.addEventListener("tiles", ({ detail }) => {
  begin(detail.epoch);
  if (!page.store) return;
  for (const message of detail.tiles) {
    const id = message[0], tile = page.store.setTile(message);
    if (!tile) continue;
    scene?.setTile(id, tile);
    page.stale?.delete(id);
    noteFresh(id, tile);
  }
  page.received = (page.received ?? 0) + detail.tiles.length;
  page.mapChanged = true;
  page.dirty = true;
});
link.addEventListener("track", ({ detail }) => {
  begin(detail.epoch);
  const grown = new Float32Array(4 * detail.first + detail.points.length);
  grown.set(page.track.subarray(0, 4 * detail.first));
  grown.set(detail.points, 4 * detail.first);
  page.track = grown;
  page.dirty = true;
});
link.addEventListener("complete", ({ detail }) => {
  begin(detail.epoch);
  // What the map before had and this one has not (a recording that went back).
  for (const id of page.stale ?? []) {
    page.store?.removeTile(id);
    scene?.clearTile(id);
  }
  page.stale = null;
  page.mapChanged = true;
  page.dirty = true;
  page.complete = true;
});

/** Another map, or the same from another moment: the latter stays until its tiles came anew, so that nothing flickers. */
function begin(epoch) {
  const map = page.state?.map;
  if (epoch === page.epoch || !map) return;
  const same = page.store && page.survey === JSON.stringify([map.survey_id, map.session, map.size_cells, map.origin_mm, map.cell_mm]);
  page.epoch = epoch;
  page.track = new Float32Array(0);
  page.fresh = [];
  page.complete = false;
  if (same) {
    page.stale = new Set(page.store.tiles.keys());
    return;
  }
  page.survey = JSON.stringify([map.survey_id, map.session, map.size_cells, map.origin_mm, map.cell_mm]);
  page.store = new MapStore(map);
  page.stale = null;
  page.fitted = page.userMoved = false;
  setPoints([]);
  scene?.begin(page.store);
}

/** Cells that changed in the newest moment: a few of them, for the beam. */
function noteFresh(id, tile) {
  const store = page.store;
  for (let k = 0; k < 256; k += 7) {
    if (!(tile[k] & 31)) continue;
    const timeS = tile[256 + k] / 10;
    const newest = page.fresh.length ? page.fresh[page.fresh.length - 1].timeS : -Infinity;
    if (timeS < newest) continue;
    page.fresh.push({
      timeS, downM: store.depthOf(tile[k]),
      northM: store.originM[0] + (Math.floor(id / store.tilesEast) * TILE_SIDE + Math.floor(k / TILE_SIDE) + 0.5) * store.cellM,
      eastM: store.originM[1] + ((id % store.tilesEast) * TILE_SIDE + (k % TILE_SIDE) + 0.5) * store.cellM,
    });
  }
  if (page.fresh.length > 40) page.fresh.splice(0, page.fresh.length - 40);
}

function nowS() {
  return page.state?.vehicle?.t_s ?? 0;
}

function vehicle() {
  const v = page.state?.vehicle;
  if (!v || !page.store) return null;
  const [northM, eastM, downM] = v.pose.position_mm.map((mm) => mm / 1000);
  if (!(v.pose.validity & 1) && !northM && !eastM) return null;
  const below = page.store.at(northM, eastM);
  const beams = v.beams.map((beam) => {
    const azimuth = (beam.azimuth_deg * Math.PI) / 180, depression = (beam.depression_deg * Math.PI) / 180;
    const outM = beam.range_m * Math.cos(depression);
    return { northM: northM + outM * Math.cos(azimuth), eastM: eastM + outM * Math.sin(azimuth), downM: downM + beam.range_m * Math.sin(depression) };
  });
  return { northM, eastM, downM, beams, headingDeg: v.pose.heading_deg, pitchDeg: v.pose.pitch_deg, rollDeg: v.pose.roll_deg,
           valid: (v.pose.validity & 1) !== 0, altitudeM: below ? below.depthM - downM : null,
           silent: words.silent(page.state) && `${words.duration(page.state.link.silent_s)} ago` };
}

// --- What is drawn

function margins() {
  const panel = $("panel").getBoundingClientRect(), bar = $("bar").getBoundingClientRect();
  const tools = $("tools").getBoundingClientRect(), legend = $("legend").getBoundingClientRect();
  const narrow = innerWidth < 760;
  const below = [$("readout"), $("legend"), ...(narrow ? [] : [$("player")]), ...(narrow ? [$("panel"), $("tools")] : [])]
    .filter((element) => !element.hidden && element.getBoundingClientRect().height > 0)
    .map((element) => innerHeight - element.getBoundingClientRect().top)
    .filter((height) => height < 0.75 * innerHeight);
  const side = !narrow && !$("panel").classList.contains("closed");
  const player = $("player").getBoundingClientRect();
  const top = narrow && player.height ? player.bottom : bar.bottom;
  return { top, left: narrow ? 0 : tools.right, right: side ? innerWidth - panel.left : 0,
           bottom: Math.max(0, ...below), legend };
}

/** Ends of the colours, on round numbers: a map that grows does not move them by every cell. */
function colourRange() {
  const store = page.store;
  if (!store?.shown) return [0, 1];
  if (page.mode === "depth") {
    const low = store.depthQuantile(0.005), high = store.depthQuantile(0.995);
    const step = roundStep(Math.max(high - low, 0.1) / 20);
    const from = Number.isFinite(page.depthFromM) ? page.depthFromM : Math.floor(low / step) * step;
    const to = Number.isFinite(page.depthToM) ? page.depthToM : Math.ceil(high / step) * step;
    return to > from ? [from, to] : [from, from + 0.1];
  }
  if (page.mode === "uncertainty") return [store.sigmaQuantile(0.01), Math.max(store.sigmaQuantile(0.99), store.sigmaQuantile(0.01) * 2)];
  if (page.mode === "age") return [0, Math.max(nowS() - store.firstTimeDs / 10, 10)];
  const steep = store.slopeQuantile(0.98);
  return [0, SLOPES.find((slope) => slope >= steep) ?? 90];
}

function contourStep(range) {
  if (page.contours !== "auto") return Number(page.contours);
  return page.mode === "depth" || !page.store?.shown ? roundStep(Math.max(range[1] - range[0], 0.1) / 12)
    : roundStep(Math.max(page.store.depthQuantile(0.995) - page.store.depthQuantile(0.005), 0.1) / 12);
}

function frame(nowMs) {
  requestAnimationFrame(frame);
  if (page.costMs === null) page.costMs = nowMs - page.drawnMs;
  if (!scene || !page.dirty) return;
  // While a map is still loading, drawing takes a third of the time at most: slow graphics do not hold it up.
  if (!page.complete && nowMs - page.drawnMs < 3 * page.costMs) return;
  page.dirty = false;
  page.drawnMs = nowMs;
  page.costMs = null; // the next call comes when this picture is done
  const store = page.store;
  const free = margins();
  if (page.userMoved) scene.glide = null;
  if (scene.glide) scene.glideOn(nowMs);
  else if (store && !page.userMoved && (!page.fitted || (page.mapChanged && !scene.framed(free, vehicle())))) fit(page.fitted && page.complete);
  const range = colourRange();
  const shared = scene.shared;
  shared.mode.value = MODES.indexOf(page.mode);
  shared.range.value.set(...range);
  shared.palette.value = scene.palettes[page.mode === "depth" ? "depth" : "uncertainty"] ?? null;
  shared.exaggeration.value = page.exaggeration;
  shared.now_ds.value = nowS() * 10;
  shared.contour_m.value = contourStep(range);
  shared.obstacle_m.value = page.obstacles && Number.isFinite(page.obstacleM) ? page.obstacleM : -1e9;
  if (store && shared.palette.value) scene.render();
  const here = vehicle();
  overlay.middle = middle(free);
  overlay.draw({ track: page.track, vehicle: here, tool: page.tool, points: page.points, hover: page.hover, marker: page.marker,
    margins: free, aim: page.aim, showTrack: $("track").checked, fresh: page.fresh.filter((p) => nowS() - p.timeS < FRESH_S) });
  page.mapChanged = false;
  showLegend(range);
}

/** The middle of what the panels leave free: what Enter reads. */
function middle(free) {
  return { x: (free.left + scene.width - free.right) / 2, y: (free.top + scene.height - free.bottom) / 2 };
}

/** All of the map into what is free; gliding where a view that was right has become wrong by itself. */
function fit(glide = false) {
  if (!scene || !page.store) return;
  page.fitted = page.store.shown;
  if (glide && !calm.matches) scene.glideTo(margins(), vehicle());
  else scene.fit(margins(), vehicle());
}

function resize() {
  if (!scene) return;
  const width = innerWidth, height = innerHeight, ratio = Math.min(devicePixelRatio || 1, 2);
  scene.resize(width, height, ratio);
  overlay.resize(width, height, ratio);
  if (!page.userMoved) fit();
  page.dirty = true;
}

// --- Panels

function showEmpty(title, text) {
  $("empty").hidden = !title;
  $("empty").querySelector("strong").textContent = title ?? "";
  $("empty").querySelector("span").textContent = text ?? "";
}

/** What the page knows of its own connection (words.js). */
function connection() {
  // The same second, said again, stays the same.
  const agoS = page.state?.link.silent_s ?? 0, atMs = Date.now() - agoS * 1000;
  if (!(Math.abs(atMs - page.silentAtMs) < 1500)) {
    page.silentAtMs = atMs;
    page.silentSince = words.timeOfDay(agoS);
  }
  return { connected: page.connected, quietS: link.quietS, silentSince: page.silentSince };
}

function showState() {
  const { state } = page, of = connection();
  const now = words.stateWords(state, of);
  $("state").dataset.kind = now.kind;
  $("state").querySelector("span").textContent = now.words;
  // For who listens: the seconds that go by are no news.
  const heard = now.words.replace(/ for .*/, "");
  if ($("state-heard").textContent !== heard) $("state-heard").textContent = heard;
  document.title = now.kind === "ok" ? "Leadline" : `${now.words} · Leadline`;
  if (scene) {
    const empty = words.emptyWords(state, of);
    const hasMap = page.store?.shown;
    if (empty && !hasMap) showEmpty(...empty);
    else showEmpty(null);
  }
  $("survey").textContent = state?.map ? (state.map.name || `Survey ${state.map.survey_id}`) : "";
  if (!state) return;
  const stale = words.staleWords(state, of);
  document.body.classList.toggle("stale", stale !== null);
  const alarms = $("alarms");
  const lines = stale ? [stale] : [];
  if (state.vehicle?.alarm_text) lines.push(...state.vehicle.alarm_text.split(", "));
  const text = lines.map((line) => line[0].toUpperCase() + line.slice(1));
  if (alarms.dataset.text !== text.join("\n")) {
    alarms.dataset.text = text.join("\n");
    alarms.replaceChildren(...text.map((line) => make("p", line)));
  }
  showFigures(words.healthRows(state));
  showPlayer(state.player);
  showNotices(state.notices);
  const age = document.querySelector("[name=mode][value=age]");
  age.disabled = Boolean(state.stored);
  age.closest("label").title = state.stored ? "A store keeps no times of cells" : "";
  if (state.stored && page.mode === "age") setMode("depth");
}

function make(tag, text, className) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (className) element.className = className;
  return element;
}

/** Rows are kept and changed in place: what is being read does not jump. */
function showFigures(rows) {
  const list = $("figures");
  for (const element of [...list.children]) if (!rows.some((row) => row.id === element.dataset.id)) element.remove();
  rows.forEach((row, i) => {
    let element = list.querySelector(`[data-id="${row.id}"]`);
    if (!element) {
      element = make("div");
      element.dataset.id = row.id;
      element.append(make("dt", row.label), make("dd"), make("small"), make("meter"));
    }
    if (list.children[i] !== element) list.insertBefore(element, list.children[i] ?? null);
    element.dataset.level = row.level;
    const set = (selector, text) => {
      const part = element.querySelector(selector);
      if (part.textContent !== text) part.textContent = text;
    };
    set("dd", row.words);
    set("small", row.detail);
    const meter = element.querySelector("meter");
    meter.hidden = row.share === null;
    meter.high = 0.9;
    meter.value = Math.min(row.share ?? 0, 1);
  });
}

function showNotices(notices) {
  const newest = notices.length ? notices[notices.length - 1].number : 0;
  if (page.newestNotice === newest) return;
  page.newestNotice = newest;
  const kinds = ["info", "warning", "error"];
  $("notices").replaceChildren(...[...notices].reverse().map((notice) => {
    const item = make("li", notice.text, kinds[notice.severity] ?? "info");
    if (!page.state.player) item.prepend(make("time", words.timeOfDay(notice.ago_s)));
    return item;
  }));
  if (!notices.length) $("notices").replaceChildren(make("li", "Nothing was said yet."));
}

function showPlayer(player) {
  $("player").hidden = !player;
  if (!player) return;
  const slider = $("time");
  slider.max = player.length_s;
  if (!page.sliding) slider.value = player.position_s;
  $("time-out").textContent = `${words.clock(page.sliding ? Number(slider.value) : player.position_s)} / ${words.clock(player.length_s)}`;
  $("play").dataset.playing = player.playing;
  $("play").setAttribute("aria-label", player.playing ? "Pause (space)" : "Play (space)");
}

function showLegend(range) {
  const store = page.store;
  $("legend").hidden = !store?.shown || !page.palettes;
  if ($("legend").hidden) return;
  const titles = { depth: "Depth, m", uncertainty: "Uncertainty (1 σ), m", age: "Age", slope: "Slope" };
  $("legend-title").textContent = titles[page.mode];
  if (page.drawnPalette !== page.mode) {
    page.drawnPalette = page.mode;
    const context = $("legend-bar").getContext("2d"), image = context.createImageData(256, 1);
    const palette = page.palettes[page.mode === "depth" ? "depth" : "uncertainty"];
    for (let i = 0; i < 256; i++) image.data.set([...palette.slice(3 * i, 3 * i + 3), 255], 4 * i);
    context.putImageData(image, 0, 0);
  }
  const digits = range[1] - range[0] < 1 ? 2 : range[1] - range[0] < 20 ? 1 : 0;
  const tick = { depth: (v) => v.toFixed(digits), uncertainty: (v) => v.toFixed(v < 0.1 ? 3 : 2),
                 age: (v) => (v ? words.duration(v) : "now"), slope: (v) => `${v.toFixed(0)}°` }[page.mode];
  const ticks = [0, 0.5, 1].map((share) => tick(range[0] + (range[1] - range[0]) * share));
  const shown = ticks.join("|");
  if ($("legend-ticks").dataset.shown !== shown) {
    $("legend-ticks").dataset.shown = shown;
    $("legend-ticks").replaceChildren(...ticks.map((text) => make("span", text)));
  }
  const step = scene.shared.contour_m.value;
  const notes = [];
  // Coarse cells have none: a flat one at a contour's depth would be one altogether.
  if (step && store.known) notes.push(`Contours every ${step >= 1 ? step : step.toFixed(step < 0.1 ? 2 : 1)} m`);
  if (!scene.mapView && page.exaggeration !== 1) notes.push(`heights × ${page.exaggeration}`);
  if (store.coarse) notes.push(`hatched: coarse so far${step && store.known ? ", without contours" : ""}`);
  if (page.state?.stored?.disputed_cells) notes.push("checkered: surveys disagree");
  const note = notes.join(" · ");
  if ($("legend-note").textContent !== note) $("legend-note").textContent = note;
}

function showObstacles() {
  const text = $("obstacle-words");
  if (!page.obstacles || !page.store || !Number.isFinite(page.obstacleM)) {
    text.textContent = "";
    return;
  }
  const found = page.store.obstacles(page.obstacleM);
  if (!found.count) {
    text.textContent = "Nothing known rises above it.";
    return;
  }
  const here = vehicle();
  let where = "";
  if (here) {
    const n = found.northM - here.northM, e = found.eastM - here.eastM;
    where = `, ${words.metres(Math.hypot(n, e), 0)} from the vehicle at ${words.bearing(n, e)}`;
  }
  const said = `${words.grouped(found.count)} cells; the shallowest ${found.depthM.toFixed(2)} m${where}.`;
  if (text.textContent !== said) text.textContent = said;
}

// --- Measuring

const HINTS = {
  profile: ["Profile", "Set the line's first point.", "Set its second point."],
  distance: ["Distance", "Set the first point.", "Set the next point."],
  area: ["Area", "Set the first corner.", "Set the next corner."],
};

function setTool(tool) {
  page.tool = tool;
  for (const button of document.querySelectorAll("[data-tool]")) button.setAttribute("aria-pressed", button.dataset.tool === tool);
  setPoints([]);
}

function setPoints(points) {
  page.points = points;
  page.hover = page.marker = null;
  showReadout();
  page.dirty = true;
}

function addPoint(place) {
  if (!place || !page.store) return;
  if (page.tool === "inspect") setPoints([place]);
  else if (page.tool === "profile" && page.points.length >= 2) setPoints([place]);
  else setPoints([...page.points, place]);
  keepInSight();
}

/** Moves the view where what was just drawn lies behind the figures about it, as far as its other points stay in sight. */
function keepInSight() {
  const box = $("readout").getBoundingClientRect(), border = 24;
  const at = page.points.map((point) => scene.project({ ...point, downM: page.store.at(point.northM, point.eastM)?.depthM ?? point.downM }))
    .filter((spot) => spot);
  const hidden = at.filter(({ x, y }) => y > box.top - border && x > box.left - border && x < box.right + border);
  if (!box.height || page.points.length < 2 || !hidden.length) return;
  const byPx = Math.min(Math.max(...hidden.map(({ y }) => y)) - box.top + border, Math.min(...at.map(({ y }) => y)) - margins().top - border);
  if (byPx > 0) scene.nudge(0, -byPx / scene.height);
}

/** What is read: title, figures [label, text, id], a hint, and a chart's samples. */
function readout() {
  const { tool, points, store } = page;
  if (tool === "inspect") return readPoint(points[0]);
  if (tool === "profile" && points.length === 2) {
    const samples = store.profile(points[0], points[1]);
    const known = samples.filter((sample) => sample.cell);
    const figures = [];
    if (known.length) {
      const depths = known.map((sample) => sample.cell.depthM);
      figures.push(["Shallowest", `${Math.min(...depths).toFixed(2)} m`], ["Deepest", `${Math.max(...depths).toFixed(2)} m`]);
    }
    figures.push(["Surveyed", `${Math.round((100 * known.length) / samples.length)} %`]);
    return { title: `Profile, ${words.metres(samples[samples.length - 1].alongM, 1)}`, figures, samples };
  }
  const hints = HINTS[tool], figures = [];
  let title = hints[0];
  if (tool === "distance" && points.length > 1) {
    let flat = 0, ground = 0, whole = true;
    for (let i = 1; i < points.length; i++) {
      const run = Math.hypot(points[i].northM - points[i - 1].northM, points[i].eastM - points[i - 1].eastM);
      const a = store.at(points[i - 1].northM, points[i - 1].eastM), b = store.at(points[i].northM, points[i].eastM);
      flat += run;
      if (a && b) ground += Math.hypot(run, b.depthM - a.depthM);
      else whole = false;
    }
    title = words.metres(flat);
    if (whole) figures.push(["Point to point", words.metres(ground)]);
    const last = points[points.length - 1], before = points[points.length - 2];
    figures.push(["Last bearing", words.bearing(last.northM - before.northM, last.eastM - before.eastM)]);
  } else if (tool === "area" && points.length > 2) {
    const area = store.area(points);
    title = words.squareMetres(area.squareM);
    figures.push(["Surveyed", `${Math.round(100 * area.known)} %`]);
  }
  return { title, figures, hint: points.length ? hints[2] : hints[1] };
}

function readPoint(point) {
  const cell = page.store.shownAt(point.northM, point.eastM);
  const figures = [];
  if (cell?.coarse) figures.push(["Coarse so far", "mean of 4 × 4 cells; theirs are still to come", "read-coarse"]);
  else if (cell) {
    const known = cell.timeS > 0 && nowS() >= cell.timeS;
    figures.push(["Last seen", known ? `${words.duration(nowS() - cell.timeS)} ago` : "time not known", "read-age"]);
    if (cell.secondSurface) figures.push(["Column", "a second surface stands in it"]);
    if (cell.disputed) figures.push(["Surveys", "disagree here; this is the shallowest", "read-disputed"]);
  }
  figures.push(["North, east", `${point.northM.toFixed(1)} m, ${point.eastM.toFixed(1)} m`, "read-place"]);
  const degrees = words.geodetic(page.state?.map, point.northM, point.eastM);
  if (degrees) figures.push(["Position", `${words.degrees(degrees.lat, "N", "S")}, ${words.degrees(degrees.lon, "E", "W")}`]);
  const digits = cell?.coarse ? 1 : 2;
  const title = cell ? `${cell.coarse ? "About " : ""}${cell.depthM.toFixed(digits)} m ± ${words.sigma(cell.sigmaM)}` : "Not surveyed";
  return { title, figures };
}

/** Figures are changed in place: what is being read, selected or pointed at stays. */
function showReadout() {
  const box = $("readout"), body = $("readout-body"), { tool, points } = page;
  box.hidden = tool === "inspect" && !points.length;
  if (box.hidden) return;
  const { title, figures, hint, samples } = readout();
  box.classList.toggle("wide", samples !== undefined);
  const heading = box.querySelector("h2");
  if (heading.textContent !== title) heading.textContent = title;
  const shape = JSON.stringify([tool, hint, figures.map(([label]) => label), samples !== undefined]);
  if (body.dataset.shape !== shape) {
    body.dataset.shape = shape;
    const list = make("dl");
    for (const [label, , id] of figures) {
      const row = make("div"), value = make("dd");
      if (id) value.id = id;
      row.append(make("dt", label), value);
      list.append(row);
    }
    body.replaceChildren(...(samples ? [make("div", undefined, "chart")] : []), list, ...(hint ? [make("p", hint, "hint")] : []));
  }
  const values = body.querySelectorAll("dd");
  figures.forEach(([, text], i) => { if (values[i].textContent !== text) values[i].textContent = text; });
  if (samples) {
    drawProfile(body.querySelector(".chart"), samples, (marker) => {
      page.marker = marker;
      page.dirty = true;
    });
  }
}

// --- What the pilot does

function setView(map) {
  scene?.setView(map);
  $("view-3d").setAttribute("aria-pressed", !map);
  $("view-map").setAttribute("aria-pressed", map);
  document.body.classList.toggle("map-view", map);
  if (!page.userMoved) fit();
  page.dirty = true;
}

function setMode(mode) {
  if (mode === "age" && page.state?.stored) return; // a store keeps no times of cells
  page.mode = mode;
  document.querySelector(`[name=mode][value=${mode}]`).checked = true;
  page.dirty = true;
}

function setExaggeration(index) {
  const at = Math.min(Math.max(index, 0), EXAGGERATIONS.length - 1);
  $("exaggeration").value = at;
  page.exaggeration = EXAGGERATIONS[at];
  $("exaggeration-out").textContent = `${page.exaggeration} ×`;
  page.dirty = true;
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  $("theme").setAttribute("aria-pressed", theme === "sunlight");
  try {
    localStorage.setItem("theme", theme);
  } catch { /* a browser that keeps nothing */ }
  page.dirty = true;
}

function toggleTheme() {
  setTheme(document.documentElement.dataset.theme === "sunlight" ? "dark" : "sunlight");
}

function setFollow(follow) {
  page.follow = follow;
  $("follow").setAttribute("aria-pressed", follow);
  if (follow) {
    page.userMoved = true;
    if (vehicle()) scene?.lookAt(vehicle());
  }
}

function setObstacles(on) {
  page.obstacles = on;
  $("obstacles").checked = on;
  if (on && !Number.isFinite(page.obstacleM) && page.store?.known) {
    page.obstacleM = Math.round(page.store.depthQuantile(0.05) * 10) / 10;
    $("obstacle-depth").value = page.obstacleM;
  }
  showObstacles();
  page.dirty = true;
}

function setPanel(open) {
  $("panel").classList.toggle("closed", !open);
  $("panel-close").setAttribute("aria-expanded", open);
  if (!page.userMoved) fit();
  page.dirty = true;
}

function showTab(name) {
  for (const tab of ["health", "display", "log"]) {
    $(tab).hidden = tab !== name;
    $(`tab-${tab}`).setAttribute("aria-selected", tab === name);
  }
  setPanel(true);
}

function playOrPause() {
  const player = page.state?.player;
  if (!player) return;
  link.send(player.playing ? { type: "pause" } : { type: "play", speed: Number($("speed").value) });
}

function seek(seconds) {
  const player = page.state?.player;
  if (!player) return;
  link.send({ type: "seek", t_s: Math.min(Math.max(seconds, 0), player.length_s) });
}

for (const [id, action] of Object.entries({
  "view-3d": () => setView(false), "view-map": () => setView(true), theme: toggleTheme, help: () => $("keys").showModal(),
  follow: () => setFollow(!page.follow), play: playOrPause, "readout-close": () => setTool("inspect"),
  fit: () => { page.userMoved = false; setFollow(false); fit(); },
  "panel-close": () => setPanel($("panel").classList.contains("closed")),
  "tab-health": () => showTab("health"), "tab-display": () => showTab("display"), "tab-log": () => showTab("log"),
})) $(id).addEventListener("click", action);
for (const button of document.querySelectorAll("[data-tool]")) button.addEventListener("click", () => setTool(button.dataset.tool));
for (const input of document.querySelectorAll("[name=mode]")) input.addEventListener("change", () => setMode(input.value));
$("exaggeration").addEventListener("input", (event) => setExaggeration(Number(event.target.value)));
$("contours").addEventListener("change", (event) => { page.contours = event.target.value; page.dirty = true; });
for (const [id, key] of [["depth-from", "depthFromM"], ["depth-to", "depthToM"]]) {
  $(id).addEventListener("input", (event) => { page[key] = event.target.valueAsNumber; page.dirty = true; });
}
$("track").addEventListener("change", () => { page.dirty = true; });
$("obstacles").addEventListener("change", (event) => setObstacles(event.target.checked));
$("obstacle-depth").addEventListener("input", (event) => {
  page.obstacleM = event.target.valueAsNumber;
  setObstacles(page.obstacles);
});
$("time").addEventListener("input", (event) => { page.sliding = true; seek(Number(event.target.value)); });
$("time").addEventListener("change", () => { page.sliding = false; });
$("speed").addEventListener("change", () => {
  if (page.state?.player?.playing) link.send({ type: "play", speed: Number($("speed").value) });
});

if (scene) {
  const canvas = $("scene");
  // Whoever presses it has it focused by the controls: that is no use of the keys.
  canvas.addEventListener("focus", () => setAim(!pressed && canvas.matches(":focus-visible")));
  canvas.addEventListener("blur", () => setAim(false));
  let pressed = null;
  canvas.addEventListener("pointerdown", (event) => {
    pressed = { x: event.clientX, y: event.clientY };
    setAim(false);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (pressed && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > 5) {
      pressed = null;
      page.userMoved = true;
      setFollow(false);
    }
    if (page.tool !== "inspect" && page.points.length && event.pointerType === "mouse" && !event.buttons) {
      page.hover = page.tool === "profile" && page.points.length === 2 ? null : scene.pick(event.clientX, event.clientY);
      page.dirty = true;
    }
  });
  canvas.addEventListener("pointerup", (event) => {
    if (pressed && event.button === 0) addPoint(scene.pick(event.clientX, event.clientY));
    pressed = null;
  });
  canvas.addEventListener("wheel", () => { page.userMoved = true; });
}

/** Whether the keys act on the map: a frame and a cross in the middle show it. */
function setAim(on) {
  page.aim = on;
  $("scene").classList.toggle("aim", on);
  page.dirty = true;
}

const MOVES = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KEYS = {
  v: () => setView(!scene?.mapView), f: () => setFollow(!page.follow), i: () => setTool("inspect"), p: () => setTool("profile"),
  d: () => setTool("distance"), a: () => setTool("area"), t: toggleTheme, h: () => $("keys").showModal(), "?": () => $("keys").showModal(),
  o: () => setObstacles(!page.obstacles), l: () => setPanel($("panel").classList.contains("closed")), " ": playOrPause,
  "[": () => setExaggeration(Number($("exaggeration").value) - 1), "]": () => setExaggeration(Number($("exaggeration").value) + 1),
  ",": () => seek((page.state?.player?.position_s ?? 0) - 10), ".": () => seek((page.state?.player?.position_s ?? 0) + 10),
  c: () => { page.contours = page.contours === "0" ? "auto" : "0"; $("contours").value = page.contours; page.dirty = true; },
  home: () => $("fit").click(), escape: () => setTool("inspect"), backspace: () => setPoints(page.points.slice(0, -1)),
  "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8),
  1: () => setMode("depth"), 2: () => setMode("uncertainty"), 3: () => setMode("age"), 4: () => setMode("slope"),
};

function zoom(factor) {
  page.userMoved = true;
  scene?.zoom(factor);
}

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || $("keys").open) return;
  const on = event.target;
  const typing = on.matches("input[type=number], select");
  const own = on.matches("button, input, select");
  if (typing && event.key !== "Escape") return;
  const move = MOVES[event.key];
  if (move && !own) {
    page.userMoved = true;
    setAim(true);
    setFollow(false);
    if (event.shiftKey) scene?.turn(-8 * move[0], 6 * move[1]);
    else scene?.nudge(0.08 * move[0], 0.08 * move[1]);
  } else if (event.key === "Enter" && !own) {
    setAim(true);
    const at = scene && middle(margins());
    if (at) addPoint(scene.pick(at.x, at.y));
  } else if (KEYS[event.key.toLowerCase()] && !(own && event.key === " ")) {
    KEYS[event.key.toLowerCase()]();
  } else {
    return;
  }
  event.preventDefault();
});

// Among the panel's tabs, as everywhere, arrows go to the neighbour.
$("tabs").addEventListener("keydown", (event) => {
  const tabs = [...document.querySelectorAll("[role=tab]")], at = tabs.indexOf(event.target);
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (at < 0 || !by) return;
  const next = tabs[(at + by + tabs.length) % tabs.length];
  next.focus();
  next.click();
  event.preventDefault();
});

let remembered = null;
try {
  remembered = localStorage.getItem("theme");
} catch { /* a browser that keeps nothing */ }
setTheme(remembered ?? (matchMedia("(prefers-contrast: more)").matches ? "sunlight" : "dark"));
setTool("inspect");
setView(false);
setExaggeration(2);
setPanel(innerWidth >= 760);
showState();
addEventListener("resize", resize);
resize();
frame(performance.now());
