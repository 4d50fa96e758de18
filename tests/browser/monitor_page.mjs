// The monitor's page in a real browser: what it shows of a known map, by mouse, by keyboard, on a small screen, through
// a monitor that dies and through a recording.
//
// usage: node monitor_page.mjs LEADLINE LOG DEPTH_ASC MODULES [PICTURES]
//   LEADLINE   the program
//   LOG        a vehicle's log; DEPTH_ASC: the same map as `leadline receive` wrote it
//   MODULES    folder with node_modules/playwright-core
//   PICTURES   folder for screenshots; without it none are kept
// Exit code: 0 passed, 1 failed, 77 no browser.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { downlinkFrames, framed, openBrowser, sendFrames, startMonitor, unframed } from "./support.mjs";

const [program, log, depthAsc, modules, pictures] = process.argv.slice(2);
let browser;
try {
  browser = await openBrowser(modules);
} catch (error) {
  console.log(`skipped: ${error.message}`);
  process.exit(77);
}

// --- The map as the program wrote it

function readAsc(file) {
  const lines = fs.readFileSync(file, "utf8").trim().split("\n");
  const header = {};
  while (/^[a-z]/i.test(lines[0])) {
    const [key, value] = lines.shift().trim().split(/\s+/);
    header[key.toLowerCase()] = Number(value);
  }
  const rows = lines.map((line) => line.trim().split(/\s+/).map(Number));
  return {
    rows: header.nrows, columns: header.ncols, cell: header.cellsize, west: header.xllcorner, south: header.yllcorner,
    /** Depth of cell (north, east), or null. */
    depth(north, east) {
      const value = rows[header.nrows - 1 - north][east];
      return value === header.nodata_value ? null : -value;
    },
  };
}
const truth = readAsc(depthAsc);
const knownCells = [];
for (let n = 0; n < truth.rows; n++) for (let e = 0; e < truth.columns; e++) if (truth.depth(n, e) !== null) knownCells.push([n, e]);

const frames = downlinkFrames(log);
const monitor = (link, http) => startMonitor(program, link, http);
const send = (port, from, to) => sendFrames(frames, port, from, to);

// --- The browser

const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
const complaints = [];
page.on("pageerror", (error) => complaints.push(error.message));
page.on("console", (message) => {
  // A connection refused is what a dead monitor looks like.
  if (message.type() === "error" && !/WebSocket|ERR_CONNECTION_REFUSED/.test(message.text())) complaints.push(message.text());
});
page.on("request", (request) => {
  if (!/^(http|ws):\/\/127\.0\.0\.1[:/]|^data:/.test(request.url())) complaints.push(`asks for ${request.url()}`);
});

const until = (expression, argument) => page.waitForFunction(expression, argument, { timeout: 60000 });
const text = (selector) => page.locator(selector).innerText();
async function shot(name) {
  if (!pictures) return;
  await page.waitForTimeout(500);
  await page.screenshot({ path: path.join(pictures, `${name}.png`) });
}
/** Where a cell's centre is on the screen. */
const screen = (north, east) => page.evaluate(([n, e]) => {
  const { page: p, scene } = window.leadline, store = p.store;
  const northM = store.originM[0] + (n + 0.5) * store.cellM, eastM = store.originM[1] + (e + 0.5) * store.cellM;
  return scene.project({ northM, eastM, downM: store.cell(n, e)?.depthM ?? store.originM[2] });
}, [north, east]);
async function clickCell(north, east) {
  const at = await screen(north, east);
  await page.mouse.click(at.x, at.y);
}
/** The colour drawn for a cell: red, green, blue, opacity. */
const pixel = (north, east) => page.evaluate(([n, e]) => {
  const { page: p, scene } = window.leadline, store = p.store;
  const northM = store.originM[0] + (n + 0.5) * store.cellM, eastM = store.originM[1] + (e + 0.5) * store.cellM;
  const at = scene.project({ northM, eastM, downM: store.cell(n, e)?.depthM ?? store.originM[2] });
  scene.render();
  const gl = scene.renderer.getContext(), ratio = scene.renderer.getPixelRatio(), out = new Uint8Array(4);
  gl.readPixels(Math.round(at.x * ratio), Math.round((scene.height - at.y) * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return [...out];
}, [north, east]);
const close = (a, b, by, what) => assert.ok(Math.abs(a - b) <= by, `${what}: ${a} instead of ${b}`);

const steps = [];
const step = (name, run) => steps.push([name, run]);
let live;

step("without a link the page says so", async () => {
  live = await monitor("udp:@127.0.0.1:0");
  await page.goto(live.url);
  await until(() => document.querySelector("#empty strong").textContent === "No link yet");
  assert.equal(await text("#state span"), "No link yet");
  await shot("empty");
});

step("coarse cells: seen at once, as what they are", async () => {
  // The vector of proto/SPEC.md, for coarse tile 0 of this survey: 64 cells to the north, 32 to the east, before any other.
  const hello = frames.find((frame) => frame[2] === 1), delta = frames.find((frame) => frame[2] === 2);
  const coarse = Buffer.from("0934120100" + "7f00b636bfd6a584d13a2ce956d9f9c3e754d18bb39e5d8c", "hex");
  unframed(delta).copy(coarse, 1, 1, 3); // the survey's tag
  await sendFrames([hello, framed(coarse)], live.port, 0, 1);
  await until(() => window.leadline.page.complete && window.leadline.page.store?.coarse === 128);
  await page.locator("#empty").waitFor({ state: "hidden" });
  assert.equal(await page.evaluate(() => window.leadline.page.store.known), 0);
  await until(() => document.querySelector('[data-id="coarse"] dd')?.textContent === "8 tiles");
  assert.match(await text("#legend-note"), /hatched: coarse so far/);
  await page.keyboard.press("v");
  await page.keyboard.press("c");
  // Opaque, greyer than the palette, and lighter where a stripe of the hatching runs.
  const seen = await page.evaluate(() => {
    const { scene, page: p } = window.leadline, store = p.store;
    scene.render();
    const gl = scene.renderer.getContext(), ratio = scene.renderer.getPixelRatio(), out = new Uint8Array(4 * 40);
    const at = scene.project({ northM: store.originM[0] + 20 * store.cellM, eastM: store.originM[1] + 16 * store.cellM, downM: store.originM[2] });
    gl.readPixels(Math.round(at.x * ratio), Math.round((scene.height - at.y) * ratio), 40, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
    return Array.from({ length: 40 }, (_, k) => [...out.subarray(4 * k, 4 * k + 4)]);
  });
  assert.ok(seen.every((colour) => colour[3] === 255));
  const light = seen.map(([r, g, b]) => r + g + b);
  assert.ok(Math.max(...light) - Math.min(...light) > 60, `hatched: ${Math.min(...light)} to ${Math.max(...light)}`);
  await clickCell(20, 16);
  assert.match(await text("#readout h2"), /^About [\d.]+ m ± /);
  assert.match(await text("#read-coarse"), /4 × 4 cells/);
  await clickCell(20, 40);
  assert.equal(await text("#readout h2"), "Not surveyed");
  await page.keyboard.press("Escape");
  await shot("coarse-map");
  await page.keyboard.press("c");
  await page.keyboard.press("v");
  await shot("coarse");
});

step("half a survey: cells where there are some, gaps where not", async () => {
  await send(live.port, 0, 0.5);
  await until(() => window.leadline.page.complete && window.leadline.page.store.known > 0);
  await until(() => document.querySelector("#state span").textContent.startsWith("Live"));
  await page.locator("#empty").waitFor({ state: "hidden" });
  await page.keyboard.press("v");
  await page.keyboard.press("c"); // no contour over the pixel that is looked at
  await page.uncheck("#track", { force: true }).catch(() => {});
  const cells = await page.evaluate(() => {
    const store = window.leadline.page.store, known = [], unknown = [];
    for (let n = store.bounds.north0; n < store.bounds.north1; n++) {
      for (let e = store.bounds.east0; e < store.bounds.east1; e++) (store.cell(n, e) ? known : unknown).push([n, e]);
    }
    return { known: known[known.length >> 1], unknown: unknown[unknown.length >> 1], count: known.length };
  });
  assert.ok(cells.count > 0);
  assert.equal((await pixel(...cells.known))[3], 255);
  if (cells.unknown) {
    assert.equal((await pixel(...cells.unknown))[3], 0, "unknown is no surface");
    await clickCell(...cells.unknown);
    assert.equal(await text("#readout h2"), "Not surveyed");
  }
  await page.keyboard.press("Escape");
  await page.keyboard.press("c");
  await page.keyboard.press("v");
  await shot("growing");
});

step("only what changed is sent", async () => {
  const before = await page.evaluate(() => ({ got: window.leadline.page.received, tiles: window.leadline.page.store.tiles.size }));
  await send(live.port, 0.5, 0.52);
  await page.waitForTimeout(600);
  const after = await page.evaluate(() => window.leadline.page.received);
  assert.ok(after - before.got < before.tiles, `${after - before.got} tiles for a fiftieth of the survey, ${before.tiles} known`);
});

step("the whole map, cell for cell as `receive` has it", async () => {
  await send(live.port, 0.52, 1);
  await until((count) => window.leadline.page.store.known === count, knownCells.length);
  const depths = await page.evaluate((cells) => cells.map(([n, e]) => window.leadline.page.store.cell(n, e).depthM), knownCells);
  knownCells.forEach(([n, e], k) => close(depths[k], truth.depth(n, e), 1e-4, `cell ${n}, ${e}`));
  await until(() => window.leadline.page.store.coarse === 0); // all of it came
  assert.equal(await page.locator('[data-id="coarse"]').count(), 0);
  await shot("live");
});

step("a click reads the cell: depth, sigma, age, place; in 3-D and on the map", async () => {
  for (const view of ["3-D", "map"]) {
    for (const share of [0.2, 0.5, 0.8]) {
      const n = Math.floor(truth.rows * share), e = Math.floor(truth.columns * (1 - share));
      await clickCell(n, e);
      const read = await page.evaluate(() => {
        const { points, store } = window.leadline.page;
        return { n: Math.floor((points[0].northM - store.originM[0]) / store.cellM),
                 e: Math.floor((points[0].eastM - store.originM[1]) / store.cellM), text: document.querySelector("#readout h2").textContent };
      });
      // In 3-D another cell may stand before the one that was aimed at: what is read must be what was hit.
      if (view === "map") assert.deepEqual([read.n, read.e], [n, e]);
      else assert.ok(Math.abs(read.n - n) <= 8 && Math.abs(read.e - e) <= 4, `${read.n}, ${read.e} for ${n}, ${e}`);
      close(Number.parseFloat(read.text), truth.depth(read.n, read.e), 0.0051, view);
      assert.match(read.text, /± \d/);
      assert.match(await text("#read-age"), /ago$/);
      assert.match(await text("#read-place"), /m, .*m/);
    }
    await page.keyboard.press("Escape");
    await page.keyboard.press("v");
  }
});

step("profile, distance and area give the map's own figures", async () => {
  await page.click("#view-map");
  const a = [5, 6], b = [5, truth.columns - 7];
  await page.keyboard.press("p");
  await clickCell(...a);
  await clickCell(...b);
  const length = (b[1] - a[1]) * truth.cell;
  close(Number.parseFloat((await text("#readout h2")).replace("Profile, ", "")), length, 2 * truth.cell, "length");
  const line = [];
  for (let e = a[1]; e <= b[1]; e++) line.push(truth.depth(5, e));
  const shown = await page.locator("#readout dd").allInnerTexts();
  close(Number.parseFloat(shown[0]), Math.min(...line), 0.011, "shallowest");
  close(Number.parseFloat(shown[1]), Math.max(...line), 0.011, "deepest");
  assert.ok((await page.locator(".chart polyline").first().getAttribute("points")).length > 100);
  // The line is not behind its own figures.
  const top = (await page.locator("#readout").boundingBox()).y;
  for (const end of [a, b]) assert.ok((await screen(...end)).y < top, "in sight");
  await shot("profile");
  await page.keyboard.press("d");
  await clickCell(...a);
  await clickCell(...b);
  close(Number.parseFloat(await text("#readout h2")), length, 2 * truth.cell, "distance");
  await page.keyboard.press("a");
  for (const [n, e] of [[10, 10], [10, 30], [30, 30], [30, 10]]) await clickCell(n, e);
  close(Number.parseFloat(await text("#readout h2")), (20 * truth.cell) ** 2, 4 * 20 * truth.cell * truth.cell, "area");
  await page.keyboard.press("Backspace");
  close(Number.parseFloat(await text("#readout h2")), (20 * truth.cell) ** 2 / 2, 3 * 20 * truth.cell * truth.cell, "area of three");
  await page.keyboard.press("Escape");
  await page.locator("#readout").waitFor({ state: "hidden" });
});

step("obstacles above a depth are counted and marked", async () => {
  await page.click("#tab-display");
  await page.check("#obstacles");
  const depths = knownCells.map(([n, e]) => truth.depth(n, e)).sort((x, y) => x - y);
  const limit = Math.round(depths[Math.floor(depths.length / 10)] * 10) / 10 + 0.003;
  await page.fill("#obstacle-depth", String(limit));
  const words = await text("#obstacle-words");
  assert.equal(Number(words.match(/^([\d,]+) cells/)[1].replace(",", "")), depths.filter((d) => d < limit).length);
  close(Number(words.match(/shallowest ([\d.]+) m/)[1]), depths[0], 0.0051, "shallowest");
  await shot("obstacles");
  await page.uncheck("#obstacles");
  await page.click("#tab-health");
});

step("everything by keyboard", async () => {
  await page.click("#view-3d");
  await page.focus("#scene");
  const say = (expression) => page.evaluate(expression);
  for (const [key, mode] of [["2", "uncertainty"], ["3", "age"], ["4", "slope"], ["1", "depth"]]) {
    await page.keyboard.press(key);
    assert.equal(await say("window.leadline.page.mode"), mode);
    await shot(`by-${mode}`);
  }
  const before = await say("window.leadline.page.exaggeration");
  await page.keyboard.press("]");
  assert.ok((await say("window.leadline.page.exaggeration")) > before);
  await page.keyboard.press("[");
  const target = await say("window.leadline.scene.orbit.target.x");
  await page.keyboard.press("ArrowRight");
  assert.ok((await say("window.leadline.scene.orbit.target.x")) > target);
  const distance = "window.leadline.scene.perspective.position.distanceTo(window.leadline.scene.orbit.target)";
  const far = await say(distance);
  await page.keyboard.press("+");
  assert.ok((await say(distance)) < far);
  await page.keyboard.press("Shift+ArrowLeft");
  await page.keyboard.press("Enter");
  assert.match(await text("#readout h2"), /m ± |Not surveyed/);
  await page.keyboard.press("Escape");
  // All of it is in sight and none of it small, however high it stands and whatever lies over it.
  const unframed = await page.evaluate(() => {
    const { page: p, scene } = window.leadline, lost = [];
    const vehicle = { northM: p.store.originM[0], eastM: p.store.originM[1], downM: 2 };
    for (const exaggeration of [1, 2, 5, 10, 20]) {
      for (const [right, bottom] of [[0, 0], [330, 0], [700, 0], [330, 230], [0, 400], [900, 500]]) {
        for (const seen of [null, vehicle]) {
          const free = { top: 50, left: 90, right, bottom };
          scene.shared.exaggeration.value = exaggeration;
          scene.fit(free, seen);
          if (!scene.framed(free, seen)) lost.push([exaggeration, right, bottom, seen !== null]);
        }
      }
    }
    scene.shared.exaggeration.value = p.exaggeration;
    return lost;
  });
  assert.deepEqual(unframed, []);
  await page.keyboard.press("Home");
  await page.keyboard.press("h");
  await page.locator("#keys").waitFor({ state: "visible" });
  await shot("keys");
  await page.keyboard.press("Escape");
  await page.locator("#keys").waitFor({ state: "hidden" });
  await page.keyboard.press("t");
  assert.equal(await say("document.documentElement.dataset.theme"), "sunlight");
  await shot("sunlight");
  await page.keyboard.press("t");
  // Every control is reached by Tab and has a name.
  const nameless = await page.evaluate(() => [...document.querySelectorAll("button, input, select")]
    .filter((c) => !(c.innerText || c.title || c.getAttribute("aria-label") || c.closest("label")?.innerText)).map((c) => c.id));
  assert.deepEqual(nameless, []);
});

step("words for every state of link and vehicle", async () => {
  const said = await page.evaluate(async () => {
    const words = await import("/words.js");
    const state = structuredClone(window.leadline.page.state);
    state.link.silent_s = 1;
    const out = { live: words.stateWords(state, true).words };
    state.link.silent_s = 12;
    out.silent = words.stateWords(state, true).words;
    state.link.silent_s = 0;
    state.vehicle.mapping_paused = true;
    out.paused = words.stateWords(state, true).words;
    state.link.frames_recent = 90;
    state.link.damaged_recent = 10;
    state.link.bytes_per_s = 180;
    state.link.budget_bytes_per_s = 200;
    state.vehicle.pings.shed = 7;
    state.vehicle.pings.range_too_long = 5;
    state.vehicle.work = { last: 50, max: 120, bound: 100 };
    out.rows = Object.fromEntries(words.healthRows(state).map((row) => [row.id, [row.words, row.level, row.detail]]));
    state.link.refused = "version 2";
    out.refused = words.stateWords(state, true).words;
    out.gone = words.stateWords(state, false).words;
    return out;
  });
  assert.match(said.live, /^Live/);
  assert.equal(said.silent, "Vehicle silent since 12 s");
  assert.equal(said.paused, "Mapping paused");
  assert.equal(said.refused, "Vehicle refused");
  assert.equal(said.gone, "Monitor not reached");
  assert.deepEqual(said.rows.link.slice(0, 2), ["poor, 10 % damaged", "bad"]);
  assert.equal(said.rows.rate[0], "180 B/s of 200 B/s");
  assert.deepEqual(said.rows.shed.slice(0, 2), ["7, queue full", "warn"]);
  assert.match(said.rows.rejected[2], /5 beyond range/);
  assert.deepEqual(said.rows.work, ["50 % of bound", "bad", "at most 120 % so far"]);
});

step("a monitor that dies is missed, and comes back", async () => {
  live.child.kill("SIGKILL");
  await until(() => document.querySelector("#state span").textContent === "Monitor not reached");
  await shot("gone");
  const { host } = new URL(live.url);
  live = await monitor("udp:@127.0.0.1:0", host);
  await until(() => document.querySelector("#state span").textContent === "No link yet");
  await send(live.port, 0, 0.5);
  await until(() => window.leadline.page.complete && document.querySelector("#state span").textContent.startsWith("Live"));
  // Cells of the life before are gone.
  await until((all) => {
    const { store, state } = window.leadline.page;
    return store.known === state.map.known_cells && store.known > 0 && store.known < all;
  }, knownCells.length);
  // A second one at the same address says why not.
  const second = spawn(program, ["monitor", "--link", "udp:@127.0.0.1:0", "--http", host]);
  let why = "";
  second.stderr.on("data", (data) => { why += data; });
  assert.equal(await new Promise((done) => second.on("exit", done)), 2);
  assert.match(why, /in use/);
  live.child.kill("SIGTERM");
  assert.equal(await live.child.ended, 0);
});

step("a recording: to its end, back, and forward again", async () => {
  const played = await monitor(`file:${log}`);
  await page.goto(played.url);
  await until((count) => window.leadline.page.complete && window.leadline.page.store.known === count, knownCells.length);
  await page.locator("#player").waitFor({ state: "visible" });
  await page.locator("#time").evaluate((slider) => {
    slider.value = slider.max * 0.3;
    slider.dispatchEvent(new Event("input"));
    slider.dispatchEvent(new Event("change"));
  });
  await until((count) => window.leadline.page.complete && window.leadline.page.stale === null && window.leadline.page.store.known < count * 0.8 &&
    window.leadline.page.store.known === window.leadline.page.state.map.known_cells, knownCells.length);
  const early = await page.evaluate(() => ({ t: window.leadline.page.state.player.position_s, length: window.leadline.page.state.player.length_s }));
  close(early.t, early.length * 0.3, 0.01, "time");
  await shot("replay");
  await page.selectOption("#speed", "100");
  await page.focus("#scene");
  await page.keyboard.press(" ");
  await until((count) => window.leadline.page.store.known === count && !window.leadline.page.state.player.playing, knownCells.length);
  const depths = await page.evaluate((cells) => cells.map(([n, e]) => window.leadline.page.store.cell(n, e).depthM), knownCells);
  knownCells.forEach(([n, e], k) => close(depths[k], truth.depth(n, e), 1e-4, `cell ${n}, ${e}`));
});

step("on a small screen nothing is out of reach", async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await page.reload();
  await until(() => window.leadline.page.complete);
  const reach = () => page.evaluate(() => ({
    wide: document.documentElement.scrollWidth,
    outside: [...document.querySelectorAll("#bar, #tools button, #tabs button, #player, #legend")].filter((c) => {
      const r = c.getBoundingClientRect();
      return r.width > 0 && (r.left < -1 || r.right > innerWidth + 1 || r.top < -1 || r.bottom > innerHeight + 1);
    }).map((c) => c.id || c.title),
  }));
  assert.deepEqual(await reach(), { wide: 390, outside: [] });
  await shot("small");
  await page.click("#tab-health");
  await page.locator("#figures").waitFor({ state: "visible" });
  assert.deepEqual((await reach()).outside, []);
  await shot("small-health");
  await page.click("#panel-close");
  await page.click("#view-map");
  await clickCell(20, 20);
  close(Number.parseFloat(await text("#readout h2")), truth.depth(20, 20), 0.0051, "depth");
  await shot("small-map");
});

let failed = 0;
for (const [name, run] of steps) {
  const begin = Date.now();
  try {
    await run();
    assert.deepEqual(complaints.splice(0), [], "the browser complains");
    console.log(`ok ${name} (${((Date.now() - begin) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failed++;
    console.log(`FAILED ${name}: ${error.stack}`);
    if (pictures) await page.screenshot({ path: path.join(pictures, "failed.png") });
    break; // what follows builds on it
  }
}
await browser.close();
process.exit(failed ? 1 : 0);
