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

/** The operators of the catalogue, by name: parameters with their starts, and y, y_dot, y_ddot at a time. */
export const operators = {
  Sinusoid: {
    parameters: { amplitude: 0.1, "angular frequency": 2 },
    at: (t, y, { amplitude: a, "angular frequency": w }) =>
      [y + a * Math.sin(w * t), a * w * Math.cos(w * t), -a * w * w * Math.sin(w * t)],
  },
  Ramp: {
    parameters: { rate: 0.1 },
    at: (t, y, { rate }) => [y + rate * t, rate, 0],
  },
  SmoothStep: {
    parameters: { height: 1, duration: 2 },
    at: (t, y, { height, duration }) => {
      const x = Math.min(t / duration, 1), u = 1 - x;
      const rise = x ** 4 * (35 - 84 * x + 70 * x * x - 20 * x ** 3);
      return [y + height * rise, (height / duration) * 140 * (x * u) ** 3,
        (height / duration ** 2) * 420 * (x * u) ** 2 * (1 - 2 * x)];
    },
  },
};

/** One of them, begun at a time from a value. */
export class Operator {
  constructor(name, value, time, parameters = { ...operators[name].parameters }) {
    Object.assign(this, { name, value, time, parameters });
  }

  at(time) {
    return operators[this.name].at(Math.max(time - this.time, 0), this.value, this.parameters);
  }
}
