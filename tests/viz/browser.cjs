// A headless browser without a GPU, and a page of it that is open.
const { chromium } = require("playwright-core");
const ARGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--no-first-run"];

// Milliseconds that a step may take: long, for machines that do much else at the same time.
const PATIENCE = 300000;

/** Launch a browser, call `work` with it, close it, print what came back as JSON. */
exports.inBrowser = async (executablePath, work) => {
  const browser = await chromium.launch({ executablePath, args: ARGS, timeout: PATIENCE });
  try {
    console.log(JSON.stringify(await work(browser)));
  } catch (error) {
    console.error(error);
    process.exitCode = 1;
  }
  await browser.close();
};

/** Two pictures are drawn after what happened before. */
exports.drawn = (page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

exports.open = async (browser, options) => {
  const page = await browser.newPage({ colorScheme: "light", ...options });
  page.setDefaultTimeout(PATIENCE);
  return page;
};

exports.ready = async (page, file) => {
  await page.goto(`file://${file}`);
  await page.waitForSelector("body[data-ready=yes]");
  await exports.drawn(page);
};
