// SPDX-License-Identifier: Apache-2.0
// Opacity micromaps in WebAssembly: index.d.ts describes the interface.

const freeze = Object.freeze;

// The values of vellum/vellum.h, which are Vulkan's.
export const Format = freeze({
  R8_UNORM: 9,
  R16_UNORM: 70,
  R16_SFLOAT: 76,
  R16G16_UNORM: 77,
  R16G16_SFLOAT: 83,
  R32_SFLOAT: 100,
  R32G32_SFLOAT: 103,
});
export const Filter = freeze({ NEAREST: 0, LINEAR: 1 });
export const AddressMode = freeze({
  REPEAT: 0,
  MIRRORED_REPEAT: 1,
  CLAMP_TO_EDGE: 2,
  CLAMP_TO_BORDER: 3,
  MIRROR_CLAMP_TO_EDGE: 4,
});
export const MicromapFormat = freeze({ TWO_STATE: 1, FOUR_STATE: 2 });
export const CompareOp = freeze({ LESS: 1, LESS_OR_EQUAL: 3, GREATER: 4, GREATER_OR_EQUAL: 6 });
export const TwoStateRule = freeze({ NEAREST: 0, UNKNOWN_IS_OPAQUE: 1, UNKNOWN_IS_TRANSPARENT: 2 });
export const State = freeze({ TRANSPARENT: 0, OPAQUE: 1, UNKNOWN_TRANSPARENT: 2, UNKNOWN_OPAQUE: 3 });
export const LEVEL_AUTOMATIC = -1;

const INDEX_TYPE_NONE = 1000165000;
const ARGUMENT = 'VELLUM_ERROR_INVALID_ARGUMENT';

// Names that begin with _ are not part of the interface: other files of this package use them.

export class VellumError extends Error {
  constructor(code, message) {
    super(message);
    this.name = 'VellumError';
    this.code = code;
  }
}

function reject(name, value, expected) {
  throw new VellumError(ARGUMENT, `${name} is ${String(value)}, not ${expected}`);
}

const outOfMemory = (message = 'out of memory') => new VellumError('VELLUM_ERROR_OUT_OF_MEMORY', message);

// What an engine throws where an array cannot be made or a value not be copied becomes an error of this package.
export function _ownError(error) {
  const { name, message } = error;
  if (name === 'DataCloneError') return /memory/.test(message) ? outOfMemory(message) : new VellumError(ARGUMENT, message);
  return error instanceof RangeError && !/call stack/.test(message) ? outOfMemory(message) : error;
}

const ranges = {
  u32: ['an integer of 0 to 2^32 - 1', (v) => Number.isInteger(v) && v >= 0 && v <= 0xffffffff],
  i32: ['an integer of 32 bits', (v) => Number.isInteger(v) && v === (v | 0)],
  u53: ['an integer of 0 to 2^53 - 1', (v) => Number.isSafeInteger(v) && v >= 0],
  real: ['a number', (v) => typeof v === 'number' && !Number.isNaN(v)],
  bit: ['true or false', (v) => typeof v === 'boolean'],
};

function checked(kind, name, value, otherwise) {
  if (value === undefined) return otherwise;
  const [expected, accepts] = ranges[kind];
  return accepts(value) ? value : reject(name, value, expected);
}

// The order in which src/wasm/call.cpp reads them.
const kOptions = [
  ['format', 'u32'],
  ['twoStateRule', 'u32'],
  ['level', 'i32'],
  ['maxLevel', 'u32'],
  ['texelsPerEdge', 'real'],
  ['compareOp', 'u32'],
  ['disallowMixedSpecialIndices', 'bit'],
  ['budget', 'u53'],
  ['minKnown', 'real'],
  ['valueTolerance', 'real'],
  ['subtexelTolerance', 'real'],
  ['barycentricTolerance', 'real'],
  ['interpolationTolerance', 'real'],
  ['maxDataSize', 'u53'],
];
const kMostMemory = 0xffffffff;
const kMostSteps = 200; // of onProgress
const kCallbacks = ['onProgress', 'cancelled', 'signal'];
const kBakeNames = [...kOptions.map(([name]) => name), ...kCallbacks];
export const _kGltfNames = [
  'blend', 'blendCutoff', 'fallbackImages', 'targetKnown', 'excludedMaterials', 'excludedMeshes',
  ...kBakeNames.filter((name) => name !== 'compareOp' && name !== 'disallowMixedSpecialIndices'),
];
const kSweepNames = _kGltfNames.filter((name) => !['level', 'format', 'budget', 'targetKnown'].includes(name));
const kInputNames = [
  'texture', 'textures', 'uvs', 'uvFormat', 'uvStride', 'uvTransform', 'indices', 'levels', 'formats', 'cutoff',
];
const kTextureNames = [
  'width', 'height', 'alpha', 'format', 'filter', 'addressModeU', 'addressModeV', 'offset', 'pixelStride',
  'rowStride', 'scale', 'border',
];

// An option with a name that nobody knows is a mistake in spelling.
export function _known(what, object, names) {
  if (typeof object !== 'object' || object === null) reject(what, object, 'an object');
  for (const name of Object.keys(object))
    if (!names.includes(name)) throw new VellumError(ARGUMENT, `${what} has no member "${name}"`);
  return object;
}

// An object of {} or JSON, whichever window or context made it.
function isPlain(value) {
  if (typeof value !== 'object' || value === null) return false;
  const prototype = Object.getPrototypeOf(value);
  return prototype === null || Object.getPrototypeOf(prototype) === null;
}

function bytesOf(name, array, types) {
  if (!types.some((type) => array instanceof type))
    reject(name, Object.prototype.toString.call(array), types.map((type) => type.name).join(', '));
  return new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
}

export function _checkCallbacks({ onProgress, cancelled, signal }) {
  for (const [name, callback] of Object.entries({ onProgress, cancelled }))
    if (callback !== undefined && typeof callback !== 'function') reject(name, callback, 'a function');
  if (signal !== undefined && (typeof signal?.aborted !== 'boolean' || typeof signal.addEventListener !== 'function'))
    reject('signal', signal, 'an AbortSignal');
  if (signal?.aborted) throw new VellumError('VELLUM_CANCELLED', 'cancelled before it began');
}

// The copies of arrays: one of each range of bytes, whichever arrays view it.
export class _Copies {
  #buffers = new Map();
  all = [];

  get({ buffer, byteOffset, byteLength }, make) {
    if (!this.#buffers.has(buffer)) this.#buffers.set(buffer, new Map());
    const ranges = this.#buffers.get(buffer);
    const key = `${byteOffset} ${byteLength}`;
    if (!ranges.has(key)) this.all.push(ranges.set(key, make()).get(key));
    return ranges.get(key);
  }
}

// How the functions of a module are called: memory of a call, its callbacks and its result.
class Call {
  constructor(module, options) {
    _checkCallbacks(options);
    this.module = module;
    this.owned = [];
    this.copies = new _Copies();
    this.onProgress = options.onProgress;
    this.poll = options.cancelled;
    this.signal = options.signal;
  }

  // An exception of the caller's must not pass through the module: it cancels the call, and is thrown at the end.
  guarded(callback) {
    try {
      return callback() || this.signal?.aborted ? 1 : 0;
    } catch (error) {
      this.thrown ??= { error };
      return 1;
    }
  }

  // The module reports some hundred steps of each material.
  progress(done, total) {
    const share = Math.floor((kMostSteps * done) / total);
    const isNew = share !== this.share || done === total;
    this.share = share;
    return this.guarded(() => (isNew && this.onProgress?.(done, total), false));
  }

  cancelled() {
    return this.thrown || this.signal?.aborted ? 1 : this.poll ? this.guarded(() => this.poll()) : 0;
  }

  allocate(size) {
    if (size > kMostMemory) throw outOfMemory('a module has at most 4 GiB of memory');
    const address = this.made(this.module.malloc(Math.max(size, 1)) >>> 0);
    this.owned.push(address);
    return address;
  }

  // What an export made; it returns 0 where memory runs out.
  made(result) {
    if (!result) throw outOfMemory();
    return result;
  }

  // The address of a copy; 0 of nothing. The same bytes have one copy: the library knows a texture by its address.
  put(bytes) {
    if (bytes === undefined) return 0;
    return this.copies.get(bytes, () => {
      const address = this.allocate(bytes.length);
      new Uint8Array(this.module.memory.buffer, address, bytes.length).set(bytes);
      return address;
    });
  }

  putText(text) {
    return this.put(new TextEncoder().encode(`${text}\0`));
  }

  putNumbers(options) {
    const numbers = kOptions.map(([name, kind]) => {
      const value = checked(kind, name, options[name], NaN);
      return typeof value === 'boolean' ? Number(value) : value;
    });
    return this.put(new Uint8Array(new Float64Array(numbers).buffer));
  }

  // Runs a function of the module: its JSON, and the parts of the result, copied.
  run(call) {
    const { module } = this;
    module.calls.push(this);
    let result;
    try {
      result = this.made(call()) >>> 0;
    } finally {
      module.calls.pop();
    }
    const words = (address, count) => new Uint32Array(module.memory.buffer, address, count);
    const bytes = (address, size) => new Uint8Array(module.memory.buffer, address, size);
    const [code, text, textSize, parts, partCount] = words(result, 5);
    const copies = [];
    let message;
    try {
      message = new TextDecoder().decode(bytes(text, textSize));
      for (let i = 0; code === 0 && i < partCount; ++i) {
        const [address, size] = words(parts + 8 * i, 2);
        copies.push(bytes(address, size).slice());
      }
    } catch (error) {
      throw _ownError(error); // of another copy of the result
    } finally {
      module.destroyResult(result);
    }
    if (this.thrown) throw this.thrown.error;
    if (code !== 0) {
      const name = module.nameOf(code | 0);
      // Enumerations have other names in C.
      if (name === ARGUMENT) message = message.replace(/\b(VELLUM_|Vellum)(?=LEVEL|[A-Z][a-z])/g, '');
      throw new VellumError(name, message || (name === 'VELLUM_CANCELLED' ? 'the call was cancelled' : 'out of memory'));
    }
    return [JSON.parse(message), copies];
  }

  end() {
    for (const address of this.owned) this.module.free(address);
  }
}

const indicesOf = (bytes) => new Int32Array(bytes.buffer);

function addTexture(call, bake, texture) {
  _known('texture', texture, kTextureNames);
  const types = [Uint8Array, Uint8ClampedArray, Uint16Array, Float32Array];
  const alpha = bytesOf('alpha', texture.alpha, types);
  const byType =
    texture.alpha instanceof Float32Array ? Format.R32_SFLOAT
    : texture.alpha instanceof Uint16Array ? Format.R16_UNORM
    : Format.R8_UNORM;
  const u32 = (name, otherwise) => checked('u32', name, texture[name], otherwise);
  const real = (name, otherwise) => checked('real', name, texture[name], otherwise);
  call.made(call.module.addTexture(
    bake, call.put(alpha), alpha.length, u32('width', 0), u32('height', 0), u32('format', byType),
    u32('filter', Filter.LINEAR), u32('addressModeU', AddressMode.REPEAT), u32('addressModeV', AddressMode.REPEAT),
    u32('offset', 0), u32('pixelStride', 0), u32('rowStride', 0), real('scale', 1), real('border', 0)));
}

function addInput(call, bake, input) {
  _known('input', input, kInputNames);
  if (input.textures !== undefined && input.texture !== undefined)
    throw new VellumError(ARGUMENT, 'an input has texture or textures, not both');
  const textures = input.textures ?? (input.texture === undefined ? [] : [input.texture]);
  if (!Array.isArray(textures)) reject('textures', textures, 'an array');
  for (const texture of textures) addTexture(call, bake, texture);
  const uvs = bytesOf('uvs', input.uvs, [Float32Array, Uint16Array, Uint8Array]);
  const byType = input.uvs instanceof Uint16Array ? Format.R16G16_UNORM : Format.R32G32_SFLOAT;
  const uvFormat = checked('u32', 'uvFormat', input.uvFormat, byType);
  const uvStride = checked('u32', 'uvStride', input.uvStride, 0);
  const size = uvFormat === Format.R32G32_SFLOAT ? 8 : 4;
  const { indices } = input;
  const indexBytes = indices === undefined ? undefined : bytesOf('indices', indices, [Uint8Array, Uint16Array, Uint32Array]);
  const indexType = indices === undefined ? INDEX_TYPE_NONE : { 1: 1000265000, 2: 0, 4: 1 }[indices.BYTES_PER_ELEMENT];
  const vertices = uvs.length < size ? 0 : Math.floor((uvs.length - size) / (uvStride || size)) + 1;
  const corners = indices === undefined ? vertices : indices.length;
  if (corners % 3 !== 0)
    throw new VellumError(ARGUMENT, `${corners} ${indices === undefined ? 'vertices' : 'indices'} are no whole number of triangles`);
  const triangles = corners / 3;
  const perTriangle = (name) => {
    if (input[name] === undefined) return undefined;
    const bytes = bytesOf(name, input[name], [Uint8Array]);
    return bytes.length === triangles ? bytes : reject(`the length of ${name}`, bytes.length, `that of the triangles, ${triangles}`);
  };
  const { uvTransform } = input;
  if (uvTransform !== undefined && uvTransform?.length !== 6) reject('uvTransform', uvTransform, '6 numbers');
  const transform = uvTransform && Float32Array.from(uvTransform);
  const cutoff = checked('real', 'cutoff', input.cutoff, 0.5);
  call.made(call.module.addInput(
    bake, call.put(uvs), uvs.length, uvStride, uvFormat, call.put(indexBytes), indexBytes?.length ?? 0, indexType,
    triangles, call.put(transform && new Uint8Array(transform.buffer)), call.put(perTriangle('levels')),
    call.put(perTriangle('formats')), cutoff));
}

class Vellum {
  #module;

  constructor(module) {
    this.#module = module;
  }

  get version() {
    const version = this.#module.version() >>> 0;
    return `${version >>> 22}.${(version >>> 12) & 0x3ff}.${version & 0xfff}`;
  }

  get bakeVersion() {
    return this.#module.bakeVersion() >>> 0;
  }

  get memorySize() {
    return this.#module.memory.buffer.byteLength;
  }

  #call(options, names, run) {
    const call = new Call(this.#module, _known('options', options, names));
    try {
      return run(call);
    } finally {
      call.end();
    }
  }

  bake(inputs, options = {}) {
    return this.#call(options, kBakeNames, (call) => {
      const { module } = call;
      const bake = call.made(module.createBake());
      try {
        for (const input of Array.isArray(inputs) ? inputs : [inputs]) addInput(call, bake, input);
        const numbers = call.putNumbers(options);
        const [made, parts] = call.run(() => module.bake(bake, numbers));
        return {
          ...made,
          data: parts[made.data],
          triangles: parts[made.triangles],
          indices: indicesOf(parts[made.indices]),
          geometries: made.geometries.map((g) => ({ ...g, indices: indicesOf(parts[g.indices]) })),
        };
      } finally {
        module.destroyBake(bake);
      }
    });
  }

  // The page in the folder `page` adds a function by it.
  _gltf(bytes, options, names, run) {
    return this.#call(options, ['name', 'files', ...names], (call) => {
      const { name = 'input', files = {} } = options;
      const isText = (text) => typeof text === 'string' && text !== '' && !text.includes('\0');
      if (!isText(name)) reject('name', name, 'a text that is not empty');
      if (!isPlain(files)) reject('files', files && Object.prototype.toString.call(files), 'a plain object');
      for (const path of Object.keys(files)) if (!isText(path)) reject('a path of files', `"${path}"`, 'a text that is not empty');
      const file = bytesOf('bytes', bytes, [Uint8Array]);
      const beside = call.made(call.module.createFiles());
      try {
        const nameAddress = call.putText(name);
        for (const [path, content] of Object.entries(files)) {
          const its = bytesOf(`files["${path}"]`, content, [Uint8Array]);
          call.made(call.module.addFile(beside, nameAddress, call.putText(path), call.put(its), its.length));
        }
        return run(call, [call.put(file), file.length, nameAddress]);
      } finally {
        call.module.destroyFiles(beside);
      }
    });
  }

  // The arguments of a bake of a file.
  #baking(call, options) {
    const lists = ['excludedMaterials', 'excludedMeshes'].map((name) => {
      const list = options[name] ?? [];
      const texts = Array.isArray(list) && list.every((t) => typeof t === 'string' && !t.includes('\0'));
      return texts ? list : reject(name, list, 'an array of texts');
    });
    const blend = checked('bit', 'blend', options.blend, false);
    const blendCutoff = checked('real', 'blendCutoff', options.blendCutoff);
    // Micromaps of a .gltf are always inside.
    const fallback = checked('bit', 'fallbackImages', options.fallbackImages, false);
    const target = checked('real', 'targetKnown', options.targetKnown);
    const flags = (blend || blendCutoff !== undefined ? 1 : 0) | 2 | (blendCutoff !== undefined ? 4 : 0) | (fallback ? 8 : 0) |
      (target !== undefined ? 16 : 0);
    const patterns = call.putText(lists.flat().join('\0'));
    return [call.putNumbers(options), flags, blendCutoff ?? 0.5, target ?? 1, patterns, lists[0].length, lists[1].length];
  }

  bakeGltf(bytes, options = {}) {
    return this._gltf(bytes, options, _kGltfNames, (call, file) => {
      const baking = this.#baking(call, options);
      const [{ output, ...report }, parts] = call.run(() => call.module.bakeGltf(...file, ...baking));
      return { bytes: parts[output], report };
    });
  }

  sweepGltf(bytes, options = {}) {
    return this._gltf(bytes, options, kSweepNames, (call, file) => {
      const baking = this.#baking(call, options);
      const [swept] = call.run(() => call.module.sweepGltf(...file, ...baking));
      const bakeOptions = ({ level, states, budget }) => ({
        level: level ?? LEVEL_AUTOMATIC,
        format: states === 2 ? MicromapFormat.TWO_STATE : MicromapFormat.FOUR_STATE,
        ...(budget !== null && { budget }),
      });
      return { ...swept, rows: swept.rows.map((row) => ({ ...row, bakeOptions: bakeOptions(row) })) };
    });
  }

  readGltf(bytes, options = {}) {
    return this._gltf(bytes, options, [], (call, file) => {
      const [read, parts] = call.run(() => call.module.readGltf(...file));
      return {
        extension: read.extension,
        micromaps: read.micromaps.map((m) => ({ ...m, data: parts[m.data], triangles: parts[m.triangles] })),
        primitives: read.primitives.map((p) => ({ ...p, indices: indicesOf(parts[p.indices]) })),
      };
    });
  }

  inspectGltf(bytes, options = {}) {
    return this._gltf(bytes, options, [], (call, file) => call.run(() => call.module.inspectGltf(...file))[0]);
  }

  verifyGltf(bytes, options = {}) {
    return this._gltf(bytes, options, ['exact', ...kCallbacks], (call, file) => {
      const exact = checked('bit', 'exact', options.exact, false);
      return call.run(() => call.module.verifyGltf(...file, Number(exact)))[0];
    });
  }
}

// Node.js fetches no files.
async function fetched(url) {
  if (url.protocol !== 'file:') return fetch(url);
  const files = 'node:fs/promises'; // esbuild would look for it in a literal
  const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ files);
  return readFile(url);
}

// Strings are relative to the page or, in Node.js, to this file.
export const _located = (source) =>
  typeof source === 'string' ? new URL(source, globalThis.location?.href ?? import.meta.url) : source;

async function compile(source) {
  if (source instanceof WebAssembly.Module) return source;
  source = _located(source);
  if (source instanceof URL) source = await fetched(source);
  if (typeof Response !== 'undefined' && source instanceof Response) {
    if (!source.ok) throw new Error(`${source.url}: ${source.status} ${source.statusText}`);
    source = await source.arrayBuffer();
  }
  return WebAssembly.compile(source);
}

export async function load(source) {
  const module = await compile(source ?? new URL('./vellum.wasm', import.meta.url));
  const calls = [];
  const failure = () => -1;
  // No file can be opened, and nothing is printed: every other import fails.
  const imports = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) (imports[from] ??= {})[name] = failure;
  imports.vellum = {
    progress: (done, total) => calls.at(-1).progress(done, total),
    cancelled: () => calls.at(-1).cancelled(),
  };
  const { exports } = await WebAssembly.instantiate(module, imports);
  exports._initialize();
  const nameOf = (code) => {
    const bytes = new Uint8Array(exports.memory.buffer, exports.resultName(code) >>> 0, 64);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  };
  return new Vellum({ ...exports, calls, nameOf });
}
