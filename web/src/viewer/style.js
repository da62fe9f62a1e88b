// How the viewer looks. It is a sheet of the document, not an element, so that pages without inline styles can have it.

const CSS = `
:host { display: block; position: relative; min-height: 8rem; contain: content; }
:host([hidden]) { display: none; }
:host(main) { position: fixed; inset: 0; }
.app {
  --behind: #17181b; --panel: rgb(28 29 33 / 0.9); --card: rgb(255 255 255 / 0.055); --line: rgb(255 255 255 / 0.13);
  --text: #ececef; --quiet: #b3b4bd; --accent: #8ccdff; --on-accent: #0b1a26; --wrong: #ffb4a9; --wrong-panel: #3a1f1d;
  position: absolute; inset: 0; overflow: hidden; container-type: size; background: var(--behind); color: var(--text);
  font: 13px/1.45 system-ui, sans-serif; font-variant-numeric: tabular-nums; color-scheme: dark;
}
@media (prefers-color-scheme: light) {
  .app {
    --behind: #e9eaed; --panel: rgb(252 252 253 / 0.94); --card: rgb(0 0 0 / 0.04); --line: rgb(0 0 0 / 0.16);
    --text: #1b1c20; --quiet: #565863; --accent: #0a5ea8; --on-accent: #ffffff; --wrong: #9a1f12; --wrong-panel: #fdecea;
    color-scheme: light;
  }
}
*, *::before, *::after { box-sizing: border-box; }
[hidden] { display: none !important; }
h2, p, dl, dd { margin: 0; font: inherit; }
.unseen { position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
:focus { outline: none; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }

.view, .overlay, .instead { position: absolute; inset: 0; overflow: hidden; }
.overlay { pointer-events: none; }
canvas { display: block; width: 100%; height: 100%; touch-action: pan-y; cursor: grab; }
canvas:focus, .whole canvas { touch-action: none; }
canvas:active { cursor: grabbing; }
canvas:focus-visible { outline-offset: -3px; }
.picture { position: absolute; inset: 0; pointer-events: none; }
.app:not(.shown) canvas, .still canvas { visibility: hidden; }
.still .panel { display: none; }

.label, .middle, .wipe { position: absolute; }
.label {
  max-width: 44%; padding: 3px 9px; overflow: hidden; border-radius: 6px; background: rgb(12 12 14 / 0.68); color: #fff;
  text-overflow: ellipsis; white-space: nowrap;
}
.label.left { top: 12px; left: 12px; }
.label.right { top: 12px; right: 12px; }
.view:has(~ .panel) .label { max-width: calc(50% - 162px); }
.view:has(~ .panel) .label.right { right: 312px; }
.label.score { bottom: 12px; left: 12px; }
.drawn {
  position: absolute; left: 4px; bottom: 1px; padding: 0 4px; border-radius: 4px; background: rgb(12 12 14 / 0.68); color: #fff; font-size: 10px; line-height: 13px;
  pointer-events: auto;
}
.app:not(.shown) .drawn { display: none; }
.middle { left: 50%; top: 0; bottom: 0; width: 2px; margin-left: -1px; background: #fff; box-shadow: 0 0 0 1px rgb(0 0 0 / 0.35); }
.wipe { top: 0; bottom: 0; width: 28px; margin-left: -14px; pointer-events: auto; touch-action: none; cursor: ew-resize; }
.wipe::before {
  content: ''; position: absolute; left: 13px; top: 0; bottom: 0; width: 2px; background: #fff;
  box-shadow: 0 0 0 1px rgb(0 0 0 / 0.35);
}
.wipe:focus-visible { outline: none; }
.wipe:focus-visible .grip { outline: 2px solid var(--accent); outline-offset: 2px; }
.grip {
  position: absolute; left: 0; top: 50%; width: 28px; height: 28px; margin-top: -14px; border: 2px solid #fff;
  border-radius: 50%; background: rgb(20 20 23 / 0.85); box-shadow: 0 1px 5px rgb(0 0 0 / 0.4);
}
.grip::before, .grip::after {
  content: ''; position: absolute; top: 8px; width: 6px; height: 6px; border: solid #fff; border-width: 0 0 2px 2px;
}
.grip::before { left: 5px; transform: rotate(45deg); }
.grip::after { right: 5px; transform: rotate(225deg); }

.instead { display: grid; place-items: center; padding: 16px; pointer-events: none; }
.instead > * { grid-area: 1 / 1; }
.instead:has(.poster:not([hidden])) { background: var(--picture, #000); }
.poster { position: absolute; grid-area: auto; left: 50%; top: 50%; height: 100cqmin; max-width: none; transform: translate(-50%, -50%); }
.poster.tall { width: 100cqmin; height: auto; }
.clean:not(.still) .instead:has(.poster:not([hidden])):has(.begin[hidden]) { place-items: end center; }
.notice {
  display: grid; gap: 10px; justify-items: center; max-width: 25rem; padding: 22px 26px; border-radius: 12px;
  background: var(--panel); text-align: center; pointer-events: auto; position: relative;
}
.whole:not(.still, .clean) .notice { border: 1.5px dashed var(--line); }
.notice h2 { font-size: 17px; font-weight: 600; }
.notice p { color: var(--quiet); text-wrap: balance; }
.notice progress { width: 12rem; max-width: 100%; }
.notice h2 { max-width: 100%; overflow-wrap: anywhere; }
.still .instead:has(.poster:not([hidden])) { place-items: end center; }
.begin { position: relative; pointer-events: auto; padding: 9px 20px; font-weight: 600; background: var(--panel); }
.begin::before { content: ''; position: absolute; inset: -100vmax; }
.over::after {
  content: 'Drop to open'; position: absolute; inset: 10px; display: grid; place-items: center; border: 2px dashed var(--accent);
  border-radius: 12px; background: rgb(0 0 0 / 0.45); color: #fff; font-size: 18px; pointer-events: none;
}

.panel {
  position: absolute; top: 12px; right: 12px; display: flex; flex-direction: column; width: 288px; max-height: calc(100% - 24px);
  border: 1px solid var(--line); border-radius: 12px; background: var(--panel); backdrop-filter: blur(14px);
  box-shadow: 0 4px 22px rgb(0 0 0 / 0.22);
}
.bar { display: flex; gap: 2px; align-items: center; padding: 7px; }
.body { display: grid; gap: 13px; padding: 5px 12px 12px; overflow: auto; overscroll-behavior: contain; }
.grow { flex: 1; min-width: 0; }
section h2, summary { color: var(--quiet); font-size: 12px; font-weight: 600; }
.cards { display: grid; gap: 8px; }
section { display: grid; gap: 6px; min-width: 0; }
.row { display: flex; gap: 7px; align-items: center; min-width: 0; }
.spread { justify-content: space-between; }
.card { gap: 2px; padding: 9px 10px; border-radius: 8px; background: var(--card); }
.card p:empty { display: none; }
.card p { color: var(--quiet); }
.card p.strong { color: var(--text); }
.card .name {
  flex: 1; min-width: 0; overflow: hidden; color: var(--text); font-size: 13px; text-overflow: ellipsis; white-space: nowrap;
}
.slot {
  flex: none; width: 18px; border-radius: 4px; background: var(--line); font-size: 11px; font-weight: 600; line-height: 18px;
  text-align: center;
}
progress { width: 100%; height: 5px; margin: 5px 0 3px; border: 0; border-radius: 3px; background: var(--line); accent-color: var(--accent); overflow: hidden; }
progress::-webkit-progress-bar { background: var(--line); }
progress::-webkit-progress-value { background: var(--accent); }
progress::-moz-progress-bar { background: var(--accent); }
.psnr { color: var(--accent); font-size: 15px; font-weight: 600; }
dl { display: grid; gap: 2px; }
dl div { display: flex; gap: 10px; justify-content: space-between; }
dt { flex: none; color: var(--quiet); }
dd { min-width: 0; overflow-wrap: anywhere; text-align: right; }
summary { cursor: pointer; border-radius: 4px; }
table { width: 100%; margin-top: 6px; border-collapse: collapse; }
th, td { padding: 2px 0; font-weight: 400; text-align: left; vertical-align: top; }
th { width: 48%; padding-right: 8px; }
td { color: var(--quiet); }

button {
  min-height: 32px; padding: 4px 10px; border: 1px solid var(--line); border-radius: 7px; background: transparent; color: inherit;
  font: inherit; cursor: pointer; white-space: nowrap;
}
button:hover:not(:disabled) { background: var(--card); border-color: var(--quiet); }
button:disabled { opacity: 0.4; cursor: default; }
.main, .main:hover:not(:disabled) { border-color: transparent; background: var(--accent); color: var(--on-accent); font-weight: 600; }
.main:hover { filter: brightness(1.08); }
.small { min-height: 24px; padding: 1px 7px; border-color: transparent; color: var(--quiet); font-size: 12px; }
.icon { display: grid; place-items: center; width: 34px; height: 34px; padding: 0; border-color: transparent; }
.icon svg { width: 20px; height: 20px; fill: none; stroke: currentColor; stroke-width: 1.5; stroke-linecap: round; stroke-linejoin: round; }
.cross { width: 26px; height: 26px; min-height: 26px; margin: -3px -4px -3px 0; color: var(--quiet); }
.cross svg { width: 16px; height: 16px; }
.turn[aria-expanded='true'] svg { transform: rotate(180deg); }
.choice { display: flex; flex: 1; padding: 2px; border-radius: 8px; background: var(--card); }
.spread .choice { flex: 0 1 200px; }
.choice button { flex: 1; min-height: 28px; padding: 2px 4px; border-color: transparent; border-radius: 6px; }
.choice [aria-pressed='true'], .choice [aria-pressed='true']:hover { border-color: transparent; background: var(--accent); color: var(--on-accent); font-weight: 600; }
input[type='range'] { flex: 1; min-width: 0; height: 20px; accent-color: var(--accent); }
input[type='color'] { width: 34px; height: 32px; padding: 2px; border: 1px solid var(--line); border-radius: 7px; background: transparent; cursor: pointer; }

.messages { position: absolute; left: 12px; bottom: 52px; display: grid; gap: 8px; width: min(430px, calc(100% - 330px)); }
.message {
  display: flex; gap: 8px; align-items: center; padding: 8px 8px 8px 13px; border: 1px solid var(--line); border-radius: 10px;
  background: var(--panel); box-shadow: 0 3px 14px rgb(0 0 0 / 0.22); backdrop-filter: blur(14px);
}
.message p { flex: 1; min-width: 0; overflow-wrap: anywhere; }
.message input { flex: 1; min-width: 0; padding: 4px; border: 1px solid var(--line); border-radius: 5px; background: transparent; color: inherit; font: inherit; }
.message.wrong { background: var(--wrong-panel); color: var(--wrong); }
.message.wrong .small { color: inherit; }


.foot { position: absolute; inset: auto 0 0; pointer-events: none; }
.dock {
  position: absolute; right: 10px; bottom: calc(10px + env(safe-area-inset-bottom)); display: flex; gap: 2px; align-items: center; padding: 3px;
  border-radius: 10px; background: var(--panel); pointer-events: auto; backdrop-filter: blur(14px);
}
.dock .choice { flex: none; }
.thin { position: absolute; inset: auto 0 0; width: 100%; height: 3px; margin: 0; border-radius: 0; }
.waits, .hint {
  position: absolute; bottom: 16px; padding: 4px 11px; border-radius: 8px; background: rgb(12 12 14 / 0.68); color: #fff; pointer-events: none;
}
.waits { left: 12px; max-width: calc(100% - 190px); }
.hint { left: 50%; bottom: 64px; width: max-content; max-width: calc(100% - 24px); transform: translateX(-50%); text-align: center; }
.marks { position: absolute; inset: 0; overflow: hidden; pointer-events: none; }
.mark {
  position: absolute; display: flex; gap: 6px; align-items: center; min-height: 0; margin: -11px 0 0 -7px; padding: 2px 9px 2px 4px; border: 0; border-radius: 11px;
  background: rgb(12 12 14 / 0.68); color: #fff; font-size: 12px; line-height: 18px; white-space: nowrap;
}
button.mark { pointer-events: auto; }
button.mark:hover:not(:disabled) { background: rgb(12 12 14 / 0.9); }
.dot { width: 8px; height: 8px; border: 2px solid #fff; border-radius: 50%; background: var(--accent); }
.clean .messages { width: min(430px, calc(100% - 24px)); }

@container (width < 640px) {
  .panel { inset: auto 0 0; width: auto; max-height: min(56%, 420px); border-width: 1px 0 0; border-radius: 14px 14px 0 0; flex-direction: column-reverse; }
  .bar { padding: 7px 10px calc(7px + env(safe-area-inset-bottom)); }
  .bar .icon { width: 40px; height: 40px; }
  .main { min-height: 40px; padding: 4px 15px; }
  .body { padding: 12px 12px 4px; }
  .turn svg { transform: rotate(180deg); }
  .turn[aria-expanded='true'] svg { transform: none; }
  .messages { left: 8px; right: 8px; top: 48px; bottom: auto; width: auto; }
  .view:has(~ .panel) .label { max-width: 44%; }
  .view:has(~ .panel) .label.right { right: 12px; }
  .view:has(~ .panel) .label.score { bottom: 68px; }
  .cards:has(.card + .card:not([hidden])) { grid-template-columns: 1fr 1fr; }
  .cards .strong + p { text-wrap: balance; }
}
@media (prefers-reduced-transparency: reduce) { .panel, .dock, .message { backdrop-filter: none; } }
@media (prefers-reduced-motion: no-preference) { button, .turn svg { transition: background-color 120ms, transform 160ms; } }
@media (forced-colors: active) { .choice [aria-pressed='true'] { outline: 2px solid Highlight; } }
`;

let sheet;

/** Gives a shadow root the look of the viewer. @param {ShadowRoot} root */
export function adopt(root) {
  if (!sheet) {
    sheet = new CSSStyleSheet();
    sheet.replaceSync(CSS);
  }
  if (!root.adoptedStyleSheets.includes(sheet)) root.adoptedStyleSheets = [...root.adoptedStyleSheets, sheet];
}
