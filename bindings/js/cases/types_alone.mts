// SPDX-License-Identifier: Apache-2.0
// What the declarations must accept without those of browsers and Node.js: compiled by tsc in gltf-transform.test.js.
import { load, type Vellum } from 'vellum-omm';
import { VellumWorker } from 'vellum-omm/worker';

const vellum: Vellum = await load(new Uint8Array());
const { bytes } = await new VellumWorker('vellum.wasm').bakeGltf(new Uint8Array(), { level: 2, fallbackImages: true });
vellum.verifyGltf(bytes, { exact: true });
