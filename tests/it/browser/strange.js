"use strict";

// A report whose texts try to become markup: they are read as they are, and nothing of them runs.

const { assert, withReport, main } = require("./page.js");

main(async (file) => {
  await withReport(`file://${file}`, async (page) => {
    assert.equal(await page.evaluate(() => window.broken), undefined);
    assert.equal(await page.locator("#injected").count(), 0);
    const text = await page.textContent("main");
    for (const part of ["<b id=injected>description", "<b id=injected>warning", "<b id=injected>reason", "<b id=injected>name", "<b id=injected>value"]) {
      assert.ok(text.includes(part), part);
    }
    await page.selectOption("#trial-param", { index: 1 });
    assert.equal(await page.locator("#injected").count(), 0);
  });
});
