// FMUs that move together: starts, connections, steps, and what an operator does with each coordinate.

import { Fmu, Refusal } from "./fmu.js";
import { Hand } from "./sources.js";

const TYPES = ["Real", "Integer", "Boolean"];
const INTERPOLATE = 2; // the inputs that are set before a step belong to its end

export class Machine {
  /** @param {object} plan  the page's data: components in the order in which they are stepped, connections, step size */
  constructor(plan, modules) {
    this.plan = plan;
    this.divide = 1; // steps into so many, each when the one before is done: samples stay communication points
    this.parts = plan.components.map((component) => this.#part(component, modules[component.module]));
    this.wires = plan.connections.map(([source, from, target, to, factor, offset]) => ({
      source: this.parts[source], from, target: this.parts[target], to, factor, offset,
    }));
    this.signals = this.parts.flatMap((part) => part.read.map((variable) => part.prefix + variable.name));
    this.told = this.parts.flatMap((part) => part.read.filter((v) => !v.drawn).map((v) => part.prefix + v.name));
    this.place = new Map(this.signals.map((name, i) => [name, i]));
    this.restart();
  }

  /** A coordinate that the page prescribes, by its name: { part, triple }. */
  coordinate(name) {
    const part = this.parts.find((p) => p.free.some((triple) => p.prefix + triple[0] === name));
    return { part, triple: part.free.find((triple) => part.prefix + triple[0] === name) };
  }

  /** Everything from the start, with the values that are set now. */
  restart() {
    this.time = 0;
    this.steps = 0;
    this.part = 0; // parts of the next step that are done
    this.divided = 1; // into so many
    this.broken = "";
    this.again = false;
    try {
      for (const part of this.parts) this.#begin(part);
      for (let round = 0; round < 2; round += 1) for (const part of this.parts) this.#feed(part); // loops need two
      for (const part of this.parts) part.fmu.leave();
    } catch (refusal) {
      this.#stop(refusal);
    }
    return !this.broken;
  }

  /** Of a communication step [s]. */
  get size() {
    return this.plan.step_size / this.divided;
  }

  /** One communication step; false if it was refused, `broken` says why. */
  step() {
    if (this.part === 0) this.divided = this.divide;
    const { size } = this;
    let stepped = 0;
    try {
      for (const part of this.parts) {
        for (const [name, source] of part.sources) {
          const triple = source.at(part.interpolates ? this.time + size : this.time);
          const members = part.free.find(([first]) => first === name);
          part.fmu.set(members.map((member) => part.reference[member]), triple.slice(0, members.length));
        }
        if (!part.interpolates) this.#feed(part);
      }
      for (const part of this.parts) {
        if (part.interpolates) this.#feed(part);
        part.fmu.step(this.time, size);
        stepped += 1;
      }
    } catch (refusal) {
      this.#stop(refusal);
      this.again = refusal.again && stepped === 0;
      return false;
    }
    this.part += 1;
    if (this.part === this.divided) Object.assign(this, { steps: this.steps + 1, part: 0 });
    this.time = (this.steps + this.part / this.divided) * this.plan.step_size;
    return true;
  }

  /** Values of all signals now, in their order. */
  values() {
    const found = new Float64Array(this.signals.length);
    let place = 0;
    for (const part of this.parts) {
      for (const [type, references] of part.references) {
        found.set(part.fmu.get(references, type), place);
        place += references.length;
      }
    }
    return found;
  }

  #part(component, module) {
    const reference = Object.fromEntries(component.variables.map((v) => [v.name, v.reference]));
    const starts = new Map(component.variables.filter((v) => v.start !== undefined).map((v) => [v.name, v.start]));
    const byType = TYPES.map((type) => [type, component.variables.filter((v) => v.read && (v.type ?? "Real") === type)])
      .filter(([, read]) => read.length);
    return {
      ...component, reference, starts, sources: new Map(), fmu: new Fmu(module, component.guid),
      read: byType.flatMap(([, read]) => read), references: byType.map(([type, read]) => [type, read.map((v) => v.reference)]),
      interpolates: component.reconstruction === INTERPOLATE,
    };
  }

  #begin(part) {
    part.fmu.reset();
    for (const [name, value] of part.starts) part.fmu.set([part.reference[name]], [value]);
    for (const [reference, value] of Object.entries(part.settings)) part.fmu.setInteger(Number(reference), value);
    for (const members of part.free) {
      const [name] = members, source = part.sources.get(name);
      if (source && !(source instanceof Hand)) source.begin(part.starts.get(name), 0);
      else part.sources.set(name, new Hand(part.starts.get(name)));
      const triple = part.sources.get(name).at(0);
      part.fmu.set(members.map((member) => part.reference[member]), triple.slice(0, members.length));
    }
    part.fmu.enter(this.plan.tolerance);
  }

  #feed(part) {
    for (const { source, from, target, to, factor, offset } of this.wires) {
      if (target !== part) continue;
      const [value] = source.fmu.get([source.reference[from]]);
      part.fmu.set([part.reference[to]], [factor * value + offset]);
    }
  }

  #stop(refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    this.broken = refusal.message;
  }
}
