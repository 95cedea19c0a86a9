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

/** Where the text of the time ends, and where the slider begins, pixels. */
const columns = () => [document.getElementById("time").getBoundingClientRect().right,
  document.getElementById("frame").getBoundingClientRect().left];

async function onScreen(browser) {
  const page = await open(browser, { viewport: { width: 900, height: 640 } });
  await ready(page, file);
  const seen = { parts: await page.evaluate(parts), shades: await page.evaluate(shades) };
  seen.columns = [];
  for (const frame of [0, 5]) {
    await page.evaluate((to) => geneoh.goTo(to), frame);
    seen.columns.push(await page.evaluate(columns));
  }
  const notes = page.locator("#notes li"), shown = () => notes.first().isVisible();
  seen.notes = { atFirst: await shown(), texts: await notes.allTextContents() };
  await page.click("#notes summary");
  seen.notes.open = await shown();
  return seen;
}

async function byKeys(browser) {
  const page = await open(browser, { viewport: { width: 900, height: 640 } });
  await ready(page, file);
  const state = () => page.evaluate(() => {
    const { frame, playing, seeThrough, colouring } = geneoh.state, { yaw, pitch, zoom } = geneoh.orbit;
    const help = document.getElementById("help").getAttribute("aria-expanded");
    const open = [!document.getElementById("keys").hidden, document.getElementById("notes").open];
    return { frame, playing, seeThrough, colouring, yaw, pitch, zoom, help, open };
  });
  /** What keys change, pressed one after the other while an element has the focus. */
  const changes = async (selector, ...keys) => {
    await page.focus(selector);
    const before = await state();
    for (const key of keys) await page.keyboard.press(key);
    const after = await state();
    return Object.fromEntries(Object.entries(after).filter(
      ([name, value]) => JSON.stringify(value) !== JSON.stringify(before[name])));
  };
  return {
    button: await changes("#seeThrough", "Space"),
    list: await changes("#colouring", "End"),
    open: await changes("#notes summary", "Space", "?"),
    closed: await changes("#help", "Escape"),
    turned: await changes("#view", "Shift+ArrowRight", "Shift+ArrowUp"),
    nearer: await changes("#view", "+"),
    play: await changes("#play", "Space"),
    ten: await changes("#frame", "Home", "Shift+ArrowRight"),
  };
}

async function inForcedColours(browser) {
  const page = await open(browser, { viewport: { width: 900, height: 640 }, forcedColors: "active" });
  await ready(page, file);
  return {
    legend: await styled(page, "#legend i", "backgroundImage"),
    dot: await styled(page, ".depth i", "backgroundColor"),
    name: await styled(page, ".before .name", "color"),
    value: await styled(page, ".after.value", "color"),
    border: await styled(page, "[aria-pressed=true]", "borderTopWidth"),
  };
}

/** As a window of 1280 by 1024 pixels at 400% zoom. */
async function magnified(browser) {
  const page = await open(browser, { viewport: { width: 320, height: 256 } });
  await ready(page, file);
  return page.evaluate(() => {
    const end = (one) => one.getBoundingClientRect().right, panels = Array.from(document.getElementById("titles").children);
    return {
      overflow: getComputedStyle(document.body).overflowY,
      wide: document.documentElement.scrollWidth,
      beside: Math.max(...panels.map((panel) => end(panel.querySelector(".depth")) - end(panel))),
    };
  });
}

inBrowser(executablePath, async (browser) => ({
  magnified: await magnified(browser),
  forced: await inForcedColours(browser),
  keys: await byKeys(browser),
  ...(await onScreen(browser)),
  paper: await onPaper(browser),
}));
