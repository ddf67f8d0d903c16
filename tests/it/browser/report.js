"use strict";

// The report of a run: sorting, explorer, zoom, views, light and dark, narrow, print, links.

const fs = require("node:fs");
const path = require("node:path");
const { assert, withReport, picture, main } = require("./page.js");

const values = (page, table, column) => page.$$eval(`#${table} tbody tr`, (rows, at) => rows.map((row) => {
  const cell = row.cells[at];
  return cell.dataset.missing !== undefined ? null : cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
}), column);

async function sorting(page) {
  const head = page.locator("#table_5 thead th").last();
  const column = await page.locator("#table_5 thead th").count() - 1;
  const before = await values(page, "table_5", column);
  assert.equal(await head.getAttribute("aria-sort"), null);
  await head.locator("button").click();
  assert.equal(await head.getAttribute("aria-sort"), "ascending");
  const rising = await values(page, "table_5", column);
  const numbers = rising.filter((v) => typeof v === "number");
  assert.ok(numbers.length > 2, `${rising}`);
  assert.deepEqual(numbers, [...numbers].sort((a, b) => a - b));
  // what is missing comes last in both directions
  const missing = before.filter((v) => v === null).length;
  assert.ok(rising.slice(rising.length - missing).every((v) => v === null));
  await head.locator("button").focus();
  await page.keyboard.press("Enter");
  assert.equal(await head.getAttribute("aria-sort"), "descending");
  const falling = await values(page, "table_5", column);
  assert.deepEqual(falling.filter((v) => typeof v === "number"), [...numbers].reverse());
  assert.ok(falling.slice(falling.length - missing).every((v) => v === null));
  await page.keyboard.press("Space");
  assert.equal(await head.getAttribute("aria-sort"), null);
  assert.deepEqual(await values(page, "table_5", column), before);
}

async function explorer(page, folder) {
  const heading = () => page.textContent("#trial h3");
  const count = fs.readdirSync(path.join(folder, "trials")).filter((name) => /^\d+$/.test(name)).length;
  assert.equal(await page.locator("#trial-list tbody tr:not(.gap)").count(), count);
  await page.click("#row-1");
  assert.match(await heading(), /^Trial 1 /);
  assert.equal(await page.getAttribute("#row-1", "aria-selected"), "true");
  assert.equal(await page.evaluate(() => location.hash), "#trial-1");
  const params = JSON.parse(fs.readFileSync(path.join(folder, "trials/0001/params.json")));
  const text = await page.textContent("#trial");
  for (const { name } of params.params) assert.ok(text.includes(name), name);
  assert.ok(text.includes(params.state) && text.includes("Duration"), text);
  assert.ok(!text.includes("not recorded"));
  assert.equal(await page.locator("#trial .chart").count(), 2);

  await page.focus("#trial-list");
  await page.keyboard.press("ArrowDown");
  assert.match(await heading(), /^Trial 2 /);
  assert.equal(await page.getAttribute("#trial-list", "aria-activedescendant"), "row-2");
  await page.keyboard.press("Home");
  assert.match(await heading(), /^Trial 0 /);
  await page.keyboard.press("End");
  assert.match(await heading(), new RegExp(`^Trial ${count - 1} `));

  await page.fill("#trial-filter", "number=2");
  assert.equal(await page.locator("#trial-list tbody tr:not(.gap)").count(), 1);
  await page.fill("#trial-filter", "nothing-has-this");
  assert.equal(await page.locator("#trial-list tbody tr:not(.gap)").count(), 0);
  await page.fill("#trial-filter", "");

  // a click in the drawing chooses what is nearest
  const drawing = await page.locator(".history svg").boundingBox();
  await page.mouse.click(drawing.x + 63, drawing.y + drawing.height / 2);
  assert.match(await heading(), /^Trial 0 /);

  await page.selectOption("#trial-param", { label: params.params[0].name });
  assert.ok((await page.textContent("#trial-list thead")).includes(params.params[0].name));
  await page.selectOption("#trial-param", "-1");
  await page.evaluate(() => { location.hash = "#trial-1"; });
  await page.waitForFunction(() => document.querySelector("#trial h3").textContent.startsWith("Trial 1 "));
}

async function zoom(page) {
  const open = () => page.evaluate(() => document.querySelector("dialog").open);
  const box = () => page.getAttribute("dialog svg", "viewBox");
  const button = page.locator("#figure_10 .enlarge");
  await button.focus();
  await page.keyboard.press("Enter");
  assert.equal(await open(), true);
  const whole = await box();
  await page.keyboard.press("+");
  const enlarged = await box();
  assert.ok(Number(enlarged.split(" ")[2]) < Number(whole.split(" ")[2]));
  await page.keyboard.press("ArrowRight");
  assert.notEqual(await box(), enlarged);
  await page.keyboard.press("0");
  assert.equal(await box(), whole);
  const at = await page.locator("dialog svg").boundingBox();
  await page.mouse.move(at.x + at.width / 2, at.y + at.height / 2);
  await page.mouse.wheel(0, -300);
  await page.waitForFunction((before) => document.querySelector("dialog svg").getAttribute("viewBox") !== before, whole);
  await picture(page, "zoom");
  await page.keyboard.press("Escape");
  assert.equal(await open(), false);
  assert.ok(await button.evaluate((b) => b === document.activeElement), "the focus is where it was");
}

async function views(page) {
  assert.ok(await page.locator("#views figure").count() >= 3);
  const grids = await page.$$eval("#views figure", (all) => all.map((f) => [...f.querySelectorAll("g path")].map((p) => p.getAttribute("d").length)));
  assert.ok(grids.every((lengths) => lengths[0] > 100 && lengths[4] > 100), JSON.stringify(grids));
  const decoded = await page.$$eval("#views image", (all) => Promise.all(all.map(async (image) => {
    const picture = new Image();
    picture.src = image.getAttribute("href");
    await picture.decode();
    return picture.naturalWidth;
  })));
  assert.ok(decoded.every((width) => width > 0));
  const seen = () => page.$eval("#views .estimate-grid", (grid) => getComputedStyle(grid).visibility);
  assert.equal(await seen(), "visible");
  await page.uncheck("#show-estimate");
  assert.equal(await seen(), "hidden");
  await page.check("#show-estimate");
}

const LIGHT = "rgb(255, 255, 255)";
const DARK = "rgb(21, 24, 28)";
// waits, because a change of the system's colours is told to pages a little later
const paper = (page, colour) => page.waitForFunction((c) => getComputedStyle(document.body).backgroundColor === c, colour, { timeout: 3000 });

async function looks(page) {
  await paper(page, LIGHT);
  await page.emulateMedia({ colorScheme: "dark" });
  await paper(page, DARK);
  await page.evaluate(() => scrollTo(0, 0));
  await picture(page, "dark");
  await page.emulateMedia({ colorScheme: "light" });
  await page.click("#theme");
  await paper(page, DARK);
  await page.emulateMedia({ media: "print" });
  await paper(page, LIGHT);
  for (const hidden of ["nav", ".controls", ".list"]) assert.ok(await page.isHidden(hidden), hidden);
  assert.ok(await page.isVisible("#trial h3"));
  const pdf = await page.pdf({ format: "A4" });
  assert.ok(pdf.length > 10_000);
  if (process.env.PANOTUNE_SCREENSHOTS) fs.writeFileSync(`${process.env.PANOTUNE_SCREENSHOTS}/report.pdf`, pdf);
  await page.emulateMedia({ media: "screen" });
  await page.click("#theme");
  await page.setViewportSize({ width: 400, height: 800 });
  await page.waitForTimeout(100);
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 400);
  await page.evaluate(() => scrollTo(0, 0));
  await picture(page, "narrow");
  await page.setViewportSize({ width: 1400, height: 900 });
}

async function links(page, folder) {
  const targets = await page.$$eval("a[href]", (all) => all.map((a) => a.getAttribute("href")));
  for (const target of new Set(targets)) {
    if (target.startsWith("#trial-")) continue;
    if (target.startsWith("#")) assert.ok(await page.locator(target).count() === 1, target);
    else assert.ok(fs.existsSync(path.join(folder, target)), target);
  }
  assert.ok(targets.length > 60, `${targets.length}`);
}

main(async (folder) => {
  await withReport(`file://${folder}/report.html`, async (page) => {
    await picture(page, "light");
    await picture(page, "whole", { fullPage: true });
    await sorting(page);
    await explorer(page, folder);
    await zoom(page);
    await views(page);
    await looks(page);
    await links(page, folder);
  });
  // a link to a trial opens the page with it
  await withReport(`file://${folder}/report.html#trial-2`, async (page) => {
    assert.match(await page.textContent("#trial h3"), /^Trial 2 /);
  });
});
