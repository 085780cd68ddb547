// A recorded motion: the picture at the times of the frames.

import { palette, shapesOf, View } from "./picture.js";

const $ = (id) => document.getElementById(id);

function floats(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

function play(plan) {
  const place = new Map(plan.signals.map((name, i) => [name, i])), values = floats(plan.values);
  const width = plan.signals.length, count = plan.frames, colours = palette();
  const shapes = plan.picture.shapes.flatMap((shape, i) => shapesOf({ shapes: [shape] }, place, "", { x: plan.shifts[i] }));
  const view = new View($("picture"), shapes, plan.plane);
  let running = true, shown = 0, last;
  const draw = () => {
    const k = Math.floor(shown);
    view.draw(values.subarray(k * width, (k + 1) * width), colours, k / plan.rate);
    $("time").textContent = `t = ${(plan.start + (k * plan.speed) / plan.rate).toFixed(2)} s`;
    $("place").value = k;
  };
  const toggle = () => {
    running = !running;
    $("run").textContent = running ? "Pause" : "Start";
  };
  view.changed = draw;
  $("place").max = count - 1;
  $("place").oninput = () => {
    shown = Number($("place").value);
    view.forget();
    draw();
  };
  $("run").onclick = toggle;
  addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.matches("button")) return;
    event.preventDefault();
    toggle();
  });
  const frame = (now) => {
    if (running) {
      shown += (Math.min(now - (last ?? now), 100) / 1000) * plan.rate;
      if (shown >= count) {
        shown = 0;
        view.forget();
      }
      draw();
    }
    last = now;
    requestAnimationFrame(frame);
  };
  new ResizeObserver(draw).observe($("picture"));
  requestAnimationFrame(frame);
}

play(JSON.parse($("plan").textContent));
