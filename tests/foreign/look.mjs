// Opens a page of `springs view` in a headless Chromium, uses it as a person would, and
// says as JSON what it shows: node look.mjs CHROMIUM PAGE WIDTH HEIGHT [PICTURE.png] [dark].

import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [chromium, page, width, height, picture, scheme] = process.argv.slice(2);
const profile = mkdtempSync(join(tmpdir(), "springs-look-"));
const browser = spawn(
  chromium,
  [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    `--user-data-dir=${profile}`,
    "--remote-debugging-pipe",
    "about:blank",
  ],
  { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] },
);

let [received, next] = ["", 1];
const waiting = new Map();
const problems = [];
browser.stdio[4].on("data", (part) => {
  const messages = (received + part).split("\0");
  received = messages.pop();
  for (const text of messages) {
    const { id, method, params, result, error } = JSON.parse(text);
    waiting.get(id)?.(error ?? result);
    if (method === "Runtime.exceptionThrown") problems.push(params.exceptionDetails.exception?.description);
    if (method === "Log.entryAdded" && params.entry.level === "error") problems.push(params.entry.text);
    if (method === "Network.requestWillBeSent" && !/^(file|data|blob):/.test(params.request.url)) problems.push(params.request.url);
  }
});

let sessionId;
function send(method, params = {}) {
  const id = next++;
  browser.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
  return new Promise((done) => waiting.set(id, done));
}

async function value(expression) {
  const { result, exceptionDetails } = await send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(exceptionDetails.exception?.description);
  return result.value;
}

async function mouse(type, x, y, more = {}) {
  await send("Input.dispatchMouseEvent", { type, x, y, button: "left", clickCount: 1, ...more });
}

async function click(x, y) {
  await mouse("mousePressed", x, y, { buttons: 1 });
  await mouse("mouseReleased", x, y);
}

async function key(name, text) {
  await send("Input.dispatchKeyEvent", { type: "keyDown", key: name, text });
  await send("Input.dispatchKeyEvent", { type: "keyUp", key: name });
}

const frames = (n) => value(`new Promise((done) => { let left = ${n}; const tick = () => (left-- > 0 ? requestAnimationFrame(tick) : done()); tick(); })`);

try {
  const { targetInfos } = await send("Target.getTargets");
  const { targetId } = targetInfos.find(({ type }) => type === "page");
  ({ sessionId } = await send("Target.attachToTarget", { targetId, flatten: true }));
  for (const domain of ["Page", "Runtime", "Log", "Network"]) await send(`${domain}.enable`);
  const isPhone = Number(width) < 600;
  await send("Emulation.setDeviceMetricsOverride", { width: Number(width), height: Number(height), deviceScaleFactor: isPhone ? 2 : 1, mobile: isPhone });
  await send("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme ?? "light" }] });
  const begin = Date.now();
  await send("Page.navigate", { url: pathToFileURL(resolve(page)).href });
  const isThere = "Boolean(window.view) || (document.getElementById('status')?.textContent ?? '').startsWith('This')";
  while (!(await value(isThere))) await new Promise((done) => setTimeout(done, 20));
  const load = (Date.now() - begin) / 1000;
  const problem = await value("window.view ? null : document.getElementById('status').textContent");
  if (problem) throw new Error(problem);

  // It plays; how many pictures a second?
  const from = Date.now();
  await frames(40);
  const rate = 40 / ((Date.now() - from) / 1000);
  const isPlaying = await value("view.isPlaying");
  // Space stops it, and the scrubber goes to the middle.
  await value("document.getElementById('scene').focus()");
  await key(" ", " ");
  const isStopped = !(await value("view.isPlaying"));
  await value("view.seek(0.5 * (view.start + view.end))");
  await frames(3);

  // A click on where a node is drawn picks it, one on the middle of a spring that.
  const place = `(({ x, y }) => { const box = document.getElementById('scene').getBoundingClientRect(); return [box.left + x, box.top + y]; })`;
  const node = await value("Math.floor(view.run.nodes / 2)");
  await click(...(await value(`${place}(view.picture.project(${node}))`)));
  await frames(2);
  const pickedNode = await value("view.picked");
  const values = await value("[...document.querySelectorAll('#values dd')].map((dd) => dd.textContent)");
  const numbers = await value("(() => { const [frame, fraction] = view.frameAt(view.time); const f = frame + Math.round(fraction); const i = view.picked?.index ?? 0; return { time: view.run.times[f], position: [0, 1, 2].map((axis) => view.run.position.at(f, 3 * i + axis)), speed: view.run.speed.at(f, i) }; })()");
  let pickedSpring = null;
  const spring = await value("Math.floor(view.run.springs / 2)");
  if (spring > 0) {
    const middle = `(() => { const [a, b] = [0, 1].map((end) => view.picture.project(view.run.ends[2 * ${spring} + end])); return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 }; })()`;
    await click(...(await value(`${place}(${middle})`)));
    await frames(2);
    pickedSpring = await value("view.picked");
  }
  const turn = await value("view.camera.turn");
  await mouse("mousePressed", Number(width) / 3, Number(height) / 4, { buttons: 1 });
  await mouse("mouseMoved", Number(width) / 3 + 30, Number(height) / 4, { buttons: 1 });
  await mouse("mouseReleased", Number(width) / 3 + 30, Number(height) / 4);
  const turned = (await value("view.camera.turn")) - turn;
  // The wheel and two fingers zoom in.
  const [x, y] = [Number(width) / 3, Number(height) / 4];
  const distances = [await value("view.camera.distance")];
  await send("Input.dispatchMouseEvent", { type: "mouseWheel", x, y, deltaX: 0, deltaY: -100 });
  await frames(2);
  distances.push(await value("view.camera.distance"));
  await send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 2 });
  for (const [type, spread] of [["touchStart", 20], ["touchMove", 30], ["touchMove", 60], ["touchEnd", 0]]) {
    const fingers = [{ x: x - spread, y, id: 0 }, { x: x + spread, y, id: 1 }];
    await send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : fingers });
  }
  await frames(2);
  distances.push(await value("view.camera.distance"));
  await value("view.home()");
  await frames(3);
  if (picture) {
    const { data } = await send("Page.captureScreenshot", { format: "png" });
    writeFileSync(picture, Buffer.from(data, "base64"));
  }
  const plots = await value("document.querySelectorAll('.plot svg').length");
  const isWider = await value("document.documentElement.scrollWidth > document.documentElement.clientWidth");
  const unnamed = await value("[...document.querySelectorAll('button, input, select, canvas, svg')].filter((one) => !(one.getAttribute('aria-label') || one.labels?.length || one.textContent.trim())).map((one) => one.outerHTML)");
  const marks = await value("[...document.querySelectorAll('#marks li:not([hidden])')].map((one) => one.textContent.replace('→', ''))");
  // The arrow of the first load, from its node to its tip, in m.
  const arrow = await value("(() => { view.seek(view.end); view.show(); const { arrows, picture, run } = view; if (arrows.nodes.length === 0) return null; const at = (i) => [...picture.positions.subarray(4 * i, 4 * i + 3)]; const [a, b] = [at(arrows.nodes[0]), at(run.nodes)]; return { vector: b.map((x, axis) => x - a[axis]), force: arrows.forceAt(arrows.nodes[0], view.end) }; })()");
  console.log(JSON.stringify({ marks, arrow, load, rate, isPlaying, isStopped, node, pickedNode, values, numbers, spring, pickedSpring, turned, distances, plots, isWider, unnamed, problems }));
} catch (error) {
  console.error(error.message, problems);
  process.exitCode = 1;
} finally {
  browser.kill();
  await new Promise((done) => browser.on("close", done));
  rmSync(profile, { recursive: true, force: true });
}
