// SPDX-License-Identifier: Apache-2.0
// Models that transforms of gltf-transform have something to do with: primitives that share accessors and materials, every
// way of reading alpha, strips, instances, an animation, duplicates.
import { crc32 as zlibCrc32, deflateSync } from 'node:zlib';

// Park and Miller's generator: numbers from 0 to 1.
function generator(seed) {
  let state = seed * 7919 + 1;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

function crc32(bytes) {
  if (zlibCrc32) return zlibCrc32(bytes);
  let crc = ~0; // Node.js 18
  for (const byte of bytes) {
    crc ^= byte;
    for (let k = 0; k < 8; ++k) crc = (crc >>> 1) ^ (0xedb88320 & -(crc & 1));
  }
  return ~crc >>> 0;
}

/** A PNG of 8-bit RGBA whose alpha is `alpha(x, y)`, 0 to 1. */
export function png(width, height, alpha) {
  const rows = Buffer.alloc(height * (1 + 4 * width));
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) rows.set([40, 120, 30, Math.round(255 * alpha(x, y))], y * (1 + 4 * width) + 1 + 4 * x);
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const sizes = [Buffer.alloc(4), Buffer.alloc(4)];
    sizes[0].writeUInt32BE(data.length);
    sizes[1].writeUInt32BE(crc32(body));
    return Buffer.concat([sizes[0], body, sizes[1]]);
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 6], 8);
  const parts = [Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', header), chunk('IDAT', deflateSync(rows)), chunk('IEND', Buffer.alloc(0))];
  return new Uint8Array(Buffer.concat(parts));
}

/** The arguments are the packages @gltf-transform/core and /extensions. */
export function mixture({ Document, Primitive }, { KHRTextureTransform }, seed) {
  const random = generator(seed);
  const document = new Document();
  const buffer = document.createBuffer();
  const accessor = (array, type) => document.createAccessor().setArray(array).setType(type).setBuffer(buffer);
  const texture = (name, alpha, size = 48) =>
    document.createTexture(name).setImage(png(size, size, alpha)).setMimeType('image/png');
  const disc = texture('disc', (x, y) => (Math.hypot(x - 24, y - 20) < 14 ? 1 : 0));
  const waves = texture('waves', (x, y) => 0.5 + 0.5 * Math.sin(x / 3 + seed) * Math.cos(y / 5));
  const leaves = document.createMaterial('leaves').setAlphaMode('MASK').setBaseColorTexture(disc);
  const grass = document.createMaterial('grass').setAlphaMode('MASK').setAlphaCutoff(0.3).setBaseColorFactor([1, 1, 1, 0.8])
    .setBaseColorTexture(waves);
  grass.getBaseColorTextureInfo().setWrapS(33648).setWrapT(33071).setMagFilter(9728);
  const fern = document.createMaterial('fern').setAlphaMode('MASK').setBaseColorTexture(waves);
  const transform = document.createExtension(KHRTextureTransform).createTransform();
  fern.getBaseColorTextureInfo().setExtension('KHR_texture_transform', transform.setOffset([0.1, 0.2]).setScale([1.5, 0.7]).setRotation(0.3));
  const bark = document.createMaterial('bark');
  const glass = document.createMaterial('glass').setAlphaMode('BLEND').setBaseColorTexture(waves);

  // Triangles with coordinates of their own.
  const triangles = (count, { indexed = true, colors = false, second = false } = {}) => {
    const vertices = 3 * count;
    const positions = Float32Array.from({ length: 3 * vertices }, () => 4 * random());
    const uvs = () => Float32Array.from({ length: 2 * vertices }, () => 1.6 * random() - 0.3);
    const primitive = document.createPrimitive().setAttribute('POSITION', accessor(positions, 'VEC3'));
    primitive.setAttribute('NORMAL', accessor(Float32Array.from({ length: 3 * vertices }, (_, i) => (i % 3 === 2 ? 1 : 0)), 'VEC3'));
    if (second) primitive.setAttribute('TEXCOORD_1', accessor(uvs(), 'VEC2'));
    primitive.setAttribute('TEXCOORD_0', accessor(uvs(), 'VEC2'));
    if (colors)
      primitive.setAttribute('COLOR_0', accessor(Float32Array.from({ length: 4 * vertices }, (_, i) => (i % 4 === 3 && i % 24 < 12 ? 0.75 : 1)), 'VEC4'));
    const order = Array.from({ length: vertices }, (_, i) => (Math.floor(i / 3) % 4 === 3 ? (i * 7) % vertices : i));
    if (indexed) primitive.setIndices(accessor(Uint16Array.from(order), 'SCALAR'));
    return primitive;
  };
  const mesh = (name, ...primitives) => primitives.reduce((made, primitive) => made.addPrimitive(primitive), document.createMesh(name));
  const plant = triangles(30);
  const copy = plant.clone().setMaterial(fern);
  const strip = triangles(9).setMode(Primitive.Mode.TRIANGLE_STRIP);
  const two = triangles(17, { second: true });
  const moss = document.createMaterial('moss').setAlphaMode('MASK').setBaseColorTexture(disc);
  moss.getBaseColorTextureInfo().setTexCoord(1);
  const meshes = [
    mesh('plant', plant.setMaterial(leaves), triangles(12).setMaterial(bark)),
    mesh('plant again', copy),
    mesh('meadow', triangles(25, { colors: true }).setMaterial(grass), triangles(20, { indexed: false }).setMaterial(grass)),
    mesh('strip', strip.setMaterial(leaves)),
    mesh('moss', two.setMaterial(moss)),
    mesh('window', triangles(6).setMaterial(glass)),
  ];
  // A duplicate, which dedup() merges.
  meshes.push(mesh('plant', document.createPrimitive().setMaterial(leaves).setIndices(accessor(plant.getIndices().getArray().slice(), 'SCALAR'))));
  for (const semantic of plant.listSemantics()) {
    const original = plant.getAttribute(semantic);
    meshes.at(-1).listPrimitives()[0].setAttribute(semantic, accessor(original.getArray().slice(), original.getType()));
  }
  const scene = document.createScene();
  const nodes = meshes.map((made, i) => document.createNode(`frame_${i}`).setMesh(made).setTranslation([i, 0, 0]));
  for (let i = 0; i < 6; ++i) nodes.push(document.createNode().setMesh(meshes[0]).setTranslation([i, 3, 0]));
  const parent = document.createNode('parent').setScale([2, 2, 2]);
  for (const node of nodes) parent.addChild(node);
  scene.addChild(parent);
  const times = accessor(Float32Array.from({ length: 9 }, (_, i) => i / 8), 'SCALAR');
  const sampler = document.createAnimationSampler().setInput(times).setOutput(accessor(new Float32Array(27), 'VEC3'));
  document.createAnimation('still').addSampler(sampler)
    .addChannel(document.createAnimationChannel().setTargetNode(nodes[1]).setTargetPath('translation').setSampler(sampler));
  return document;
}
