// Shapes in space, drawn on a canvas: what lies behind is painted first.

/** Functions of the values that give each shape's places; a coordinate is a number or the name of a signal. */
export function shapesOf(picture, place, prefix = "", shift = { x: 0 }) {
  const number = (given) => {
    if (typeof given === "number") return () => given;
    const i = place.get(prefix + given);
    if (i === undefined) throw new Error(`the picture names ${prefix + given}, which is no variable`);
    return (values) => values[i];
  };
  const point = (given) => {
    const [x, y, z] = given.map(number);
    return (values) => [x(values) + shift.x, y(values), z(values)];
  };
  const direction = (given) => {
    const [x, y, z] = given.map(number);
    return (values) => [x(values), y(values), z(values)];
  };
  return picture.shapes.map((shape) => {
    const found = { ...shape };
    for (const member of ["from", "to", "at"]) if (shape[member]) found[member] = point(shape[member]);
    if (shape.points) {
      const points = shape.points.map(point);
      found.curve = (values) => points.map((p) => p(values));
    }
    if (shape.axes) found.axes = shape.axes.map(direction);
    if (shape.size) found.size = shape.size.map(number);
    for (const member of ["radius", "length", "width", "count"]) if (shape[member] !== undefined) found[member] = number(shape[member]);
    if (shape.length !== undefined) found.curve = (values) => hanging(found.from(values), found.to(values), found.length(values));
    if (shape.normal) {
      const { at, width } = found, normal = direction(shape.normal), thickness = (values) => DRAWING.floor.thickness * width(values);
      const axes = [0, 1, 2].map((i) => (values) => upright(normal(values))[i]);
      Object.assign(found, { axes, size: [width, width, thickness], at: (values) => along(at(values), axes[2](values), -thickness(values) / 2) });
    }
    return found;
  });
}

/** All points of the shapes now, the corners of boxes among them. */
function pointsOf(shapes, values) {
  return shapes.flatMap((s) => {
    const found = [...[s.from, s.to, s.at].filter(Boolean).map((p) => p(values)), ...(s.curve?.(values) ?? [])];
    const edges = (s.axes ?? []).map((axis, i) => [axis(values), s.size[i](values) / 2]);
    return edges.reduce((all, [axis, half]) => all.flatMap((p) => [along(p, axis, half), along(p, axis, -half)]), found);
  });
}

/** Groups of shapes side by side: each is shifted along x by what those before it take, with room to swing. */
export function sideBySide(groups, values) {
  let right = null;
  for (const { shift, shapes } of groups) {
    shift.x = 0;
    const points = pointsOf(shapes, values);
    if (!points.length) continue;
    const [low, high] = [Math.min, Math.max].map((extreme) => [0, 1, 2].map((i) => extreme(...points.map((p) => p[i]))));
    const centre = (low[0] + high[0]) / 2, room = 1.1 * Math.max(...minus(high, low)) || 1;
    if (right !== null) shift.x = right + room - centre;
    right = centre + shift.x + room;
  }
}

/** Colours of the style sheet, light or dark. */
export function palette() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  const mixed = (name, part, other) => `color-mix(in srgb, ${of(name)} ${Math.round(100 * part)}%, ${other})`;
  return {
    of, rod: of("--rod"), wire: of("--wire"), spring: of("--spring"), faint: of("--faint"), edge: of("--edge"),
    ball: of("--ball"), ballLight: of("--ball-light"),
    box: (light) => mixed("--box", light, "black"), floor: (light) => mixed("--wire", light, "black"), flash: of("--flash"), trail: (part) => mixed("--ball", part, "transparent"),
  };
}

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a, direction, length) => a.map((x, i) => x + direction[i] * length);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const middle = (a, b) => a.map((x, i) => (x + b[i]) / 2);

const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);

/** A rope of a length between two points: a parabola below the line between them, as frames.py has it. */
function hanging(a, b, length) {
  const curve = (sag) => Array.from({ length: 17 }, (_, i) => {
    const part = i / 16;
    return along(along(a, minus(b, a), part), [0, 0, -4 * part * (1 - part)], sag);
  });
  let sag = 0;
  for (let k = 2; k < 30; k += 1) {
    const deeper = sag + length / 2 ** k, points = curve(deeper);
    if (points.slice(1).reduce((sum, p, i) => sum + Math.hypot(...minus(p, points[i])), 0) <= length) sag = deeper;
  }
  return curve(sag);
}

/** Axes, the third along a normal. */
function upright(normal) {
  const unit = (v) => v.map((x) => x / (Math.hypot(...v) || 1));
  const third = unit(normal), sizes = third.map(Math.abs), smallest = sizes.indexOf(Math.min(...sizes));
  const first = unit(cross([0, 1, 2].map((i) => Number(i === smallest)), third));
  return [first, cross(third, first), third];
}

/* global DRAWING: sizes as fractions of the extent, numbers of coils, views of planes, the light, the thickness of a
   floor as a fraction of its width and its teeth, frames of a flash; from inline.py */

const PIECES = 16; // of a trail, each paler than the next

export class View {
  constructor(canvas, shapes, plane) {
    Object.assign(this, { canvas, shapes, plane, context: canvas.getContext("2d") });
    this.home();
    this.#listen();
  }

  /** The view at the beginning. */
  home() {
    const [yaw, pitch] = DRAWING.facing[this.plane];
    Object.assign(this, { yaw, pitch, zoom: 1, shift: [0, 0] });
    this.forget();
  }

  forget() {
    this.low = [Infinity, Infinity, Infinity];
    this.high = [-Infinity, -Infinity, -Infinity];
    this.extent = 0; // of the shapes themselves at the start: what sizes are a fraction of
    this.trails = this.shapes.map(() => []);
  }

  draw(values, colours, time) {
    const { context: c, canvas } = this;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    if (!this.shapes.length) return;
    this.#frame(pointsOf(this.shapes, values), width, height);
    this.#scaleBar(c, width, height, colours);
    const items = [];
    this.shapes.forEach((shape, i) => this.#add(items, shape, values, colours, this.trails[i], time));
    items.sort((a, b) => a.depth - b.depth);
    for (const item of items) item.paint(c);
  }

  /** Where a point of space is seen: [x, y] in pixels, and its depth, larger towards the eye. */
  see(point) {
    const [x, y, z] = minus(point, this.centre);
    const cy = Math.cos(this.yaw), sy = Math.sin(this.yaw), cp = Math.cos(this.pitch), sp = Math.sin(this.pitch);
    const right = cy * x + sy * y, away = cy * y - sy * x;
    return [this.origin[0] + this.scale * right, this.origin[1] - this.scale * (cp * z + sp * away), sp * z - cp * away];
  }

  #frame(points, width, height) {
    const low = [0, 1, 2].map((i) => Math.min(...points.map((p) => p[i])));
    const high = [0, 1, 2].map((i) => Math.max(...points.map((p) => p[i])));
    if (![...low, ...high].every(Number.isFinite)) return;
    const size = Math.hypot(...minus(high, low));
    this.extent ||= size || 1;
    this.low = this.low.map((x, i) => Math.min(x, low[i]));
    this.high = this.high.map((x, i) => Math.max(x, high[i]));
    const far = Math.hypot(...minus(this.high, this.low)) > 5 * Math.max(size, this.extent);
    const [from, to] = far ? [low, high] : [this.low, this.high]; // what wanders off is followed
    this.centre = middle(from, to);
    Object.assign(this, { scale: 1, origin: [0, 0] });
    const half = minus(to, this.centre), corners = [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(
      ([a, b]) => this.see(along(this.centre, [half[0], a * half[1], b * half[2]], 1)),
    );
    const across = 2 * Math.max(...corners.map((p) => Math.abs(p[0]))), up = 2 * Math.max(...corners.map((p) => Math.abs(p[1])));
    const spread = Math.max(across / width, up / height, (0.25 * this.extent) / Math.min(width, height));
    this.scale = (0.78 * this.zoom) / spread;
    this.origin = [width / 2 + this.shift[0], height / 2 + this.shift[1]];
  }

  #add(items, shape, values, colours, trail, time) {
    const at = (member) => this.see(shape[member](values));
    const unit = this.scale * this.extent, { sizes, coils } = DRAWING;
    const radius = shape.radius ? this.scale * shape.radius(values) : null;
    const line = (a, b, width, colour, bias = 0) => items.push({
      depth: (a[2] + b[2]) / 2 + bias,
      paint: (c) => path(c, [a, b], width, colour),
    });
    const remember = (now) => {
      if (!trail.length || time > trail.at(-1).time) trail.push({ time, now });
      while (trail.length > 400) trail.shift();
    };
    const curve = () => {
      const seen = shape.curve(values).map((p) => this.see(p));
      if (shape.closed) seen.push(seen[0]);
      seen.slice(1).forEach((p, i) => line(seen[i], p, Math.max(2 * sizes.wire * unit, 1.5), colours.wire, -1e-3));
    };
    const draws = {
      rod: () => line(at("from"), at("to"), Math.max(radius ? 2 * radius : 2 * sizes.rod * unit, 2), colours.rod),
      ball: () => {
        const p = at("at"), r = Math.max(radius || sizes.ball * unit, 3);
        items.push({ depth: p[2] + 1e-3, paint: (c) => ball(c, p, r, colours) });
      },
      box: () => this.#box(items, shape, values, colours),
      wire: curve,
      rope: curve,
      floor: () => (this.plane ? this.#hatching(items, shape, values, colours) : this.#box(items, shape, values, colours)),
      flash: () => {
        remember(Math.round(shape.count(values)));
        const last = trail.findLastIndex((p, i) => i && p.now !== trail[i - 1].now);
        const strength = last < 0 ? 0 : 1 - (trail.length - 1 - last) / DRAWING.flash, p = at("at");
        if (strength > 0) items.push({ depth: -Infinity, paint: (c) => star(c, p, sizes.flash * unit * strength, colours.flash) });
      },
      spring: () => {
        const a = at("from"), b = at("to");
        shape.coils ??= Math.min(Math.max(Math.round((30 * Math.hypot(...minus(shape.to(values), shape.from(values)))) / this.extent), coils[0]), coils[1]);
        items.push({ depth: (a[2] + b[2]) / 2, paint: (c) => spring(c, a, b, sizes.spring * unit, shape.coils, colours.spring) });
      },
      trail: () => {
        remember(shape.at(values));
        const seen = trail.map((p) => this.see(p.now)), piece = Math.ceil(seen.length / PIECES);
        for (let i = 0; i + 1 < seen.length; i += piece) {
          const part = seen.slice(i, i + piece + 1), colour = colours.trail((0.7 * (i + piece)) / seen.length);
          items.push({ depth: -Infinity, paint: (c) => path(c, part, 1.5, colour) });
        }
      },
    };
    draws[shape.shape]();
  }

  #box(items, shape, values, colours) {
    const centre = shape.at(values), axes = shape.axes.map((axis) => axis(values)), half = shape.size.map((s) => s(values) / 2);
    const eye = this.#eye();
    axes.forEach((axis, i) => {
      const [j, k] = [(i + 1) % 3, (i + 2) % 3];
      for (const side of [1, -1]) {
        if (side * dot(axis, eye) <= 0) continue;
        const face = along(centre, axis, side * half[i]);
        const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([a, b]) => this.see(
          along(along(face, axes[j], a * half[j]), axes[k], b * half[k]),
        ));
        const light = 0.55 + 0.45 * Math.max(0, side * dot(axis, DRAWING.light));
        items.push({ depth: shape.normal ? -dot(axes[2], eye) * Infinity : this.see(face)[2], paint: (c) => polygon(c, corners, colours[shape.shape](light), colours.edge) });
      }
    });
  }

  /** A floor that is seen from its side. */
  #hatching(items, shape, values, colours) {
    const { teeth, thickness } = DRAWING.floor, normal = shape.axes[2](values), width = shape.width(values);
    const ground = this.see(shape.at(values)), end = this.see(along(shape.at(values), normal, width));
    const up = [end[0] - ground[0], end[1] - ground[1]], line = Math.max(this.scale * this.extent * DRAWING.sizes.wire, 0.8);
    const point = (across, height) => [ground[0] - across * up[1] + height * up[0], ground[1] + across * up[0] + height * up[1]];
    items.push({ depth: -Infinity, paint: (c) => {
      path(c, [point(-0.5, thickness / 2), point(0.5, thickness / 2)], 2 * line, colours.wire);
      for (let k = 0; k < teeth; k += 1) path(c, [point((k + 1) / teeth - 0.5, thickness / 2), point(k / teeth - 0.5, -thickness / 2)], line, colours.wire);
    } });
  }

  /** Direction from the mechanism to the eye. */
  #eye() {
    const cp = Math.cos(this.pitch);
    return [Math.sin(this.yaw) * cp, -Math.cos(this.yaw) * cp, Math.sin(this.pitch)];
  }

  #scaleBar(c, width, height, colours) {
    const wanted = 90 / this.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = power * [1, 2, 5].findLast((digit) => digit * power <= wanted);
    Object.assign(c, { strokeStyle: colours.faint, fillStyle: colours.faint, lineWidth: 1.5, font: "12px system-ui" });
    c.beginPath();
    c.moveTo(16, height - 16);
    c.lineTo(16 + length * this.scale, height - 16);
    c.stroke();
    c.fillText(`${Number(length.toPrecision(3))} m`, 16, height - 22);
  }

  #listen() {
    const held = new Map();
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.offsetX, event.offsetY]);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => held.delete(e.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const last = held.get(event.pointerId);
      if (!last) return;
      const now = [event.offsetX, event.offsetY], move = [now[0] - last[0], now[1] - last[1]];
      const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
      if (other) this.zoom *= Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.hypot(last[0] - other[0], last[1] - other[1]);
      if (other || this.plane || event.shiftKey) {
        const part = other ? 0.5 : 1;
        this.shift = [this.shift[0] + part * move[0], this.shift[1] + part * move[1]];
      } else {
        this.yaw -= 0.008 * move[0];
        this.pitch = Math.min(Math.max(this.pitch + 0.008 * move[1], -1.5), 1.5);
      }
      held.set(event.pointerId, now);
      this.changed?.();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom *= Math.exp(-0.001 * event.deltaY);
      this.changed?.();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      this.home();
      this.changed?.();
    });
  }
}

function path(c, points, width, colour) {
  Object.assign(c, { strokeStyle: colour, lineWidth: width, lineCap: "round", lineJoin: "round" });
  c.beginPath();
  points.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
  c.stroke();
}

function ball(c, [x, y], radius, colours) {
  const light = c.createRadialGradient(x - radius / 3, y - radius / 3, radius / 8, x, y, radius);
  light.addColorStop(0, colours.ballLight);
  light.addColorStop(1, colours.ball);
  c.fillStyle = light;
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.fill();
}

function star(c, [x, y], radius, colour) {
  c.fillStyle = colour;
  c.beginPath();
  for (let k = 0; k < 24; k += 1) {
    const r = k % 2 ? 0.35 * radius : radius, angle = (Math.PI * k) / 12;
    c.lineTo(x + r * Math.cos(angle), y + r * Math.sin(angle));
  }
  c.fill();
}

function polygon(c, corners, fill, edge) {
  Object.assign(c, { fillStyle: fill, strokeStyle: edge, lineWidth: 1, lineJoin: "round" });
  c.beginPath();
  corners.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
  c.closePath();
  c.fill();
  c.stroke();
}

function spring(c, a, b, width, turns, colour) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const across = [(a[1] - b[1]) / length, (b[0] - a[0]) / length];
  Object.assign(c, { strokeStyle: colour, lineWidth: 2, lineJoin: "round", lineCap: "round" });
  c.beginPath();
  c.moveTo(a[0], a[1]);
  for (let i = 0; i <= 2 * turns; i += 1) {
    const part = 0.12 + (0.76 * i) / (2 * turns), off = i === 0 || i === 2 * turns ? 0 : Math.min(width, length / 6) * (i % 2 ? 1 : -1);
    c.lineTo(a[0] + part * (b[0] - a[0]) + off * across[0], a[1] + part * (b[1] - a[1]) + off * across[1]);
  }
  c.lineTo(b[0], b[1]);
  c.stroke();
}
