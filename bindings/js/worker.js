// SPDX-License-Identifier: Apache-2.0
// The functions of index.js in a worker: they do not block, and a signal ends them at any time. worker.d.ts describes it.
// This file is also what runs in the worker.
import { VellumError, load } from './index.js';

const inNode = typeof process !== 'undefined' && Boolean(process.versions?.node);
const threads = inNode ? await import(/* webpackIgnore: true */ /* @vite-ignore */ 'node:worker_threads') : undefined;
const kName = 'vellum-omm';

function serve(port) {
  let vellum;
  port.onmessage = async ({ data: { id, method, args, options, source, progress } }) => {
    const onProgress = progress ? (done, total) => port.postMessage({ id, done, total }) : undefined;
    try {
      vellum ??= load(source).catch((error) => {
        vellum = undefined; // the next call tries again
        throw error;
      });
      const result = (await vellum)[method](...args, { ...options, ...(onProgress && { onProgress }) });
      port.postMessage({ id, result });
    } catch (error) {
      const own = error instanceof VellumError;
      // A module that trapped is not used again; the memory of one that has run out would never shrink.
      if (!own || error.code === 'VELLUM_ERROR_OUT_OF_MEMORY') vellum = undefined;
      port.postMessage({ id, error: { code: error.code, message: error.message || String(error), own } });
    }
  };
}

export class VellumWorker {
  #source;
  #make;
  #worker;
  #calls = new Map();
  #next = 0;

  constructor(source, { make } = {}) {
    this.#source = source;
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

  #start() {
    const worker = inNode
      ? new threads.Worker(new URL('./worker.js', import.meta.url), { name: kName, workerData: kName })
      : this.#make
        ? this.#make({ type: 'module', name: kName })
        : new Worker(new URL('./worker.js', import.meta.url), { type: 'module', name: kName }); // as bundlers know it
    const receive = ({ id, result, error, done, total }) => {
      const call = this.#calls.get(id);
      if (done !== undefined) {
        try {
          return call?.onProgress(done, total);
        } catch (error) {
          return this.terminate(error);
        }
      }
      this.#calls.delete(id);
      this.#rest();
      if (!error) return call?.resolve(result);
      call?.reject(error.own ? new VellumError(error.code, error.message) : new Error(error.message));
    };
    if (inNode) worker.on('message', receive).on('error', (error) => this.terminate(error));
    else Object.assign(worker, { onmessage: ({ data }) => receive(data), onerror: (event) => this.terminate(new Error(event.message || 'the worker cannot be started')) });
    return worker;
  }

  // A worker without calls does not keep Node.js alive.
  #rest() {
    if (this.#calls.size === 0) this.#worker?.unref?.();
  }

  // Not part of the interface: the page in the folder `page` adds a function by it.
  _post(method, args, { onProgress, signal, ...options } = {}) {
    return new Promise((resolve, reject) => {
      if (onProgress !== undefined && typeof onProgress !== 'function')
        return reject(new VellumError('VELLUM_ERROR_INVALID_ARGUMENT', 'onProgress must be a function'));
      const cancel = () => this.terminate();
      const end = (settle) => (value) => {
        signal?.removeEventListener('abort', cancel);
        settle(value);
      };
      if (signal?.aborted) return reject(new VellumError('VELLUM_CANCELLED', 'cancelled before it began'));
      signal?.addEventListener('abort', cancel, { once: true });
      const id = this.#next++;
      this.#worker ??= this.#start();
      this.#worker.ref?.();
      this.#calls.set(id, { resolve: end(resolve), reject: end(reject), onProgress });
      try {
        this.#worker.postMessage({ id, method, args, options, source: this.#source, progress: onProgress !== undefined });
      } catch (error) {
        this.#calls.delete(id);
        this.#rest();
        end(reject)(error);
      }
    });
  }
}

if (threads ? threads.workerData === kName : typeof WorkerGlobalScope !== 'undefined' && self.name === kName) {
  if (threads) {
    const { parentPort } = threads;
    const port = { postMessage: (message) => parentPort.postMessage(message) };
    parentPort.on('message', (data) => port.onmessage({ data }));
    serve(port);
  } else {
    serve(self);
  }
}
