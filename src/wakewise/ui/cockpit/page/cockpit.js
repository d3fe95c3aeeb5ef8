// The pilot's page: ties the parts together. Nothing here flies; it sends what hands do and shows what comes back.

import { banner } from "./banner.js";
import { Camera } from "./camera.js";
import { Coverage } from "./coverage.js";
import { Designation } from "./designate.js";
import { FlightSettings, pressed } from "./settings.js";
import { HELP as PAD_HELP, Pads } from "./gamepad.js";
import { Helm } from "./helm.js";
import { Thrusts, figures, millimetres, put } from "./instruments.js";
import { HELP as KEY_HELP, Keyboard } from "./keyboard.js";
import { Link } from "./link.js";
import { Notes } from "./notes.js";
import { clock, finite, shown, words } from "./numbers.js";
import { Plot } from "./plots.js";
import { Sticks } from "./sticks.js";
import { Target } from "./target.js";
import { Theme, keep, kept } from "./theme.js";
import { Touch } from "./touch.js";

const $ = (id) => document.getElementById(id);
const asked = new URLSearchParams(location.search);

if (asked.has("widget")) document.body.classList.add("widget");

const name = () => words(asked.get("name") ?? kept("name") ?? "", 24) || "A pilot";
// The token stands in the fragment, which browsers send to nobody.
const token = () => decodeURIComponent(location.hash.replace(/^#(token=)?/, "")) || null;

// The lease of the helm that this tab had last, by which the server knows it again.
const link = new Link(() => ({ type: "hello", token: token(), name: name(), wants: "watch", ...(Helm.last() ? { lease: Helm.last() } : {}) }));
const helm = new Helm(link);
const notes = new Notes($("notes"));
const settings = new FlightSettings(helm);
const thrusts = new Thrusts($("thrusts"));
const target = new Target($("target"), $("scale"));
const coverage = new Coverage({ canvas: $("patches"), share: $("share"), next: $("next") });
const washes = new Plot($("plot-disturbance"), [{ ink: "--s1" }, { ink: "--s2", dashed: true }], { unit: "rms, mm/s", least: 10, decades: 3 });
const deviations = new Plot($("plot-deviation"), [{ ink: "--s1" }], { unit: "% of the command", least: 10, most: 100 });
const camera = new Camera({ canvas: $("camera"), empty: $("no-picture"), late: $("late"), link });
const designation = new Designation({
  camera, marks: $("marks"), panel: $("designated"), line: $("designated-line"), forget: $("forget"), propose: $("propose"), accept: $("accept"), refuse: $("refuse"), helm,
  say: (level, text) => notes.add(level, text),
});

const now = { link: "connecting", said: "", mode: "hold", preparing: "" };
const show = () => banner({ ...now, helm, sending: sticks.sending });

const attentive = () => !document.hidden && document.hasFocus();
const pads = new Pads({ press: act, nudge: (steps) => settings.nudge(steps), say: (level, text) => notes.add(level, text) });
const touch = new Touch(document.querySelector(".touch"));
const keyboard = new Keyboard({ act: onKey, stop });
const sticks = new Sticks({ link, helm, sources: [keyboard, pads, touch], attentive, changed: show });
const theme = new Theme($("theme"), () => [target, coverage, washes, deviations].forEach((one) => one.repaint()));

function stop() {
  sticks.cut();
  helm.stop();
  $("stop").classList.add("pressed");
  setTimeout(() => $("stop").classList.remove("pressed"), 200);
}

/** What buttons, keys and pads ask for. */
function act(what) {
  if (what === "hold") stop();
  else if (what === "gain_up" || what === "gain_down" || what === "precise") helm.press(what);
  else if (!helm.press(what)) notes.add("warn", "Take the helm first");
}

const KEYS = {
  KeyO: () => act("operator"), KeyH: () => act("hold"), KeyM: () => act("scan"), KeyC: () => act("capture"), KeyP: () => act("precise"),
  Minus: () => act("gain_down"), NumpadSubtract: () => act("gain_down"), Equal: () => act("gain_up"), NumpadAdd: () => act("gain_up"),
  BracketLeft: () => settings.nudge(-1), BracketRight: () => settings.nudge(1), KeyX: () => settings.swap(), KeyG: changeHelm, KeyV: nextWash,
  KeyL: () => theme.next(), KeyT: () => designation.middle(), KeyB: () => designation.propose(),
  KeyK: () => designation.answer("accept"), KeyN: () => designation.answer("refuse"), Escape: () => designation.forget(),
};

function onKey(code, event) {
  if (event.key === "?") {
    openHelp();
    return true;
  }
  KEYS[code]?.();
  return code in KEYS;
}

function changeHelm() {
  if (helm.mine) {
    sticks.cut();
    helm.giveBack();
  } else helm.ask();
}

// ---- what comes in

let shots = Infinity;

/** A photograph was taken: the picture blinks. */
function flash() {
  const view = document.querySelector(".view");
  view.classList.add("shot");
  setTimeout(() => view.classList.remove("shot"), 220);
}

const takers = {
  welcome(message) {
    // Only now is there anything to show: until the welcome, the page is connecting.
    linked("up", "");
    helm.id = message.id ?? null;
    now.preparing = words(message.preparing);
    // While something is made there is no state to hear.
    link.expectant = !now.preparing;
    $("no-picture").textContent = now.preparing ? `Preparing: ${now.preparing}` : "No picture yet";
    const scenario = message.scenario ?? {};
    const parts = [scenario.name, scenario.world, message.vehicle?.name].map((one) => words(one, 40)).filter(Boolean);
    $("scenario").textContent = parts.join(" · ") || "cockpit";
    $("scenario").title = [...parts, words(scenario.target, 40)].filter(Boolean).join(" · ");
    thrusts.place(message.vehicle?.thrusters);
    target.place(message.target);
    settings.place(message.settings);
    offerScene(message.scene_url);
    show();
  },
  helm(message) {
    const mine = helm.mine;
    helm.take(message);
    if (helm.why && mine !== helm.mine) notes.add("info", helm.why);
  },
  state(message) {
    now.mode = words(message.mode, 20) || words(message.settings?.mode, 20) || "hold";
    document.body.dataset.mode = now.mode;
    notes.at(message.time_s);
    $("time").textContent = clock(message.time_s);
    const watching = finite(message.spectators);
    $("watching").textContent = watching ? `${watching} watching` : "";
    if (finite(message.photos) > shots) flash();
    shots = finite(message.photos) ?? shots;
    figures(message);
    thrusts.update(message.thrusts_N);
    target.update(message);
    showWash();
    settings.update(message.settings ?? {}, message);
    coverage.update(message);
    designation.update(message.target ?? null);
    washes.add(message.time_s, [millimetres(message.rms_m_s), millimetres(message.direct_rms_m_s)]);
    deviations.add(message.time_s, [message.deviation_pct]);
    pressed("[data-press][data-mode]", (button) => button.dataset.mode === now.mode);
    $("fallback").textContent = words(message.fallback) ? `fallback: ${words(message.fallback)}` : "";
    const loop = message.loop ?? {};
    $("loop").textContent = finite(loop.stick_to_thrust_ms_p99) === null ? "" : `stick to thrust ${shown(loop.stick_to_thrust_ms_p99, 0, "ms")}`;
    show();
  },
  note(message) {
    notes.add(message.level, message.text, finite(message.time_s) ?? undefined);
  },
};

link.addEventListener("message", (event) => {
  try {
    takers[event.detail.type]?.(event.detail);
  } catch (error) {
    // One message that is not as agreed must not cost the pilot the page.
    console.warn(`${event.detail.type} could not be shown`, error);
  }
});
link.addEventListener("heard", () => linked("up", ""));
link.addEventListener("silent", () => linked("silent", ""));
link.addEventListener("refused", (event) => linked("refused", words(event.detail.why) || "open the address that the command printed"));
link.addEventListener("down", (event) => {
  for (const source of [keyboard, pads, touch]) source.drop();
  if (now.link !== "down" && now.link !== "connecting") notes.add("error", "Link lost: the vehicle holds; helm given up");
  const why = words(event.detail.why);
  linked(now.link === "connecting" ? "connecting" : "down", `${why ? `${why}; ` : ""}trying again in ${shown(event.detail.wait_ms / 1000, 1, "s")}`);
});
helm.addEventListener("change", show);

function linked(state, said) {
  if (now.link === "down" && state === "up") notes.add("info", "Link is back: you are watching until you take the helm");
  Object.assign(now, { link: state, said });
  document.body.classList.toggle("stale", state !== "up");
  show();
}

// ---- leaving and coming back

for (const event of ["blur", "pagehide"]) window.addEventListener(event, () => sticks.cut());
document.addEventListener("visibilitychange", () => { if (document.hidden) sticks.cut(); });
document.addEventListener("freeze", () => sticks.cut());
window.addEventListener("pagehide", () => link.close());
// From the browser's back-and-forward store the page comes alive again, with nothing in its hands.
window.addEventListener("pageshow", (event) => { if (event.persisted) link.connect(); });

// ---- buttons

for (const button of document.querySelectorAll("[data-press]")) button.addEventListener("click", () => act(button.dataset.press));
// Down, not up: whoever stops must not wait for a finger.
$("stop").addEventListener("pointerdown", (event) => { event.preventDefault(); stop(); });
$("stop").addEventListener("click", (event) => { if (event.detail === 0) stop(); });
$("helm-button").addEventListener("click", changeHelm);
$("ask-yes").addEventListener("click", () => { sticks.cut(); helm.answer(true); });
$("ask-no").addEventListener("click", () => helm.answer(false));
// A button that was clicked lets the keys go back to flying.
document.addEventListener("click", (event) => { if (event.detail > 0) event.target.closest?.("button")?.blur(); });

$("end").addEventListener("click", () => {
  sticks.cut();
  $("end-box").returnValue = "keep";
  $("end-box").showModal();
});
$("end-box").addEventListener("close", () => {
  if ($("end-box").returnValue === "end") act("stop");
  if ($("end-box").returnValue === "hold") stop();
});

function openHelp() {
  sticks.cut();
  $("pad-now").textContent = pads.name ? `Found: ${pads.name}.` : "No gamepad found. Press any of its buttons to wake it.";
  $("your-name").value = name();
  $("help-box").showModal();
}
$("help").addEventListener("click", openHelp);
$("your-name").addEventListener("change", () => keep("name", words($("your-name").value.trim(), 24)));
for (const [id, rows] of [["keys", KEY_HELP], ["pads", PAD_HELP]]) {
  for (const [keys, does] of rows) {
    const row = $(id).insertRow(), head = document.createElement("th");
    head.textContent = keys;
    row.append(head);
    row.insertCell().textContent = does;
  }
}

for (const button of document.querySelectorAll("[data-wash]")) button.addEventListener("click", () => { target.show = button.dataset.wash; showWash(); });
function nextWash() {
  const kinds = target.hasTruth ? ["predicted", "true", "difference"] : ["predicted"];
  target.show = kinds[(kinds.indexOf(target.show) + 1) % kinds.length];
  showWash();
}
function showWash() {
  if (!target.hasTruth) target.show = "predicted";
  for (const button of document.querySelectorAll("[data-wash]")) {
    button.disabled = button.dataset.wash !== "predicted" && !target.hasTruth;
    button.title = button.disabled ? "Only a simulated tank knows the true water" : "";
  }
  pressed("[data-wash]", (button) => button.dataset.wash === target.show);
  $("scale-words").textContent = { predicted: "wash by the model, mm/s", true: "true wash, known only in the tank, mm/s", difference: "model less true (tank only), mm/s" }[target.show];
  const worst = target.worst_m_s;
  put("worst", shown(worst === null ? null : 1e3 * worst, 1, "mm/s"));
  target.repaint();
}

for (const button of document.querySelectorAll("[data-show]")) {
  button.addEventListener("click", () => {
    document.body.dataset.tab = button.dataset.show;
    pressed("[data-show]", (one) => one === button);
  });
}

function offerScene(url) {
  let fit = null;
  try {
    fit = typeof url === "string" ? new URL(url, location.href) : null;
  } catch {
    // No address, no scene.
  }
  const fine = fit !== null && ["http:", "https:"].includes(fit.protocol);
  $("scene-button").hidden = !fine;
  $("scene").dataset.url = fine ? fit.href : "";
  if (!fine) $("scene").hidden = true;
}
$("scene-button").addEventListener("click", () => {
  const scene = $("scene"), open = scene.hidden;
  // Loaded only while it is looked at: it takes the graphics card.
  if (open) scene.src = scene.dataset.url;
  else scene.removeAttribute("src");
  scene.hidden = !open;
  $("scene-button").setAttribute("aria-pressed", String(open));
  $("scene-button").textContent = open ? "Camera" : "3D scene";
});

// A phone has no room for gain beside the modes.
const narrow = matchMedia("(max-width: 720px)");
const placeGain = () => (narrow.matches ? document.querySelector(".settings") : document.querySelector(".acts")).append(document.querySelector(".finer"));
narrow.addEventListener("change", placeGain);
placeGain();

const thumbs = matchMedia("(pointer: coarse)");
const offerThumbs = () => touch.show(asked.has("touch") || thumbs.matches);
thumbs.addEventListener("change", offerThumbs);
offerThumbs();
show();
link.connect();
