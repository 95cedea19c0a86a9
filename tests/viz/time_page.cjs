// Seconds of its own thread's time that a page takes to open, and for each picture while it plays.
const { inBrowser, open, ready } = require("./browser.cjs");
const [, , executablePath, file] = process.argv;
const PLAYED = 3000;

inBrowser(executablePath, async (browser) => {
  const page = await open(browser, { viewport: { width: 1280, height: 800 } });
  const session = await page.context().newCDPSession(page);
  await session.send("Performance.enable", { timeDomain: "threadTicks" });
  const spent = async () => {
    const { metrics } = await session.send("Performance.getMetrics");
    return metrics.find((metric) => metric.name === "TaskDuration").value;
  };
  const start = Date.now();
  await ready(page, file);
  const wall = (Date.now() - start) / 1000, opening = await spent();
  await page.waitForFunction(() => geneoh.sharp());
  const before = await spent();
  const frames = await page.evaluate(async (long) => {
    const seen = new Set(), start = performance.now();
    document.getElementById("play").click();
    while (performance.now() - start < long) {
      await new Promise(requestAnimationFrame);
      seen.add(geneoh.state.frame);
    }
    document.getElementById("play").click();
    return seen.size;
  }, PLAYED);
  return { wall, opening, playing: ((await spent()) - before) / frames, rate: (1000 * frames) / PLAYED };
});
