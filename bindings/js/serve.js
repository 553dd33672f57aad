// SPDX-License-Identifier: Apache-2.0
// What runs in the worker of worker.js.
import { VellumError, _ownError, load } from './index.js';

// The memory of the arrays in a result, which is moved instead of copied.
function buffersIn(value, found = new Set()) {
  if (ArrayBuffer.isView(value)) found.add(value.buffer);
  else if (typeof value === 'object' && value !== null) for (const member of Object.values(value)) buffersIn(member, found);
  return [...found];
}

// `port`: of the worker, with postMessage(). It gets its event handlers.
export function serve(port) {
  let vellum;
  const post = (message) => port.postMessage(message, buffersIn(message.result));
  port.onmessage = async ({ data: { id, method, args, options, source, progress } }) => {
    const onProgress = progress ? (done, total) => port.postMessage({ id, done, total }) : undefined;
    try {
      vellum ??= load(source).catch((error) => {
        vellum = undefined; // the next call tries again
        throw error;
      });
      post({ id, result: (await vellum)[method](...args, { ...options, ...(onProgress && { onProgress }) }) });
    } catch (thrown) {
      const error = _ownError(thrown);
      const own = error instanceof VellumError;
      // A module that trapped is not used again; the memory of one that has run out would never shrink.
      if (!own || error.code === 'VELLUM_ERROR_OUT_OF_MEMORY') vellum = undefined;
      post({ id, error: { code: error.code, message: error.message || String(error), own } });
    }
  };
  port.onmessageerror = () => post({ lost: 'arguments' });
}

if (typeof WorkerGlobalScope !== 'undefined' && self.name === 'vellum-omm') serve(self);
