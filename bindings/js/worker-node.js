// SPDX-License-Identifier: Apache-2.0
// worker.js for Node.js. This file is also what runs in the worker.
import { Worker, parentPort, workerData } from 'node:worker_threads';
import { serve } from './serve.js';
import { VellumWorker as BrowserWorker } from './worker.js';

const kName = 'vellum-omm';

export class VellumWorker extends BrowserWorker {
  _start({ onmessage, onmessageerror, onerror }) {
    const worker = new Worker(new URL('./worker-node.js', import.meta.url), { name: kName, workerData: kName });
    return worker.on('message', (data) => onmessage({ data })).on('messageerror', onmessageerror).on('error', onerror);
  }
}

if (workerData === kName) {
  const port = { postMessage: (message, moved) => parentPort.postMessage(message, moved) };
  serve(port);
  parentPort.on('message', (data) => port.onmessage({ data })).on('messageerror', () => port.onmessageerror());
}
