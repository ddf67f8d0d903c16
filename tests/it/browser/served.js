"use strict";

// The dashboard, and a report behind its policy.

const { assert, withPage, picture, main } = require("./page.js");

main(async (address, run) => {
  await withPage(address, async (page) => {
    await page.waitForSelector(`a[href="/runs/${run}/"]`);
    await picture(page, "dashboard");
  });
  await withPage(`${address}runs/${run}/`, async (page) => {
    await page.waitForSelector("svg.curve polyline");
    await picture(page, "dashboard-run");
  });
  await withPage(`${address}files/${run}/report.html`, async (page) => {
    await page.click("#row-1");
    assert.match(await page.textContent("#trial h3"), /^Trial 1 /);
    await page.locator("#figure_10 .enlarge").click();
    await page.keyboard.press("Escape");
  });
});
