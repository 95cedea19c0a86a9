// Opens a page in a headless browser and does what a person would; prints what was seen as JSON.
const { chromium } = require("playwright-core");
const [, , executablePath, file, folder] = process.argv;
const ARGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
  "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"];

// Pixels of the 3D view in each half that are red, as deep penetration is painted.
const redHalves = () => {
  const view = document.getElementById("view"), flat = document.createElement("canvas");
  flat.width = view.width;
  flat.height = view.height;
  const pen = flat.getContext("2d");
  pen.drawImage(view, 0, 0);
  const { data } = pen.getImageData(0, 0, flat.width, flat.height), red = [0, 0];
  for (let i = 0; i < data.length; i += 4)
    if (data[i] - data[i + 1] > 48) red[((i / 4) % flat.width) * 2 < flat.width ? 0 : 1]++;
  return red;
};
const pixels = () => Array.from(document.getElementById("view").toDataURL());

(async () => {
  const browser = await chromium.launch({ executablePath, args: ARGS, timeout: 120000 });
  const page = await browser.newPage({ viewport: { width: 900, height: 640 }, colorScheme: "light" });
  page.setDefaultTimeout(120000);
  const messages = [], requests = [];
  page.on("console", (message) => { if (message.type() === "error") messages.push(message.text()); });
  page.on("pageerror", (error) => messages.push(error.message));
  page.on("request", (request) => { if (/^(https?|wss?):/.test(request.url())) requests.push(request.url()); });
  await page.goto(`file://${file}`);
  await page.waitForSelector("body[data-ready=yes]");
  const drawn = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const state = (name) => page.evaluate((key) => geneoh.state[key], name);

  await drawn();
  const red = await page.evaluate(redHalves);
  await page.screenshot({ path: `${folder}/page.png` });
  const box = await page.locator("#curves").boundingBox();
  await page.mouse.click(box.x + box.width - 5, box.y + 20);
  const scrubbed = await state("frame");
  await page.keyboard.press("Home");
  await page.keyboard.press("End");
  await page.click("#play");
  await page.waitForFunction((from) => geneoh.state.frame !== from, scrubbed);
  const played = await state("frame");
  await page.click("#play");
  const before = await page.evaluate(pixels);
  await page.selectOption("#colouring", "contact");
  await page.selectOption("#sample", "0");
  await page.keyboard.press("v");
  await page.keyboard.press("d");
  await drawn();
  const after = await page.evaluate(pixels);
  const changed = before.filter((value, i) => value !== after[i]).length;
  const legend = (await page.textContent("#legend")).trim();
  const seen = { messages, requests, scrubbed, played, red, changed, legend,
    layout: await state("layout"), sample: await state("sample") };
  await browser.close();
  console.log(JSON.stringify(seen));
})().catch((error) => { console.error(error); process.exit(1); });
