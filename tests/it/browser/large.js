"use strict";

// The report of ten thousand trials: how long it takes to open, and that its explorer stays quick.

const fs = require("node:fs");
const { assert, withReport, picture, main } = require("./page.js");

main(async (file) => {
  await withReport(`file://${file}`, async (page, loaded) => {
    const painted = await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => setTimeout(() => done(performance.now())))));
    console.log(`${(fs.statSync(file).size / 1e6).toFixed(2)} MB, loaded after ${loaded.toFixed(0)} ms, painted after ${painted.toFixed(0)} ms`);
    assert.ok(loaded < 2000 && painted < 2000, "it opens within two seconds");
    // only rows that are seen exist
    assert.ok(await page.locator("#trial-list tbody tr").count() < 100);
    const begun = Date.now();
    await page.focus("#trial-list");
    await page.keyboard.press("End");
    assert.match(await page.textContent("#trial h3"), /^Trial 9999 /);
    assert.ok(await page.isVisible("#row-9999"));
    await page.locator("#trial-list thead button").nth(2).click();
    await page.focus("#trial-list");
    await page.keyboard.press("Home");
    const objectives = await page.$$eval("#trial-list tbody tr:not(.gap)", (rows) => rows.map((row) => Number(row.cells[2].textContent)));
    assert.deepEqual(objectives, [...objectives].sort((a, b) => a - b));
    assert.ok((await page.textContent("#trial h3")).includes("best"));
    await page.fill("#trial-filter", "state=pruned epochs<15");
    assert.match(await page.textContent("[role=status]"), /^\d+ of 10000 trials$/);
    await page.fill("#trial-filter", "");
    console.log(`end, sort, home and two filters within ${Date.now() - begun} ms`);
    await picture(page, "large");
    await page.locator("#trials").scrollIntoViewIfNeeded();
    await picture(page, "large-trials");
  });
});
