// The target in the picture: a box drawn by hand designates it, its outline shows what is tracked and protected.

import { fit, soon } from "./draw.js";
import { clip, finite, shown, words } from "./numbers.js";

/** A click is a box of this share of the picture's width. */
const CLICK = 0.12;
/** Less is a click, in CSS pixels. */
const LEAST_DRAG = 6;
const LEAST_SIDE = 0.01;
/** On the picture, which is dark in every theme. */
const INK = { assumed: "#f7c859", proposed: "#f7c859", tracked: "#7fd6b4", lost: "#f08670" };
const DASHED = ["assumed", "lost"];
const BAND = "#e6eef0";

export class Designation {
  #camera;
  #marks;
  #panel;
  #line;
  #proposes;
  #answers;
  #helm;
  #say;
  #from = null;
  #to = null;
  #target = null;

  /**
   * `camera`: a Camera; `marks`: a canvas over its picture; `panel` with `line` and `forget`: what is told of the target;
   * `propose` asks for a proposal while there is no target; `accept` and `refuse`: the answers to it.
   */
  constructor({ camera, marks, panel, line, forget, propose, accept, refuse, helm, say }) {
    this.#camera = camera;
    this.#marks = marks;
    this.#panel = panel;
    this.#line = line;
    this.#helm = helm;
    this.#say = say;
    this.#listen(camera.canvas);
    forget.addEventListener("click", () => this.forget());
    this.#proposes = propose;
    propose.addEventListener("click", () => this.propose());
    this.#answers = { accept, refuse };
    for (const [what, button] of Object.entries(this.#answers)) button.addEventListener("click", () => this.answer(what));
    helm.addEventListener("change", () => this.cancel());
    new ResizeObserver(() => this.repaint()).observe(marks);
  }

  /** The target of a `state`. */
  update(target) {
    const known = target !== null && typeof target === "object" && Object.hasOwn(INK, words(target.status));
    this.#target = known ? target : null;
    this.#panel.hidden = this.#target === null;
    this.#proposes.hidden = this.#target !== null || this.#camera.frame === null;
    for (const button of Object.values(this.#answers)) button.hidden = this.#target?.status !== "proposed";
    if (this.#target) this.#tell(this.#target);
    this.repaint();
  }

  /** The scenario's own target again; whether there was anything to end. */
  forget() {
    if (this.#from) return this.cancel();
    if (!this.#target) return false;
    if (!this.#helm.designate("clear")) this.#say("warn", "Take the helm first");
    return true;
  }

  /** The body nearest to the middle of the picture is to be proposed. */
  propose() {
    if (this.#view()) this.#ask("ask");
  }

  /** "accept" or "refuse" a proposed target. */
  answer(what) {
    if (this.#target?.status === "proposed") this.#ask(what);
  }

  /** What lies in the middle of the picture. */
  middle() {
    const view = this.#view();
    if (view) this.#send(this.#about(view.left + 0.5 * view.width, view.top + 0.5 * view.height, view));
  }

  /** Give up a box that is being drawn; whether there was one. */
  cancel() {
    const drawn = this.#from !== null;
    this.#from = this.#to = null;
    this.repaint();
    return drawn;
  }

  repaint() {
    soon(this.#paint);
  }

  #listen(canvas) {
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !event.isPrimary || !this.#view()) return;
      if (!this.#helm.mine) {
        this.#say("warn", "Take the helm first");
        return;
      }
      event.preventDefault();
      canvas.setPointerCapture(event.pointerId);
      this.#from = this.#to = this.#at(event);
      this.repaint();
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#from || !event.isPrimary) return;
      this.#to = this.#at(event);
      this.repaint();
    });
    canvas.addEventListener("pointerup", (event) => {
      const from = this.#from, view = this.#view();
      if (!from || !event.isPrimary) return;
      const to = this.#at(event);
      this.cancel();
      if (!view) return;
      const far = Math.hypot(to.x - from.x, to.y - from.y);
      this.#send(far < LEAST_DRAG ? this.#about(to.x, to.y, view) : this.#between(from, to, view));
    });
    canvas.addEventListener("pointercancel", () => this.cancel());
  }

  /** Where the picture lies within its canvas, in CSS pixels; null while none is shown. */
  #view() {
    const { canvas, frame } = this.#camera;
    // The marks are hidden where the 3D scene covers the picture.
    const wide = this.#marks.clientWidth, high = this.#marks.clientHeight;
    if (frame === null || !wide || !high) return null;
    const scale = Math.min(wide / canvas.width, high / canvas.height);
    const width = scale * canvas.width, height = scale * canvas.height;
    return { left: 0.5 * (wide - width), top: 0.5 * (high - height), width, height };
  }

  #at(event) {
    const box = this.#camera.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  #about(x, y, view) {
    const half = 0.5 * CLICK * view.width;
    return this.#between({ x: x - half, y: y - half }, { x: x + half, y: y + half }, view);
  }

  /** [left, top, right, bottom] in shares of the picture. */
  #between(a, b, view) {
    const us = [a.x, b.x].map((x) => clip((x - view.left) / view.width, 0, 1)).sort((p, q) => p - q);
    const vs = [a.y, b.y].map((y) => clip((y - view.top) / view.height, 0, 1)).sort((p, q) => p - q);
    return [us[0], vs[0], us[1], vs[1]].map((share) => Number(share.toFixed(4)));
  }

  #send(box) {
    if (box[2] - box[0] < LEAST_SIDE || box[3] - box[1] < LEAST_SIDE) this.#say("warn", "That box is too small for a target");
    else if (!this.#helm.designate(box, this.#camera.frame)) this.#say("warn", "Take the helm first");
  }

  #ask(what) {
    if (!this.#helm.propose(what)) this.#say("warn", "Take the helm first");
  }

  #tell(target) {
    const distance = finite(target.distance_m), std = finite(target.std_m), age = finite(target.age_ms);
    const parts = [
      target.status,
      distance === null ? "" : shown(distance, 2, "m"),
      std === null ? "" : `±${shown(1e3 * std, 0, "mm")}`,
      age === null ? "" : `${shown(age, 0, "ms")} old`,
      words(target.trouble, 120),
    ];
    this.#line.textContent = parts.filter(Boolean).join(", ");
    this.#panel.dataset.status = target.status;
  }

  #paint = () => {
    const on = fit(this.#marks), view = this.#view();
    if (!on || !view) return;
    const { context } = on;
    context.save();
    context.beginPath();
    context.rect(view.left, view.top, view.width, view.height);
    context.clip();
    const circle = this.#target?.outline;
    const [u, v, radius] = [finite(circle?.u), finite(circle?.v), finite(circle?.radius)];
    if (u !== null && v !== null && radius !== null && radius > 0) {
      context.beginPath();
      context.arc(view.left + u * view.width, view.top + v * view.height, radius * view.width, 0, 2 * Math.PI);
      stroke(context, INK[this.#target.status], DASHED.includes(this.#target.status));
    }
    if (this.#from) {
      context.beginPath();
      context.rect(this.#from.x, this.#from.y, this.#to.x - this.#from.x, this.#to.y - this.#from.y);
      stroke(context, BAND, false);
    }
    context.restore();
  };
}

/** A line that shows on dark and bright water alike. */
function stroke(context, colour, dashed) {
  context.setLineDash(dashed ? [8, 6] : []);
  context.strokeStyle = "rgb(6 13 16 / 70%)";
  context.lineWidth = 4;
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.stroke();
}
