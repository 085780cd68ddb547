// One FMU of FMI 2.0, its own C compiled to WebAssembly, called through its FMI functions.

const OK = 0, WARNING = 1, DISCARD = 2;

/** A call that the FMU refused; `message` is what it said. */
export class Refusal extends Error {
  constructor(message, again) {
    super(message);
    this.again = again; // whether the instance can go on as it is
  }
}

/** @param {string} packed base64 of the gzipped module */
export async function compile(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(stream).arrayBuffer());
}

export class Fmu {
  /** @param {WebAssembly.Module} module  @param {string} guid  that of its model description */
  constructor(module, guid) {
    this.said = "";
    const nothing = () => 8; // EBADF: a page has no files
    const wasi = new Proxy({}, { get: () => nothing });
    const page = {
      say: (status, text) => { if (status > OK) this.said = this.#text(text); },
      number: (value, digits, place) => this.#write(place, String(Number(value.toPrecision(digits)))),
    };
    this.c = new WebAssembly.Instance(module, { wasi_snapshot_preview1: wasi, page }).exports;
    this.c._initialize();
    const place = this.c.malloc(guid.length + 1);
    this.#write(place, guid);
    this.instance = this.c.page_instantiate(place);
    this.c.free(place);
    if (!this.instance) throw new Refusal(this.said || "the FMU cannot be instantiated", false);
    this.capacity = 0;
  }

  /** Values of the variables of a type with these references. */
  get(references, type = "Real") {
    const [first, second] = this.#places(references), numbers = type === "Real" ? Float64Array : Int32Array;
    this.#check(this.c[`fmi2Get${type}`](this.instance, first, references.length, second));
    return new numbers(this.c.memory.buffer, second, references.length).slice();
  }

  set(references, values) {
    const [first, second] = this.#places(references);
    new Float64Array(this.c.memory.buffer, second, references.length).set(values);
    this.#check(this.c.fmi2SetReal(this.instance, first, references.length, second));
  }

  setInteger(reference, value) {
    const [first, second] = this.#places([reference]);
    new Int32Array(this.c.memory.buffer, second, 1)[0] = value;
    this.#check(this.c.fmi2SetInteger(this.instance, first, 1, second));
  }

  /** Back to where nothing has been set. */
  reset() {
    this.#check(this.c.fmi2Reset(this.instance));
  }

  enter(tolerance) {
    this.#check(this.c.fmi2SetupExperiment(this.instance, 1, tolerance, 0, 0, 0));
    this.#check(this.c.fmi2EnterInitializationMode(this.instance));
  }

  leave() {
    this.#check(this.c.fmi2ExitInitializationMode(this.instance));
  }

  step(time, size) {
    this.#check(this.c.fmi2DoStep(this.instance, time, size, 1));
  }

  #places(references) {
    if (references.length > this.capacity) {
      this.capacity = 2 * references.length;
      this.references = this.c.malloc(4 * this.capacity);
      this.values = this.c.malloc(8 * this.capacity);
    }
    new Uint32Array(this.c.memory.buffer, this.references, references.length).set(references);
    return [this.references, this.values];
  }

  #check(status) {
    if (status > WARNING) throw new Refusal(this.said || "refused", status === DISCARD);
  }

  /** Text in ASCII to the module's memory, and a 0 after it. */
  #write(place, text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    new Uint8Array(this.c.memory.buffer, place, bytes.length).set(bytes);
  }

  #text(place) {
    const bytes = new Uint8Array(this.c.memory.buffer, place);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
}
