// The page of the viewer in Chromium, with stand-ins for the WebAssembly and the session.

import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { after, before, describe } from 'node:test';
import { launch, npm, shot } from './support/chromium.mjs';
import { decodePng } from './support/png.mjs';
import { calls, drop, faultless, newPage, reportOf, scene, serveStub, whole } from './support/viewer-page.mjs';

// Longer than the rest after which a picture is drawn in full, in milliseconds.
const REST = 300;

describe('the page of the viewer', { skip: !npm && 'LEXISPLAT_NPM is not set' }, () => {
  let browser;
  let server;
  let page;
  before(async () => {
    [browser, server] = await Promise.all([launch(), serveStub()]);
  });
  after(() => Promise.all([browser?.close(), server?.close()]));

  const file = (name, text = scene(name)) => ({ name, text });
  const open = async (address = '', options = {}) => {
    page = await newPage(browser, options);
    await page.goto(server.page + address);
    return page;
  };
  const ready = () => page.waitForFunction(() => globalThis.viewers?.length > 0);
  const report = () => reportOf(page);
  const rest = () => page.waitForTimeout(REST);
  const message = (text) => page.locator('.message', { hasText: text }).waitFor();
  const test = faultless(() => page);

  test('opens dropped files, the second beside the first, and says its figures', async () => {
    await open();
    await page.getByText('Open a scene').waitFor();
    await drop(page, 'body', [file('one.lexi')]);
    await whole(page, 'one.lexi');
    assert.equal(await page.getByText('Open a scene').isVisible(), false);
    assert.equal((await calls(page, 'part')).length, 5);
    await drop(page, 'body', [file('two.ply')]);
    await whole(page, 'two.ply');
    assert.deepEqual((await report()).models.map((model) => model.name), ['one.lexi', 'two.ply']);
    await page.getByText('41.27 dB', { exact: true }).waitFor();
    await page.getByText('12,345 / 12,345').waitFor();
    await page.getByText('5.0 MB').waitFor();
    assert.equal(await page.title(), 'one.lexi and two.ply');
    await drop(page, 'body', [file('three.spz')], { shift: true });
    await whole(page, 'three.spz');
    assert.deepEqual((await report()).models.map((model) => model.name), ['three.spz', 'two.ply']);
  });

  test('opens two files at once, by the button as well, and removes them', async () => {
    await open();
    const chooser = page.waitForEvent('filechooser');
    await page.getByRole('button', { name: 'Open files' }).first().click();
    const files = ['a.lexi', 'b.sog'].map((name) => ({ name, mimeType: '', buffer: Buffer.from(scene(name)) }));
    await (await chooser).setFiles(files);
    await Promise.all([whole(page, 'a.lexi'), whole(page, 'b.sog')]);
    await page.getByRole('button', { name: 'Remove b.sog' }).click();
    await page.getByRole('button', { name: 'Remove a.lexi' }).click();
    await page.getByText('Open a scene').waitFor();
    assert.deepEqual((await report()).models, [null, null]);
  });

  test('steers by mouse, wheel and keys', async () => {
    await open('?url=/made/first.lexi');
    await whole(page, 'first.lexi');
    const drag = async (button = 'left') => {
      await page.mouse.move(300, 300);
      await page.mouse.down({ button });
      await page.mouse.move(340, 320);
      await page.mouse.up({ button });
      await rest();
    };
    await drag();
    assert.deepEqual((await calls(page, 'orbit')).at(-1), ['orbit', 0.2, 0.1], '200 pixels are a radian');
    await drag('right');
    const [, right, down] = (await calls(page, 'pan')).at(-1);
    assert.ok(Math.abs(right - 40 / 600) < 1e-9 && Math.abs(down - 20 / 600) < 1e-9, 'shares of the shorter side');
    await page.keyboard.down('Control');
    await drag();
    await page.keyboard.up('Control');
    assert.equal((await calls(page, 'look')).length, 1);
    await page.mouse.wheel(0, 100);
    await page.mouse.dblclick(450, 150);
    await rest();
    assert.ok((await calls(page, 'dolly')).at(-1)[1] > 1, 'scrolling down goes farther');
    assert.deepEqual((await calls(page, 'focus')).at(-1), ['focus', 0.5, 0.25]);

    for (const key of [']', '3', '+', 'r']) await page.keyboard.press(key);
    await page.keyboard.press('ArrowRight');
    await page.evaluate(() => {
      for (const name of ['keydown', 'keyup']) document.body.dispatchEvent(new KeyboardEvent(name, { key: 'w', code: 'KeyW', bubbles: true }));
    });
    await rest();
    assert.equal((await calls(page, 'fly')).length, 1, 'a key that is released before the next picture flies one step');
    await page.keyboard.down('w');
    await page.waitForFunction(() => globalThis.viewers.at(-1).calls.filter(([name]) => name === 'fly').length > 2);
    await page.keyboard.up('w');
    await rest();
    assert.deepEqual((await calls(page, 'key')).map((call) => call[1]), [']', '3', '+', 'r']);
    assert.deepEqual((await calls(page, 'run')).at(-1), ['run', 'orbit=5:0']);
    const flights = await calls(page, 'fly');
    assert.ok(flights.length > 0 && flights.every(([, x, y, forward]) => x === 0 && y === 0 && forward > 0), JSON.stringify(flights));
    await rest();
    assert.equal((await calls(page, 'fly')).length, flights.length, 'a flight ends with its key');
    await page.keyboard.press('h');
    assert.equal(await page.getByText('Figures').isVisible(), false);
  });

  test('steers by fingers', async () => {
    await open('?url=/made/first.lexi', { hasTouch: true, viewport: { width: 360, height: 640 } });
    await page.waitForFunction(() => document.title === 'first.lexi');
    const devtools = await page.context().newCDPSession(page);
    const touch = (type, ...touchPoints) =>
      devtools.send('Input.dispatchTouchEvent', { type, touchPoints: touchPoints.map(([x, y], id) => ({ x, y, id })) });
    await touch('touchStart', [100, 200]);
    await touch('touchMove', [150, 200]);
    await touch('touchMove', [200, 240]);
    await touch('touchEnd');
    await rest();
    const turns = await calls(page, 'orbit');
    assert.ok(turns.reduce((sum, [, x]) => sum + x, 0) > 0.2 && (await calls(page, 'pan')).length === 0);

    await touch('touchStart', [100, 200], [200, 200]);
    await touch('touchMove', [90, 220], [230, 220]);
    await touch('touchMove', [80, 260], [280, 260]);
    await touch('touchEnd');
    await rest();
    assert.equal((await calls(page, 'orbit')).length, turns.length, 'two fingers do not orbit');
    const factor = (await calls(page, 'dolly')).reduce((product, [, by]) => product * by, 1);
    assert.ok(Math.abs(factor - 0.5) < 0.1, `fingers twice as far apart halve the distance: ${factor}`);
    const down = (await calls(page, 'pan')).reduce((sum, [, , by]) => sum + by, 0);
    assert.ok(Math.abs(down - 60 / 360) < 0.05, `${down}`);
  });

  test('moves the line of the wipe by pointer and by keys', async () => {
    await open('?url=/made/first.lexi&url2=/made/second.lexi');
    await Promise.all([whole(page, 'first.lexi'), whole(page, 'second.lexi')]);
    const line = page.getByRole('slider', { name: 'Line between the scenes' });
    await page.mouse.move(450, 200);
    await page.mouse.down();
    await page.mouse.move(225, 200);
    await page.mouse.up();
    await rest();
    assert.equal((await report()).split, 0.25);
    assert.equal(await line.getAttribute('aria-valuenow'), '25');
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('PageUp');
    await rest();
    assert.equal((await report()).split, 0.36);
    assert.equal((await calls(page, 'orbit')).length, 0);
    await page.getByRole('button', { name: 'Diff' }).click();
    await page.getByRole('slider', { name: 'Gain of the difference' }).fill('100');
    await page.getByRole('button', { name: 'Off' }).click();
    await page.getByRole('button', { name: 'White' }).click();
    await page.getByText('difference x 100').waitFor();
    const { mode, gain, degree, background } = await report();
    assert.deepEqual([mode, gain, degree, background], ['difference', 100, 0, [1, 1, 1]]);
    assert.equal(await page.getByRole('button', { name: 'Off' }).getAttribute('aria-pressed'), 'true');
    assert.equal(await line.isVisible(), false);
  });

  test('draws only what changed, coarsely while it moves', async () => {
    await open('?url=/made/first.lexi');
    await whole(page, 'first.lexi');
    await rest();
    const draws = () => page.evaluate(() => globalThis.viewers.at(-1).draws);
    const still = (await draws()).length;
    await rest();
    assert.equal((await draws()).length, still, 'nothing is drawn at rest');
    await page.evaluate(() => (globalThis.cost = 200));
    await page.mouse.move(300, 300);
    await page.mouse.down();
    for (let x = 0; x < 10; x++) await page.mouse.move(300 + 5 * x, 300);
    await page.mouse.up();
    assert.equal(await page.locator('canvas').getAttribute('aria-busy'), 'true');
    await page.locator('canvas[aria-busy=false]').waitFor();
    const moved = (await draws()).slice(still);
    assert.ok(moved.some((scale) => scale < 1), `${moved}`);
    assert.equal(moved.at(-1), 1, 'at rest it is drawn in full');
  });

  test('asks nothing of a viewer that draws', async () => {
    await open('?url=/made/first.lexi');
    await whole(page, 'first.lexi');
    await page.evaluate(() => (globalThis.slow = 60));
    await page.mouse.move(300, 300);
    await page.mouse.down();
    for (let x = 0; x < 30; x++) {
      await page.mouse.move(300 + x, 300);
      await page.waitForTimeout(5);
    }
    await page.mouse.up();
    await page.keyboard.press('p');
    await message('first.png was saved');
    const turned = (await calls(page, 'orbit')).reduce((sum, [, x]) => sum + x, 0);
    assert.ok(Math.abs(turned - 29 / 200) < 1e-9, 'no motion is lost');
    assert.equal(await page.locator('.wrong').count(), 0);
  });

  test('says what is wrong with a file and keeps what it had', async () => {
    await open('?url=/made/first.lexi');
    await whole(page, 'first.lexi');
    await drop(page, 'body', [file('bad.ply', 'this is no scene')], { shift: true });
    await message('bad.ply: this is not a scene that can be read.');
    await drop(page, 'body', []);
    await message('That was no file.');
    assert.equal((await report()).models[0].name, 'first.lexi');
    await whole(page, 'first.lexi');
    await drop(page, 'body', [file('good.lexi')]);
    await whole(page, 'good.lexi');
    await page.getByRole('button', { name: 'Close' }).first().click();
  });

  test('says that a connection was cut and keeps what had come', async () => {
    const half = scene('cut').slice(0, 350);
    const cutter = createServer((_, response) => {
      response.writeHead(200, { 'content-length': 515, 'access-control-allow-origin': '*' });
      response.write(half, () => setTimeout(() => response.destroy(), 100));
    });
    await new Promise((done) => cutter.listen(0, '127.0.0.1', done));
    try {
      await open(`?url=${encodeURIComponent(`http://localhost:${cutter.address().port}/cut.lexi`)}`);
      await message('67 % of it had come, which stays');
      const { models } = await report();
      assert.equal(models[0].name, 'cut.lexi');
      await drop(page, 'body', [file('next.lexi')], { shift: true });
      await whole(page, 'next.lexi');
    } finally {
      cutter.closeAllConnections();
      cutter.close();
    }
  });

  test('says that a scene is on its way, and lets it be cancelled', async () => {
    const slow = createServer((_, response) => {
      response.writeHead(200, { 'content-length': 1000, 'access-control-allow-origin': '*' });
      response.write('lexi');
    });
    await new Promise((done) => slow.listen(0, '127.0.0.1', done));
    try {
      await open(`?url=${encodeURIComponent(`http://localhost:${slow.address().port}/slow.lexi`)}`);
      await page.getByText('Loading slow.lexi').waitFor();
      await page.getByText('4 B of 1.0 kB').waitFor();
      await page.getByRole('button', { name: 'Cancel slow.lexi' }).click();
      await page.getByText('Open a scene').waitFor();
      assert.equal(await page.locator('.message').count(), 0);
      assert.equal(await page.locator('.card').filter({ visible: true }).count(), 0);
    } finally {
      slow.closeAllConnections();
      slow.close();
    }
  });

  test('says that an address has nothing', async () => {
    await open('?url=/made/none.lexi');
    await message('none.lexi: the server answered 404.');
    await page.getByText('Open a scene').waitFor();
  });

  test('restores the view of its link', async () => {
    await open('?url=/made/first.lexi&url2=/made/second.lexi', { permissions: ['clipboard-read', 'clipboard-write'] });
    await Promise.all([whole(page, 'first.lexi'), whole(page, 'second.lexi')]);
    await page.mouse.move(300, 300);
    await page.mouse.down();
    await page.mouse.move(380, 330);
    await page.mouse.up();
    await page.keyboard.press('3');
    await page.getByRole('button', { name: 'Copy a link' }).click();
    await message('The link was copied');
    const link = await page.evaluate(() => navigator.clipboard.readText());
    assert.equal(link, page.url());
    const { view } = await page.evaluate(() => ({ view: globalThis.viewers.at(-1).view }));

    await page.goto('about:blank');
    await page.goto(link);
    await Promise.all([whole(page, 'first.lexi'), whole(page, 'second.lexi')]);
    await rest();
    const again = await page.evaluate(() => globalThis.viewers.at(-1).view);
    assert.deepEqual(again, view);
    assert.equal(again.turn[0], 0.4);

    await page.evaluate(() => (location.hash = '#dance'));
    await message('dance: this is no link to a view');
    await page.evaluate(() => (location.hash = '#%E0%A4%A'));
    await message('The view of the link could not be read');
    assert.deepEqual(await page.evaluate(() => globalThis.viewers.at(-1).view), view);
  });

  test('saves what is shown as a PNG', async () => {
    await open('?url=/made/first.lexi', { acceptDownloads: true });
    await whole(page, 'first.lexi');
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save a picture' }).click();
    const saved = await download;
    assert.equal(saved.suggestedFilename(), 'first.png');
    const picture = decodePng(await readFile(await saved.path()));
    assert.deepEqual([picture.width, picture.height], [900, 600]);
    assert.ok(picture.data.some((value, at) => at % 4 < 3 && value > 100));
  });

  test('sends nothing anywhere and asks only for the address given', async () => {
    page = await newPage(browser);
    const asked = [];
    page.on('request', (request) => asked.push(request.url()));
    await page.goto(`${server.page}?url=/made/first.lexi`);
    await whole(page, 'first.lexi');
    await drop(page, 'body', [file('private.lexi')]);
    await whole(page, 'private.lexi');
    for (const key of ['4', 'p', ']']) await page.keyboard.press(key);
    await rest();
    const outside = asked.filter((address) => !/^(blob|data):/.test(address) && !/\/src\/viewer\/|\/wasm\/viewer/.test(address));
    assert.deepEqual(outside.sort(), [`${server.url}/made/first.lexi`, `${server.url}/src/session.js`]);
  });

  test('refuses code made of text', async () => {
    await open();
    await ready();
    const made = await page.evaluate(() => {
      const script = document.createElement('script');
      script.textContent = 'globalThis.inlined = true';
      document.body.append(script);
      return globalThis.inlined;
    });
    assert.equal(made, undefined);
    assert.ok(page.faults.length > 0, 'the policy is in force');
    page.faults.length = 0;
    // Playwright's own evaluation is exempt, a function of the page is not.
    const refused = await page.evaluate(
      () =>
        new Promise((done) => {
          document.addEventListener('securitypolicyviolation', (event) => done(event.blockedURI), { once: true });
          setTimeout('globalThis.evaluated = true', 0);
        }),
    );
    assert.equal(refused, 'eval');
    page.faults.length = 0;
  });

  test('without WebGPU draws on the processor, and says so', async () => {
    page = await newPage(browser);
    await page.addInitScript(() => {
      delete Navigator.prototype.gpu;
      globalThis.cost = 300;
    });
    await page.goto(`${server.page}?url=/made/first.lexi`);
    await whole(page, 'first.lexi');
    const note = page.getByText('Drawn by the processor');
    await note.waitFor();
    assert.equal(await note.getAttribute('title'), 'This browser has no WebGPU.');
    assert.equal((await reportOf(page)).renderer, 'processor');
    assert.equal(await page.locator('canvas.picture').isVisible(), true);
    await page.locator('canvas[aria-busy=false]').waitFor();
    const draws = () => page.evaluate(() => globalThis.viewers.at(-1).draws);
    assert.equal((await draws()).at(-1), 1);
    const move = async (from) => {
      await page.mouse.move(from, 300);
      await page.mouse.down();
      await page.mouse.move(from + 30, 310, { steps: 3 });
      await page.mouse.up();
    };
    await move(300);
    await page.waitForFunction(() => globalThis.viewers.at(-1).draws.some((scale) => scale <= 0.5));
    await page.locator('canvas[aria-busy=false]').waitFor();
    assert.equal((await draws()).at(-1), 1, 'at rest it is drawn in full');
    // A picture in full does not keep one who moves waiting; this one would never be whole.
    const still = (await draws()).length;
    await page.getByLabel('Colour behind the scene').fill('#ff0000');
    await page.waitForFunction((still) => globalThis.viewers.at(-1).draws.length > still, still);
    const before = (await draws()).length;
    await move(320);
    await page.waitForFunction((before) => globalThis.viewers.at(-1).draws.slice(before).some((scale) => scale <= 0.5), before);
    await page.getByRole('button', { name: 'Black' }).click();
    await move(320);
    await page.locator('canvas[aria-busy=false]').waitFor();
    assert.equal((await draws()).at(-1), 1);
    const [red, green] = (({ data }) => data.slice(4 * 900 * 200 + 2000))(await shot(page, '.view'));
    assert.ok(Math.abs(red - 200) < 2 && Math.abs(green - 200) < 2, `${red} ${green}: the picture of the worker is shown`);
  });

  test('draws on the processor where the address asks for it', async () => {
    page = await newPage(browser);
    await page.goto(`${server.page}?url=/made/first.lexi&renderer=processor`);
    await whole(page, 'first.lexi');
    assert.equal((await reportOf(page)).renderer, 'processor');
    assert.equal(await page.getByText('Drawn by the processor').getAttribute('title'), '');
  });

  test('without WebGPU and WebAssembly says so, with a still picture if there is one', async () => {
    page = await newPage(browser);
    await page.addInitScript(() => delete globalThis.WebAssembly);
    const still = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';
    await page.route(/page\.html/, async (route) => {
      const answer = await route.fetch();
      const body = (await answer.text()).replace('<body data-poster=""', `<body data-poster="${still}"`);
      await route.fulfill({ response: answer, body });
    });
    await page.goto(`${server.page}?url=/made/first.lexi`);
    await page.getByText('This browser has no WebAssembly with SIMD').waitFor();
    assert.equal(await page.locator('.poster').isVisible(), true);
    assert.equal(await page.locator('.poster').getAttribute('src'), still);
    await drop(page, 'body', [file('one.lexi')]);
    assert.equal(await page.locator('canvas').isVisible(), false, 'there is one canvas, and it is not shown');
    assert.equal(await page.locator('.panel').isVisible(), false, 'nothing can be done there');
  });

  test('without an adapter and without the processor says the reason', async () => {
    page = await newPage(browser);
    await page.addInitScript(() => {
      Object.defineProperty(globalThis, 'viewers', { set: () => {}, get: () => ({ push: () => { throw 'no GPU is to be had'; } }) });
    });
    await page.goto(server.page);
    await page.getByText('no GPU is to be had.').first().waitFor();
  });

  for (const [name, options] of [['wide and dark', { colorScheme: 'dark' }], ['narrow and light', { colorScheme: 'light', viewport: { width: 360, height: 640 } }]]) {
    test(`has nothing serious for axe: ${name}`, async () => {
      // axe is put in by script text, which the policy of the page refuses.
      await open('', { ...options, bypassCSP: true, reducedMotion: 'reduce' });
      await page.addScriptTag({ path: join(npm, 'axe-core/axe.min.js') });
      const wrong = async () => {
        const { violations } = await page.evaluate(() => globalThis.axe.run());
        return violations.filter(({ impact }) => ['serious', 'critical'].includes(impact)).map(({ id, nodes }) => [id, nodes.map((node) => node.html)]);
      };
      assert.deepEqual(await wrong(), [], 'empty');
      await drop(page, 'body', [file('a.lexi'), file('b.lexi')]);
      await page.waitForFunction(() => document.title === 'a.lexi and b.lexi');
      const panel = page.getByRole('button', { name: 'Panel' });
      if ((await panel.getAttribute('aria-expanded')) === 'false') await panel.click();
      await page.getByText('Keys and pointers').first().click();
      await drop(page, 'body', [file('bad.ply', 'nonsense')]);
      await message('bad.ply');
      assert.deepEqual(await wrong(), [], 'two scenes and a message');
      await page.keyboard.press('5');
      await page.getByText('difference x').waitFor();
      assert.deepEqual(await wrong(), [], 'the difference');
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(wide <= 0, 'nothing is wider than the window');
    });
  }
});
