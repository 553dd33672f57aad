// SPDX-License-Identifier: Apache-2.0
// Micromaps (EXT_mesh_opacity_micromap) in documents of gltf-transform. docs/gltf-transform.md has examples.
import { Extension, ExtensionProperty } from '@gltf-transform/core';
import type { ReaderContext, Transform, WriterContext } from '@gltf-transform/core';
import type { Callbacks, GltfBakeOptions, Usage, Vellum } from './index.js';

/** What decodes images to PNG: the function of the package `sharp`, or one with these methods. */
export type ImageDecoder = (image: Uint8Array) => { png(): { toBuffer(): Promise<Uint8Array> } };

/** Options of a bake that are kept in the document, for the next one: what can be written as JSON. */
export type DocumentBakeOptions = Omit<GltfBakeOptions, keyof Callbacks | 'name' | 'files' | 'fallbackImages' | 'targetKnown'>;

/** A micromap, which primitives may share: input of a micromap build. */
export declare class OpacityMicromap extends ExtensionProperty {
  static EXTENSION_NAME: 'EXT_mesh_opacity_micromap';
  readonly extensionName: 'EXT_mesh_opacity_micromap';
  readonly propertyType: 'OpacityMicromap';
  readonly parentTypes: string[];
  protected init(): void;
  getData(): Uint8Array;
  /** 8 bytes for each: the offset of its data (32 bits), its level and its format (16 bits each), as Vulkan has them. */
  getTriangles(): Uint8Array;
  /** Number of micromap triangles by format and level. */
  getUsages(): Usage[];
}

/**
 * What `primitive.getExtension('EXT_mesh_opacity_micromap')` returns. With or without a micromap: without one, the primitive
 * stays without, whereas alpha-tested primitives that a transform made, and have no such property, are baked when the
 * document is written.
 */
export declare class PrimitiveMicromap extends ExtensionProperty {
  static EXTENSION_NAME: 'EXT_mesh_opacity_micromap';
  readonly extensionName: 'EXT_mesh_opacity_micromap';
  readonly propertyType: 'PrimitiveMicromap';
  readonly parentTypes: string[];
  protected init(): void;
  getMicromap(): OpacityMicromap | null;
  /**
   * For each triangle: the number of a micromap triangle, or -1 fully transparent, -2 fully opaque, -3 fully unknown
   * transparent, -4 fully unknown opaque. They are those of the triangles that were baked or read: a transform after that
   * does not change them.
   */
  getIndices(): Int32Array;
  /** Options with which it is baked again. Of a file that was read: the highest level in it, its states, and blend options. */
  getOptions(): DocumentBakeOptions;
}

/**
 * Reads and writes micromaps. While a file is written, after compression, each micromap is compared with the triangles, the
 * texture and the material that it was made for. Where they differ it is baked again by the dependency "vellum", with what is
 * left of its budget, or dropped with a warning of the document's logger. Where alpha can change, by morph targets, animations
 * or variants, it is dropped. Dependencies, of `registerDependencies` of an I/O class:
 *
 * - "vellum": a Vellum, of load(). omm() brings its own.
 * - "draco3d.decoder", "meshopt.decoder": to see what compression wrote.
 */
export declare class EXTMeshOpacityMicromap extends Extension {
  static readonly EXTENSION_NAME: 'EXT_mesh_opacity_micromap';
  readonly extensionName: 'EXT_mesh_opacity_micromap';
  read(context: ReaderContext): this;
  write(context: WriterContext): this;
}

export interface OmmOptions extends DocumentBakeOptions, Callbacks {
  /** Default: load(). */
  vellum?: Vellum;
  /** For WebP and AVIF images, which are not baked without it. */
  encoder?: ImageDecoder;
}

/**
 * Bakes all alpha-tested primitives of a document as it is, and replaces the micromaps that it has: the last transform.
 * Strips and fans with alpha-tested materials become lists, also if they are excluded. Under a budget, all triangles count alike. Primitives that are not baked, and
 * why, go to the document's logger. Throws a VellumError where an option is wrong or an image is damaged.
 */
export declare function omm(options?: OmmOptions): Transform;

/** Of `gltf-transform --config`. */
export interface CliConfig {
  onProgramReady?: (parameters: any) => Promise<void>;
  [member: string]: unknown;
}

/**
 * A configuration of gltf-transform's command line: all commands keep micromaps, baked again where it is needed, and the
 * command `omm` bakes them. `encoder`: as of omm(). Other members are those of the configuration, and are kept.
 */
export declare function micromapConfig(config?: CliConfig & { encoder?: ImageDecoder }): CliConfig & Required<Pick<CliConfig, 'onProgramReady'>>;
