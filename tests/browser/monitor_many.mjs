// Many at one monitor while the map grows: two tabs that are reloaded in mid flight, visitors that talk nonsense, guests
// of its link that come, are killed and come late, one of them with the same store. In the end all have one map.
//
// usage: node monitor_many.mjs LEADLINE MODULES
//   LEADLINE the program; MODULES: folder with node_modules/playwright-core
// Exit code: 0 passed, 1 failed, 77 no browser.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import net from "node:net";
import { PATIENCE_MS, downlinkFrames, sendFrames, setUp, startMonitor, watch } from "./support.mjs";

const [program, modules] = process.argv.slice(2);
const { browser, scratch, log, wanted } = await setUp(program, modules);
const frames = downlinkFrames(log);
const socket = `${scratch}/link.sock`, store = `${scratch}/monitor.lls`, own = `${scratch}/guest.lls`;
const monitor = await startMonitor(program, "udp:@127.0.0.1:0", "127.0.0.1:0", ["--store", store, "--share", socket]);
const port = Number(new URL(monitor.url).port);

function receive(...more) {
  const child = spawn(program, ["receive", "--link", `unix:${socket}`, ...more], { stdio: "ignore" });
  child.ended = new Promise((done) => child.on("exit", done));
  return child;
}
function nonsense(bytes) {
  return new Promise((done) => {
    const visitor = net.connect(port, "127.0.0.1", () => visitor.write(bytes, () => visitor.destroy()));
    visitor.on("error", () => {});
    visitor.on("close", done);
  });
}

const complaints = [];
const tabs = [];
for (let k = 0; k < 2; k++) {
  const tab = watch(await browser.newPage({ viewport: { width: 640, height: 400 } }), complaints);
  await tab.goto(monitor.url);
  tabs.push(tab);
}
const rounds = 6;
for (let k = 0; k < rounds; k++) {
  const guest = receive(...(k % 2 ? ["--store", store] : []));
  await Promise.all([
    sendFrames(frames, monitor.port, k / rounds, (k + 1) / rounds),
    tabs[k % 2].reload(),
    nonsense(k % 2 ? "GET /live HTTP/1.1\r\nHost: 127" : Buffer.from([0, 255, 1, 13, 10])),
  ]);
  guest.kill(k % 3 ? "SIGKILL" : "SIGTERM");
  await guest.ended;
}
const late = receive("--store", own);
for (const tab of tabs) await tab.waitForFunction((count) => window.leadline.page.store?.known === count, wanted.known_cells, { timeout: PATIENCE_MS });
const stored = (file) => {
  try {
    return JSON.parse(execFileSync(program, ["store", "show", file, "--json"], { stdio: ["ignore", "pipe", "ignore"] }));
  } catch {
    return {};  // not there yet
  }
};
const deadline = Date.now() + PATIENCE_MS;
while (stored(own).known_cells !== wanted.known_cells && Date.now() < deadline) await new Promise((done) => setTimeout(done, 200));
late.kill("SIGTERM");
assert.equal(await late.ended, 0);
monitor.child.kill("SIGTERM");
assert.equal(await monitor.child.ended, 0);
for (const file of [store, own]) assert.equal(stored(file).cells_hash, wanted.cells_hash, file);
assert.deepEqual(complaints, []);
await browser.close();
process.exit(0);
