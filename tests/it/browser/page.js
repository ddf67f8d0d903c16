"use strict";

// What all checks of pages need: a browser, and a page of which everything that goes wrong is written down.

const assert = require("node:assert/strict");
const { chromium } = require("playwright-core");

// Opens `address`, lets `check` look at it, and fails if the page complained or asked for anything but itself.
async function withPage(address, check, options = {}) {
  const browser = await chromium.launch({
    executablePath: process.env.BROWSER_PATH,
    args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"],
  });
  try {
    const page = await browser.newPage({ viewport: { width: 1400, height: 900 }, ...options });
    const problems = [];
    const asked = [];
    page.on("console", (message) => problems.push(`${message.type()}: ${message.text()}`));
    page.on("pageerror", (error) => problems.push(String(error.stack)));
    page.on("request", (request) => { if (!request.url().startsWith("data:")) asked.push(request.url()); });
    const begun = performance.now();
    await page.goto(address);
    await check(page, performance.now() - begun);
    // late ones
    await page.waitForTimeout(300);
    assert.deepEqual(problems, []);
    return asked;
  } finally {
    await browser.close();
  }
}

// The same for a page that needs nothing beside itself.
async function withReport(address, check, options) {
  const asked = await withPage(address, check, options);
  assert.deepEqual(asked, [address.split("#")[0]]);
}

// For people who want to look: a picture in the folder that `PANOTUNE_SCREENSHOTS` names, if it does.
async function picture(page, name, options = {}) {
  const folder = process.env.PANOTUNE_SCREENSHOTS;
  if (folder) await page.screenshot({ path: `${folder}/${name}.png`, ...options });
}

// Ends the process with 1 if a check fails.
function main(check) {
  check(...process.argv.slice(2)).catch((error) => {
    console.error(error);
    process.exit(1);
  });
}

module.exports = { assert, withPage, withReport, picture, main };
