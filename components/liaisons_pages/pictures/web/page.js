// The page: buttons, sliders, picture, plot and energy account round a machine.

import { compile } from "./fmu.js";
import { Machine } from "./machine.js";
import { palette, shapesOf, sideBySide, View } from "./picture.js";
import { colourOf, MOST, plot, short } from "./plot.js";
import { Hand, Operator, presets, Table } from "./sources.js";

const BUDGET = 4; // ms of stepping a frame
const KEPT = 900; // steps in the plot, or four times as many if they are divided
const SHORTEST = 0.8; // s on the clock that one period of what is shaken takes
const $ = (id) => document.getElementById(id);

function make(tag, properties = {}, ...children) {
  const { data = {}, ...others } = properties;
  const element = Object.assign(document.createElement(tag), others);
  Object.assign(element.dataset, data);
  element.append(...children);
  return element;
}

/** Where a slider for a variable goes from and to. */
function range({ start, minimum, maximum, unit }) {
  const span = Math.max(2 * Math.abs(start), unit === "rad" ? Math.PI : 0) || 1;
  const low = minimum === undefined ? start - span : Math.max(minimum, start - span);
  return [low === minimum && start > 0 ? Math.max(low, start / 10) : low, Math.min(maximum ?? Infinity, start + span)];
}

class Page {
  constructor(plan, modules) {
    this.plan = plan;
    this.machine = new Machine(plan, modules);
    this.groups = plan.groups.map((members) => {
      const shift = { x: 0 }, parts = members.map((i) => this.machine.parts[i]);
      return { shift, shapes: parts.flatMap((p) => shapesOf(p.picture, this.machine.place, p.prefix, shift)) };
    });
    this.view = new View($("picture"), this.groups.flatMap((group) => group.shapes), plan.plane);
    this.view.changed = () => this.paint();
    this.speed = plan.speed;
    this.paced = false; // by the one who looks
    this.running = false;
    this.chosen = plan.signals.slice(0, MOST);
    this.over = ""; // the signal on the horizontal axis; time
    this.colours = palette();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.colours = palette();
      this.paint();
    });
    $("question").textContent = plan.question;
    $("question").hidden = !plan.question;
    for (const id of ["signals", "plot"]) $(id).hidden = plan.signals.length === 0;
    this.#buttons();
    this.#controls();
    this.#choices();
    this.reset();
    this.unknown = this.#follow(new URLSearchParams(location.hash.slice(1) || location.search));
    this.#tell();
    addEventListener("hashchange", () => location.reload());
    const resized = new ResizeObserver(() => this.paint()); // at rest, too: else a canvas is stretched
    for (const id of ["picture", "plot"]) resized.observe($(id));
    requestAnimationFrame((now) => this.#frame(now));
  }

  reset() {
    this.times = [];
    this.history = [];
    this.view.forget();
    this.owed = 0;
    if (this.machine.restart()) {
      this.#look();
      sideBySide(this.groups, this.now);
    } else this.running = false;
    for (const part of this.machine.parts) for (const [name, source] of part.sources) if (source instanceof Hand) this.#show(part.prefix + name, source.aim);
    this.#tell();
    this.paint();
  }

  toggle(running = !this.running) {
    if (running && this.machine.broken && !this.machine.again) this.reset();
    else this.machine.broken = "";
    this.unknown = "";
    this.running = running && !this.machine.broken;
    this.#tell();
  }

  /** One step; what is refused is said, and the hand is where the last good step ended. */
  step() {
    if (this.machine.step()) {
      this.#look();
      return true;
    }
    this.running = false;
    for (const part of this.machine.parts) {
      for (const name of part.sources.keys()) this.#show(part.prefix + name, this.#hold(part, name));
    }
    this.#tell();
    return false;
  }

  /** So many steps of the plan at once; for tests. */
  run(count) {
    const { machine } = this, last = machine.steps + count;
    while (machine.steps < last && this.step());
    this.paint();
    return Object.fromEntries(this.machine.signals.map((name, i) => [name, this.now[i]]));
  }

  paint() {
    if (!this.now) return;
    this.view.draw(this.now, this.colours, this.machine.time);
    const place = this.machine.place;
    for (const part of this.machine.parts) for (const [name, source] of part.sources) if (source instanceof Operator) this.#show(part.prefix + name, this.now[place.get(part.prefix + name)]);
    const past = (name) => this.history.map((v) => v[place.get(name)]);
    plot($("plot"), this.over ? past(this.over) : this.times, this.chosen.map((name) => ({ name, values: past(name) })), this.colours.of, this.over);
    this.#account();
    $("time").textContent = `t = ${this.machine.time.toFixed(2)} s`;
  }

  #frame(now) {
    const past = Math.min((now - (this.last ?? now)) / 1000, 0.1);
    this.last = now;
    if (this.running) {
      const begin = performance.now();
      this.owed += past * this.speed;
      while (this.owed >= this.machine.size && this.running) {
        this.owed -= this.machine.size;
        this.step();
        if (performance.now() - begin > BUDGET) this.owed = 0; // slower than time; no worse
      }
      this.paint();
    }
    requestAnimationFrame((next) => this.#frame(next));
  }

  /** Remember what can be read now. */
  #look() {
    this.now = this.machine.values();
    this.times.push(this.machine.time);
    this.history.push(this.now);
    while (this.times.length > KEPT * Math.min(this.machine.divided, 4)) {
      this.times.shift();
      this.history.shift();
    }
    if (this.times.length === 1) this.first = this.now;
  }

  #tell() {
    const text = this.machine.broken.replace(/[^.!?]$/, "$&.");
    $("said").textContent = this.unknown || text && (this.machine.again ? `${text} The step was refused; the motion can go on.` : `${text} Reset to begin anew.`);
    $("run").textContent = this.running ? "Pause" : "Start";
    $("run").setAttribute("aria-pressed", String(this.running));
  }

  /** Work on one side, what became of it on the other: both end at the same place. */
  #account() {
    const sum = (name, values) => this.machine.parts.reduce((s, p) => s + (values[this.machine.place.get(p.prefix + name)] ?? 0), 0);
    if (!this.machine.parts.some((p) => this.machine.place.has(`${p.prefix}energy`))) return;
    const work = sum("work", this.now), gain = sum("energy", this.now) - sum("energy", this.first), lost = sum("dissipated", this.now) + sum("impact_loss", this.now);
    const rounding = 1e-9 * Math.max(sum("kinetic_energy", this.now), Math.abs(sum("energy", this.now)), 1e-30);
    this.largest = Math.max(this.times.length > 1 ? this.largest : 0, Math.abs(work), Math.abs(gain), Math.abs(gain + lost), rounding);
    const bar = (id, from, to) => {
      const [a, b] = [from, to].sort((p, q) => p - q).map((v) => 50 + (48 * v) / this.largest);
      $(id).setAttribute("x", a);
      $(id).setAttribute("width", Math.max(b - a, 0.3));
    };
    bar("bar-work", 0, work);
    bar("bar-gain", 0, gain);
    bar("bar-lost", gain, gain + lost);
    const told = (id, words, value) => make("span", { className: id, textContent: `${words} ${short(value)} J` });
    $("account").replaceChildren(
      told("bar-work", "work", work), " = ", told("bar-gain", "energy gained", gain), " + ", told("bar-lost", "dissipated", lost),
      `, to ${Math.abs(gain + lost - work).toExponential(0)} J`,
    );
    for (const part of this.machine.parts) {
      for (const [name] of part.free) {
        const value = (end) => this.now[this.machine.place.get(`${part.prefix}${name}${end}`)];
        const shown = document.querySelector(`[data-force="${CSS.escape(part.prefix + name)}"]`);
        if (shown && value("_force") !== undefined) {
          const [force, power] = part.units[name] ?? ["", "W"];
          shown.textContent = `force ${short(value("_force"))} ${force}, power ${short(value("_power"))} ${power}`;
        }
      }
    }
  }

  #buttons() {
    $("run").onclick = () => this.toggle();
    $("step").onclick = () => { this.toggle(false); this.step(); this.paint(); };
    $("reset").onclick = () => { this.running = false; this.reset(); };
    $("link").onclick = () => this.#share();
    $("speed").oninput = () => {
      this.paced = true;
      this.#pace(this.plan.speed * 2 ** Number($("speed").value));
    };
    this.#pace(this.speed);
    addEventListener("keydown", (event) => {
      const taken = event.key === " " ? "input[type=number], select, button" : "input[type=number], select";
      if (event.target.matches(taken) || event.ctrlKey || event.metaKey) return;
      const keys = { " ": $("run"), ".": $("step"), r: $("reset") };
      if (keys[event.key]) {
        event.preventDefault();
        keys[event.key].click();
      }
    });
  }

  /** Seconds of motion a second; steps are as short as frames need. */
  #pace(speed) {
    this.speed = speed;
    this.machine.divide = Math.max(1, Math.ceil(this.plan.speed / speed - 1e-9));
    $("speed").value = Math.log2(speed / this.plan.speed);
    $("speed-shown").textContent = speed < 1 ? `slowed ${short(1 / speed)} ×` : speed > 1 ? `${short(speed)} × as fast` : "real time";
  }

  /** Slow enough for the eye, unless the one who looks has chosen. */
  #slow() {
    if (this.paced) return;
    const periods = this.machine.parts.flatMap((part) => [...part.sources.values()].map((source) => source.period ?? Infinity));
    const times = SHORTEST / (Math.min(...periods) / this.plan.speed);
    if (times <= 1) return this.#pace(this.plan.speed);
    const power = 10 ** Math.floor(Math.log10(times));
    this.#pace(this.plan.speed / (power * [1, 2, 5, 10].find((digit) => digit * power >= times)));
  }

  /** The address of this page with what has been chosen on it. */
  link() {
    const { plan, machine } = this, chosen = new URLSearchParams();
    for (const part of machine.parts) {
      for (const [name, value] of part.starts) if (value !== part.given.get(name)) chosen.set(part.prefix + name, value);
      for (const [name, source] of part.sources) {
        if (source instanceof Hand) {
          if (source.aim !== part.given.get(name)) chosen.set(part.prefix + name, source.aim);
          if (part.moves?.[name]) chosen.set(`${part.prefix + name}.by`, "by hand");
        } else {
          chosen.set(`${part.prefix + name}.by`, source.name);
          for (const [key, number] of Object.entries(source.parameters)) chosen.set(`${part.prefix + name}.${key}`, number);
        }
      }
    }
    if (this.paced) chosen.set("speed", this.speed);
    if (String(this.chosen) !== String(plan.signals.slice(0, MOST))) chosen.set("plots", this.chosen);
    if (this.over) chosen.set("over", this.over);
    return `${location.href.split("#")[0]}#${chosen}`;
  }

  async #share() {
    const address = this.link();
    try {
      history.replaceState(null, "", address);
      await navigator.clipboard.writeText(address);
      $("link").textContent = "Copied";
    } catch {
      $("link").textContent = "In the address bar";
    }
    setTimeout(() => { $("link").textContent = "Copy link"; }, 2000);
  }

  /** Choose what a link says; returns what it says that this page has not. */
  #follow(chosen) {
    const unknown = [];
    for (const [key, text] of chosen) {
      const number = Number(text), owner = key.slice(0, key.lastIndexOf(".")), last = key.slice(owner.length + 1);
      const find = (name) => this.machine.parts.map((part) => [part, part.variables.find((v) => part.prefix + v.name === name)]).find(([, v]) => v);
      const choice = document.querySelector(`[data-preset="${CSS.escape(owner)}"]`), known = (name) => this.machine.told.includes(name);
      const [part, variable] = find(key) ?? [];
      if (key === "run") this.toggle(true);
      else if (key === "speed" && number > 0) {
        this.paced = true;
        this.#pace(number);
      } else if (key === "plots" && text.split(",").every((name) => !name || known(name))) this.chosen = text.split(",").filter(Boolean).slice(0, MOST);
      else if (key === "over" && known(text)) document.querySelector("[data-over]").value = this.over = text;
      else if (variable?.start !== undefined && text && Number.isFinite(number)) {
        this.#show(key, number);
        if (part.sources.has(variable.name)) this.#move(part, variable.name, number);
        else this.#set(part, variable, number);
      } else if (last === "by" && [...(choice?.options ?? [])].some(({ value }) => value === text)) {
        choice.value = text;
        choice.onchange();
      } else {
        const field = choice?.parentElement.querySelector(`[title="${CSS.escape(last)}"]`);
        if (field && text && Number.isFinite(number)) {
          field.value = text;
          field.onchange();
        } else unknown.push(`${key}=${text}`);
      }
    }
    if (chosen.has("plots")) this.#choices();
    return unknown.length ? `The link says ${unknown.join(", ")}, which is not on this page.` : "";
  }

  #controls() {
    const rows = new Map(), add = (id, name, ...elements) => rows.set(name, () => $(id).append(...elements));
    for (const part of this.machine.parts) {
      part.given = new Map(part.starts);
      const prescribed = new Set(part.free.flat());
      for (const variable of part.variables) {
        const name = part.prefix + variable.name;
        if (part.free.some(([first]) => first === variable.name)) {
          add("sigma", name, this.#slider(name, variable, (value) => this.#move(part, variable.name, value)), this.#preset(part, variable));
        } else if (variable.start !== undefined && variable.set && !prescribed.has(variable.name)) {
          add(variable.initial ? "starts" : "parameters", name, this.#slider(name, variable, (value) => this.#set(part, variable, value)));
        }
      }
    }
    for (const name of this.plan.controls ?? rows.keys()) rows.get(name)();
    for (const id of ["sigma", "starts", "parameters"]) $(id).hidden = $(id).childElementCount < 2;
  }

  #slider(name, variable, moved) {
    const [low, high] = range(variable);
    const slider = make("input", { type: "range", min: low, max: high, step: (high - low) / 500 || 1, value: variable.start, data: { name } });
    const number = make("input", { type: "number", step: "any", value: short(variable.start), data: { number: name } });
    slider.oninput = () => { number.value = short(Number(slider.value)); moved(Number(slider.value)); };
    number.onchange = () => { slider.value = number.value; moved(Number(number.value)); };
    slider.setAttribute("aria-label", name);
    number.setAttribute("aria-label", `${name}, value`);
    return make("label", { title: variable.description ?? "", className: "row" }, make("span", {}, ...name.split(/(?<=[._])/).flatMap((part) => [part, make("wbr")])), slider, number, make("span", { className: "unit", textContent: variable.unit ?? "" }));
  }

  #preset(part, variable) {
    const { name } = variable, leaves = part.variables.some((v) => v.name === "impact_loss"), given = part.moves?.[name];
    const offered = presets(variable, part.starts, leaves);
    if (given) offered[given[0]] = [offered[given[0]]?.[0] ?? "follow the table", given[1]];
    const fields = make("div", { className: "fields" });
    const choice = make("select", { data: { preset: part.prefix + name } }, make("option", { textContent: "by hand" }), ...Object.entries(offered).map(([value, [words]]) => make("option", { value, textContent: `${words} (${value})` })));
    choice.setAttribute("aria-label", `what moves ${name}`);
    const move = (source) => {
      part.sources.set(name, source);
      fields.replaceChildren(...Object.entries(source.parameters).map(([key, start]) => {
        const field = this.#slider(`${part.prefix + name}.${key}`, { start, minimum: start > 0 ? 0 : undefined }, (number) => {
          source.change(key, number, this.machine.time);
          this.#slow();
          this.#begin();
        });
        field.firstChild.textContent = key;
        field.querySelector("[data-number]").title = key;
        return field;
      }));
      this.#slow();
    };
    choice.onchange = () => {
      const chosen = choice.value, value = this.#hold(part, name);
      choice.value = chosen;
      if (chosen === "Table") {
        move(new Table(given[1]));
        this.reset(); // it says where it begins
      } else if (chosen !== "by hand") move(new Operator(chosen, value, this.machine.time, { ...offered[chosen][1] }));
      this.#begin();
    };
    if (given) {
      choice.value = given[0];
      move(given[0] === "Table" ? new Table(given[1]) : new Operator(given[0], variable.start, 0, { ...given[1] }));
    }
    return make("div", { className: "preset" }, choice, make("output", { data: { force: part.prefix + name } }), fields);
  }

  /** Before the first step all begins with what moves it now, its rates among it. */
  #begin() {
    if (this.machine.time === 0) this.reset();
  }

  #move(part, name, value) {
    if (this.machine.time === 0) {
      this.#hold(part, name);
      part.starts.set(name, value);
      part.sources.set(name, new Hand(value));
      this.reset();
      return;
    }
    if (part.sources.get(name) instanceof Operator) this.#hold(part, name);
    part.sources.get(name).move(value, this.machine.time);
  }

  /** From now on by hand, which holds what has been reached. */
  #hold(part, name) {
    const [value] = part.sources.get(name).at(this.machine.time), hand = new Hand(value);
    hand.time = this.machine.time;
    part.sources.set(name, hand);
    const choice = document.querySelector(`[data-preset="${CSS.escape(part.prefix + name)}"]`);
    if (choice) choice.value = "by hand";
    choice?.parentElement.querySelector(".fields").replaceChildren();
    this.#slow();
    return value;
  }

  #set(part, variable, value) {
    part.starts.set(variable.name, value);
    if (!variable.tunable) this.reset();
    else {
      try {
        part.fmu.set([variable.reference], [value]);
      } catch (refusal) {
        this.machine.broken = refusal.message;
        this.#tell();
      }
    }
  }

  #show(name, value) {
    const slider = document.querySelector(`[data-name="${CSS.escape(name)}"]`);
    if (!slider) return;
    slider.value = value;
    document.querySelector(`[data-number="${CSS.escape(name)}"]`).value = short(value);
  }

  #choices() {
    const render = () => {
      $("signals").replaceChildren(
        ...this.chosen.map((name, i) => {
          const button = make("button", { textContent: `${name} ×`, title: "take this curve away" });
          button.style.setProperty("color", `var(${colourOf(i)})`);
          button.onclick = () => { this.chosen = this.chosen.filter((other) => other !== name); render(); };
          return button;
        }),
        ...(this.plan.asked ? [] : [choice, over]),
      );
      this.paint();
    };
    const choice = make("select", { data: { signals: "" } }, make("option", { textContent: "plot ..." }), ...this.machine.told.map((text) => make("option", { textContent: text })));
    choice.setAttribute("aria-label", "signals to plot");
    const over = make("select", { data: { over: "" } }, ...["", ...this.machine.told].map((name) => make("option", { value: name, textContent: `over ${name || "time"}` })));
    over.value = this.over;
    over.setAttribute("aria-label", "horizontal axis of the plot");
    over.onchange = () => { this.over = over.value; this.paint(); };
    choice.onchange = () => {
      if (!this.chosen.includes(choice.value)) this.chosen = [...this.chosen, choice.value].slice(-MOST);
      choice.selectedIndex = 0;
      render();
    };
    render();
  }
}

async function open() {
  const plan = JSON.parse($("plan").textContent);
  try {
    const modules = await Promise.all(plan.modules.map(compile));
    window.page = new Page(plan, modules);
  } catch (error) {
    $("said").textContent = `This page cannot run: ${error.message}`;
    throw error;
  }
}

open();
