// Opens a page as people do who print it; prints what was seen as JSON.
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

inBrowser(executablePath, async (browser) => ({ paper: await onPaper(browser) }));
