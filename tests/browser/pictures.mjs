// Screenshots of the monitor's page for README.md.
//
// usage: node pictures.mjs LEADLINE LOG MODULES OUT
//   LEADLINE  the program; LOG: a vehicle's log, such as out/demo/survey.lll
//   MODULES   folder with node_modules/playwright-core (build/browser); OUT: where live*.png go
import path from "node:path";
import { downlinkFrames, openBrowser, sendFrames, startMonitor } from "./support.mjs";

const [program, log, modules, out] = process.argv.slice(2);
// The frames of minutes go in seconds: what they may be is as much faster.
const { url, port } = await startMonitor(program, "udp:@127.0.0.1:0", "127.0.0.1:0", ["--budget", "4000"]);
const browser = await openBrowser(modules);
const page = await browser.newPage({ viewport: { width: 960, height: 600 } });
await page.goto(url);

const frames = downlinkFrames(log);
const send = (from, to) => sendFrames(frames, port, from, to, 10);
const still = async () => {
  await page.waitForFunction(() => window.leadline.page.complete && document.querySelector("#state span").textContent.startsWith("Live"));
  await page.waitForTimeout(1200);
};
const shot = (name) => page.screenshot({ path: path.join(out, `${name}.png`) });

await send(0, 0.62);
await still();
await shot("live");
await send(0.62, 0.9);
await still();
await page.keyboard.press("v");
await page.keyboard.press("p");
await page.waitForTimeout(600);
await page.mouse.click(210, 220);
await page.mouse.click(440, 330);
await page.waitForTimeout(600);
await shot("live-profile");
await page.keyboard.press("Escape");
await page.keyboard.press("v");
await page.keyboard.press("2");
await page.keyboard.press("t");
await page.click("#tab-display");
await page.check("#obstacles");
await page.waitForTimeout(800);
await shot("live-sunlight");
await page.uncheck("#obstacles");
await page.keyboard.press("t");
await page.keyboard.press("1");
await page.setViewportSize({ width: 390, height: 844 });
await page.reload();
await page.waitForFunction(() => window.leadline.page.complete);
await page.waitForTimeout(1200);
await page.touchscreen.tap(200, 330).catch(() => page.mouse.click(200, 330));
await page.waitForTimeout(600);
await shot("live-small");
await browser.close();
process.exit(0);
