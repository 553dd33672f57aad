// SPDX-License-Identifier: Apache-2.0
import type {
  BakeInput, BakeOptions, BakeResult, Callbacks, FileOptions, GltfBakeOptions, GltfBakeResult, GltfInspection, GltfMicromaps,
  GltfSweep, GltfSweepOptions, GltfVerification, ModuleSource, VellumError,
} from './index.js';

type InWorker<Options> = Omit<Options, 'cancelled'>;
type ReadOptions = FileOptions & Pick<Callbacks, 'signal'>;

/**
 * The functions of a Vellum in a worker (worker_threads in Node.js), one after the other. Arguments are copied. An aborted
 * signal, and an exception of onProgress, which is thrown on, end the worker and all its calls, the others with
 * VELLUM_CANCELLED; the next call starts another.
 */
export declare class VellumWorker {
  /**
   * `source`: as load() takes it, in the thread of the constructor. `make`: starts the Worker of a browser with these options, where
   * the code of serve.js is elsewhere, for instance in a Blob.
   */
  constructor(
    source?: ModuleSource,
    options?: { make?: (options: { type: 'module'; name: string }) => { postMessage(message: unknown): void; terminate(): void } });
  bake(inputs: BakeInput | BakeInput[], options?: InWorker<BakeOptions>): Promise<BakeResult>;
  bakeGltf(bytes: Uint8Array, options?: InWorker<GltfBakeOptions>): Promise<GltfBakeResult>;
  sweepGltf(bytes: Uint8Array, options?: InWorker<GltfSweepOptions>): Promise<GltfSweep>;
  readGltf(bytes: Uint8Array, options?: ReadOptions): Promise<GltfMicromaps>;
  inspectGltf(bytes: Uint8Array, options?: ReadOptions): Promise<GltfInspection>;
  verifyGltf(bytes: Uint8Array, options?: InWorker<FileOptions & Callbacks & { exact?: boolean }>): Promise<GltfVerification>;
  terminate(error?: VellumError): void;
}
