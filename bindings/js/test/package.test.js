// SPDX-License-Identifier: Apache-2.0
// Tests of the package in build/wasm/package, with nothing but Node.js: node --test bindings/js/test
//   VELLUM_PACKAGE        the folder of the package
//   VELLUM_LIBRARY_PATH   the folder of the native libvellum, with which results are compared
//   VELLUM_COMMAND        the native command, with which files are compared
//   VELLUM_MODELS          a folder of .glb files to compare, besides that of examples/python/tree.py
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { deflateSync } from 'node:zlib';
import { limited } from '../cases/limited.js';

const here = dirname(fileURLToPath(import.meta.url));
const root = resolve(here, '../../..');
const folder = resolve(process.env.VELLUM_PACKAGE ?? join(root, 'build/wasm/package'));
const library = process.env.VELLUM_LIBRARY_PATH;
const command = process.env.VELLUM_COMMAND;
const api = await import(pathToFileURL(join(folder, 'index.js')));
const { VellumWorker } = await import(pathToFileURL(join(folder, 'worker-node.js')));
const { VellumError } = api;
const vellum = await api.load();

const work = mkdtempSync(join(tmpdir(), 'vellum-js-'));
after(() => rmSync(work, { recursive: true }));
const tree = join(work, 'tree.glb');
execFileSync('python3', [join(root, 'examples/python/tree.py'), tree]);
const models = [tree];
if (process.env.VELLUM_MODELS)
  for (const name of readdirSync(process.env.VELLUM_MODELS).sort())
    if (name.endsWith('.glb')) models.push(join(process.env.VELLUM_MODELS, name));
const bytesOf = (path) => new Uint8Array(readFileSync(path));

const disc = (size) => Uint8Array.from({ length: size * size }, (_, i) => (Math.hypot((i % size) - size / 2, Math.floor(i / size) - size / 2) < size / 3 ? 255 : 0));
const card = (size = 64) => ({
  texture: { width: size, height: size, alpha: disc(size) },
  uvs: new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]),
  indices: new Uint16Array([0, 1, 2, 0, 2, 3]),
});
const fails = (code, message) => (error) => {
  assert(error instanceof VellumError, String(error));
  assert.equal(error.code, code);
  assert.match(error.message, message);
  return true;
};
const decoded = (text, type) => {
  const bytes = new Uint8Array(Buffer.from(text, 'base64'));
  return type ? new type(bytes.buffer) : bytes;
};

// A .glb with other JSON and, if given, other bytes at the end of its binary part.
function changed(glb, change, more = new Uint8Array()) {
  const size = Buffer.from(glb.buffer, glb.byteOffset).readUInt32LE(12);
  const document = JSON.parse(Buffer.from(glb).toString('utf8', 20, 20 + size));
  change(document);
  document.buffers[0].byteLength = glb.length - 28 - size + more.length;
  const text = JSON.stringify(document);
  const json = Buffer.from(text.padEnd(Math.ceil(text.length / 4) * 4));
  const bin = Buffer.concat([glb.subarray(28 + size), more, Buffer.alloc(-(glb.length + more.length) & 3)]);
  const head = (...words) => Buffer.from(Uint32Array.from(words).buffer);
  const length = 28 + json.length + bin.length;
  return new Uint8Array(Buffer.concat([head(0x46546c67, 2, length, json.length, 0x4e4f534a), json, head(bin.length, 0x4e4942), bin]));
}

function crc(bytes) {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let bit = 0; bit < 8; ++bit) sum = sum & 1 ? (sum >>> 1) ^ 0xedb88320 : sum >>> 1;
  }
  return ~sum >>> 0;
}

// The tree with a PNG whose texels all have the same alpha.
function treeWith(size, rgba) {
  const chunk = (type, content) => {
    const all = Buffer.concat([Buffer.alloc(4), Buffer.from(type), content, Buffer.alloc(4)]);
    all.writeUInt32BE(content.length, 0);
    all.writeUInt32BE(crc(all.subarray(4, -4)), all.length - 4);
    return all;
  };
  const header = Buffer.from([0, 0, 0, 0, 0, 0, 0, 0, 8, 6, 0, 0, 0]);
  header.writeUInt32BE(size, 0);
  header.writeUInt32BE(size, 4);
  const row = Buffer.concat([Buffer.alloc(1), ...Array(size).fill(Buffer.from(rgba))]);
  const rows = Buffer.concat(Array(size).fill(row));
  const png = Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', header), chunk('IDAT', deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
  return changed(bytesOf(tree), ({ bufferViews, images, buffers }) => {
    bufferViews.push({ buffer: 0, byteOffset: buffers[0].byteLength, byteLength: png.length });
    images[0].bufferView = bufferViews.length - 1;
  }, png);
}

function digestOf({ data, triangles, indices }) {
  const hash = createHash('sha256');
  for (const part of [data, triangles, new Uint8Array(indices.buffer)]) hash.update(part);
  return hash.digest('hex');
}

test('random bakes have the bytes of the native library', { skip: !library && 'VELLUM_LIBRARY_PATH' }, () => {
  const count = process.env.VELLUM_CASES ?? '660';
  const output = execFileSync('python3', [join(here, 'make_cases.py'), count], { maxBuffer: 1 << 30, encoding: 'utf8' });
  const lines = output.trim().split('\n');
  assert.equal(lines.length, Number(count));
  let bytes = 0;
  for (const [number, line] of lines.entries()) {
    const expected = JSON.parse(line);
    const texturesOf = (list) => list.map((t) => ({ ...t, alpha: decoded(t.alpha) }));
    const shared = expected.shared && texturesOf(expected.inputs[0].textures);
    const inputs = expected.inputs.map(({ textures, uvs, indices, members }) => ({
      ...members,
      ...(members.levels && { levels: Uint8Array.from(members.levels) }),
      ...(members.formats && { formats: Uint8Array.from(members.formats) }),
      textures: shared || texturesOf(textures),
      uvs: decoded(uvs),
      ...(indices && { indices: decoded(indices[1], { B: Uint8Array, H: Uint16Array, I: Uint32Array }[indices[0]]) }),
    }));
    const made = vellum.bake(inputs, expected.options);
    assert.equal(digestOf(made), expected.digest, `case ${number}: ${line.slice(0, 2000)}`);
    assert.equal(made.distinctCount, expected.distinct, `case ${number}`);
    bytes += made.data.length;
  }
  assert(bytes > 100000);
});

const files = [{}, { level: 3 }, { format: api.MicromapFormat.TWO_STATE }, { budget: 20000 }];
const flagsOf = (options) => [
  ...(options.level !== undefined ? ['--level', String(options.level)] : []),
  ...(options.format ? ['--states', '2'] : []),
  ...(options.budget ? ['--budget', String(options.budget)] : []),
];

test('baked files have the bytes of the native command', { skip: !command && 'VELLUM_COMMAND' }, () => {
  for (const model of models)
    for (const options of files) {
      const output = join(work, 'native.glb');
      execFileSync(command, ['bake', '--force', '--quiet', ...flagsOf(options), model, output], { stdio: 'pipe' });
      const { bytes, report } = vellum.bakeGltf(bytesOf(model), options);
      assert(Buffer.from(bytes).equals(readFileSync(output)), `${model} ${JSON.stringify(options)}`);
      assert.equal(report.outputSize, bytes.length);
      assert(report.primitiveCount > 0);
    }
});

test('a sweep has the rows of the native command', { skip: !command && 'VELLUM_COMMAND' }, () => {
  for (const model of models)
    for (const [options, flags] of [[{}, []], [{ maxLevel: 4, minKnown: 0.3, blend: true }, ['--max-level', '4', '--min-known', '0.3', '--blend']]]) {
      const native = JSON.parse(execFileSync(command, ['sweep', '--json', model, ...flags], { encoding: 'utf8', stdio: 'pipe' }));
      const swept = vellum.sweepGltf(bytesOf(model), options);
      assert(swept.rows.length > 10);
      assert.deepEqual(swept.rows.map(({ bakeOptions, ...row }) => row), native.rows);
      const { row, reason } = swept.recommendation;
      assert.equal(reason, native.recommendation.reason);
      assert(native.recommendation.options.startsWith(swept.rows[row].options));
      const { report } = vellum.bakeGltf(bytesOf(model), { ...options, ...swept.rows[row].bakeOptions });
      assert.equal(report.micromapSize, swept.rows[row].bytes);
      assert.equal(report.primitiveCount, swept.primitives.length);
    }
  const baked = vellum.bakeGltf(bytesOf(tree)).bytes;
  assert.equal(vellum.sweepGltf(bytesOf(tree)).hadMicromaps, false);
  assert.equal(vellum.sweepGltf(baked).hadMicromaps, true);
  const none = vellum.sweepGltf(bytesOf(tree), { excludedMeshes: ['tree'] });
  assert.deepEqual([none.rows, none.recommendation, none.primitives], [[], null, []]);
  assert.equal(none.skipped[0].code, 'excluded');
  assert.throws(() => vellum.sweepGltf(baked, { level: 3 }), fails('VELLUM_ERROR_INVALID_ARGUMENT', /no member "level"/));
  assert.throws(() => vellum.sweepGltf(baked, { maxLevel: 13 }), fails('VELLUM_ERROR_INVALID_ARGUMENT', /maxLevel/));
  assert.throws(() => vellum.sweepGltf(baked, { cancelled: () => true }), fails('VELLUM_CANCELLED', /cancel/));
});

test('a baked file is read, inspected and verified', () => {
  const { bytes, report } = vellum.bakeGltf(bytesOf(tree));
  assert.deepEqual(report.skipped, []);
  const read = vellum.readGltf(bytes);
  const inspected = vellum.inspectGltf(bytes);
  assert.equal(read.extension, 'EXT_mesh_opacity_micromap');
  assert.deepEqual(inspected.findings, []);
  assert.equal(inspected.micromaps[0].bytes, read.micromaps[0].data.length + read.micromaps[0].triangles.length);
  assert.equal(inspected.primitives[0].triangles, read.primitives[0].indices.length);
  assert.equal(inspected.primitives[0].name, read.primitives[0].name);
  const verified = vellum.verifyGltf(bytes);
  assert.equal(verified.counts.wrong, 0);
  assert.deepEqual(verified.unverified, []);
  const sum = (list) => list.reduce((a, b) => a + b);
  const states = verified.primitives.map((p) => p.counts.microTriangles);
  assert.deepEqual(states, inspected.primitives.map((p) => sum(p.states) + sum(p.special)));
  assert.equal(vellum.readGltf(bytesOf(tree)).extension, '');
  // The micromap of another cutoff is wrong.
  const text = new TextDecoder('latin1').decode(bytes).replace('"alphaMode":"MASK"', '"alphaMode":"MASK","alphaCutoff":0.05');
  assert.notEqual(text.length, bytes.length);
  const json = text.slice(20, 20 + new DataView(bytes.buffer).getUint32(12, true) + text.length - bytes.length).padEnd(65536);
  const changed = Buffer.concat([Buffer.alloc(20), Buffer.from(json, 'latin1'), bytes.subarray(20 + new DataView(bytes.buffer).getUint32(12, true))]);
  changed.write('glTF', 0);
  for (const [at, word] of [[4, 2], [8, changed.length], [12, json.length], [16, 0x4e4f534a]]) changed.writeUInt32LE(word, at);
  const wrong = vellum.verifyGltf(new Uint8Array(changed));
  assert(wrong.counts.wrong > 0);
  assert.equal(wrong.primitives[0].findings[0].kind, 'wrong');
});

test('a .gltf gets its micromaps in a data URI', () => {
  const uri = (bytes) => `data:application/octet-stream;base64,${Buffer.from(bytes).toString('base64')}`;
  const glb = bytesOf(tree);
  const size = new DataView(glb.buffer).getUint32(12, true);
  const document = JSON.parse(new TextDecoder().decode(glb.subarray(20, 20 + size)));
  document.buffers[0].uri = uri(glb.subarray(28 + size));
  const encode = (value) => new TextEncoder().encode(JSON.stringify(value));
  const { bytes } = vellum.bakeGltf(encode(document));
  const baked = vellum.readGltf(bytes);
  assert.deepEqual(baked.micromaps, vellum.readGltf(vellum.bakeGltf(glb).bytes).micromaps);
  // Files beside it.
  document.buffers[0].uri = 'da%20ta/tree.bin';
  const beside = encode(document);
  const files = { 'da ta/tree.bin': glb.subarray(28 + size) };
  assert.deepEqual(vellum.readGltf(vellum.bakeGltf(beside, { files }).bytes, { files }).micromaps, baked.micromaps);
  assert.deepEqual(vellum.sweepGltf(beside, { files }), vellum.sweepGltf(glb));
  assert.equal(vellum.verifyGltf(vellum.bakeGltf(beside, { files }).bytes, { files }).counts.wrong, 0);
  for (const [wrong, code, message] of [
    [{}, 'FILE', /tree\.bin\): no such file/],
    [{ '../tree.bin': files['da ta/tree.bin'] }, 'FILE', /no such file/],
    [{ 'da ta/tree.bin': glb.subarray(0, 100) }, 'FILE', /buffer 0/],
    [{ 'da ta/tree.bin': 'text' }, 'INVALID_ARGUMENT', /files\["da ta\/tree\.bin"\] is .*not Uint8Array/],
    [[], 'INVALID_ARGUMENT', /files is .*not a plain object/],
    [new Map(Object.entries(files)), 'INVALID_ARGUMENT', /files is \[object Map\], not a plain object/],
    [files['da ta/tree.bin'], 'INVALID_ARGUMENT', /files is /],
    [null, 'INVALID_ARGUMENT', /files is null/],
    [{ '': glb }, 'INVALID_ARGUMENT', /path of files is ""/],
  ])
    assert.throws(() => vellum.bakeGltf(beside, { files: wrong }), fails(`VELLUM_ERROR_${code}`, message));
  // The folder of `name` is that of the files.
  for (const name of ['models/tree.gltf', '/models/tree.gltf', '../tree.gltf'])
    assert.deepEqual(vellum.sweepGltf(beside, { name, files }), vellum.sweepGltf(glb), name);
  document.buffers[0].uri = '../tree.bin';
  assert.throws(() => vellum.bakeGltf(encode(document), { files: { '../tree.bin': glb } }), fails('VELLUM_ERROR_FILE', /leads out/));
  document.buffers[0].uri = 'elsewhere.bin';
  assert.throws(() => vellum.bakeGltf(encode(document), { name: 'tree.gltf' }), fails('VELLUM_ERROR_FILE', /tree\.gltf: .*elsewhere\.bin/));
});

test('options of files', () => {
  const { report } = vellum.bakeGltf(bytesOf(tree), { excludedMaterials: ['nothing', 'lea*'] });
  assert.equal(report.primitiveCount, 0);
  assert.match(report.skipped[0].reason, /exclu/);
  const excluded = vellum.bakeGltf(bytesOf(tree), { excludedMeshes: ['tree'] });
  assert.equal(excluded.report.skipped.length, 1);
  for (const method of ['bakeGltf', 'sweepGltf'])
    assert.throws(() => vellum[method](bytesOf(tree), { blendCutoff: Infinity }), fails('VELLUM_ERROR_INVALID_ARGUMENT', /blendCutoff/));
});

test('damaged files are errors, whatever the damage', () => {
  const baked = vellum.bakeGltf(bytesOf(tree), { level: 2 }).bytes;
  for (const glb of [bytesOf(tree), baked]) {
    const lengths = new Set([0, 1, 3, 4, 11, 12, 19, 20, 21, glb.length - 1]);
    for (let i = 0; i < 200; ++i) lengths.add(Math.floor((glb.length * i) / 200));
    for (const length of lengths)
      for (const method of ['bakeGltf', 'sweepGltf', 'readGltf', 'inspectGltf', 'verifyGltf'])
        assert.throws(() => vellum[method](glb.subarray(0, length)), fails('VELLUM_ERROR_FILE', /^input: /));
  }
  let random = 1;
  const next = (below) => (random = (random * 48271) % 2147483647) % below;
  let rejected = 0;
  for (let i = 0; i < 400; ++i) {
    const damaged = baked.slice();
    for (let k = next(8); k >= 0; --k) damaged[next(i % 2 ? damaged.length : 4000)] = next(256);
    for (const method of ['bakeGltf', 'sweepGltf', 'readGltf', 'inspectGltf', 'verifyGltf'])
      try {
        vellum[method](damaged, method === 'bakeGltf' ? { level: 1 } : method === 'sweepGltf' ? { maxLevel: 1 } : {});
      } catch (error) {
        assert(error instanceof VellumError, `${method} ${i}: ${error.stack}`);
        ++rejected;
      }
  }
  assert(rejected > 100);
  assert.equal(vellum.bake(card(), { level: 2 }).indices.length, 2);
});

test('wrong arguments are errors that name them', () => {
  const bad = (change, message, options) => {
    const input = card();
    change(input);
    assert.throws(() => vellum.bake(input, options), fails('VELLUM_ERROR_INVALID_ARGUMENT', message));
  };
  bad((c) => (c.texture.width = 0), /input 0: texture 0: width is 0, not 1 to 2\^24/);
  bad((c) => (c.texture.width = -1), /width is -1/);
  bad((c) => (c.texture.width = 1.5), /width is 1\.5/);
  bad((c) => (c.texture.height = 65), /do not lie within 4096 bytes/);
  bad((c) => (c.texture.wdith = 1), /no member "wdith"/);
  bad((c) => (c.texture.alpha = [1, 2]), /alpha is \[object Array\], not Uint8Array/);
  bad((c) => (c.texture.filter = 7), /filter is 7/);
  bad((c) => delete c.texture, /there is no texture/);
  bad((c) => (c.indices = new Uint16Array([0, 1, 2, 3])), /4 indices are no whole number/);
  bad((c) => (c.indices = new Uint16Array([0, 1, 9])), /index 2 is 9, of 4 vertices/);
  bad((c) => (c.levels = new Uint8Array(3)), /length of levels is 3/);
  bad((c) => (c.cutoff = NaN), /cutoff is NaN/);
  bad(() => {}, /level is 13/, { level: 13 });
  bad(() => {}, /level is 1\.5/, { level: 1.5 });
  bad(() => {}, /no member "levle"/, { levle: 1 });
  bad(() => {}, /minKnown/, { minKnown: 2 });
  bad(() => {}, /onProgress is 1, not a function/, { onProgress: 1 });
  for (const signal of [new AbortController(), null, 1]) bad(() => {}, /signal is .*, not an AbortSignal/, { signal });
  for (const uvTransform of [null, 1, [1, 2]]) bad((c) => (c.uvTransform = uvTransform), /uvTransform is .*, not 6 numbers/);
  bad(() => {}, /level is 13, not 0 to 12 or LEVEL_AUTOMATIC/, { level: 13 });
  bad(() => {}, /twoStateRule is 7, not a TwoStateRule/, { twoStateRule: 7 });
  assert.throws(() => vellum.bake(card(), { level: 9, maxDataSize: 100 }), fails('VELLUM_ERROR_TOO_LARGE', /./));
  assert.throws(() => vellum.bakeGltf('text'), fails('VELLUM_ERROR_INVALID_ARGUMENT', /bytes/));
});

test('progress, and cancelling from callbacks', () => {
  const seen = [];
  vellum.bakeGltf(bytesOf(tree), { onProgress: (done, total) => seen.push([done, total]) });
  assert(seen.length > 0);
  assert(seen.every(([done, total], i) => done <= total && (i === 0 || done >= seen[i - 1][0])));
  assert.equal(seen.at(-1)[0], seen.at(-1)[1]);
  const cancelled = fails('VELLUM_CANCELLED', /cancel/);
  for (const cancel of [
    () => ({ cancelled: () => true }),
    () => ({ signal: AbortSignal.abort() }),
    () => {
      const controller = new AbortController();
      return { signal: controller.signal, onProgress: () => controller.abort() };
    },
  ]) {
    assert.throws(() => vellum.bake(card(), cancel()), cancelled);
    assert.throws(() => vellum.bakeGltf(bytesOf(tree), cancel()), cancelled);
  }
  const baked = vellum.bakeGltf(bytesOf(tree)).bytes;
  const controller = new AbortController();
  assert.throws(() => vellum.verifyGltf(baked, { signal: controller.signal, onProgress: () => controller.abort() }), cancelled);
  assert.throws(() => vellum.verifyGltf(baked, { cancelled: () => true }), cancelled);
  const last = new AbortController();
  const atTheEnd = { signal: last.signal, onProgress: (done, total) => done === total && last.abort() };
  assert.throws(() => vellum.bakeGltf(bytesOf(tree), atTheEnd), cancelled);
  const thrown = new Error('of the callback');
  const throws = () => {
    throw thrown;
  };
  assert.throws(() => vellum.bake(card(), { onProgress: throws }), (error) => error === thrown);
  // Callbacks may call the library.
  let inner;
  const outer = vellum.bake(card(), { onProgress: () => (inner = vellum.bake(card())) });
  assert.deepEqual(inner, outer);
});

test('memory does not grow', () => {
  const glb = bytesOf(tree);
  const once = (i) => {
    vellum.bake(card(), { level: i % 7 });
    if (i % 20 === 0) vellum.verifyGltf(vellum.bakeGltf(glb).bytes);
    if (i % 20 === 1) assert.throws(() => vellum.bake(card(), { cancelled: () => true }));
    if (i % 20 === 2) assert.throws(() => vellum.bakeGltf(glb.subarray(0, 5000)));
  };
  for (let i = 0; i < 40; ++i) once(i);
  const before = vellum.memorySize;
  for (let i = 0; i < 1000; ++i) once(i);
  assert.equal(vellum.memorySize, before);
});

test('where memory runs out, the error says so, and the file is not blamed', async () => {
  const wasm = bytesOf(join(folder, 'vellum.wasm'));
  const outOfMemory = fails('VELLUM_ERROR_OUT_OF_MEMORY', /memory/);
  const large = treeWith(2048, [255, 255, 255, 255]);
  const baked = vellum.bakeGltf(large, { level: 1 }).bytes;
  assert.equal(vellum.verifyGltf(baked).counts.wrong, 0);
  const long = new TextEncoder().encode(JSON.stringify({ asset: { version: '2.0', generator: 'x'.repeat(12 << 20) } }));
  assert.equal(vellum.bakeGltf(long).report.primitiveCount, 0);
  let texels = 0;
  for (const pages of [300, 350, 400, 450, 500, 600]) {
    const small = await api.load(limited(wasm, pages));
    for (const [method, bytes, options] of [
      ['bakeGltf', large, { level: 1 }],
      ['sweepGltf', large, { maxLevel: 1 }],
      ['verifyGltf', baked],
      ['bakeGltf', long],
    ])
      try {
        assert.deepEqual(small[method](bytes, options).unverified ?? [], []);
      } catch (error) {
        assert(outOfMemory(error));
        texels += method === 'verifyGltf';
      }
    assert.equal(small.bake(card(), { level: 2 }).indices.length, 2);
  }
  assert(texels > 2);
  const small = await api.load(limited(wasm, 1024));
  assert.throws(() => small.bake({ ...card(), texture: { width: 1, height: 1, alpha: new Uint8Array(1 << 27) } }), outOfMemory);
  let endless;
  try {
    endless = new Uint8Array(2 ** 32);
  } catch {
    return; // not in this version of Node.js
  }
  assert.throws(() => vellum.bake({ ...card(), texture: { width: 1, height: 1, alpha: endless } }), outOfMemory);
});

test('inputs that share a texture share its copy', async () => {
  const own = await api.load();
  const alpha = new Uint8ClampedArray(4 * 1024 * 1024).fill(255);
  const texture = { width: 1024, height: 1024, alpha, offset: 3, pixelStride: 4 };
  const made = own.bake(Array.from({ length: 40 }, () => ({ ...card(), texture: { ...texture } })), { level: 2 });
  assert.equal(made.distinctCount, 2);
  assert(own.memorySize < 64 << 20, `${own.memorySize} bytes`);
});

test('the smallest micromaps that know a share of the surface', () => {
  const size = (targetKnown) => vellum.bakeGltf(bytesOf(tree), { targetKnown, level: 4 }).report.micromapSize;
  assert(size(0) < size(0.4) && size(0.4) < size(0.5));
  assert.throws(() => size(1), fails('VELLUM_ERROR_FILE', /the wanted share is not reached/));
  assert.throws(() => size(2), fails('VELLUM_ERROR_INVALID_ARGUMENT', /targetKnown/));
  assert.throws(() => vellum.sweepGltf(bytesOf(tree), { targetKnown: 0.4 }), TypeError);
});

test('textures with an image that is not supported, and another one', () => {
  const both = changed(bytesOf(tree), ({ images, textures }) => {
    images.push({ uri: 'leaf.ktx2' });
    textures[0].extensions = { KHR_texture_basisu: { source: 1 } };
  });
  const { skipped } = vellum.bakeGltf(both).report;
  assert.equal(skipped[0].reason, 'its texture also has an image that is not supported (KHR_texture_basisu), which renderers may take');
  assert.equal(vellum.bakeGltf(both, { fallbackImages: true }).report.primitiveCount, 1);
  assert.equal(vellum.sweepGltf(both, { fallbackImages: true }).primitives.length, 1);
});

test('progress is reported some hundred times at most, whatever the file has', () => {
  const triangles = 1 << 17;
  const steps = (method, bytes, options) => {
    const seen = [];
    vellum[method](bytes, { ...options, onProgress: (done, total) => seen.push([done, total]) });
    assert(seen.length > 0 && seen.length < 400, `${method}: ${seen.length}`);
    assert(seen.every(([done, total], i) => done <= total && (i === 0 || done >= seen[i - 1][0])), method);
    assert.equal(seen.at(-1)[0], seen.at(-1)[1]);
  };
  const many = changed(bytesOf(tree), ({ meshes, materials }) => {
    for (let i = 1; i < 30; ++i) {
      materials.push({ ...materials[1], alphaCutoff: i / 50 });
      meshes[0].primitives.push({ ...meshes[0].primitives[1], material: materials.length - 1 });
    }
  });
  steps('bakeGltf', many, { level: 0 });
  steps('sweepGltf', many, { maxLevel: 1 });
  // The product of two counts of triangles has more than 32 bits.
  const uvs = Float32Array.from({ length: 6 * triangles }, (_, i) => i / 997);
  const bytes = new Uint8Array(uvs.buffer);
  const wide = changed(bytesOf(tree), ({ meshes, accessors, bufferViews, buffers }) => {
    bufferViews.push({ buffer: 0, byteOffset: buffers[0].byteLength, byteLength: bytes.length });
    accessors.push({ bufferView: bufferViews.length - 1, componentType: 5126, count: 3 * triangles, type: 'VEC2' });
    accessors.push({ componentType: 5126, count: 3 * triangles, type: 'VEC3', min: [0, 0, 0], max: [0, 0, 0] });
    meshes[0].primitives = [{ attributes: { TEXCOORD_0: accessors.length - 2, POSITION: accessors.length - 1 }, material: 1 }];
  }, bytes);
  const baked = vellum.bakeGltf(wide, { level: 0 });
  assert.equal(baked.report.primitiveCount, 1);
  steps('verifyGltf', baked.bytes);
});

test('results stay valid, and modules are independent', async () => {
  const first = vellum.bake(card(), { level: 5 });
  const copy = first.data.slice();
  vellum.bake(card(512), { level: 9 });
  assert.deepEqual(first.data, copy);
  const compiled = await WebAssembly.compile(readFileSync(join(folder, 'vellum.wasm')));
  for (const source of [compiled, readFileSync(join(folder, 'vellum.wasm')), new Response(readFileSync(join(folder, 'vellum.wasm')))])
    assert.deepEqual((await api.load(source)).bake(card(), { level: 5 }), first);
  const file = pathToFileURL(join(folder, 'vellum.wasm'));
  for (const source of [file, file.href]) assert.deepEqual((await api.load(source)).bake(card(), { level: 5 }), first);
  assert.match(vellum.version, /^\d+\.\d+\.\d+$/);
  assert.equal(vellum.version, JSON.parse(readFileSync(join(folder, 'package.json'), 'utf8')).version);
});

test('the worker', async () => {
  const worker = new VellumWorker();
  const seen = [];
  const made = await worker.bake(card(), { level: 4, onProgress: (done) => seen.push(done) });
  assert.deepEqual(made, vellum.bake(card(), { level: 4 }));
  assert.equal(seen.at(-1), 2);
  await assert.rejects(worker.bake(card(), { level: 13 }), fails('VELLUM_ERROR_INVALID_ARGUMENT', /level is 13/));
  const controller = new AbortController();
  const long = worker.bake(card(256), { level: 11, signal: controller.signal });
  controller.abort();
  await assert.rejects(long, fails('VELLUM_CANCELLED', /cancel/));
  const thrown = new Error('of the callback');
  const throws = () => {
    throw thrown;
  };
  await assert.rejects(worker.bake(card(256), { level: 9, onProgress: throws }), (error) => error === thrown);
  await assert.rejects(worker.bake(card(), { onProgress: null }), fails('VELLUM_ERROR_INVALID_ARGUMENT', /onProgress/));
  const { bytes } = await worker.bakeGltf(bytesOf(tree));
  assert.deepEqual(bytes, vellum.bakeGltf(bytesOf(tree)).bytes);
  assert.deepEqual(await worker.sweepGltf(bytes, { maxLevel: 3 }), vellum.sweepGltf(bytes, { maxLevel: 3 }));
  const rejects = (promise, message) => assert.rejects(promise, fails('VELLUM_ERROR_INVALID_ARGUMENT', message));
  await rejects(worker.bake(card(), { cancelled: () => true }), /no member "cancelled"/);
  await rejects(worker.bake(card(), null), /options is null/);
  await rejects(worker.bake(card(), { signal: controller }), /signal is/);
  await rejects(worker.bake(card(), { level: () => 1 }), /could not be cloned/);
  await rejects(worker.bake(card(), { onProgress: 1 }), /onProgress is 1/);
  assert.equal((await worker.readGltf(bytes, { signal: new AbortController().signal })).micromaps.length, 1);
  // One call's callback does not speak for the others.
  const calls = await Promise.allSettled([worker.bake(card(), { level: 9, onProgress: throws }), worker.bake(card())]);
  assert.equal(calls[0].reason, thrown);
  assert(fails('VELLUM_CANCELLED', /cancel/)(calls[1].reason));
  worker.terminate();
  for (const source of [pathToFileURL(join(folder, 'vellum.wasm')), 'vellum.wasm', bytesOf(join(folder, 'vellum.wasm'))]) {
    const other = new VellumWorker(source);
    assert.deepEqual(await other.bake(card(), { level: 4 }), made);
    other.terminate();
  }
});

test('what is sent to a worker, and what it cannot receive', async () => {
  const started = [];
  class Recorded extends VellumWorker {
    _start(handlers) {
      const worker = { ...handlers, sent: [], terminate() {}, postMessage: (message, moved) => worker.sent.push([message, moved]) };
      started.push(worker);
      return worker;
    }
  }
  const worker = new Recorded();
  const whole = new Uint8Array(new SharedArrayBuffer(1 << 20)).fill(1);
  const alpha = whole.subarray(100, 100 + 64 * 64);
  const inputs = [card(), card()];
  for (const input of inputs) input.texture.alpha = alpha;
  const lost = worker.bake(inputs);
  const [{ args: [sent] }, moved] = started[0].sent[0];
  assert.equal(sent[0].texture.alpha.buffer, sent[1].texture.alpha.buffer);
  assert.equal(sent[0].texture.alpha.buffer.byteLength, 64 * 64);
  assert(sent[0].texture.alpha.buffer instanceof ArrayBuffer && sent[0].uvs instanceof Float32Array);
  assert.deepEqual([...sent[0].texture.alpha], [...alpha]);
  assert.equal(moved.length, 5);
  started[0].onmessageerror();
  await assert.rejects(lost, fails('VELLUM_ERROR_OUT_OF_MEMORY', /memory for the result/));
  const alsoLost = worker.bake(inputs);
  started[1].onmessage({ data: { lost: 'arguments' } });
  await assert.rejects(alsoLost, fails('VELLUM_ERROR_OUT_OF_MEMORY', /memory for the arguments/));
  // What an ended worker still reports is not about its successor.
  const last = worker.bake(card());
  started[0].onerror(new Error('late'));
  started[1].onmessageerror();
  started[2].onmessage({ data: { id: started[2].sent[0][0].id, result: 'made' } });
  assert.equal(await last, 'made');
});

test('the package is found by its names, also by require()', () => {
  const require = createRequire(join(folder, 'index.js'));
  assert.equal(require.resolve('vellum-omm/worker'), join(folder, 'worker-node.js'));
  assert.equal(require.resolve('vellum-omm'), join(folder, 'index.js'));
  if (process.features.require_module) assert.equal(require('vellum-omm/worker').VellumWorker, VellumWorker);
});

test('the example of docs/javascript.md', async () => {
  const page = readFileSync(join(root, 'docs/javascript.md'), 'utf8');
  const examples = [...page.matchAll(/```js\n([\s\S]*?)```/g)].map((match) => match[1]);
  assert(examples.length > 0);
  const index = JSON.stringify(pathToFileURL(join(folder, 'index.js')));
  const worker = JSON.stringify(pathToFileURL(join(folder, 'worker-node.js')));
  const AsyncFunction = (async () => {}).constructor;
  for (const example of examples) {
    const code = example
      .replace(/import (\{[^}]*\}) from 'vellum-omm';/, `const $1 = await import(${index});`)
      .replace(/import (\{[^}]*\}) from 'vellum-omm\/worker';/, `const $1 = await import(${worker});`);
    const { alpha } = { alpha: disc(64) };
    await new AsyncFunction('alpha', 'glb', 'console', code)(alpha, bytesOf(tree), { log: () => {} });
  }
});
