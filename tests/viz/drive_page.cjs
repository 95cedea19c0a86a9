// Opens a page in a headless browser and does what a person would; prints what was seen as JSON.
const { inBrowser, open, ready, drawn } = require("./browser.cjs");
const [, , executablePath, file, folder] = process.argv;

// Shares of the view: red as deep penetration is painted, skin and object; in each half of it.
const regions = (stacked) => {
  const view = document.getElementById("view"), { width, height } = view;
  const { data } = view.getContext("2d").getImageData(0, 0, width, height);
  const found = { red: [0, 0], skin: [0, 0], object: [0, 0] };
  for (let at = 0; at < width * height; at++) {
    const half = Number(stacked ? 2 * Math.floor(at / width) >= height : 2 * (at % width) >= width);
    const [red, green, blue] = data.subarray(4 * at, 4 * at + 3);
    if (red - green > 70) found.red[half]++;
    else if (red - blue > 25) found.skin[half]++;
    else if (blue - red > 15) found.object[half]++;
  }
  return found;
};
/** The share of the view's pixels that differ from the last time this was asked. */
const changed = () => {
  const view = document.getElementById("view"), last = window.last ?? [];
  const now = new Uint32Array(view.getContext("2d").getImageData(0, 0, view.width, view.height).data.buffer);
  window.last = now;
  return last.length === now.length ? now.filter((v, i) => v !== last[i]).length / now.length : 1;
};

inBrowser(executablePath, async (browser) => {
  const page = await open(browser, { viewport: { width: 900, height: 640 } });
  const messages = [], requests = [];
  page.on("console", (message) => { if (message.type() === "error") messages.push(message.text()); });
  page.on("pageerror", (error) => messages.push(error.message));
  page.on("request", (request) => { if (/^(https?|wss?):/.test(request.url())) requests.push(request.url()); });
  await ready(page, file);
  const state = (name) => page.evaluate((key) => geneoh.state[key], name);
  const rested = () => page.waitForFunction(() => geneoh.sharp());

  await rested();
  const first = await page.evaluate(regions, false);
  await page.screenshot({ path: `${folder}/page.png` });
  const box = await page.locator("#curves").boundingBox();
  await page.mouse.click(box.x + box.width - 5, box.y + 20);
  const scrubbed = await state("frame");
  await page.keyboard.press("Home");
  await page.keyboard.press("End");
  await page.click("#play");
  // the frame is read where it is waited for: a clip this short is soon back at the same one
  const other = (from) => geneoh.state.frame !== from && { frame: geneoh.state.frame };
  const { frame: played } = await (await page.waitForFunction(other, scrubbed)).jsonValue();
  await page.click("#play");

  await rested();
  await page.evaluate(changed);
  const stage = await page.locator("#view").boundingBox();
  await page.mouse.move(stage.x + 200, stage.y + 200);
  await page.mouse.down();
  await page.mouse.move(stage.x + 280, stage.y + 230, { steps: 4 });
  await page.mouse.up();
  await rested();
  const turned = await page.evaluate(changed);
  await page.selectOption("#colouring", "contact");
  await page.selectOption("#sample", "0");
  await rested();
  const painted = await page.evaluate(changed);
  const legend = (await page.textContent("#legend")).trim();
  await page.keyboard.press("v");
  await page.keyboard.press("d");
  await drawn(page);
  const seen = { messages, requests, scrubbed, played, first, turned, painted, legend,
    layout: await state("layout"), sample: await state("sample") };

  const phone = await open(browser, { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 });
  phone.on("pageerror", (error) => messages.push(error.message));
  await ready(phone, file);
  await phone.waitForFunction(() => geneoh.sharp());
  await phone.screenshot({ path: `${folder}/phone.png` });
  const overflow = () => Array.from(document.querySelectorAll("body *")).filter((one) => {
    const { left, right, width } = one.getBoundingClientRect();
    return width && (left < -1 || right > innerWidth + 1);
  }).length;
  seen.phone = { ...(await phone.evaluate(regions, true)), overflow: await phone.evaluate(overflow) };

  // every control can be used in a narrow window too
  const narrow = await open(browser, { viewport: { width: 500, height: 900 } });
  await ready(narrow, file);
  await narrow.waitForFunction(() => geneoh.sharp());
  await narrow.screenshot({ path: `${folder}/narrow.png` });
  await narrow.click("#follow");
  await narrow.click("#help");
  seen.narrow = { follow: await narrow.evaluate(() => geneoh.state.follow),
    keys: await narrow.isVisible("#keys"), overflow: await narrow.evaluate(overflow) };
  return seen;
});
