// One line: the mode of control and the state of the sticks.

const box = document.getElementById("banner");
const what = document.getElementById("banner-what");
const more = document.getElementById("banner-more");
const button = document.getElementById("helm-button");
const ask = document.getElementById("ask");
const MODES = { operator: "sticks are live", hold: "holding the position: press Operate to fly", scan: "the mission flies: press Operate to take over" };

/** `link`: "up", "connecting", "down", "silent", "refused" with words; then the helm, whether sticks go out, the mode. */
export function banner({ link, said, helm, sending, mode, preparing }) {
  const body = document.body.dataset;
  body.link = link;
  body.helm = helm.mine ? "mine" : helm.holder ? "other" : "free";
  let tone = "calm", first, second = "", label = "";
  if (link === "refused") [tone, first, second] = ["bad", "Not let in", said];
  else if (link === "down") [tone, first, second] = ["bad", "Link lost: the vehicle holds", said];
  else if (link === "connecting") [first, second] = ["Connecting", said];
  else if (link === "silent") [tone, first, second] = ["bad", "No news from the vehicle", "what is shown is old; without a link it holds"];
  else if (helm.mine) {
    label = "Give back";
    if (sending && !helm.armed) [tone, first, second] = ["warn", "Sticks at zero", "they were silent for a moment: let go of them once"];
    else if (sending) [tone, first, second] = [mode === "operator" ? "live" : "mine", "You have the helm", MODES[mode] ?? ""];
    else [tone, first, second] = ["warn", "Sticks at zero", "this window is not in front: click here to fly on"];
  } else if (helm.holder && helm.quiet) {
    [first, second, label] = [`${helm.holder} has left the sticks`, "the vehicle holds, the helm is free", "Take the helm"];
  } else if (helm.holder) {
    [first, second, label] = [`${helm.holder} has the helm`, helm.waiting ? "asked: waiting for an answer" : "you are watching", helm.waiting ? "" : "Ask for the helm"];
  } else [first, second, label] = ["Nobody has the helm", mode === "scan" ? "the mission flies" : "the vehicle holds", "Take the helm"];
  if (preparing && (link === "up" || link === "connecting")) second = preparing;
  box.dataset.tone = tone;
  put(what, first);
  put(more, second);
  button.hidden = !label;
  if (label && button.dataset.label !== label) {
    button.dataset.label = label;
    button.replaceChildren(`${label} `, Object.assign(document.createElement("kbd"), { textContent: "G" }));
  }
  const asking = helm.mine && helm.askedBy;
  if (asking) put(document.getElementById("ask-text"), `${helm.askedBy.name} asks for the helm.`);
  ask.hidden = !asking;
}

function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
