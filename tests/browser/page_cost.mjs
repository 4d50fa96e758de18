// What an update costs the page, for maps of any size: tiles into the map and up to the graphics.
//
// usage: node page_cost.mjs LEADLINE MODULES    (the program; folder with node_modules/playwright-core: build/browser)
// Prints a table: sides of maps full of cells, bytes to the graphics and milliseconds of the page's own work per update of
// eight tiles, obstacles counted.
import { openBrowser, startMonitor } from "./support.mjs";

const [program, modules] = process.argv.slice(2);
const { url } = await startMonitor(program, "udp:@127.0.0.1:0");
const browser = await openBrowser(modules);
const page = await browser.newPage({ viewport: { width: 400, height: 300 } });
await page.goto(url);
await page.waitForFunction(() => window.leadline?.scene);
console.log("side_cells  tiles  bytes_uploaded  ms_of_page");
for (const side of [64, 128, 256, 512, 1024, 2048]) {
  const row = await page.evaluate(async (cells) => {
    const { MapStore } = await import("/map_store.js");
    const { scene } = window.leadline;
    const store = new MapStore({ cell_mm: 500, size_cells: [cells, cells, 64], origin_mm: [0, 0, 0] });
    scene.begin(store);
    const message = new Uint32Array(513);
    const put = (id, depth) => {
      message[0] = id;
      for (let k = 0; k < 256; k++) message[1 + k] = ((depth + k) << 8) | 10;
      scene.setTile(id, store.setTile(message));
    };
    const tiles = (cells / 16) ** 2;
    store.obstacles(2.2); // half of the cells
    for (let id = 0; id < tiles; id++) put(id, 1000);
    const before = scene.uploads.bytes, begin = performance.now(), rounds = 50;
    for (let round = 0; round < rounds; round++) {
      for (let k = 0; k < 8; k++) put((k * 2654435761 + round * 40503) % tiles, 1000 + round);
    }
    return { tiles, bytes: (scene.uploads.bytes - before) / rounds, ms: (performance.now() - begin) / rounds };
  }, side);
  console.log(`${side}  ${row.tiles}  ${Math.round(row.bytes)}  ${row.ms.toFixed(2)}`);
}
await browser.close();
process.exit(0);
