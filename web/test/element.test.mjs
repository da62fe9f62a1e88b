// <lexi-viewer> in Chromium, with stand-ins for the WebAssembly and the session.

import assert from 'node:assert/strict';
import { writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { launch, npm } from './support/chromium.mjs';
import { faultless, newPage, reportOf, scene, serveStub } from './support/viewer-page.mjs';

const STILL = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';
// A strict page around the element: no inline styles, no inline scripts.
const HOST = (body) => `<!doctype html><html lang="en"><title>host</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; connect-src 'self'; style-src 'self'; img-src data:">
<link rel="icon" href="data:,"><script type="module" src="/src/viewer/element.js"></script><script src="/made/events.js"></script>
${body}`;
const EVENTS = `globalThis.heard = [];
for (const name of ['load', 'progress', 'error']) {
  document.addEventListener(name, (event) => event.target.localName === 'lexi-viewer' && heard.push([name, event.detail]), true);
}`;

describe('<lexi-viewer>', { skip: !npm && 'LEXISPLAT_NPM is not set' }, () => {
  let browser;
  let server;
  let page;
  before(async () => {
    [browser, server] = await Promise.all([launch(), serveStub()]);
    await writeFile(join(server.made, 'events.js'), EVENTS);
  });
  after(() => Promise.all([browser?.close(), server?.close()]));

  const open = async (body, options) => {
    await writeFile(join(server.made, 'host.html'), HOST(body));
    page = await newPage(browser, options);
    await page.goto(`${server.url}/made/host.html`);
  };
  const heard = (name) => page.evaluate((name) => globalThis.heard.filter(([heard]) => heard === name).map(([, detail]) => detail), name);
  const loaded = (count = 1) => page.waitForFunction((count) => globalThis.heard.filter(([name]) => name === 'load').length === count, count);
  // The first picture may be of a canvas that has not learnt its size yet.
  const drawnInFull = () =>
    page.waitForFunction(() => {
      const canvas = document.querySelector('lexi-viewer').shadowRoot.querySelector('canvas');
      return canvas.width === Math.round(canvas.clientWidth * devicePixelRatio) && canvas.ariaBusy === 'false';
    });
  const viewers = () => page.evaluate(() => (globalThis.viewers ?? []).map(({ freed }) => freed));
  const test = faultless(() => page);

  test('shows its scene and tells the page', async () => {
    await open('<lexi-viewer src="/made/first.lexi" alt="A garden"></lexi-viewer>');
    await loaded();
    assert.deepEqual((await heard('load')).map(({ slot, name, gaussians }) => [slot, name, gaussians]), [[0, 'first.lexi', 12_345]]);
    const progress = await heard('progress');
    assert.equal(progress.at(-1).decoded, 12_345);
    await page.getByLabel('A garden').waitFor();
    assert.equal(await page.locator('.panel').count(), 0, 'no controls were asked for');
    const box = await page.locator('lexi-viewer canvas').boundingBox();
    assert.ok(box.width > 800 && box.height >= 128, 'it has a height without any style');
  });

  test('opens clean: a small bar, no figures, no files', async () => {
    await open('<lexi-viewer src="/made/first.lexi"></lexi-viewer>');
    await loaded();
    await page.getByRole('button', { name: 'Back to the first view' }).waitFor();
    await page.getByRole('button', { name: 'Full screen' }).waitFor();
    for (const text of ['Open files', 'Figures', 'Gaussians', 'Side']) assert.equal(await page.getByText(text).filter({ visible: true }).count(), 0, text);
    const hint = page.locator('.hint');
    assert.match(await hint.textContent(), /^Drag to turn, click and scroll/);
    assert.equal(await hint.isVisible(), true);
    await page.mouse.click(300, 60);
    assert.equal(await hint.isVisible(), false, 'who moves knows how');
    await page.evaluate(() => (document.querySelector('lexi-viewer').controls = 'none'));
    await loaded(2);
    assert.equal(await page.getByRole('button').filter({ visible: true }).count(), 0);
  });

  test('turns until it is touched', async () => {
    await open('<lexi-viewer src="/made/first.lexi"></lexi-viewer>', { reducedMotion: 'no-preference' });
    await loaded();
    const turns = () => page.evaluate(() => globalThis.viewers[0].calls.filter(([name]) => name === 'orbit'));
    await page.waitForFunction(() => globalThis.viewers[0].calls.filter(([name]) => name === 'orbit').length > 3);
    assert.ok((await turns()).every(([, right, down]) => right > 0 && down === 0));
    await page.mouse.click(300, 60);
    await page.locator('canvas[aria-busy=false]').waitFor();
    const before = (await turns()).length;
    await page.waitForTimeout(200);
    assert.equal((await turns()).length, before);
    await page.getByRole('button', { name: 'Turn', exact: true }).click();
    await page.waitForFunction((before) => globalThis.viewers[0].calls.filter(([name]) => name === 'orbit').length > before, before);
    await page.getByRole('button', { name: 'Stop turning' }).click();
    await page.locator('canvas[aria-busy=false]').waitFor();
  });

  test('stands still where it is asked to, by people or the page', async () => {
    const orbits = () => page.evaluate(() => globalThis.viewers.flatMap(({ calls }) => calls).filter(([name]) => name === 'orbit').length);
    for (const [more, options] of [['', {}], ['still', { reducedMotion: 'no-preference' }], ['controls="all"', { reducedMotion: 'no-preference' }]]) {
      await page?.context().close();
      await open(`<lexi-viewer src="/made/first.lexi" ${more}></lexi-viewer>`, options);
      await loaded();
      await page.waitForTimeout(150);
      assert.equal(await orbits(), 0, more);
    }
  });

  test('begins with its camera and returns to it', async () => {
    await open('<lexi-viewer src="/made/first.lexi" camera="1:2:3:0:0:0:1:4:1.2"></lexi-viewer>');
    await loaded();
    const runs = () => page.evaluate(() => globalThis.viewers[0].calls.filter(([name]) => name === 'run' || name === 'key'));
    assert.deepEqual((await runs()).at(-1), ['run', 'view=1:2:3:0:0:0:1:4:1.2']);
    await page.mouse.click(300, 60);
    await page.keyboard.press('ArrowRight');
    await page.getByRole('button', { name: 'Back to the first view' }).click();
    await page.waitForFunction(() => globalThis.viewers[0].calls.filter(([name]) => name === 'key').length === 1);
    await page.locator('canvas[aria-busy=false]').waitFor();
    assert.deepEqual((await runs()).slice(-2), [['key', 'r'], ['run', 'view=1:2:3:0:0:0:1:4:1.2']]);
    await page.evaluate(() => (document.querySelector('lexi-viewer').camera = '2'));
    await page.waitForFunction(() => globalThis.viewers[0].calls.at(-1)[1] === 'camera=2');
    const link = await page.evaluate(() => document.querySelector('lexi-viewer').link());
    await page.evaluate((link) => (document.querySelector('lexi-viewer').camera = link), link);
    await page.waitForFunction((link) => globalThis.viewers[0].calls.some(([name, text]) => name === 'set_link' && text === link), link);
  });

  test('puts annotations where their points are', async () => {
    const marks = JSON.stringify([{ at: [0, 0, 0], text: 'Middle' }, { at: [1.5, 0, 0], text: 'Right', view: '9:9:9' }, { at: [0, 0, -5], text: 'Behind' }]);
    await open(`<lexi-viewer src="/made/first.lexi" annotations='${marks}'></lexi-viewer>`);
    await loaded();
    const place = async (text) => {
      const { x, y, height } = await page.locator('.mark', { hasText: text }).boundingBox();
      return [x + 7, y + height / 2].map(Math.round);
    };
    await drawnInFull();
    const box = await page.locator('lexi-viewer canvas').boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const near = ([a, b], [c, d]) => assert.ok(Math.abs(a - c) <= 2 && Math.abs(b - d) <= 2, `${a} ${b}, not ${c} ${d}`);
    near(await place('Middle'), [x, y]);
    near(await place('Right'), [x + box.height / 2, y]);
    assert.equal(await page.locator('.mark', { hasText: 'Behind' }).isVisible(), false);
    await page.getByRole('button', { name: 'Right' }).click();
    await page.waitForFunction(() => globalThis.viewers[0].calls.some(([name, words]) => name === 'run' && words === 'view=9:9:9'));
    await page.evaluate(() => (document.querySelector('lexi-viewer').annotations = '[{"at": [1, 2]}]'));
    await page.locator('.message', { hasText: 'annotations: number 1: at has to be three numbers.' }).waitFor();
  });

  test('says that it loads again when it was removed and put back', async () => {
    const slow = createServer((_, response) => {
      response.writeHead(200, { 'content-length': 1000, 'access-control-allow-origin': '*' });
      response.write('lexi');
    });
    await new Promise((done) => slow.listen(0, '127.0.0.1', done));
    try {
      const src = `http://localhost:${slow.address().port}/slow.lexi`;
      await writeFile(join(server.made, 'host.html'), HOST(`<lexi-viewer src="${src}" poster="${STILL}"></lexi-viewer>`).replace("connect-src 'self'", 'connect-src *'));
      page = await newPage(browser);
      await page.goto(`${server.url}/made/host.html`);
      await page.getByRole('button', { name: 'Show in 3D' }).click();
      await page.getByText('Loading slow.lexi').waitFor();
      await page.getByText('4 B of 1.0 kB, 0 %').waitFor();
      await page.evaluate(() => {
        const viewer = document.querySelector('lexi-viewer');
        viewer.remove();
        document.body.append(viewer);
      });
      await page.getByText('Loading slow.lexi').waitFor();
      await page.getByText('4 B of 1.0 kB, 0 %').waitFor();
    } finally {
      slow.closeAllConnections();
      slow.close();
    }
  });

  test('says that a download has stalled', async () => {
    await writeFile(join(server.made, 'stalls.lexi'), scene('stalls'));
    await open('<lexi-viewer src="/made/stalls.lexi"></lexi-viewer>');
    await page.locator('.waits', { hasText: 'Nothing has come for 12 s' }).waitFor();
    await page.locator('progress.thin').waitFor();
    await page.evaluate(() => (document.querySelector('lexi-viewer').controls = 'all'));
    await page.locator('.card', { hasText: 'Nothing has come for 12 s' }).waitFor();
  });

  test('compares two scenes, and its mode follows the user', async () => {
    await open('<lexi-viewer src="/made/first.lexi" src2="/made/second.lexi" mode="difference" controls="all"></lexi-viewer>');
    await loaded(2);
    assert.equal((await reportOf(page)).mode, 'difference');
    await page.getByRole('button', { name: 'Side' }).click();
    await page.waitForFunction(() => document.querySelector('lexi-viewer').getAttribute('mode') === 'side');
    await page.evaluate(() => (document.querySelector('lexi-viewer').mode = 'wipe'));
    await page.waitForFunction(() => globalThis.viewers[0].view.mode === 'wipe');
    assert.equal((await page.evaluate(() => document.querySelector('lexi-viewer').report)).psnr, 41.27);
    await page.evaluate(() => document.querySelector('lexi-viewer').run('split=0.2,degree=1'));
    assert.deepEqual([(await reportOf(page)).split, (await reportOf(page)).degree], [0.2, 1]);
    assert.match(await page.evaluate(() => document.querySelector('lexi-viewer').run('dance').catch(String)), /dance/);
  });

  test('takes new addresses, reflects its properties, and says what failed', async () => {
    await open('<lexi-viewer src="/made/first.lexi" controls="all"></lexi-viewer>');
    await loaded();
    await page.evaluate(() => (document.querySelector('lexi-viewer').src = '/made/second.lexi'));
    await loaded(2);
    const reflected = await page.evaluate(() => {
      const viewer = document.querySelector('lexi-viewer');
      [viewer.src2, viewer.alt] = ['/made/none.lexi', 'A room'];
      return [viewer.getAttribute('src'), viewer.getAttribute('src2'), viewer.getAttribute('alt'), viewer.controls];
    });
    assert.deepEqual(reflected, ['/made/second.lexi', '/made/none.lexi', 'A room', 'all']);
    await page.locator('.message', { hasText: 'none.lexi: the server answered 404.' }).waitFor();
    assert.deepEqual((await heard('error')).map(({ message }) => message), ['none.lexi: the server answered 404.']);
    assert.equal((await reportOf(page)).models[0].name, 'second.lexi', 'what it had stays');
    await page.evaluate(() => document.querySelector('lexi-viewer').removeAttribute('src'));
    await page.waitForFunction(() => globalThis.viewers[0].models[0] === null);
  });

  test('begins when it is seen', async () => {
    await open(`${'<br>'.repeat(300)}<lexi-viewer src="/made/first.lexi"></lexi-viewer>`);
    await page.waitForFunction(() => customElements.get('lexi-viewer'));
    await page.waitForTimeout(200);
    assert.deepEqual(await viewers(), []);
    await page.locator('lexi-viewer').scrollIntoViewIfNeeded();
    await loaded();
  });

  test('with a poster begins when it is asked to', async () => {
    await open(`<lexi-viewer src="/made/first.lexi" poster="${STILL}"></lexi-viewer>`);
    await page.locator('.poster').waitFor();
    await page.waitForTimeout(200);
    assert.deepEqual(await viewers(), []);
    await page.getByRole('button', { name: 'Show in 3D' }).click();
    await loaded();
    assert.equal(await page.locator('.poster').isVisible(), false);
    assert.equal(await page.getByRole('button', { name: 'Show in 3D' }).isVisible(), false);
  });

  test('leaves the wheel and keys to the page until it has the focus', async () => {
    await open('<lexi-viewer src="/made/first.lexi"></lexi-viewer><p id="rest">text</p>');
    await loaded();
    await page.evaluate(() => (document.getElementById('rest').style.height = '3000px'));
    await page.mouse.move(300, 60);
    await page.mouse.wheel(0, 20);
    await page.keyboard.press('4');
    await page.waitForFunction(() => scrollY > 0);
    const steered = () => page.evaluate(() => globalThis.viewers[0].calls.filter(([name]) => ['dolly', 'key'].includes(name)).length);
    assert.equal(await steered(), 0);
    await page.evaluate(() => scrollTo(0, 0));
    await page.mouse.click(300, 60);
    await page.mouse.wheel(0, 20);
    await page.keyboard.press('4');
    await page.waitForFunction(() => globalThis.viewers[0].calls.filter(([name]) => ['dolly', 'key'].includes(name)).length === 2);
    assert.equal(await page.evaluate(() => scrollY), 0);
  });

  test('frees what it has when it is removed, and begins again when it is put back', async () => {
    await open('<lexi-viewer src="/made/first.lexi"></lexi-viewer><lexi-viewer src="/made/second.lexi"></lexi-viewer>');
    await loaded(2);
    await page.evaluate(() => {
      globalThis.kept = document.querySelector('lexi-viewer');
      kept.remove();
    });
    await page.waitForFunction(() => globalThis.viewers.filter(({ freed }) => freed).length === 1);
    await page.keyboard.press('w');
    await page.evaluate(() => document.body.append(globalThis.kept));
    await loaded(3);
    assert.deepEqual((await viewers()).sort(), [false, false, true]);
  });

  test('frees what it has when it is removed at once', async () => {
    await open('<lexi-viewer></lexi-viewer>');
    await page.evaluate(async (address) => {
      for (let wait = 0; wait < 12; wait++) {
        const viewer = document.createElement('lexi-viewer');
        viewer.src = address;
        document.body.append(viewer);
        viewer.start();
        await new Promise((go) => setTimeout(go, wait));
        viewer.remove();
      }
    }, '/made/first.lexi');
    await page.waitForFunction(() => globalThis.viewers.filter(({ freed }) => !freed).length <= 1);
    assert.deepEqual(await heard('error'), []);
  });

  test('without WebGPU draws on the processor, in the end', async () => {
    for (const init of [() => delete Navigator.prototype.gpu, () => Object.defineProperty(globalThis, 'noAdapter', { value: 'no adapter is to be had' })]) {
      await page?.context().close();
      await writeFile(join(server.made, 'host.html'), HOST('<lexi-viewer src="/made/first.lexi"></lexi-viewer>'));
      page = await newPage(browser, { reducedMotion: 'no-preference' });
      await page.addInitScript(init);
      await page.goto(`${server.url}/made/host.html`);
      await loaded();
      assert.equal(await page.evaluate(() => document.querySelector('lexi-viewer').report.renderer), 'processor');
      assert.match(await page.getByText('Drawn by the processor').getAttribute('title'), /^This browser has no WebGPU\.|^no adapter is to be had\.$/);
      assert.deepEqual(await heard('error'), []);
      const turns = (most) => page.waitForFunction((most) => globalThis.viewers[0].calls.filter(([name]) => name === 'orbit').length > most, most);
      await page.waitForTimeout(150);
      assert.equal(await page.evaluate(() => globalThis.viewers[0].calls.filter(([name]) => name === 'orbit').length), 0, 'it does not turn by itself');
      await page.getByRole('button', { name: 'Turn', exact: true }).click();
      await turns(2);
    }
  });

  test('draws on the processor where it is asked to', async () => {
    await open('<lexi-viewer src="/made/first.lexi" controls="none" renderer="processor"></lexi-viewer>');
    await loaded();
    const renderer = () => page.evaluate(() => document.querySelector('lexi-viewer').report.renderer);
    assert.equal(await renderer(), 'processor');
    assert.equal(await page.getByText('Drawn by the processor').isVisible(), false, 'no words were asked for');
    await page.evaluate(() => (document.querySelector('lexi-viewer').renderer = ''));
    await loaded(2);
    assert.equal(await renderer(), 'webgpu');
    assert.deepEqual(await viewers(), [true, false]);
  });

  test('loads its scene again when the GPU is lost, and draws on the processor when it is lost for good', async () => {
    await open('<lexi-viewer src="/made/first.lexi"></lexi-viewer>');
    await loaded();
    await page.evaluate(() => document.querySelector('lexi-viewer').run('orbit=30:10'));
    const link = await page.evaluate(() => document.querySelector('lexi-viewer').link());
    const state = () =>
      page.evaluate(async () => {
        const viewer = document.querySelector('lexi-viewer');
        return [viewer.report.renderer, viewer.report.models[0].name, await viewer.link()];
      });
    for (const [times, renderer] of [[2, 'webgpu'], [3, 'processor']]) {
      await page.evaluate(() => globalThis.viewers.at(-1).lose());
      await loaded(times);
      await page.waitForFunction((link) => globalThis.viewers.at(-1).calls.some(([name, text]) => name === 'set_link' && text === link), link);
      assert.deepEqual(await state(), [renderer, 'first.lexi', link]);
    }
    assert.deepEqual(await viewers(), [true, true, false]);
    assert.deepEqual(await heard('error'), []);
  });

  test('says at once that it can draw by nothing, and shows its poster', async () => {
    await writeFile(join(server.made, 'host.html'), HOST(`<lexi-viewer src="/made/first.lexi" poster="${STILL}"></lexi-viewer>`));
    page = await newPage(browser);
    await page.addInitScript(() => delete globalThis.WebAssembly);
    await page.goto(`${server.url}/made/host.html`);
    await page.getByText('This browser has no WebAssembly with SIMD').waitFor();
    assert.equal(await page.locator('.poster').isVisible(), true);
    assert.equal((await heard('error')).length, 1);
  });

  test('opens a file by its function', async () => {
    await open('<lexi-viewer></lexi-viewer>');
    const whole = await page.evaluate((text) => document.querySelector('lexi-viewer').open(new File([text], 'own.lexi')), scene('own'));
    assert.equal(whole, true);
    assert.equal((await reportOf(page)).models[0].name, 'own.lexi');
  });
});

describe('the module of <lexi-viewer>', () => {
  it('can be loaded where there is no browser', async () => {
    const { LexiViewer } = await import('../src/viewer/element.js');
    assert.deepEqual(LexiViewer.observedAttributes, ['src', 'src2', 'poster', 'mode', 'controls', 'alt', 'camera', 'annotations', 'still', 'budget', 'budget-bytes', 'renderer']);
  });
});
