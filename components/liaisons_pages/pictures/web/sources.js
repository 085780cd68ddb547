// What an operator does with one coordinate: σ, σ̇ and σ̈ at a time, each the exact rate of the one before.

/** Follows the hand: σ'' = -2ω σ' - ω² (σ - aim), critically damped, solved exactly between two moves of the aim. */
export class Hand {
  constructor(value, pace = 12) {
    Object.assign(this, { aim: value, pace, time: 0, from: value, speed: 0 });
  }

  move(aim, time) {
    [this.from, this.speed] = this.at(time);
    Object.assign(this, { aim, time });
  }

  at(time) {
    const t = time - this.time, w = this.pace, apart = this.from - this.aim;
    const decay = Math.exp(-w * t), slope = this.speed + w * apart, e = (apart + slope * t) * decay;
    const rate = slope * decay - w * e;
    return [this.aim + e, rate, -w * (slope * decay + rate)];
  }
}

/** The operators of the catalogue, by name: y, y_dot, y_ddot at a time. */
const operators = {
  Sinusoid: (t, y, { amplitude: a, "angular frequency": w, phase = 0 }) => {
    const sine = a * Math.sin(w * t + phase);
    return [y + sine - a * Math.sin(phase), a * w * Math.cos(w * t + phase), -w * w * sine];
  },
  Ramp: (t, y, { rate }) => [y + rate * t, rate, 0],
  SmoothStep: (t, y, { height, duration }) => {
    const x = Math.min(t / duration, 1), u = 1 - x;
    const rise = x ** 4 * (35 - 84 * x + 70 * x * x - 20 * x ** 3);
    return [y + height * rise, (height / duration) * 140 * (x * u) ** 3,
      (height / duration ** 2) * 420 * (x * u) ** 2 * (1 - 2 * x)];
  },
};

/** What one does with a coordinate, by operator: in words, and numbers that suit it; whether it moves what may leave. */
export function presets({ name, unit, start, description }, starts, leaves) {
  const size = Math.abs(start) || 1, swing = pace(Object.fromEntries(starts), leaves && unit === "m");
  const chosen = (sine, often, amplitude, verb, rate, height) => ({
    Sinusoid: [sine, { amplitude, "angular frequency": Number(often.toPrecision(4)) }],
    Ramp: [`${verb} evenly`, { rate }],
    SmoothStep: [`${verb} smoothly`, { height: Number(height.toPrecision(5)), duration: 4 }],
  });
  if (unit === "rad") {
    const round = /wheel|axis|about/.test(description); // it may go all the way
    return chosen("rock it", swing, 0.5, "turn it", 1, round ? 2 * Math.PI : 1);
  }
  if (start) return chosen("pump it", 2 * swing, 0.1 * size, "lengthen it", 0.1 * size, 0.5 * size); // twice a period
  return chosen("shake it", name.endsWith("_z") ? 20 * swing : swing, 0.1, "move it", 0.1, 0.5); // 20: stands upright
}

/** How often a mechanism would swing [rad/s], as its parameters and starts say; or lies on what is shaken; else 2. */
function pace({ gravity, stiffness, mass, length, length_1 = length, rope = length_1 }, leaves) {
  if (gravity && rope) return Math.sqrt(gravity / rope);
  if (stiffness && mass) return Math.sqrt(stiffness / mass);
  return leaves && gravity ? Math.sqrt(1.5 * gravity / 0.1) : 2; // more than its weight holds, by 0.1 m
}

/** One of them, begun at a time from a value. */
export class Operator {
  constructor(name, value, time, parameters) {
    Object.assign(this, { name, parameters });
    this.begin(value, time);
  }

  begin(value, time) {
    Object.assign(this, { value, time, turned: 0 }); // turned: phase beside that of the parameters
  }

  at(time) {
    const { "start time": begin = 0, phase = 0 } = this.parameters;
    return operators[this.name](Math.max(time - this.time - begin, 0), this.value, { ...this.parameters, phase: phase + this.turned });
  }

  /** Another parameter from now on; the coordinate stays where it is, only its rate may jump. */
  change(key, number, time) {
    const [reached] = this.at(time);
    if (key === "angular frequency") this.turned += (this.parameters[key] - number) * (time - this.time);
    this.parameters[key] = number;
    this.value += reached - this.at(time)[0];
  }

  /** The time in which it repeats itself [s]. */
  get period() {
    return (2 * Math.PI) / Math.abs(this.parameters["angular frequency"] ?? 0);
  }
}

/** Follows knots (t, σ, σ̇, σ̈) by a quintic between two of them, as PlannedMotion does; then it comes to rest. */
export class Table extends Operator {
  constructor(knots) {
    super("Table", 0, 0, {});
    this.knots = knots;
    const [times, values, rates] = knots, last = new Hand(values.at(-1));
    Object.assign(last, { time: times.at(-1) - times[0], speed: rates.at(-1) });
    this.last = last;
  }

  at(time) {
    const [times, values, rates, accelerations] = this.knots, t = time + times[0]; // the page's clock begins with it
    if (t >= times.at(-1)) return this.last.at(time);
    const k = Math.max(times.findLastIndex((knot) => knot <= t), 0), h = times[k + 1] - times[k], x = t - times[k], u = x / h;
    const [y, v, a] = [values, rates, accelerations].map((column) => column[k]);
    const D = values[k + 1] - (y + v * h + (a * h * h) / 2), V = (rates[k + 1] - (v + a * h)) * h, A = (accelerations[k + 1] - a) * h * h;
    const [c, d, e] = [10 * D - 4 * V + A / 2, -15 * D + 7 * V - A, 6 * D - 3 * V + A / 2];
    return [
      y + v * x + (a * x * x) / 2 + u ** 3 * (c + u * (d + u * e)),
      v + a * x + (u * u * (3 * c + u * (4 * d + 5 * u * e))) / h,
      a + (u * (6 * c + u * (12 * d + 20 * u * e))) / (h * h),
    ];
  }
}
