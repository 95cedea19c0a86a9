// Opens a page of a body with an object, also as people do who print it; prints what was seen as JSON.
const { inBrowser, open, ready } = require("./browser.cjs");
const [, , executablePath, file] = process.argv;

/** The value of a CSS property of the first element that a selector finds. */
const styled = (page, selector, property) =>
  page.$eval(selector, (one, name) => getComputedStyle(one)[name], property);

async function onPaper(browser) {
  const page = await open(browser, { viewport: { width: 1280, height: 800 } });
  await ready(page, file);
  await page.emulateMedia({ media: "print" });
  const colours = await Promise.all(
    ["#legend i", ".depth i"].map((selector) => styled(page, selector, "webkitPrintColorAdjust")));
  return { fit: await styled(page, "#view", "objectFit"), colours };
}

/** Numbers of pixels that are as blue as the object, and as grey as a limb. */
const parts = () => {
  const view = document.getElementById("view");
  const { data } = view.getContext("2d").getImageData(0, 0, view.width, view.height);
  const found = { object: 0, limb: 0 };
  for (let at = 0; at < data.length; at += 4) {
    const blueness = (data[at + 2] - data[at]) / data[at + 2];
    if (blueness > 0.2) found.object++;
    else if (blueness > 0.04 && blueness < 0.09) found.limb++;
  }
  return found;
};

/** For each frame, whether something is drawn above the curve of the first measure. */
const shades = () => {
  const plot = document.querySelector("#curves canvas"), pen = plot.getContext("2d"), last = geneoh.scene.frames - 1;
  return Array.from({ length: last + 1 }, (_, t) =>
    pen.getImageData(8 + (t / last) * (plot.width - 16), 1, 1, 1).data[3] > 0);
};

async function onScreen(browser) {
  const page = await open(browser, { viewport: { width: 900, height: 640 } });
  await ready(page, file);
  const seen = { parts: await page.evaluate(parts), shades: await page.evaluate(shades) };
  const notes = page.locator("#notes li"), shown = () => notes.first().isVisible();
  seen.notes = { atFirst: await shown(), texts: await notes.allTextContents() };
  await page.click("#notes summary");
  seen.notes.open = await shown();
  return seen;
}

inBrowser(executablePath, async (browser) => ({
  ...(await onScreen(browser)),
  paper: await onPaper(browser),
}));
