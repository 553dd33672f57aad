// SPDX-License-Identifier: Apache-2.0
// Opacity micromaps in WebAssembly: the baker, and glTF files. docs/javascript.md has examples; docs/baking.md explains the
// options. Enumerations have Vulkan's values.

/** Formats of texels (one channel) and of texture coordinates (two). */
export declare const Format: Readonly<{
  R8_UNORM: 9; R16_UNORM: 70; R16_SFLOAT: 76; R16G16_UNORM: 77; R16G16_SFLOAT: 83; R32_SFLOAT: 100; R32G32_SFLOAT: 103;
}>;
export declare const Filter: Readonly<{ NEAREST: 0; LINEAR: 1 }>;
export declare const AddressMode: Readonly<{
  REPEAT: 0; MIRRORED_REPEAT: 1; CLAMP_TO_EDGE: 2; CLAMP_TO_BORDER: 3; MIRROR_CLAMP_TO_EDGE: 4;
}>;
export declare const MicromapFormat: Readonly<{ TWO_STATE: 1; FOUR_STATE: 2 }>;
export declare const CompareOp: Readonly<{ LESS: 1; LESS_OR_EQUAL: 3; GREATER: 4; GREATER_OR_EQUAL: 6 }>;
export declare const TwoStateRule: Readonly<{ NEAREST: 0; UNKNOWN_IS_OPAQUE: 1; UNKNOWN_IS_TRANSPARENT: 2 }>;
/** The states of 4-state data, 2 bits each; 2-state data has the first two, 1 bit each. */
export declare const State: Readonly<{ TRANSPARENT: 0; OPAQUE: 1; UNKNOWN_TRANSPARENT: 2; UNKNOWN_OPAQUE: 3 }>;
export declare const LEVEL_AUTOMATIC: -1;

export type ErrorCode =
  | 'VELLUM_CANCELLED'
  | 'VELLUM_ERROR_INVALID_ARGUMENT' /** a value out of the range given here, or a member that does not exist */
  | 'VELLUM_ERROR_OUT_OF_MEMORY' /** more than the 4 GiB of a module, or than there is */
  | 'VELLUM_ERROR_TOO_LARGE' /** the result would exceed maxDataSize */
  | 'VELLUM_ERROR_UNSUPPORTED'
  | 'VELLUM_ERROR_INTERNAL' /** a bug in Vellum */
  | 'VELLUM_ERROR_FILE'; /** a file is invalid, or needs a file beside it */

/**
 * What all functions throw. The message is one sentence that names the argument, or the place in the file. Exceptions of
 * callbacks are thrown as they are. load() also throws what fetch() and WebAssembly do. A bug in Vellum may be a
 * WebAssembly.RuntimeError; do not use the module again then.
 */
export declare class VellumError extends Error {
  constructor(code: ErrorCode, message: string);
  readonly code: ErrorCode;
}

/**
 * The alpha of one mip level. Texel (x, y) is at byte offset + y * rowStride + x * pixelStride of `alpha`; row 0 is at
 * v = 0. For the alpha of 8-bit RGBA, such as ImageData: offset 3, pixelStride 4.
 */
export interface Texture {
  /** Texels, 1 to 2^24. */
  width: number;
  height: number;
  alpha: Uint8Array | Uint8ClampedArray | Uint16Array | Float32Array;
  /** A Format of one channel. Default: R8_UNORM, R16_UNORM or R32_SFLOAT by the type of `alpha`. */
  format?: number;
  /** A Filter; default LINEAR. */
  filter?: number;
  /** An AddressMode; default REPEAT. */
  addressModeU?: number;
  addressModeV?: number;
  /** Bytes; default 0. */
  offset?: number;
  /** Bytes; default: those of a value. */
  pixelStride?: number;
  /** Bytes; default: width * pixelStride. */
  rowStride?: number;
  /** Factor on alpha; default 1. */
  scale?: number;
  /** Alpha outside with CLAMP_TO_BORDER, before `scale`; default 0. */
  border?: number;
}

/** Triangles that are alpha-tested with one texture and cutoff. */
export interface BakeInput {
  /** One of both: the texture, or the mip levels that the sampler may read, 1 to 256, largest first. */
  texture?: Texture;
  textures?: Texture[];
  /** u and v of each vertex. Uint16Array: R16G16_UNORM, unless uvFormat is another; Uint8Array: bytes of any format. */
  uvs: Float32Array | Uint16Array | Uint8Array;
  /** A Format of two channels; default R32G32_SFLOAT. */
  uvFormat?: number;
  /** Bytes from vertex to vertex; default: those of u and v. */
  uvStride?: number;
  /** Row-major 2 x 3 matrix: (u, v) becomes (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]). */
  uvTransform?: ArrayLike<number>;
  /** Three for each triangle. Without: each three vertices are a triangle. */
  indices?: Uint8Array | Uint16Array | Uint32Array;
  /** The subdivision level of each triangle, 0 to 12; default: by the options. */
  levels?: Uint8Array;
  /** The MicromapFormat of each triangle; default: that of the options. */
  formats?: Uint8Array;
  /** Alpha is compared with it; default 0.5. */
  cutoff?: number;
}

export interface Callbacks {
  /**
   * `done` of `total` steps, a few hundred times at most. Steps are triangles or, under a budget and of a sweep, passes over them.
   * It may call the module.
   */
  onProgress?: (done: number, total: number) => void;
  /**
   * Return true to cancel. Called often: reading an Int32Array on a SharedArrayBuffer is cheap enough. verifyGltf() calls it
   * between its steps only.
   */
  cancelled?: () => boolean;
  /** Calls are synchronous: it can only be aborted by a callback. In a VellumWorker, at any time. */
  signal?: Signal;
}

/** An AbortSignal. These declarations need no library of types for browsers or Node.js. */
export interface Signal {
  readonly aborted: boolean;
  addEventListener(type: 'abort', listener: () => void, options?: { once?: boolean }): void;
  removeEventListener(type: 'abort', listener: () => void): void;
}

export interface QualityOptions {
  /** A MicromapFormat; default FOUR_STATE. */
  format?: number;
  /** A TwoStateRule: what unknown becomes in 2-state data; default NEAREST. */
  twoStateRule?: number;
  /** Subdivision level, 0 to 12, or LEVEL_AUTOMATIC, the default. */
  level?: number;
  /** The highest automatic level, 0 to 12; default 8. */
  maxLevel?: number;
  /** For automatic levels: edges of micro-triangles in texels, 0 or more; default 4. */
  texelsPerEdge?: number;
  /** The most bytes of data, with 8 for each micromap triangle; default: no limit. */
  budget?: number;
  /** Share of a triangle that must be known for it to get data, 0 to 1; default 0. */
  minKnown?: number;
  /** Of a filtered value, 0 or more; default 2/255. */
  valueTolerance?: number;
  /** In texels, 0 to 1024; default 1/16. */
  subtexelTolerance?: number;
  /** In barycentrics, 0 to 1; default 1e-5. */
  barycentricTolerance?: number;
  /** Relative to the largest coordinate, 0 to 2^-10; default 2^-20. */
  interpolationTolerance?: number;
  /** Bytes, at most 2^32 - 1, above which a bake fails; default 2^30. */
  maxDataSize?: number;
}

export interface BakeOptions extends QualityOptions, Callbacks {
  /** A CompareOp: a sample is opaque if "alpha op cutoff"; default GREATER_OR_EQUAL. */
  compareOp?: number;
  /** Either all triangles of an input have special indices or none has; default false. */
  disallowMixedSpecialIndices?: boolean;
}

/** Number of triangles with data, by format and level. */
export interface Usage {
  count: number;
  subdivisionLevel: number;
  /** A MicromapFormat. */
  format: number;
}

/** The input of a micromap build. */
export interface Micromap {
  data: Uint8Array;
  /** 8 bytes for each: the offset of its data (32 bits), its level and its format (16 bits each), as Vulkan has them. */
  triangles: Uint8Array;
  usages: Usage[];
}

export interface BakeResult extends Micromap {
  /**
   * For each triangle of all inputs: the number of a micromap triangle, or -1 fully transparent, -2 fully opaque, -3 fully
   * unknown transparent, -4 fully unknown opaque. Uint16Array.from(indices) has those for an index buffer of 16 bits.
   */
  indices: Int32Array;
  /** The part of each input. */
  geometries: { indices: Int32Array; usages: Usage[] }[];
  /** Micro-triangles by State, with those of triangles with special indices. */
  stateCounts: [number, number, number, number];
  /** Triangles with special indices by State. */
  specialCounts: [number, number, number, number];
  /** Triangles that differ in coordinates, textures, level or format. */
  distinctCount: number;
}

export interface FileOptions {
  /** What messages call the file; default "input". */
  name?: string;
  /** The files that it names, such as "textures/leaf.png", by path from its own folder, which is that of `name`. */
  files?: Record<string, Uint8Array>;
}

export interface GltfBakeOptions extends FileOptions, QualityOptions, Callbacks {
  /** Also bakes alphaMode BLEND: opaque only where alpha is 1, transparent only where it is 0. */
  blend?: boolean;
  /** Bakes it as a mask with this cutoff instead, which is wrong for renderers that blend. */
  blendCutoff?: number;
  /**
   * Bakes textures with an image that is not supported (KTX2, DDS) from their other image; renderers that take the former see
   * another alpha.
   */
  fallbackImages?: boolean;
  /**
   * The smallest micromaps that know this share of the alpha-tested surface, 0 to 1, instead of a budget. Not with 2 states, and
   * not of sweepGltf().
   */
  targetKnown?: number;
  /** Names of materials or meshes that are not baked; shell patterns: * ? [...]. */
  excludedMaterials?: string[];
  excludedMeshes?: string[];
}

export interface GltfBakeResult {
  /** The file with micromaps: a .glb for a .glb, a .gltf for a .gltf. */
  bytes: Uint8Array;
  report: {
    micromapCount: number;
    /** Primitives that got a micromap. */
    primitiveCount: number;
    /** Bytes of micromaps, with 8 for each micromap triangle. */
    micromapSize: number;
    inputSize: number;
    outputSize: number;
    /** The input had micromaps, which were replaced. */
    replaced: boolean;
    /** Alpha-tested primitives without a micromap: `mesh 2 "leaves" primitive 0`, and why. */
    skipped: { name: string; reason: string }[];
  };
}

export type GltfSweepOptions = Omit<GltfBakeOptions, 'level' | 'format' | 'budget' | 'targetKnown'>;

/** A setting, and what a bake with it would be. */
export interface SweepRow {
  /** Of `vellum bake`: "--level 5 --states 2". */
  options: string;
  /** The same for bakeGltf(), to which the others of the sweep are added. */
  bakeOptions: Pick<GltfBakeOptions, 'level' | 'format' | 'budget'>;
  /** null: automatic. */
  level: number | null;
  states: 2 | 4;
  budget: number | null;
  /** Of micromaps, with 8 for each micromap triangle. */
  bytes: number;
  /** The bake would fail with VELLUM_ERROR_TOO_LARGE. */
  tooLarge: boolean;
  /** Share of the alpha-tested surface that is opaque or transparent, 0 to 1; and the share that is proven to be so. */
  known: number;
  proven: number;
  /** Bytes for each percentage point that the row before does not know; null where there is none. */
  bytesPerPercent: number | null;
  /** Of 1,000 hits on the surface, those that run the alpha test. */
  shaderCalls: number;
  /** Triangles with data by level. */
  levels: Record<string, number>;
}

export interface GltfSweep {
  /** The file has micromaps, which a bake replaces. */
  hadMicromaps: boolean;
  /** Areas are those of the scene; otherwise all triangles count alike. */
  measured: boolean;
  /** Share of the alpha-tested surface, 0 to 1. */
  withoutMicromap: number;
  /** Primitives that a bake gives a micromap. */
  primitives: (Place & { material: string; triangles: number })[];
  /** Alpha-tested primitives without a micromap, and why; `code` is "reason" in the JSON of `vellum bake`. */
  skipped: { name: string; material: string; code: string; reason: string }[];
  /** Levels with 4 states, levels with 2, budgets. None if nothing is baked. */
  rows: SweepRow[];
  /** Into `rows`, and why. */
  recommendation: { row: number; reason: string } | null;
}

/** meshes[mesh].primitives[primitive], and its name in messages. */
export interface Place {
  mesh: number;
  primitive: number;
  name: string;
}

/** A rule of the extension that the file breaks. */
export interface StructureFinding {
  place: string;
  message: string;
}

export interface GltfMicromaps {
  /** The name of the extension in the file; empty without micromaps. */
  extension: string;
  micromaps: Micromap[];
  primitives: (Place & {
    /** Into `micromaps`. */
    micromap: number;
    /** Added to indices that are not special. */
    baseTriangle: number;
    indices: Int32Array;
    usages: Usage[];
  })[];
}

export interface GltfInspection {
  extension: string;
  /** With any, the lists below are empty. At most 100. */
  findings: StructureFinding[];
  micromaps: { triangles: number; bytes: number; usages: Usage[] }[];
  primitives: (Place & {
    micromap: number;
    triangles: number;
    /** Micro-triangles with data by State. */
    states: [number, number, number, number];
    /** Triangles with special indices by State. */
    special: [number, number, number, number];
  })[];
}

/** Numbers of micro-triangles, a special index counting as one; docs/verify.md explains them. */
export interface VerifyCounts {
  microTriangles: number;
  transparent: number;
  opaque: number;
  unknown: number;
  wrong: number;
  outsideMargins: number;
  needlesslyUnknown: number;
  open: number;
  twoState: { true: number; mixed: number; reversed: number };
}

export interface GltfVerification {
  extension: string;
  findings: StructureFinding[];
  counts: VerifyCounts;
  primitives: (Place & {
    material: string;
    triangles: number;
    /** Why its alpha may differ from the one that was verified; empty if it cannot. */
    caution: string;
    counts: VerifyCounts;
    /** The first 20 of each kind. */
    findings: {
      kind: 'wrong' | 'outsideMargins' | 'needlesslyUnknown';
      triangle: number;
      microTriangle: number;
      level: number;
      special: boolean;
      /** A State. */
      state: number;
      /** A point that contradicts it, and the value there. */
      uv: [number | null, number | null];
      value: number | null;
    }[];
  })[];
  /** Primitives that cannot be verified, and why. */
  unverified: (Place & { reason: string })[];
}

/** A module. Calls are synchronous, and return copies. Not more than one thread may use it. */
export interface Vellum {
  /** Of the library, such as "0.1.0". */
  readonly version: string;
  /** Higher where results for the same arguments may differ: for the keys of caches. */
  readonly bakeVersion: number;
  /** Bytes of memory that the module has. It is used again, and never returned. */
  readonly memorySize: number;
  /** One micromap for the triangles of all inputs. */
  bake(inputs: BakeInput | BakeInput[], options?: BakeOptions): BakeResult;
  /** Bakes the alpha-tested primitives of a .glb or .gltf. */
  bakeGltf(bytes: Uint8Array, options?: GltfBakeOptions): GltfBakeResult;
  /** What bakes with many settings would be, as `vellum sweep` shows them. */
  sweepGltf(bytes: Uint8Array, options?: GltfSweepOptions): GltfSweep;
  /** The micromaps of a file; an error if they break a rule. */
  readGltf(bytes: Uint8Array, options?: FileOptions): GltfMicromaps;
  /** What the micromaps of a file are, and every rule that they break. */
  inspectGltf(bytes: Uint8Array, options?: FileOptions): GltfInspection;
  /** Compares every state with the texture, independently of the baker. `exact`: without the margins of GPUs. */
  verifyGltf(bytes: Uint8Array, options?: FileOptions & Callbacks & { exact?: boolean }): GltfVerification;
}

/** A URL, a string being relative to the page or, in Node.js, to index.js; or bytes, or a WebAssembly.Module. */
export type ModuleSource = string | { readonly href: string } | ArrayBuffer | ArrayBufferView | CompiledModule;
/** A WebAssembly.Module, whose type has no members. */
export type CompiledModule = object;

/** Loads vellum.wasm: beside this file, or from a source or a Response. */
export declare function load(source?: ModuleSource | { arrayBuffer(): Promise<ArrayBuffer> }): Promise<Vellum>;
