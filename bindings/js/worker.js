// SPDX-License-Identifier: Apache-2.0
// The functions of index.js in a worker: they do not block, and a signal ends them at any time. worker.d.ts describes it.
import { VellumError, _Copies, _checkCallbacks, _known, _located, _ownError } from './index.js';

// The arguments of a call with arrays that have memory of their own, among the copies.
function copied(value, copies) {
  if (ArrayBuffer.isView(value)) {
    const type = value[Symbol.toStringTag]; // a Buffer of Node.js is a Uint8Array
    const { buffer, byteOffset, byteLength } = value;
    return new globalThis[type](copies.get(value, () => new Uint8Array(new Uint8Array(buffer, byteOffset, byteLength)).buffer));
  }
  if (Array.isArray(value)) return value.map((member) => copied(member, copies));
  if (Object.prototype.toString.call(value) !== '[object Object]') return value;
  return Object.fromEntries(Object.entries(value).map(([name, member]) => [name, copied(member, copies)]));
}

export class VellumWorker {
  #source;
  #make;
  #worker;
  #calls = new Map();
  #next = 0;

  constructor(source, { make } = {}) {
    const located = _located(source);
    this.#source = located instanceof URL ? located.href : located;
    this.#make = make;
  }

  bake(inputs, options) {
    return this._post('bake', [inputs], options);
  }

  bakeGltf(bytes, options) {
    return this._post('bakeGltf', [bytes], options);
  }

  sweepGltf(bytes, options) {
    return this._post('sweepGltf', [bytes], options);
  }

  readGltf(bytes, options) {
    return this._post('readGltf', [bytes], options);
  }

  inspectGltf(bytes, options) {
    return this._post('inspectGltf', [bytes], options);
  }

  verifyGltf(bytes, options) {
    return this._post('verifyGltf', [bytes], options);
  }

  // Ends the worker, and with it every call. The next call starts another.
  terminate(error = new VellumError('VELLUM_CANCELLED', 'the call was cancelled')) {
    this.#worker?.terminate();
    this.#worker = undefined;
    for (const { reject } of this.#calls.values()) reject(error);
    this.#calls.clear();
  }

  // Starts a worker with these event handlers: worker-node.js has another one.
  _start(handlers) {
    const worker = this.#make
      ? this.#make({ type: 'module', name: 'vellum-omm' })
      : new Worker(new URL('./serve.js', import.meta.url), { type: 'module', name: 'vellum-omm' }); // as bundlers know it
    return Object.assign(worker, handlers);
  }

  #started() {
    // Of a worker that was ended before, nothing counts.
    const current = (handle) => (event) => worker === this.#worker && handle(event);
    const worker = this._start({
      onmessage: current(({ data }) => this.#receive(data)),
      onmessageerror: current(() => this.#lose('result')),
      onerror: current((event) =>
        this.terminate(event instanceof Error ? event : new Error(event.message || 'the worker cannot be started'))),
    });
    return worker;
  }

  // A message that cannot be received does not say of which call it is.
  #lose(what) {
    this.terminate(new VellumError('VELLUM_ERROR_OUT_OF_MEMORY', `there is not enough memory for the ${what} of a call`));
  }

  #receive({ id, result, error, done, total, lost }) {
    if (lost) return this.#lose(lost);
    const call = this.#calls.get(id);
    if (done === undefined) {
      this.#calls.delete(id);
      this.#rest();
      if (!error) return call?.resolve(result);
      return call?.reject(error.own ? new VellumError(error.code, error.message) : new Error(error.message));
    }
    try {
      call?.onProgress(done, total);
    } catch (thrown) {
      call.reject(thrown);
      this.terminate();
    }
  }

  // A worker without calls does not keep Node.js alive.
  #rest() {
    if (this.#calls.size === 0) this.#worker?.unref?.();
  }

  // The page in the folder `page` adds a function by it.
  async _post(method, args, given = {}) {
    _known('options', given, Object.keys(given ?? {}).filter((name) => name !== 'cancelled'));
    _checkCallbacks(given);
    const { onProgress, signal, ...options } = given;
    const id = this.#next++;
    const ended = new Promise((resolve, reject) => this.#calls.set(id, { resolve, reject, onProgress }));
    try {
      const copies = new _Copies();
      const message = { id, method, ...copied({ args, options }, copies), source: this.#source, progress: onProgress !== undefined };
      this.#worker ??= this.#started();
      this.#worker.ref?.();
      this.#worker.postMessage(message, copies.all);
    } catch (error) {
      this.#calls.delete(id);
      this.#rest();
      throw _ownError(error);
    }
    const cancel = () => this.terminate();
    signal?.addEventListener('abort', cancel, { once: true });
    try {
      return await ended;
    } finally {
      signal?.removeEventListener('abort', cancel);
    }
  }
}
