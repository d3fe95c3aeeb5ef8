// The wash meter's page: asks its server five times a second how it stands, and shows it. It can command three things of
// the meter (mark a target, take the mark away, begin the sums anew) and nothing of the vehicle.

import { Past } from "./past.js";
import { finite, numbers, shown } from "./numbers.js";
import { Theme } from "./theme.js";

const EVERY_MS = 200, PATIENCE_MS = 2000;
const $ = (id) => document.getElementById(id);
const token = new URLSearchParams(location.hash.slice(1)).get("token");
const headers = token ? { "X-Wakewise-Token": token } : {};

if (new URLSearchParams(location.search).has("widget")) document.body.classList.add("widget");
const past = new Past($("history"), $("span"));
new Theme($("theme"), () => past.repaint());

async function ask(path, method = "GET") {
  const patience = AbortSignal.timeout(PATIENCE_MS);
  const answer = await fetch(path, { method, headers, cache: "no-store", signal: patience });
  if (answer.status === 401) throw new Error("the token is missing: open the address that was printed");
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.why_not ?? `status ${answer.status}`);
  return told;
}

let bars = [];
function makeBars(names) {
  if (bars.length === names.length && bars.every((bar, i) => bar.name === names[i])) return;
  $("thrusters").replaceChildren();
  bars = names.map((name) => {
    const row = document.createElement("li");
    const label = document.createElement("span"), bar = document.createElement("div");
    const thrust = document.createElement("output"), share = document.createElement("output");
    label.textContent = name.replaceAll("_", " ").replaceAll("-", " ");
    label.title = label.textContent;
    bar.className = "bar";
    share.className = "share";
    bar.append(document.createElement("i"), document.createElement("b"));
    row.append(label, bar, thrust, share);
    $("thrusters").append(row);
    return { name, row, bar, thrust, share };
  });
}

let reach = 5;
function showThrusters(state) {
  const flown = numbers(state.thrusts_N?.flown), gentle = numbers(state.thrusts_N?.gentle), shares = numbers(state.shares_pct);
  // The scale grows at once and shrinks slowly, so that bars can be compared from one look to the next.
  const largest = Math.max(1, ...flown.map(Math.abs), ...gentle.map(Math.abs));
  reach = Math.max(largest, 0.98 * reach);
  bars.forEach(({ row, bar, thrust, share }, i) => {
    const now = finite(flown[i]), command = finite(gentle[i]), part = finite(shares[i]);
    bar.style.setProperty("--flown", (now ?? 0) / reach);
    bar.style.setProperty("--gentle", (command ?? 0) / reach);
    thrust.textContent = shown(now, 1, "N");
    share.textContent = part === null ? "–" : `${shown(part, 0)}\u202f%`;
    row.classList.toggle("strong", (part ?? 0) >= 25);
  });
}

/** What the large number says in words. */
function meaning(state) {
  const saved = finite(state.saved_pct);
  if (saved !== null && saved < 0.5) return "of the last minute's wash could have been spared: these thrusts are gentle.";
  if (saved !== null) return "of the last minute's wash could have been spared, for the same forces.";
  if (state.why_not) return `${state.why_not[0].toUpperCase()}${state.why_not.slice(1)}.`;
  if (!state.running && !finite(state.running_instants)) return "The thrusters rest.";
  if (!state.running) return "The thrusters have rested for a minute, or no jet reached the target.";
  return "No jet reaches the target: nothing to spare.";
}

function note(state) {
  const notes = [];
  if (!state.directions_known) notes.push("The autopilot has not said which motors run the other way (MOT_n_DIRECTION): all are taken as forward, so figures may be wrong. Open QGroundControl, or start with --ask or --params.");
  if (state.others?.length) notes.push(`Another vehicle is heard, too (system ${state.others.join(", ")}); this is system ${state.system}.`);
  $("note").textContent = notes.join(" ");
  $("note").hidden = notes.length === 0;
}

function show(state) {
  const live = state.why_not === null;
  document.body.dataset.link = live ? "live" : "waiting";
  $("link").textContent = !live ? "Waiting" : [state.armed === null ? "" : state.armed ? "Armed" : "Disarmed", state.mode ?? ""].filter(Boolean).join(" · ") || "Hearing";
  $("vehicle").textContent = state.vehicle;
  const saved = finite(state.saved_pct);
  $("saved").textContent = saved === null ? "–" : shown(Math.max(saved, 0), saved < 9.95 && saved >= 0.05 ? 1 : 0);
  $("percent").hidden = saved === null;
  $("meaning").textContent = meaning(state);
  $("dive").textContent = finite(state.saved_dive_pct) === null ? "–" : `${shown(state.saved_dive_pct, 0)}\u202f%`;
  $("points").textContent = state.points.replace(/^of /, "");
  const flown = finite(state.rms_mm_s?.flown), gentle = finite(state.rms_mm_s?.gentle);
  $("flown").textContent = shown(flown, 1, "mm/s");
  $("gentle").textContent = shown(gentle, 1, "mm/s");
  $("peak").textContent = shown(state.peak_mm_s?.flown, 1, "mm/s");
  const most = Math.max(past.most, flown ?? 0, gentle ?? 0, 1e-3);
  document.querySelector(".now .flown .bar").style.setProperty("--share", (flown ?? 0) / most);
  document.querySelector(".now .gentle .bar").style.setProperty("--share", (gentle ?? 0) / most);
  makeBars(state.thrusters ?? []);
  showThrusters(state);
  note(state);
  const mark = $("mark");
  mark.hidden = !(state.can_mark || state.marked);
  mark.setAttribute("aria-pressed", String(Boolean(state.marked)));
  mark.textContent = state.marked ? "Let the target go with the vehicle" : "Mark the target here";
  const volts = finite(state.voltage_V);
  $("facts").textContent = [`Wake model ${state.wake_model}`, volts === null ? "battery not heard" : `battery ${shown(volts, 1, "V")}`, state.publishes ? "publishes WW_D and WW_SAVED" : "publishes nothing"].join(" · ");
  past.add(state.second, state.second_mm_s);
}

async function command(what) {
  try {
    await ask(what, "POST");
  } catch (fault) {
    $("note").textContent = `Not done: ${fault.message}.`;
    $("note").hidden = false;
  }
}
$("mark").addEventListener("click", () => command($("mark").getAttribute("aria-pressed") === "true" ? "unmark" : "mark"));
$("begin").addEventListener("click", () => command("begin"));

let whole = false;
async function turn() {
  const began = performance.now();
  try {
    if (!whole) {
      past.fill(await ask("history.json"));
      whole = true;
    }
    show(await ask("state.json"));
  } catch (fault) {
    document.body.dataset.link = "lost";
    $("link").textContent = fault.message.startsWith("the token") ? "Token needed" : "No answer";
    // A meter that was started anew has another past.
    whole = false;
  }
  setTimeout(turn, Math.max(EVERY_MS - (performance.now() - began), 50));
}
turn();
