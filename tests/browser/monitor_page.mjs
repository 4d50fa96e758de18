// The monitor's page in a real browser: what it shows of a known map, by mouse, by keyboard, on a small screen, through
// a monitor that dies and through a recording.
//
// usage: node monitor_page.mjs LEADLINE MODULES [PICTURES]
//   LEADLINE   the program
//   MODULES    folder with node_modules/playwright-core
//   PICTURES   folder for screenshots; without it none are kept
// Exit code: 0 passed, 1 failed, 77 no browser.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { PATIENCE_MS, downlinkFrames, framed, sendFrames, setUp, startMonitor, unframed, watch } from "./support.mjs";

const [program, modules, pictures] = process.argv.slice(2);
const { browser, scratch, log, map } = await setUp(program, modules);
if (pictures) fs.mkdirSync(pictures, { recursive: true });

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
const truth = readAsc(path.join(map, "depth.asc"));
const knownCells = [];
for (let n = 0; n < truth.rows; n++) for (let e = 0; e < truth.columns; e++) if (truth.depth(n, e) !== null) knownCells.push([n, e]);

const frames = downlinkFrames(log);
const monitor = (link, http) => startMonitor(program, link, http);
const hello = frames.find((frame) => frame[2] === 1);
/** A part of the flight; from then on the vehicle is heard, however slow the browser is, until it is told to be quiet. */
let heardAt = 0;
async function send(port, from, to) {
  await sendFrames(frames, port, from, to);
  heardAt = port;
}
setInterval(() => { if (heardAt) sendFrames([hello], heardAt, 0, 1); }, 1000).unref();

// --- The browser

const complaints = [];
// No gliding: where a cell is on the screen is where it stays.
let page = watch(await browser.newPage({ viewport: { width: 1280, height: 800 }, reducedMotion: "reduce" }), complaints);

const until = (expression, argument) => page.waitForFunction(expression, argument, { timeout: PATIENCE_MS });
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
  return scene.project({ northM, eastM, downM: scene.groundM({ northM, eastM }) });
}, [north, east]);
async function clickCell(north, east) {
  const at = await screen(north, east);
  await page.mouse.click(at.x, at.y);
}
/** The colour drawn for a cell: red, green, blue, opacity. */
const pixel = (north, east) => page.evaluate(([n, e]) => {
  const { page: p, scene } = window.leadline, store = p.store;
  const northM = store.originM[0] + (n + 0.5) * store.cellM, eastM = store.originM[1] + (e + 0.5) * store.cellM;
  const at = scene.project({ northM, eastM, downM: scene.groundM({ northM, eastM }) });
  scene.render();
  const gl = scene.renderer.getContext(), ratio = scene.renderer.getPixelRatio(), out = new Uint8Array(4);
  gl.readPixels(Math.round(at.x * ratio), Math.round((scene.height - at.y) * ratio), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
  return [...out];
}, [north, east]);
const close = (a, b, by, what) => assert.ok(Math.abs(a - b) <= by, `${what}: ${a} instead of ${b}`);

const steps = [];
const step = (name, run) => steps.push([name, run]);
let live, played;

step("without a link the page says so", async () => {
  live = await monitor("udp:@127.0.0.1:0");
  await page.goto(live.url);
  await until(() => document.querySelector("#empty strong").textContent === "No link yet");
  assert.equal(await text("#state span"), "No link yet");
  await shot("empty");
});

step("coarse cells: seen at once, as what they are", async () => {
  // The vector of proto/SPEC.md, for coarse tile 0 of this survey, frame 5: 64 cells to the north, 32 to the east, before any other.
  const delta = frames.find((frame) => frame[2] === 2);
  const coarse = Buffer.from("093412010005" + "7f00b636bfd6a584d13a2ce956d9f9c3e754d18bb39e5d8c", "hex");
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
  await until((received) => window.leadline.page.received > received, before.got);
  const after = await page.evaluate(() => window.leadline.page.received);
  assert.ok(after - before.got < before.tiles, `${after - before.got} tiles for a fiftieth of the survey, ${before.tiles} known`);
});

step("a tab that slept has everything when it wakes", async () => {
  const before = await page.evaluate(() => window.leadline.page.received);
  const session = await page.context().newCDPSession(page);
  await session.send("Page.setWebLifecycleState", { state: "frozen" });
  await send(live.port, 0.52, 0.6);
  await session.send("Page.setWebLifecycleState", { state: "active" });
  await until((received) => {
    const { page: p } = window.leadline;
    return p.received > received && p.complete && p.store.known === p.state.map.known_cells;
  }, before);
  await session.detach();
});

step("the whole map, cell for cell as `receive` has it", async () => {
  await send(live.port, 0.6, 1);
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

step("in 3-D what is picked is the cell that is drawn there", async () => {
  const found = await page.evaluate(() => {
    const { page: p, scene } = window.leadline, { store } = p, { shared } = scene;
    const kept = { range: shared.range.value.clone(), exaggeration: shared.exaggeration.value };
    // Every cell in a colour that says its row and column, modulo 8, whatever the light: by the age of it.
    const palette = scene.palettes.depth.clone();
    const data = Uint8Array.from({ length: 768 }, (_, i) => [28 + 18 * (Math.floor(i / 24) % 8), 28 + 18 * (Math.floor(i / 3) % 8), 150][i % 3]);
    palette.image = { data, width: 256, height: 1 };
    palette.needsUpdate = true;
    for (const [id, tile] of store.tiles) {
      const coded = tile.slice();
      for (let k = 0; k < 256; k++) coded[256 + k] = 1000 - (8 * (Math.floor(k / 16) % 8) + (k % 8));
      scene.setTile(id, coded);
    }
    const gl = scene.renderer.getContext(), ratio = scene.renderer.getPixelRatio();
    const width = gl.drawingBufferWidth, height = gl.drawingBufferHeight, out = new Uint8Array(4 * width * height);
    const cellAt = (x, y) => {
      const at = scene.pick(x, y);
      const n = at && Math.floor((at.northM - store.originM[0]) / store.cellM), e = at && Math.floor((at.eastM - store.originM[1]) / store.cellM);
      return at && store.cell(n, e) ? `${n % 8} ${e % 8}` : "nothing";
    };
    let compared = 0;
    const wrong = [];
    for (const exaggeration of [1, 5, 20]) {
      shared.exaggeration.value = exaggeration;
      scene.fit({ top: 50, left: 90, right: 330, bottom: 0 });
      scene.turn(25 * exaggeration, 10);
      shared.mode.value = 2;
      shared.now_ds.value = 1000;
      shared.range.value.set(0, 25.5);
      shared.palette.value = palette;
      shared.contour_m.value = 0;
      scene.render();
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, out);
      for (let y = 40; y < height; y += 17) {
        for (let x = 110; x < width - 340; x += 13) {
          const at = [(x + 0.5) / ratio, (height - y - 0.5) / ratio], picked = cellAt(...at);
          // At the border of two cells either is right.
          if ([[-1, 0], [1, 0], [0, -1], [0, 1]].some(([dx, dy]) => cellAt(at[0] + dx, at[1] + dy) !== picked)) continue;
          const [red, green, blue, alpha] = out.subarray(4 * (y * width + x));
          const row = (value) => Math.round(((value / blue) * 150 - 28) / 18);
          const drawn = alpha ? `${row(red)} ${row(green)}` : "nothing";
          compared++;
          if (drawn !== picked) wrong.push(`${exaggeration} x, ${x}, ${y}: ${picked} instead of ${drawn} (${[red, green, blue, alpha]})`);
        }
      }
    }
    for (const [id, tile] of store.tiles) scene.setTile(id, tile);
    shared.range.value.copy(kept.range);
    shared.exaggeration.value = kept.exaggeration;
    p.dirty = true;
    return { compared, wrong };
  });
  assert.ok(found.compared > 500, `${found.compared} compared`);
  assert.deepEqual(found.wrong, []);
  await page.keyboard.press("Home");
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
  // Colours that are held by hand.
  const ticks = (wanted) => until((list) => document.querySelector("#legend-ticks").dataset.shown === list, wanted);
  const own = await page.getAttribute("#legend-ticks", "data-shown");
  await page.fill("#depth-from", "10");
  await page.fill("#depth-to", "22");
  await ticks("10.0|16.0|22.0");
  await page.fill("#depth-from", "");
  await page.fill("#depth-to", "");
  await ticks(own);
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
});

step("every control is reached by Tab, seen to be, and has a name; no text is small or faint", async () => {
  await page.click("#tab-display");
  // Of radio buttons one is reached, the others from there by arrows.
  const wanted = await page.evaluate(() => [...document.querySelectorAll("button, input:not([type=radio]), input:checked, select, canvas[tabindex]")]
    .filter((c) => c.checkVisibility() && !c.disabled).map((c) => (c.dataset.reach = c.id || c.dataset.tool || c.name)).sort());
  const reached = [];
  for (let k = 0; k < wanted.length + 2; k++) { // round once, through the page itself
    await page.keyboard.press("Tab");
    const at = await page.evaluate(() => {
      const on = document.activeElement;
      if (on === document.body) return null;
      const style = getComputedStyle(on.type === "radio" ? on.nextElementSibling : on);
      const name = on.getAttribute("aria-label") || on.closest("label")?.innerText || on.innerText || on.title;
      return { id: on.dataset.reach, name, outlinePx: style.outlineStyle === "none" ? 0 : Number.parseFloat(style.outlineWidth) };
    });
    if (at && !reached.includes(at.id)) {
      reached.push(at.id);
      assert.ok(at.name?.trim(), `${at.id} has a name`);
      assert.ok(at.outlinePx >= 2, `${at.id} shows that it has the keys`);
    }
  }
  assert.deepEqual(reached.sort(), wanted);
  const poor = await page.evaluate(() => {
    const rgb = (text) => text.match(/[\d.]+/g).map(Number);
    const luminance = (c) => [0.2126, 0.7152, 0.0722].reduce((sum, part, i) => {
      const x = c[i] / 255;
      return sum + part * (x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    }, 0);
    const found = [], root = document.documentElement, was = root.dataset.theme;
    let looked = 0;
    for (const theme of ["dark", "sunlight"]) {
      root.dataset.theme = theme;
      for (const tab of ["log", "display", "health"]) {
        document.querySelector(`#tab-${tab}`).click();
        const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
        while (walk.nextNode()) {
          const element = walk.currentNode.parentElement, text = walk.currentNode.data.trim().slice(0, 30);
          if (!text || !element.checkVisibility({ visibilityProperty: true }) || element.closest("#state-heard, option")) continue;
          looked++;
          const style = getComputedStyle(element);
          if (Number.parseFloat(style.fontSize) < 12) found.push(`${theme}: ${text}: ${style.fontSize}`);
          let ground = element, colour;
          do colour = rgb(getComputedStyle(ground).backgroundColor); while ((colour[3] ?? 1) < 0.9 && (ground = ground.parentElement));
          const [a, b] = [luminance(rgb(style.color)), luminance(colour)];
          const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
          if (contrast < 4.5) found.push(`${theme}: ${text}: contrast ${contrast.toFixed(1)}`);
        }
      }
    }
    root.dataset.theme = was;
    return { found, looked };
  });
  assert.ok(poor.looked > 100, `${poor.looked} texts`);
  assert.deepEqual(poor.found, []);
  await page.focus("#tab-health");
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.getAttribute("#tab-display", "aria-selected"), "true");
  await page.keyboard.press("ArrowLeft");
});

step("a view that has to move glides, unless the system asks for calm", async () => {
  await page.emulateMedia({ reducedMotion: "no-preference" });
  const grow = () => page.evaluate(() => {
    const { page: p, scene } = window.leadline;
    p.userMoved = false;
    scene.zoom(8);
    p.mapChanged = p.dirty = true;
  });
  const framedNow = () => until(() => {
    const { page: p, scene } = window.leadline;
    return !scene.glide && p.fitted && scene.framed({ top: 0, left: 0, right: 0, bottom: 0 }, null);
  });
  await page.evaluate(() => {
    const { scene } = window.leadline, glideTo = scene.glideTo.bind(scene);
    scene.glides = 0;
    scene.glideTo = (...given) => { scene.glides++; glideTo(...given); };
  });
  await grow();
  await until(() => window.leadline.scene.glides > 0);
  await framedNow();
  const before = await page.evaluate(() => window.leadline.scene.glides);
  await page.emulateMedia({ reducedMotion: "reduce" });
  await grow();
  await framedNow();
  assert.equal(await page.evaluate(() => window.leadline.scene.glides), before);
});

step("a silent vehicle and a silent monitor are said, with the time", async () => {
  const said = await page.evaluate(() => {
    const { link, page: p } = window.leadline, real = p.state, seen = () => ({
      state: document.querySelector("#state span").innerText, heard: document.querySelector("#state-heard").textContent,
      alarm: document.querySelector("#alarms").innerText, stale: document.body.classList.contains("stale") });
    const state = structuredClone(real);
    Object.assign(state.link, { silent_s: 61, bytes_per_s: 0 });
    link.dispatchEvent(new CustomEvent("state", { detail: state }));
    const vehicle = seen();
    for (let k = 0; k < 6; k++) link.tick();
    const monitor = seen();
    link.dispatchEvent(new CustomEvent("state", { detail: real }));
    return { vehicle, monitor };
  });
  assert.equal(said.vehicle.state, "Vehicle silent for 1 min 1 s");
  assert.equal(said.vehicle.heard, "Vehicle silent");
  assert.match(said.vehicle.alarm, /^The vehicle has been silent since \d\d:\d\d:\d\d: figures/);
  assert.equal(said.vehicle.stale, true);
  assert.match(said.monitor.state, /^Monitor silent for \d+ s$/);
  await until(() => document.querySelector("#state span").textContent.startsWith("Live"));
  // One that stays silent is given up, and reached anew.
  await page.evaluate(() => { for (let k = 0; k < 20; k++) window.leadline.link.tick(); });
  await until((count) => window.leadline.page.complete && window.leadline.page.store.known === count, knownCells.length);
});

step("words for every state of link and vehicle", async () => {
  const said = await page.evaluate(async () => {
    const words = await import("/words.js");
    const state = structuredClone(window.leadline.page.state);
    state.link.silent_s = 1;
    const link = { connected: true, quietS: 0, silentSince: "14:03:20" };
    const out = { live: words.stateWords(state, link).words, fresh: words.staleWords(state, link) };
    state.link.silent_s = 72;
    state.link.bytes_per_s = 0;
    out.silent = [words.stateWords(state, link).words, words.staleWords(state, link)];
    state.link.bytes_per_s = 100;
    out.noise = [words.stateWords(state, link).words, words.staleWords(state, link)];
    state.link.silent_s = 0;
    state.vehicle.mapping_paused = true;
    out.paused = words.stateWords(state, link).words;
    state.link.frames_recent = 90;
    state.link.damaged_recent = 10;
    state.link.bytes_per_s = 180;
    state.link.budget_bytes_per_s = 200;
    state.vehicle.pings.shed = 7;
    state.vehicle.pings.range_too_long = 5;
    state.vehicle.pings.stopped = 3;
    state.vehicle.work = { last: 50, max: 120, bound: 100 };
    out.rows = Object.fromEntries(words.healthRows(state).map((row) => [row.id, [row.words, row.level, row.detail]]));
    state.link.refused = "version 2";
    out.refused = words.stateWords(state, link).words;
    out.quiet = words.stateWords(state, { ...link, quietS: 7 }).words;
    out.gone = words.stateWords(state, { ...link, connected: false }).words;
    return out;
  });
  assert.match(said.live, /^Live/);
  assert.equal(said.fresh, null);
  assert.deepEqual(said.silent, ["Vehicle silent for 1 min 12 s", "The vehicle has been silent since 14:03:20: figures are of its last word"]);
  assert.deepEqual(said.noise, ["Only noise for 1 min 12 s", "Bytes come, but no whole frame since 14:03:20: figures are of its last word"]);
  assert.equal(said.quiet, "Monitor silent for 7 s");
  assert.equal(said.paused, "Mapping paused");
  assert.equal(said.refused, "Vehicle refused");
  assert.equal(said.gone, "Monitor not reached");
  assert.deepEqual(said.rows.link.slice(0, 2), ["poor, 10 % damaged", "bad"]);
  assert.equal(said.rows.rate[0], "180 B/s of 200 B/s");
  assert.deepEqual(said.rows.shed.slice(0, 2), ["7, queue full", "warn"]);
  assert.match(said.rows.rejected[2], /5 beyond range/);
  assert.deepEqual(said.rows.work, ["120 % of bound", "bad", ""]);
});

step("a monitor that dies is missed, and comes back", async () => {
  heardAt = 0;
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
  played = await monitor(log);
  await page.setViewportSize({ width: 900, height: 600 });
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

step("a stored survey: the same map, by the same page", async () => {
  const store = path.join(scratch, "survey.lls");
  execFileSync(program, ["receive", "--link", `file:${log}`, "--store", store], { stdio: "ignore" });
  const stored = await startMonitor(program, `${store}#1`);
  await page.goto(stored.url);
  await until((count) => window.leadline.page.complete && window.leadline.page.store.known === count, knownCells.length);
  const depths = await page.evaluate((cells) => cells.map(([n, e]) => window.leadline.page.store.cell(n, e).depthM), knownCells);
  knownCells.forEach(([n, e], k) => close(depths[k], truth.depth(n, e), 1e-4, `cell ${n}, ${e}`));
  assert.equal(await text("#state span"), "Stored survey");
  assert.equal(await text('[data-id="survey"] dd'), "no. 1");
  assert.match(await text('[data-id="saved"] dd'), /^20\d\d-\d\d-\d\d \d\d:\d\d UTC$/);
  assert.equal(await page.locator('[data-id="link"], [data-id="rate"], [data-id="pings"]').count(), 0);
  assert.equal(await page.isVisible("#player"), false);
  await page.focus("#scene");
  await page.keyboard.press("3"); // a store keeps no times
  assert.equal(await page.evaluate(() => window.leadline.page.mode), "depth");
  await page.keyboard.press("v");
  await clickCell(20, 20);
  close(Number.parseFloat(await text("#readout h2")), truth.depth(20, 20), 0.0051, "depth");
  assert.equal(await text("#read-age"), "time not known");
  await page.keyboard.press("p");
  await clickCell(5, 6);
  await clickCell(5, 60);
  close(Number.parseFloat((await text("#readout h2")).replace("Profile, ", "")), 54 * truth.cell, 2 * truth.cell, "length");
  await shot("stored");
  await page.keyboard.press("Escape");
  stored.child.kill("SIGTERM");
  assert.equal(await stored.child.ended, 0);
});

step("without WebGL health and messages are there, and nothing breaks", async () => {
  const blind = watch(await browser.newPage({ viewport: { width: 900, height: 600 } }), complaints);
  await blind.addInitScript(() => {
    const get = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return /webgl/.test(kind) ? null : get.call(this, kind, ...more); };
  });
  await blind.goto(played.url);
  await blind.waitForFunction(() => document.querySelector('[data-id="map"] dd') && window.leadline.page.complete, null, { timeout: PATIENCE_MS });
  assert.match(await blind.locator("#empty").innerText(), /cannot be drawn[\s\S]*no WebGL 2/);
  for (const key of ["v", "p", "Enter", "ArrowLeft", "+", "o", "2", "c", "f", "Home", "Escape", "t"]) await blind.keyboard.press(key);
  if (pictures) await blind.screenshot({ path: path.join(pictures, "no-webgl.png") });
  await blind.close();
});

step("on a small screen, by touch, nothing is out of reach", async () => {
  const context = await browser.newContext({ viewport: { width: 360, height: 640 }, hasTouch: true, isMobile: true, reducedMotion: "reduce" });
  page = watch(await context.newPage(), complaints);
  await page.goto(played.url);
  await until(() => window.leadline.page.complete);
  const reach = () => page.evaluate(() => ({
    wide: document.documentElement.scrollWidth,
    outside: [...document.querySelectorAll("#bar, #tools button, #tabs button, #player, #legend")].filter((c) => {
      const r = c.getBoundingClientRect();
      return r.width > 0 && (r.left < -1 || r.right > innerWidth + 1 || r.top < -1 || r.bottom > innerHeight + 1);
    }).map((c) => c.id || c.title),
  }));
  assert.deepEqual(await reach(), { wide: 360, outside: [] });
  await shot("small");
  await page.tap("#tab-health");
  await page.locator("#figures").waitFor({ state: "visible" });
  assert.deepEqual((await reach()).outside, []);
  await shot("small-health");
  await page.tap("#tab-display");
  assert.deepEqual((await reach()).outside, []);
  await shot("small-display");
  await page.tap("#panel-close");
  await page.tap("#view-map");
  const at = await screen(20, 20);
  await page.touchscreen.tap(at.x, at.y);
  close(Number.parseFloat(await text("#readout h2")), truth.depth(20, 20), 0.0051, "depth");
  await shot("small-map");
  await page.tap("[data-tool=profile]");
  for (const cell of [[30, 10], [30, 60]]) {
    const end = await screen(...cell);
    await page.touchscreen.tap(end.x, end.y);
  }
  await page.locator(".chart polyline").first().waitFor();
  assert.deepEqual((await reach()).outside, []);
  await shot("small-profile");
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
