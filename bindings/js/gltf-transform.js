// SPDX-License-Identifier: Apache-2.0
// Micromaps for gltf-transform: the extension, omm(), and a configuration of its command line. gltf-transform.d.ts describes
// it.
import { Document, Extension, ExtensionProperty, GLB_BUFFER, Logger, PropertyType, Verbosity, WebIO } from '@gltf-transform/core';
import { MicromapFormat, VellumError, _kGltfNames, _known, load } from './index.js';

const NAME = 'EXT_mesh_opacity_micromap';
const DRACO = 'KHR_draco_mesh_compression';
const MESHOPT = ['EXT_meshopt_compression', 'KHR_meshopt_compression'];
const TRIANGLES = 4;
const STRIP = 5;
const FAN = 6;
const RECORD_BYTES = 8;
const MOST_LEVEL = 12;
// What Vulkan requires of the addresses of a micromap build.
const BUILD_ALIGNMENT = 256;

const COMPONENTS = {
  5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5124: Int32Array, 5125: Uint32Array, 5126: Float32Array,
};
const ELEMENTS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

// A fault of a file, which costs it a micromap.
class Fault extends Error {}

function fail(message) {
  throw new Fault(message);
}

const isIndex = (value, length) => Number.isInteger(value) && value >= 0 && value < length;
const listOf = (value) => (Array.isArray(value) ? value : []);
const viewOf = (bytes) => new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const bytesOf = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

// A function that makes the value of a key once.
function memo() {
  const values = new Map();
  return (key, make) => {
    if (!values.has(key)) values.set(key, make());
    return values.get(key);
  };
}

function equalBytes(a, b) {
  if (a === b) return true;
  if (!a || !b || a.byteLength !== b.byteLength) return false;
  const [x, y] = [bytesOf(a), bytesOf(b)];
  return x.every((value, i) => value === y[i]);
}

// The bytes of images as they are now: an application may write to the array of a texture.
const imageCopies = new WeakMap();

// The same array for the same bytes.
function copyOf(image) {
  if (!image) return undefined;
  if (!equalBytes(imageCopies.get(image), image)) imageCopies.set(image, new Uint8Array(image)); // slice() of a Buffer is no copy
  return imageCopies.get(image);
}

// Micromap triangles, as Vulkan stores them.

const recordAt = (view, i) => ({
  dataOffset: view.getUint32(RECORD_BYTES * i, true),
  subdivisionLevel: view.getUint16(RECORD_BYTES * i + 4, true),
  format: view.getUint16(RECORD_BYTES * i + 6, true),
});
const dataBytes = ({ subdivisionLevel, format }) => Math.ceil((4 ** subdivisionLevel * format) / 8);

function recordsOf(triangles) {
  const view = viewOf(triangles);
  return Array.from({ length: triangles.length / RECORD_BYTES }, (_, i) => recordAt(view, i));
}

function usagesOf(triangles) {
  const counts = new Map();
  for (const { subdivisionLevel, format } of recordsOf(triangles)) {
    const key = format * 16 + subdivisionLevel;
    counts.set(key, (counts.get(key) ?? 0) + 1);
  }
  return [...counts].sort(([a], [b]) => a - b)
    .map(([key, count]) => ({ count, subdivisionLevel: key % 16, format: Math.floor(key / 16) }));
}

// The rules of the extension that matter to who reads it: docs/gltf.md.
function checkRecords(data, triangles) {
  const records = recordsOf(triangles);
  records.forEach((record, i) => {
    if (record.format !== MicromapFormat.TWO_STATE && record.format !== MicromapFormat.FOUR_STATE)
      fail(`triangle ${i}: format ${record.format} is neither 1 (2-state) nor 2 (4-state)`);
    if (record.subdivisionLevel > MOST_LEVEL) fail(`triangle ${i}: subdivision level ${record.subdivisionLevel} is above ${MOST_LEVEL}`);
    const end = record.dataOffset + dataBytes(record);
    if (end > data.length) fail(`triangle ${i}: its data ends at byte ${end} of ${data.length}`);
  });
  let end = 0;
  for (const record of records.sort((a, b) => a.dataOffset - b.dataOffset)) {
    if (record.dataOffset < end) fail(`the data of triangles overlaps at byte ${record.dataOffset}`);
    end = record.dataOffset + dataBytes(record);
  }
}

export class OpacityMicromap extends ExtensionProperty {
  static EXTENSION_NAME = NAME;

  init() {
    this.extensionName = NAME;
    this.propertyType = 'OpacityMicromap';
    this.parentTypes = ['PrimitiveMicromap'];
  }

  getDefaults() {
    return Object.assign(super.getDefaults(), { data: new Uint8Array(), triangles: new Uint8Array() });
  }

  getData() {
    return this.get('data');
  }

  getTriangles() {
    return this.get('triangles');
  }

  getUsages() {
    return usagesOf(this.getTriangles());
  }
}

export class PrimitiveMicromap extends ExtensionProperty {
  static EXTENSION_NAME = NAME;

  init() {
    this.extensionName = NAME;
    this.propertyType = 'PrimitiveMicromap';
    this.parentTypes = [PropertyType.PRIMITIVE];
  }

  getDefaults() {
    // `source`: what the states were made from; null if that is not known.
    return Object.assign(super.getDefaults(), { micromap: null, indices: new Int32Array(), options: {}, source: null });
  }

  getMicromap() {
    return this.getRef('micromap');
  }

  getIndices() {
    return this.get('indices');
  }

  getOptions() {
    return this.get('options');
  }
}

// What the states of a primitive depend on.

class Source {
  constructor(alpha, image, corners, cornerAlpha) {
    Object.assign(this, { alpha, image, corners, cornerAlpha });
  }

  equals(other) {
    return (
      this.alpha === other.alpha && equalBytes(this.image, other.image) && equalBytes(this.corners, other.corners) &&
      equalBytes(this.cornerAlpha, other.cornerAlpha)
    );
  }
}

// Where the image of a texture is: an extension's goes before the texture's own.
function imageIndexOf(texture) {
  for (const extension of Object.values(texture.extensions ?? {})) if (Number.isInteger(extension?.source)) return extension.source;
  return texture.source;
}

// Of vertices with so many `elements`, the `kept` ones from `from` on, for each corner of the triangles.
function cornersOf({ array, normalized }, indices, elements, from, kept) {
  const scale = normalized ? { 1: 255, 2: 65535 }[array.BYTES_PER_ELEMENT] ?? 1 : 1;
  const signed = normalized && (array instanceof Int8Array || array instanceof Int16Array);
  const most = signed ? (scale - 1) / 2 : scale;
  const vertices = array.length / elements;
  const values = new Float32Array(indices.length * kept);
  for (let i = 0; i < indices.length; ++i) {
    if (indices[i] >= vertices) fail(`index ${i} is ${indices[i]}, of ${vertices} vertices`);
    for (let k = 0; k < kept; ++k) values[i * kept + k] = array[indices[i] * elements + from + k] / most;
  }
  return values;
}

// Materials whose alpha an animation changes (KHR_animation_pointer), by number.
function animatedMaterials(json) {
  const pointers = listOf(json.animations).flatMap((animation) => listOf(animation?.channels))
    .map((channel) => channel?.target?.extensions?.KHR_animation_pointer?.pointer);
  return new Set(pointers.map((pointer) => Number(/^\/materials\/(\d+)\/.*(alphaCutoff|baseColor)/.exec(pointer)?.[1])));
}

// What primitives of a file have in common. `imageOf`: the bytes of an image by its number, each compared once.
function sharedSource(json, textures) {
  const once = memo();
  const imageOf = (index) => once(index, () => copyOf(textures[index]?.getImage()));
  return { json, imageOf, animated: animatedMaterials(json) };
}

// `geometry`: indices, and attributes by name: { array, type, normalized }.
function sourceOf({ json, imageOf, animated }, def, geometry) {
  if ((def.mode ?? TRIANGLES) !== TRIANGLES) fail(`its mode is ${def.mode}, not 4 (TRIANGLES)`);
  const material = json.materials?.[def.material] ?? {};
  if (material.extensions?.KHR_materials_pbrSpecularGlossiness) fail('its alpha is that of KHR_materials_pbrSpecularGlossiness');
  if (animated.has(def.material)) fail("its material's alpha is animated (KHR_animation_pointer)");
  if (listOf(def.extensions?.KHR_materials_variants?.mappings).some((mapping) => mapping?.material !== def.material))
    fail('its material can be changed (KHR_materials_variants)');
  const checkMorphs = (semantic) => {
    if (listOf(def.targets).some((target) => target?.[semantic] !== undefined)) fail(`morph targets change its ${semantic}`);
  };
  const pbr = material.pbrMetallicRoughness ?? {};
  const info = pbr.baseColorTexture;
  const texture = json.textures?.[info?.index];
  const sampler = json.samplers?.[texture?.sampler];
  const transform = info?.extensions?.KHR_texture_transform;
  const alpha = [material.alphaMode ?? 'OPAQUE', material.alphaCutoff ?? 0.5, pbr.baseColorFactor?.[3] ?? 1];
  let corners;
  if (texture) {
    const set = `TEXCOORD_${transform?.texCoord ?? info.texCoord ?? 0}`;
    const uvs = geometry.attributes[set] ?? fail(`it has no ${set}`);
    checkMorphs(set);
    corners = cornersOf(uvs, geometry.indices, 2, 0, 2);
    const { offset = [0, 0], rotation = 0, scale = [1, 1] } = transform ?? {};
    alpha.push(sampler?.wrapS ?? 10497, sampler?.wrapT ?? 10497, sampler?.magFilter ?? 9729, ...offset, rotation, ...scale);
  }
  const colors = geometry.attributes.COLOR_0;
  if (colors?.type === 'VEC4') checkMorphs('COLOR_0');
  const cornerAlpha = colors?.type === 'VEC4' ? cornersOf(colors, geometry.indices, 4, 3, 1) : undefined;
  // The number of triangles matters, even where nothing else does.
  return new Source(JSON.stringify([geometry.indices.length, ...alpha]), texture && imageOf(imageIndexOf(texture)), corners, cornerAlpha);
}

const isWanted = (semantic) => semantic === 'COLOR_0' || semantic.startsWith('TEXCOORD_');
const sequence = (count) => Uint32Array.from({ length: count }, (_, i) => i);

// Geometry of a primitive whose accessors `read` returns: { array, type, normalized, count }.
function geometryOf(def, read) {
  const attributes = {};
  for (const [semantic, index] of Object.entries(def.attributes ?? {})) if (isWanted(semantic)) attributes[semantic] = read(index);
  const position = def.attributes?.POSITION;
  const vertices = position === undefined ? 0 : read(position).count;
  const indices = def.indices === undefined ? sequence(vertices) : read(def.indices).array;
  return { attributes, indices, vertices };
}

// Geometry as a finished file has it: compressors change the order of triangles and corners, and the values.
class WrittenGeometry {
  #once = memo();

  constructor({ json, resources }, accessorOf, dependencies) {
    Object.assign(this, { json, resources, accessorOf, dependencies });
  }

  of(def) {
    const draco = def.extensions?.[DRACO];
    return draco ? this.#draco(def, draco) : geometryOf(def, (index) => this.#accessor(index));
  }

  #bytes({ buffer, byteOffset = 0, byteLength }) {
    const resource = this.resources[this.json.buffers[buffer].uri ?? GLB_BUFFER];
    return resource.subarray(byteOffset, byteOffset + byteLength);
  }

  // gltf-transform does not write accessors without a buffer.
  #definition(index) {
    return this.json.accessors?.[index] ?? fail('one of its accessors has no buffer');
  }

  #accessor(index) {
    const { bufferView, byteOffset = 0, componentType, count, type, normalized } = this.#definition(index);
    const view = this.json.bufferViews?.[bufferView];
    const compressed = MESHOPT.map((name) => view?.extensions?.[name]).find(Boolean);
    if (!compressed) {
      const array = this.accessorOf(index)?.getArray() ?? fail(`accessor ${index} has no data`);
      return { array, type, normalized, count, componentType };
    }
    const bytes = this.#once(bufferView, () => this.#meshopt(compressed));
    return { array: unpacked(bytes, byteOffset, view.byteStride, componentType, ELEMENTS[type], count), type, normalized, count, componentType };
  }

  #decoder(name) {
    return this.dependencies[name] ?? fail(`compression changes its triangles, which takes the dependency "${name}" to know`);
  }

  #meshopt({ count, byteStride, mode, filter, ...view }) {
    const bytes = new Uint8Array(count * byteStride);
    this.#decoder('meshopt.decoder').decodeGltfBuffer(bytes, count, byteStride, this.#bytes(view), mode, filter);
    return bytes;
  }

  #draco(def, { bufferView, attributes }) {
    const module = this.#decoder('draco3d.decoder');
    return this.#once(JSON.stringify([def, attributes]), () => {
      const bytes = this.#bytes(this.json.bufferViews[bufferView]);
      const owned = [];
      const make = (type) => (owned.push(new module[type]()), owned.at(-1));
      const copied = (Type, length, fill) => {
        const address = module._malloc(length * Type.BYTES_PER_ELEMENT);
        try {
          fill(length * Type.BYTES_PER_ELEMENT, address);
          return new Type(module.HEAPU8.buffer, address, length).slice();
        } finally {
          module._free(address);
        }
      };
      try {
        const [buffer, decoder, mesh] = [make('DecoderBuffer'), make('Decoder'), make('Mesh')];
        buffer.Init(bytes, bytes.length);
        if (!decoder.DecodeBufferToMesh(buffer, mesh).ok()) fail('what Draco wrote cannot be decoded');
        const vertices = mesh.num_points();
        const types = { 5120: 'DT_INT8', 5121: 'DT_UINT8', 5122: 'DT_INT16', 5123: 'DT_UINT16', 5125: 'DT_UINT32', 5126: 'DT_FLOAT32' };
        const found = {};
        for (const [semantic, id] of Object.entries(attributes)) {
          if (!isWanted(semantic)) continue;
          const { componentType, type, normalized } = this.#definition(def.attributes[semantic]);
          const attribute = decoder.GetAttributeByUniqueId(mesh, id);
          const array = copied(COMPONENTS[componentType], vertices * ELEMENTS[type], (size, address) =>
            decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, module[types[componentType]], size, address));
          found[semantic] = { array, type, normalized, count: vertices, componentType };
        }
        const indices = copied(Uint32Array, 3 * mesh.num_faces(), (size, address) => decoder.GetTrianglesUInt32Array(mesh, size, address));
        return { attributes: found, indices, vertices };
      } finally {
        for (const object of owned.reverse()) module.destroy(object);
      }
    });
  }
}

// The elements of an accessor, one after the other.
function unpacked(bytes, offset, stride, componentType, elements, count) {
  const Type = COMPONENTS[componentType] ?? fail(`component type ${componentType} does not exist`);
  const size = Type.BYTES_PER_ELEMENT * elements;
  const step = stride ?? size;
  for (const value of [offset, step, count]) if (!isIndex(value, 2 ** 32)) fail(`an offset, stride or count is ${value}`);
  if (count > 0 && (step < size || offset + (count - 1) * step + size > bytes.length)) fail('it reaches outside of its buffer view');
  const packed = new Uint8Array(count * size);
  for (let i = 0; i < count; ++i) packed.set(bytes.subarray(offset + i * step, offset + i * step + size), i * size);
  return new Type(packed.buffer);
}

// Bakes

const silent = new Logger(Verbosity.SILENT);
const isTested = (material, { blend, blendCutoff } = {}) =>
  material?.alphaMode === 'MASK' || (material?.alphaMode === 'BLEND' && (blend === true || blendCutoff !== undefined));
const nameOf = (place) => `mesh ${place.mesh}${place.name ? ` "${place.name}"` : ''} primitive ${place.primitive}`;

// PNG images in place of those that vellum.wasm does not decode, by copyOf() of their bytes.
const decodedImages = new WeakMap();

async function decodeImages(document, encoder) {
  if (!encoder) return;
  for (const material of document.getRoot().listMaterials()) {
    const texture = material.getAlphaMode() === 'OPAQUE' ? null : material.getBaseColorTexture();
    const image = copyOf(texture?.getImage());
    if (!image || !/^image\/(webp|avif)$/.test(texture.getMimeType()) || decodedImages.has(image)) continue;
    try {
      decodedImages.set(image, new Uint8Array(await encoder(image).png().toBuffer()));
    } catch (error) {
      document.getLogger().warn(`${NAME}: image ${texture.getName() || texture.getURI()}: ${error.message}`);
    }
  }
}

// A file with one mesh for each primitive, of which a bake needs nothing else.
function bakeInput(json, primitives, textures) {
  const parts = [];
  const bufferViews = [];
  const accessors = [];
  let length = 0;
  const addView = (bytes) => {
    bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.byteLength });
    const padding = -bytes.byteLength & 3;
    parts.push(bytesOf(bytes), new Uint8Array(padding));
    length += bytes.byteLength + padding;
    return bufferViews.length - 1;
  };
  const addAccessor = ({ array, type, normalized, componentType }) => {
    const count = array.length / ELEMENTS[type];
    // Vertices are aligned to 4 bytes.
    const stride = (ELEMENTS[type] * array.BYTES_PER_ELEMENT + 3) & ~3;
    const padded = new Uint8Array(count * stride);
    const size = ELEMENTS[type] * array.BYTES_PER_ELEMENT;
    for (let i = 0; i < count; ++i) padded.set(bytesOf(array).subarray(i * size, (i + 1) * size), i * stride);
    const bufferView = addView(type === 'SCALAR' ? array : padded);
    if (type !== 'SCALAR') bufferViews[bufferView].byteStride = stride;
    accessors.push({ bufferView, componentType, count, type, ...(normalized && { normalized }) });
    return accessors.length - 1;
  };
  const used = new Set(primitives.map(({ def }) => {
    const info = json.materials?.[def.material]?.pbrMetallicRoughness?.baseColorTexture;
    return info && imageIndexOf(json.textures[info.index]);
  }));
  const unused = { bufferView: addView(new Uint8Array(4)), mimeType: 'image/png' };
  const images = textures.map((texture, i) => {
    if (!used.has(i)) return unused;
    const image = copyOf(texture.getImage()) ?? new Uint8Array();
    const decoded = decodedImages.get(image);
    return { bufferView: addView(decoded ?? image), mimeType: decoded ? 'image/png' : texture.getMimeType() };
  });
  const plainTexture = ({ sampler, extensions, ...texture }) => {
    const source = imageIndexOf({ ...texture, extensions });
    return images[source]?.mimeType === 'image/png' ? { source, sampler } : { ...texture, sampler, extensions };
  };
  const meshes = primitives.map(({ place, def, geometry }) => {
    const attributes = {};
    for (const [semantic, attribute] of Object.entries(geometry.attributes)) attributes[semantic] = addAccessor(attribute);
    // Positions are not read. They are there for the number of vertices where nothing else has it.
    if (Object.keys(attributes).length === 0) {
      accessors.push({ componentType: 5126, count: geometry.vertices, type: 'VEC3' });
      attributes.POSITION = accessors.length - 1;
    }
    const indices = addAccessor({ array: Uint32Array.from(geometry.indices), type: 'SCALAR', componentType: 5125 });
    return { name: place.name, primitives: [{ attributes, indices, material: def.material }] };
  });
  const some = (list) => (list?.length > 0 ? list : undefined);
  const text = new TextEncoder().encode(JSON.stringify({
    asset: { version: '2.0' }, extensionsUsed: some(json.extensionsUsed?.filter((name) => ![NAME, DRACO, ...MESHOPT].includes(name))),
    materials: some(json.materials), textures: some(json.textures?.map(plainTexture)), samplers: some(json.samplers), images: some(images),
    meshes, accessors, bufferViews, buffers: [{ byteLength: length }],
  }));
  const chunk = (text.length + 3) & ~3;
  const glb = new Uint8Array(28 + chunk + length).fill(0x20, 20, 20 + chunk);
  const view = viewOf(glb);
  [0x46546c67, 2, glb.length, chunk, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
  glb.set(text, 20);
  [length, 0x004e4942].forEach((word, i) => view.setUint32(20 + chunk + 4 * i, word, true));
  let at = 28 + chunk;
  for (const part of parts) {
    glb.set(part, at);
    at += part.length;
  }
  return glb;
}

// The micromaps of primitives: [{ data, triangles }, indices] or the reason why there is none, for each.
function bake(vellum, json, primitives, textures, options, callbacks) {
  const { bytes, report } = vellum.bakeGltf(bakeInput(json, primitives, textures), { ...options, ...callbacks, name: 'document' });
  const reasons = new Map(report.skipped.map(({ name, reason }) => [Number(/^mesh (\d+)/.exec(name)[1]), reason]));
  const results = primitives.map((_, i) => ({ reason: reasons.get(i) ?? 'it is not alpha-tested' }));
  const { micromaps, primitives: baked } = vellum.readGltf(bytes);
  for (const { mesh, micromap, indices, baseTriangle } of baked)
    results[mesh] = { micromap: micromaps[micromap], indices: indices.map((index) => (index < 0 ? index : index + baseTriangle)) };
  return results;
}

// A budget is for all of a file: what `entries` already have counts.
function withinBudget(options, entries) {
  if (options.budget === undefined) return options;
  const sizes = new Map(entries.map(({ micromap: { data, triangles } }) => [data, data.length + triangles.length]));
  const used = [...sizes.values()].reduce((a, b) => a + b, 0);
  return { ...options, budget: Math.max(options.budget - used, 0) };
}

// Files

// `once`: makes what a key stands for when it is first wanted. Many elements may have the same large buffer views.
function readMicromap(element, json, bufferViews, once) {
  if (typeof element !== 'object' || element === null) fail('it is not an object');
  const bytes = (name) => {
    if (!isIndex(element[name], listOf(json.bufferViews).length)) fail(`"${name}" is ${element[name]}, not a buffer view`);
    return bufferViews[element[name]] ?? fail(`"${name}": buffer view ${element[name]} reaches outside of its buffer`);
  };
  const [data, stored] = [bytes('data'), bytes('triangles')];
  const stride = json.bufferViews[element.triangles].byteStride ?? RECORD_BYTES;
  if (!Number.isInteger(stride) || stride < RECORD_BYTES || stride % 4 !== 0) fail(`"triangles": byteStride is ${stride}`);
  const triangles = once(`triangles ${element.triangles}`, () => {
    const count = Math.floor((stored.length + stride - RECORD_BYTES) / stride);
    const records = new Uint8Array(count * RECORD_BYTES);
    for (let i = 0; i < count; ++i) records.set(stored.subarray(i * stride, i * stride + RECORD_BYTES), i * RECORD_BYTES);
    return records;
  });
  once(`${element.data} ${element.triangles}`, () => checkRecords(data, triangles));
  return { data: once(`data ${element.data}`, () => new Uint8Array(data)), triangles };
}

// Elements of an accessor: zeros without a buffer view, and with those of "sparse" in place of some.
function elementsOf({ componentType, type, count, sparse, ...accessor }, json, bufferViews) {
  const size = ELEMENTS[type] ?? fail(`type ${type} is not of one vector`);
  const Type = COMPONENTS[componentType] ?? fail(`component type ${componentType} does not exist`);
  const read = ({ bufferView, byteOffset = 0 }, component, width, length) => {
    const bytes = bufferViews[bufferView] ?? fail(`buffer view ${bufferView} is invalid`);
    return unpacked(bytes, byteOffset, json.bufferViews[bufferView].byteStride, component, width, length);
  };
  if (!isIndex(count, 2 ** 32)) fail(`a count is ${count}`);
  const elements = accessor.bufferView === undefined ? new Type(count * size) : read(accessor, componentType, size, count);
  if (sparse === undefined) return elements;
  const { count: replaced, indices, values } = sparse ?? {};
  if (!isIndex(replaced, count + 1) || !indices || !values) fail('"sparse" is invalid');
  const changed = read(values, componentType, size, replaced);
  read(indices, indices.componentType, 1, replaced).forEach((index, i) => {
    if (!isIndex(index, count)) fail(`"sparse" has element ${index} of ${count}`);
    elements.set(changed.subarray(i * size, (i + 1) * size), index * size);
  });
  return elements;
}

function readIndices(def, json, bufferViews, triangles, records) {
  const base = def.micromapBaseTriangle ?? 0;
  if (!isIndex(base, 2 ** 32)) fail(`"micromapBaseTriangle" is ${base}`);
  let indices;
  if (def.micromapIndices === undefined) {
    if (base + triangles > records) fail(`${triangles} triangles from ${base} on are outside of ${records} micromap triangles`);
    indices = sequence(triangles);
  } else {
    const accessor = listOf(json.accessors)[def.micromapIndices] ?? fail(`"micromapIndices": accessor ${def.micromapIndices} does not exist`);
    const { componentType, type, count } = accessor;
    if (type !== 'SCALAR' || ![5121, 5122, 5123, 5124, 5125].includes(componentType) || accessor.normalized)
      fail('"micromapIndices": it is not a scalar of integers that are not normalized, of component type 5121 to 5125');
    if (count !== triangles) fail(`"micromapIndices" has ${count} elements for ${triangles} triangles`);
    indices = elementsOf(accessor, json, bufferViews);
  }
  // Special indices are -1 to -4, also in unsigned types.
  const special = indices.BYTES_PER_ELEMENT === 4 ? 2 ** 32 : 2 ** (8 * indices.BYTES_PER_ELEMENT);
  return Int32Array.from(indices, (index, i) => {
    if (index >= special - 4) return index - special;
    if (index >= -4 && index < 0) return index;
    if (index < 0 || index + base >= records)
      fail(`triangle ${i}: index ${index} + base triangle ${base} is outside of ${records} micromap triangles`);
    return index + base;
  });
}

// Appends to the first buffer of a finished file.
class Appender {
  #parts = [];

  constructor({ json, resources }) {
    Object.assign(this, { json, resources });
    this.buffer = listOf(json.buffers).findIndex(({ uri }) => resources[uri ?? GLB_BUFFER]);
    if (this.buffer < 0) throw new Error(`${NAME}: the document has no buffer with data`);
    this.key = json.buffers[this.buffer].uri ?? GLB_BUFFER;
    this.length = resources[this.key].byteLength;
    this.#parts.push(resources[this.key]);
  }

  #push(bytes) {
    this.#parts.push(bytes);
    this.length += bytes.byteLength;
  }

  add(bytes, alignment) {
    this.#push(new Uint8Array((alignment - (this.length % alignment)) % alignment));
    this.json.bufferViews.push({ buffer: this.buffer, byteOffset: this.length, byteLength: bytes.byteLength });
    this.#push(bytes);
    return this.json.bufferViews.length - 1;
  }

  end() {
    this.#push(new Uint8Array(-this.length & 3));
    const all = new Uint8Array(this.length);
    let at = 0;
    for (const part of this.#parts) {
      all.set(part, at);
      at += part.byteLength;
    }
    this.resources[this.key] = all;
    this.json.buffers[this.buffer].byteLength = all.byteLength;
  }
}

// Of micromaps and the indices of primitives: [{ def, micromap: { data, triangles }, indices }].
function writeMicromaps(jsonDoc, found, extras) {
  const { json } = jsonDoc;
  const appender = new Appender(jsonDoc);
  const micromaps = [];
  const written = [];
  for (const { def, micromap, indices } of found) {
    const { data, triangles } = micromap;
    let number = micromaps.findIndex((other) => equalBytes(other.data, data) && equalBytes(other.triangles, triangles));
    if (number < 0) {
      number = micromaps.push(micromap) - 1;
      const usages = usagesOf(micromap.triangles);
      written.push({
        data: appender.add(micromap.data, BUILD_ALIGNMENT), triangles: appender.add(micromap.triangles, BUILD_ALIGNMENT),
        usageCounts: usages.map((u) => u.count), usageLevels: usages.map((u) => u.subdivisionLevel), usageFormats: usages.map((u) => u.format),
      });
    }
    const records = micromap.triangles.length / RECORD_BYTES;
    const [Type, componentType] = records <= 0xfc ? [Uint8Array, 5121] : records <= 0xfffc ? [Uint16Array, 5123] : [Uint32Array, 5125];
    json.accessors.push({ bufferView: appender.add(bytesOf(Type.from(indices)), 4), componentType, count: indices.length, type: 'SCALAR' });
    (def.extensions ??= {})[NAME] = { micromap: number, micromapIndices: json.accessors.length - 1 };
  }
  appender.end();
  (json.extensions ??= {})[NAME] = { micromaps: written, ...extras };
}

// Buffer views and accessors of the extension alone. gltf-transform shall not read them: broken ones would be errors of the
// file, and others would stay in the document as accessors that nothing refers to.
function ownParts(json) {
  const views = new Set();
  const accessors = new Set();
  for (const micromap of listOf(json.extensions?.[NAME]?.micromaps)) [micromap?.data, micromap?.triangles].forEach((view) => views.add(view));
  const primitives = listOf(json.meshes).flatMap((mesh) => listOf(mesh?.primitives));
  for (const primitive of primitives) accessors.add(primitive?.extensions?.[NAME]?.micromapIndices);
  for (const primitive of primitives)
    [primitive?.indices, ...Object.values(primitive?.attributes ?? {})].forEach((index) => accessors.delete(index));
  const viewsOf = (accessor) => [accessor, accessor?.sparse?.indices, accessor?.sparse?.values].map((part) => part?.bufferView);
  const visit = (own, action) => listOf(json.accessors).forEach((accessor, i) => accessors.has(i) === own && viewsOf(accessor).forEach(action));
  visit(true, (view) => views.add(view));
  visit(false, (view) => views.delete(view));
  for (const image of listOf(json.images)) views.delete(image?.bufferView);
  return { views, accessors };
}

const eagerly = Symbol('eagerly');

export class EXTMeshOpacityMicromap extends Extension {
  static EXTENSION_NAME = NAME;
  extensionName = NAME;
  prereadTypes = [PropertyType.BUFFER];
  writeDependencies = ['vellum', 'draco3d.decoder', 'meshopt.decoder'];
  #dependencies = {};
  #broken = new Set(); // buffer views of the file that is being read
  #accessors; // of that file
  #own; // of those, the ones that only this extension refers to
  #context; // of the file that is being written
  #eager; // options and callbacks of a bake that goes into the document instead of the file

  install(key, dependency) {
    if (dependency !== undefined) this.#dependencies[key] = dependency;
    return this;
  }

  preread({ jsonDoc: { json, resources }, bufferViews }) {
    const { views, accessors } = ownParts(json);
    listOf(json.bufferViews).forEach((view, index) => {
      if (!views.has(index) || MESHOPT.some((name) => view?.extensions?.[name])) return;
      const { buffer, byteOffset = 0, byteLength } = view ?? {};
      const def = listOf(json.buffers)[buffer];
      const size = Math.min(resources[def?.uri ?? GLB_BUFFER]?.byteLength ?? 0, def?.byteLength ?? 0);
      if (isIndex(byteOffset, size + 1) && isIndex(byteLength, size - byteOffset + 1)) return;
      this.#broken.add(index);
      bufferViews[index] = new Uint8Array();
    });
    this.#own = accessors;
    this.#accessors = listOf(json.accessors);
    if (accessors.size > 0)
      json.accessors = this.#accessors.map((def, index) => (accessors.has(index) ? { type: 'SCALAR', componentType: 5121, count: 0 } : def));
    return this;
  }

  read(context) {
    const { jsonDoc, meshes, accessors, textures } = context;
    const json = { ...jsonDoc.json, accessors: this.#accessors };
    const shared = sharedSource(json, textures);
    const bufferViews = context.bufferViews.map((view, index) => (this.#broken.has(index) ? undefined : view));
    const graph = this.document.getGraph();
    const attempt = (what, read) => {
      try {
        return read();
      } catch (error) {
        if (!(error instanceof Fault)) throw error;
        this.document.getLogger().warn(`${NAME}: ${what}: ${error.message}`);
        return undefined;
      }
    };
    const list = json.extensions?.[NAME]?.micromaps;
    if (!Array.isArray(list)) attempt('the file', () => fail('"micromaps" is not an array'));
    const blendCutoff = json.extensions?.[NAME]?.extras?.blendCutoff;
    const once = memo();
    const micromaps = listOf(list).map((element, i) =>
      attempt(`micromaps[${i}], which is dropped`, () => {
        const { data, triangles } = readMicromap(element, json, bufferViews, once);
        return new OpacityMicromap(graph).set('data', data).set('triangles', triangles);
      }));
    const accessorOf = (index) => {
      // gltf-transform makes these arrays last.
      const def = json.accessors[index] ?? fail(`accessor ${index} does not exist`);
      const { type, normalized } = def;
      const ready = !def.sparse && accessors[index]?.getArray();
      const array = ready || once(`accessor ${index}`, () => elementsOf(def, json, bufferViews));
      return { array, type, normalized, count: Math.floor(array.length / ELEMENTS[type]) };
    };
    listOf(json.meshes).forEach((meshDef, m) => listOf(meshDef.primitives).forEach((def, p) => {
      const primitive = meshes[m].listPrimitives()[p];
      const own = def.extensions?.[NAME];
      const material = json.materials?.[def.material];
      if (own === undefined) {
        // It stays without.
        if (isTested(material, { blend: true })) primitive.setExtension(NAME, new PrimitiveMicromap(graph));
        return;
      }
      attempt(`${nameOf({ mesh: m, name: meshDef.name, primitive: p })}, whose micromap is dropped`, () => {
        if (typeof own !== 'object' || own === null) fail('its extension is not an object');
        if (!isIndex(own.micromap, micromaps.length)) fail(`micromap ${own.micromap} does not exist`);
        const micromap = micromaps[own.micromap] ?? fail(`micromaps[${own.micromap}] is invalid`);
        let source = null;
        let corners = json.accessors[def.indices ?? def.attributes?.POSITION]?.count;
        try {
          const geometry = geometryOf(def, accessorOf);
          corners = geometry.indices.length;
          source = sourceOf(shared, def, geometry);
        } catch (error) {
          if (!(error instanceof Fault)) throw error;
        }
        const usages = micromap.getUsages();
        const indices = readIndices(own, json, bufferViews, Math.floor((corners ?? 0) / 3), micromap.getTriangles().length / RECORD_BYTES);
        const options = {
          ...(usages.length > 0 && { maxLevel: Math.max(...usages.map(({ subdivisionLevel }) => subdivisionLevel)) }),
          ...(usages.length > 0 && usages.every(({ format }) => format === MicromapFormat.TWO_STATE) && { format: MicromapFormat.TWO_STATE }),
          ...(material?.alphaMode === 'BLEND' && (Number.isFinite(blendCutoff) ? { blendCutoff } : { blend: true })),
        };
        const binding = new PrimitiveMicromap(graph).set('indices', indices).set('options', options).set('source', source);
        primitive.setExtension(NAME, binding.setRef('micromap', micromap));
      });
    }));
    for (const index of this.#own) accessors[index]?.dispose();
    return this;
  }

  write(context) {
    // After all others: compressors decide the order of triangles.
    const registered = new Set(context.options.extensions.map((type) => type.EXTENSION_NAME));
    const extensions = this.document.getRoot().listExtensionsUsed().filter(({ extensionName }) => registered.has(extensionName));
    const last = extensions.reduce((a, b) => (a.extensionName > b.extensionName ? a : b), this);
    this.#context = context;
    if (last === this) return this.#finish(context);
    const { write } = last;
    last.write = (...args) => {
      last.write = write;
      write.apply(last, args);
      // An earlier file whose writing failed left this behind.
      if (this.#context === context) this.#finish(context);
      return last;
    };
    return this;
  }

  // Bakes all alpha-tested primitives of the document as it is.
  async [eagerly](vellum, options, callbacks) {
    this.#dependencies.vellum = vellum;
    this.#eager = { options, callbacks };
    try {
      const compressors = new Set([DRACO, ...MESHOPT]);
      const types = this.document.getRoot().listExtensionsUsed().map((extension) => extension.constructor);
      const io = new WebIO().setLogger(silent).registerExtensions(types.filter((type) => !compressors.has(type.EXTENSION_NAME)));
      await io.writeJSON(this.document);
    } finally {
      this.#eager = undefined;
    }
  }

  // A finished file gets its micromaps.
  #finish(context) {
    this.#context = undefined;
    const { json } = context.jsonDoc;
    const textures = this.document.getRoot().listTextures();
    const shared = sharedSource(json, textures);
    const accessors = new Map([...context.accessorIndexMap].map(([accessor, index]) => [index, accessor]));
    const written = new WrittenGeometry(context.jsonDoc, (index) => accessors.get(index), this.#dependencies);
    const kept = [];
    const stale = [];
    const drop = (place, reason) =>
      this.document.getLogger().warn(`${NAME}: ${nameOf(place)} has no micromap: ${reason}`);
    for (const mesh of this.document.getRoot().listMeshes()) {
      const number = context.meshIndexMap.get(mesh);
      mesh.listPrimitives().forEach((primitive, p) => {
        const def = json.meshes[number].primitives[p];
        const place = { mesh: number, name: mesh.getName(), primitive: p };
        const binding = primitive.getExtension(NAME);
        const micromap = binding?.getMicromap();
        const options = this.#eager?.options ?? binding?.getOptions() ?? this.#commonOptions();
        // Without a micromap it stays without; without a binding it is new.
        if (!this.#eager && binding && !micromap) return;
        const tested = isTested(json.materials?.[def.material], options);
        if (!tested && !micromap) return;
        try {
          if (!tested) fail('its material is not alpha-tested any more');
          const geometry = written.of(def);
          const source = sourceOf(shared, def, geometry);
          if (!this.#eager && micromap && binding.get('source')?.equals(source))
            kept.push({ def, place, options, indices: binding.getIndices(),
              micromap: { data: micromap.getData(), triangles: micromap.getTriangles() } });
          else stale.push({ primitive, def, place, geometry, source, options, isNew: !micromap });
        } catch (error) {
          if (!(error instanceof Fault)) throw error;
          drop(place, error.message);
        }
      });
    }
    let found = [...kept, ...this.#bakeAll(json, kept, stale, textures, drop)];
    if (this.#eager) return this.#store(found);
    // A file has one cutoff of blended alpha.
    const blended = found.filter(({ def }) => json.materials[def.material].alphaMode === 'BLEND');
    const cutoff = blended[0]?.options.blendCutoff;
    const others = new Set(blended.filter(({ options }) => options.blendCutoff !== cutoff));
    for (const { place, options } of others) drop(place, `it is for the blend cutoff ${options.blendCutoff}, others are for ${cutoff}`);
    found = found.filter((entry) => !others.has(entry));
    if (found.length > 0) writeMicromaps(context.jsonDoc, found, cutoff !== undefined && { extras: { blendCutoff: cutoff } });
    else for (const list of ['extensionsUsed', 'extensionsRequired']) json[list] = json[list]?.filter((name) => name !== NAME);
    return this;
  }

  // Of new primitives.
  #commonOptions() {
    const bindings = this.listProperties().filter((property) => property instanceof PrimitiveMicromap && property.getMicromap());
    return bindings[0]?.getOptions() ?? {};
  }

  #bakeAll(json, kept, stale, textures, drop) {
    const { vellum } = this.#dependencies;
    const groups = new Map();
    for (const entry of stale) {
      const key = JSON.stringify(entry.options);
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push(entry);
    }
    const found = [];
    const attempt = (group) => {
      let results;
      try {
        const options = withinBudget(group[0].options, [...kept, ...found]);
        results = bake(vellum, json, group, textures, options, this.#eager?.callbacks);
      } catch (error) {
        if (this.#eager) throw error;
        // What is wrong with one of them costs the others nothing.
        if (group.length > 1) return group.forEach((entry) => attempt([entry]));
        results = [{ reason: error.message }];
      }
      group.forEach((entry, i) => {
        if (!results[i].micromap) return drop(entry.place, results[i].reason);
        found.push({ ...entry, ...results[i] });
        const what = entry.isNew ? 'was baked' : 'changed since it was baked, and was baked again';
        if (!this.#eager) this.document.getLogger().info(`${NAME}: ${nameOf(entry.place)} ${what}`);
      });
    };
    if (vellum) for (const group of groups.values()) attempt(group);
    else
      for (const { place, isNew } of stale)
        drop(place, `${isNew ? 'it is new' : 'it changed since it was baked'}, and the dependency "vellum", which would bake it, is not registered`);
    return found;
  }

  #store(found) {
    for (const property of this.listProperties()) property.dispose();
    const graph = this.document.getGraph();
    const micromaps = new Map();
    const entries = new Map(found.map((entry) => [entry.primitive, entry]));
    for (const mesh of this.document.getRoot().listMeshes())
      for (const primitive of mesh.listPrimitives()) {
        const binding = new PrimitiveMicromap(graph);
        primitive.setExtension(NAME, binding);
        const entry = entries.get(primitive);
        if (!entry) continue;
        const { data, triangles } = entry.micromap;
        if (!micromaps.has(data)) micromaps.set(data, new OpacityMicromap(graph).set('data', data).set('triangles', triangles));
        binding.set('indices', entry.indices).set('options', entry.options).set('source', entry.source);
        binding.setRef('micromap', micromaps.get(data));
      }
    return this;
  }
}

// Triangles of strips and fans, in their order: micromaps are for lists.
function toLists(document, options) {
  if (document.hasExtension('KHR_mesh_primitive_restart')) return;
  for (const mesh of document.getRoot().listMeshes())
    for (const primitive of mesh.listPrimitives()) {
      const mode = primitive.getMode();
      if ((mode !== STRIP && mode !== FAN) || !isTested({ alphaMode: primitive.getMaterial()?.getAlphaMode() }, options)) continue;
      const position = primitive.getAttribute('POSITION');
      const corners = primitive.getIndices()?.getArray() ?? sequence(position?.getCount() ?? 0);
      const list = new Uint32Array(3 * Math.max(corners.length - 2, 0));
      for (let i = 0; i < list.length / 3; ++i)
        list.set(mode === FAN ? [corners[i + 1], corners[i + 2], corners[0]] : [corners[i], corners[i + 1 + (i % 2)], corners[i + 2 - (i % 2)]], 3 * i);
      primitive.setIndices(document.createAccessor().setArray(list).setBuffer(position?.getBuffer() ?? null)).setMode(TRIANGLES);
    }
}

let loaded; // the module for calls without one

async function withOwnModule(run) {
  try {
    return await run(await (loaded ??= load()));
  } catch (error) {
    // Another one is loaded after a failure or a trap, and where memory has run out, which would never shrink.
    if (!(error instanceof VellumError) || error.code === 'VELLUM_ERROR_OUT_OF_MEMORY') loaded = undefined;
    throw error;
  }
}

export function omm({ vellum, encoder, onProgress, cancelled, signal, ...options } = {}) {
  return async function omm(document) {
    _known('options', options, _kGltfNames.filter((name) => name !== 'fallbackImages' && name !== 'targetKnown'));
    // Its accessors would be of another class than those that are written to be baked.
    if (!(document instanceof Document))
      throw new Error('The document is of another copy of @gltf-transform/core than that of vellum-omm: install both in one folder.');
    await decodeImages(document, encoder);
    toLists(document, options);
    const bakeBy = (baker) =>
      document.createExtension(EXTMeshOpacityMicromap)[eagerly](baker, options, { onProgress, cancelled, signal });
    await (vellum ? bakeBy(vellum) : withOwnModule(bakeBy));
  };
}

export function micromapConfig({ encoder, onProgramReady, ...config } = {}) {
  return {
    ...config,
    async onProgramReady(parameters) {
      const { program, io, Session } = parameters;
      await onProgramReady?.(parameters);
      const vellum = await load();
      io.registerExtensions([EXTMeshOpacityMicromap]).registerDependencies({ vellum });
      const { transform } = Session.prototype;
      const images = (document) => document.hasExtension(NAME) && decodeImages(document, encoder);
      Session.prototype.transform = function (...transforms) {
        return transform.call(this, ...transforms, images);
      };
      const number = (text) => (text === undefined ? undefined : Number(text));
      program
        .command('omm', 'Bake opacity micromaps')
        .help('Bakes opacity micromaps for all alpha-tested primitives. Other commands keep them where nothing changed\n' +
          'that they depend on, and bake them again elsewhere.')
        .argument('<input>', 'Path to read glTF 2.0 (.glb, .gltf) model')
        .argument('<output>', 'Path to write output')
        .option('--level <level>', 'Subdivision level, 0 to 12; default: by the texture')
        .option('--max-level <level>', 'The highest automatic level, 0 to 12')
        .option('--budget <bytes>', 'The most bytes of micromaps')
        .option('--two-state', 'Data of 2 states instead of 4')
        .option('--blend', 'Also bake alphaMode BLEND')
        .action(({ args, options, logger }) => {
          const { level, maxLevel, budget, twoState, blend } = options;
          const chosen = { level: number(level), maxLevel: number(maxLevel), budget: number(budget),
            ...(twoState && { format: MicromapFormat.TWO_STATE }), ...(blend && { blend: true }) };
          return Session.create(io, logger, args.input, args.output).transform(omm({ vellum, encoder, ...chosen }));
        });
    },
  };
}
