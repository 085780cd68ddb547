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
  Sinusoid: (t, y, { amplitude: a, "angular frequency": w }) =>
    [y + a * Math.sin(w * t), a * w * Math.cos(w * t), -a * w * w * Math.sin(w * t)],
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
    Object.assign(this, { name, value, time, parameters });
  }

  at(time) {
    return operators[this.name](Math.max(time - this.time, 0), this.value, this.parameters);
  }
}
