// SPDX-License-Identifier: Apache-2.0
// What the declarations must accept, and must not: compiled by tsc in gltf-transform.test.js.
import { NodeIO, type Transform } from '@gltf-transform/core';
import { AddressMode, VellumError, load, type BakeResult, type GltfSweep, type GltfVerification, type Vellum } from 'vellum-omm';
import { EXTMeshOpacityMicromap, micromapConfig, omm, type OpacityMicromap, type PrimitiveMicromap } from 'vellum-omm/gltf-transform';
import { VellumWorker } from 'vellum-omm/worker';
import sharp from 'sharp';

const vellum: Vellum = await load();
const result: BakeResult = vellum.bake(
  { texture: { width: 2, height: 2, alpha: new Uint8Array(4), addressModeU: AddressMode.REPEAT }, uvs: new Float32Array(6) },
  { level: 2, onProgress: (done, total) => console.log(done / total), signal: AbortSignal.timeout(1000) });
console.log(result.geometries[0].indices, result.usages[0].count);
const verified: GltfVerification = vellum.verifyGltf(vellum.bakeGltf(new Uint8Array(), { blend: true, name: 'x' }).bytes, { exact: true });
console.log(verified.counts.twoState.mixed);
const { rows, recommendation }: GltfSweep = vellum.sweepGltf(new Uint8Array(), { maxLevel: 6, files: { 'leaf.png': new Uint8Array() } });
vellum.bakeGltf(new Uint8Array(), { ...rows[recommendation?.row ?? 0].bakeOptions, maxLevel: 6 });
// @ts-expect-error: a sweep has all levels.
vellum.sweepGltf(new Uint8Array(), { level: 1 });
console.log(new VellumWorker(undefined, { make: (options) => new Worker('code', options) }));
const worker = new VellumWorker();
const read = await worker.readGltf(new Uint8Array(), { signal: AbortSignal.timeout(1000) });
console.log(new VellumWorker(new URL('file:///vellum.wasm')), await load(await fetch('vellum.wasm')));
console.log(read.primitives[0].name);
worker.terminate(new VellumError('VELLUM_CANCELLED', 'enough'));
// @ts-expect-error: a worker's calls are cancelled by their signal.
await worker.bakeGltf(new Uint8Array(), { cancelled: () => true });
// @ts-expect-error: no such member
vellum.bakeGltf(new Uint8Array(), { levle: 1 });
// @ts-expect-error: no such code
console.log(new VellumError('VELLUM_ERROR', ''));

const transform: Transform = omm({ vellum, encoder: sharp, maxLevel: 6, excludedMaterials: ['glass'] });
const io = new NodeIO().registerExtensions([EXTMeshOpacityMicromap]).registerDependencies({ vellum });
const document = await io.read('tree.glb');
await document.transform(transform);
document.createExtension(EXTMeshOpacityMicromap).setRequired(false);
const binding = document.getRoot().listMeshes()[0].listPrimitives()[0].getExtension<PrimitiveMicromap>('EXT_mesh_opacity_micromap');
const micromap: OpacityMicromap | null = binding!.getMicromap();
const arrays: [Uint8Array, Uint8Array, Int32Array] | null = micromap && [micromap.getData(), micromap.getTriangles(), binding!.getIndices()];
console.log(arrays, binding!.getOptions().maxLevel, micromap!.getUsages()[0].subdivisionLevel);
// @ts-expect-error: no such option
omm({ cancelled: 1 });
// @ts-expect-error: a document has its files.
omm({ files: {} });
export default micromapConfig({ encoder: sharp });
