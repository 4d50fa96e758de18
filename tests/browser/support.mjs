// What the browser's programs share: the browser, a monitor to look at, a vehicle's voice.
import { execFileSync, spawn } from "node:child_process";
import dgram from "node:dgram";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";

/** How long a test waits for what has to come: a net, not a measure. */
export const PATIENCE_MS = 120000;

/** For tests: a browser, an empty folder, and the log of a small survey with the map that `receive` makes of it (receive.json,
 * depth.asc). Ends the program with 77 where there is no browser. */
export async function setUp(program, modules) {
  let browser;
  try {
    browser = await openBrowser(modules);
  } catch (error) {
    console.log(`skipped: ${error.message} (toolchain/setup.sh --checks)`);
    process.exit(77);
  }
  const scratch = fs.mkdtempSync(path.join(os.tmpdir(), "leadline-page."));
  process.on("exit", () => fs.rmSync(scratch, { recursive: true, force: true }));
  const quiet = { stdio: ["ignore", "ignore", "ignore"] };
  execFileSync(program, ["simulate", "--set", "north_count=64", "--set", "east_count=80", "--set", "margin_cells=4", "--out", `${scratch}/survey`], quiet);
  const log = `${scratch}/survey/survey.lll`;
  execFileSync(program, ["receive", "--link", `file:${log}`, "--out", `${scratch}/map`], quiet);
  return { browser, scratch, log, map: `${scratch}/map`, wanted: JSON.parse(fs.readFileSync(`${scratch}/map/receive.json`)) };
}

/** Collects what a page complains of, and what it asks for outside of this machine. */
export function watch(page, complaints) {
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => {
    // A connection refused is what a dead monitor looks like.
    if (message.type() === "error" && !/WebSocket|ERR_CONNECTION_REFUSED/.test(message.text())) complaints.push(message.text());
  });
  page.on("request", (request) => {
    if (!/^(http|ws):\/\/127\.0\.0\.1[:/]|^data:/.test(request.url())) complaints.push(`asks for ${request.url()}`);
  });
  return page;
}

/** Chromium by Playwright from `modules`/node_modules. Throws where either is missing. */
export async function openBrowser(modules) {
  const { chromium } = createRequire(path.join(path.resolve(modules), "x"))("playwright-core");
  const executablePath = process.env.LEADLINE_CHROMIUM ?? "/usr/bin/chromium";
  fs.accessSync(executablePath, fs.constants.X_OK);
  return chromium.launch({
    executablePath, headless: true,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
      "--disable-background-networking", "--disable-component-update", "--disable-sync"],
  });
}

const running = [];
process.on("exit", () => running.forEach((child) => child.kill("SIGKILL")));

/** A monitor that serves its page: { child, url, port (of the link, 0 for files) }. `source`: a link's URI, or a file. */
export async function startMonitor(program, source, http = "127.0.0.1:0", more = []) {
  const from = /^(udp|tcp|file):/.test(source) ? ["--link", source] : [source];
  const child = spawn(program, ["monitor", ...from, "--http", http, ...more], { stdio: ["ignore", "ignore", "pipe"] });
  running.push(child);
  child.ended = new Promise((done) => child.on("exit", done));
  let said = "";
  const [url, port] = await new Promise((done, fail) => {
    child.stderr.on("data", (data) => {
      said += data;
      const page = said.match(/page is at (http:\S+)\n/);
      if (page) done([page[1], Number(said.match(/listening at port (\d+)/)?.[1] ?? 0)]);
    });
    child.on("exit", (code) => fail(new Error(`monitor ended with ${code}: ${said}`)));
  });
  return { child, url, port };
}

/** The frames of the downlink in a vehicle's log, as they were sent: what a topside would have heard. */
export function downlinkFrames(log) {
  const bytes = fs.readFileSync(log);
  const frames = [];
  for (let at = 0; at < bytes.length;) {
    let end = bytes.indexOf(0, at);
    if (end < 0) end = bytes.length;
    // COBS: unless the first code is 1 (a zero), the payload's first byte, its type, is the second here.
    if (end > at + 1 && bytes[at] > 1 && bytes[at + 1] < 0x40) frames.push(Buffer.concat([Buffer.from([0]), bytes.subarray(at, end), Buffer.from([0])]));
    at = end + 1;
  }
  return frames;
}

/** The payload of a frame, and a frame of a payload (proto/SPEC.md, "Frame"). */
export function unframed(frame) {
  const out = [];
  const body = frame.subarray(1, -1);
  for (let at = 0; at < body.length; at += body[at]) {
    out.push(...body.subarray(at + 1, at + body[at]));
    if (body[at] < 255) out.push(0);
  }
  return Buffer.from(out.slice(0, -5)); // the last zero is not data; the CRC
}
export function framed(payload) {
  let crc = ~0;
  for (const byte of payload) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0x82f63b78 : 0);
  }
  const tail = Buffer.alloc(4);
  tail.writeUInt32LE(~crc >>> 0);
  const out = [0];
  let block = [];
  for (const byte of [...payload, ...tail, 0]) {
    if (byte !== 0) block.push(byte);
    if (byte === 0 || block.length === 254) {
      out.push(block.length + 1, ...block);
      block = [];
    }
  }
  return Buffer.from([...out, 0]);
}

/** Sends the frames from share `from` to share `to`, each a datagram, over about `seconds`. */
export async function sendFrames(frames, port, from, to, seconds = 0.5) {
  const socket = dgram.createSocket("udp4");
  const part = frames.slice(Math.floor(from * frames.length), Math.floor(to * frames.length));
  const burst = Math.max(Math.ceil(part.length / (seconds * 50)), 1);
  for (let k = 0; k < part.length; k++) {
    await new Promise((done) => socket.send(part[k], port, "127.0.0.1", done));
    if (k % burst === burst - 1) await new Promise((done) => setTimeout(done, 20));
  }
  socket.close();
}
