"use strict";

// The report of a comparison.

const fs = require("node:fs");
const path = require("node:path");
const { assert, withReport, picture, main } = require("./page.js");

main(async (folder, verdict) => {
  await withReport(`file://${folder}/report.html`, async (page) => {
    assert.ok((await page.textContent(".verdict")).includes(verdict));
    for (const target of await page.$$eval("a[href]", (all) => all.map((a) => a.getAttribute("href")))) {
      if (target.startsWith("#")) assert.equal(await page.locator(target).count(), 1, target);
      else assert.ok(fs.existsSync(path.join(folder, target)), target);
    }
    const head = page.locator("#runs thead th").nth(2);
    await head.locator("button").click();
    await head.locator("button").click();
    assert.equal(await head.getAttribute("aria-sort"), "descending");
    const seeds = await page.$$eval("#runs tbody tr", (rows) => rows.map((row) => Number(row.cells[2].textContent)));
    assert.deepEqual(seeds, [...seeds].sort((a, b) => b - a));
    await page.locator("#search_curves .enlarge").click();
    await page.keyboard.press("Escape");
    await picture(page, "comparison", { fullPage: true });
  });
});
