// SPDX-License-Identifier: Apache-2.0
// Tests of vellum-omm/gltf-transform in gltf-transform itself: node --test bindings/js/test
//   VELLUM_GLTF_TRANSFORM   a folder where vellum-omm and gltf-transform's packages are installed: docs/testing.md. Without,
//                           nothing of this file is tested.
//   VELLUM_COMMAND          the native command
//   VELLUM_MODELS           a folder of .glb files, besides the generated ones
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { limited } from '../cases/limited.js';
import { mixture } from '../cases/models.js';

const here = dirname(fileURLToPath(import.meta.url));
const root = resolve(here, '../../..');
const { VELLUM_GLTF_TRANSFORM: installed, VELLUM_COMMAND: command, VELLUM_MODELS: folder } = process.env;
const NAME = 'EXT_mesh_opacity_micromap';

if (!installed || !command) {
  const missing = installed ? 'VELLUM_COMMAND, the native command,' : 'VELLUM_GLTF_TRANSFORM, a folder with the packages,';
  test('vellum-omm/gltf-transform is not tested', { skip: `${missing} is not set` }, () => {});
} else {
  await tests();
}

async function tests() {
  const work = mkdtempSync(join(tmpdir(), 'vellum-gltf-transform-'));
  after(() => rmSync(work, { recursive: true }));

  // As users import them, whose modules are in that folder.
  const imports = join(installed, 'vellum-test.mjs');
  writeFileSync(imports, `
    export * as core from '@gltf-transform/core';
    export * as extensions from '@gltf-transform/extensions';
    export * as functions from '@gltf-transform/functions';
    export * as omm from 'vellum-omm/gltf-transform';
    export * as vellum from 'vellum-omm';
    export * as meshoptimizer from 'meshoptimizer';
    export { default as draco3d } from 'draco3dgltf';
    export { default as sharp } from 'sharp';`);
  const { core, extensions, functions, omm: { EXTMeshOpacityMicromap, OpacityMicromap, PrimitiveMicromap, omm }, vellum: api, meshoptimizer, draco3d, sharp } =
    await import(pathToFileURL(imports));
  const { MeshoptDecoder, MeshoptEncoder, MeshoptSimplifier } = meshoptimizer;
  await Promise.all([MeshoptDecoder.ready, MeshoptEncoder.ready]);
  const vellum = await api.load();
  const decoders = { 'draco3d.decoder': await draco3d.createDecoderModule(), 'meshopt.decoder': MeshoptDecoder };
  const compressors = { ...decoders, 'draco3d.encoder': await draco3d.createEncoderModule(), 'meshopt.encoder': MeshoptEncoder };

  // The command line, in this process, which reads its configuration once.
  const config = join(installed, 'vellum-test.config.mjs');
  writeFileSync(config, `
    import { micromapConfig } from 'vellum-omm/gltf-transform';
    import sharp from 'sharp';
    export default micromapConfig({ encoder: sharp });`);
  const cliModule = join(installed, 'vellum-test-cli.mjs');
  writeFileSync(cliModule, `export { program, programReady } from '@gltf-transform/cli';`);
  process.argv = [process.argv[0], 'gltf-transform', '--config', config];
  process.env.NODE_ENV = 'test';
  const { program, programReady } = await import(pathToFileURL(cliModule));
  await programReady;
  // Options of one word: exec() loses others.
  const run = (name, input, output, options = {}) => program.exec([name, input, output], { silent: true, ...options });
  const start = (...words) =>
    execFileSync(process.execPath, [join(installed, 'node_modules/@gltf-transform/cli/bin/cli.js'), ...words], { cwd: work, stdio: 'pipe' });

  const logOf = (lines) => ({ debug() {}, info: (line) => lines.push(`info: ${line}`), warn: (line) => lines.push(`warning: ${line}`), error: (line) => lines.push(`error: ${line}`) });
  // `lines` gets what is logged about micromaps and all else.
  const ioOf = (dependencies = {}, lines = []) =>
    new core.NodeIO().registerExtensions([...extensions.ALL_EXTENSIONS, EXTMeshOpacityMicromap])
      .registerDependencies({ ...compressors, ...dependencies }).setLogger(logOf(lines));
  const io = ioOf({ vellum });
  const micromapLines = (lines) => lines.filter((line) => line.includes(NAME));

  const models = {};
  for (const seed of [1, 2, 3]) models[`mixture ${seed}`] = await io.writeBinary(mixture(core, extensions, seed));
  const tree = join(work, 'tree.glb');
  execFileSync('python3', [join(root, 'examples/python/tree.py'), tree]);
  models.tree = new Uint8Array(readFileSync(tree));
  for (const name of folder ? readdirSync(folder).sort() : [])
    if (name.endsWith('.glb')) models[name] = new Uint8Array(readFileSync(join(folder, name)));
  const kOptions = { level: 3 };

  const verify = (bytes) => vellum.verifyGltf(bytes);
  // By the native command, which decodes what gltf-transform compresses.
  function verifyFile(path) {
    const { stdout, stderr, error } = spawnSync(command, ['verify', '--json', path], { encoding: 'utf8', maxBuffer: 1 << 28 });
    if (error) throw error;
    return stdout.trim() ? JSON.parse(stdout).files[0] : assert.fail(`${path}: ${stderr}`);
  }
  function verifyCompressed(bytes) {
    const path = join(work, 'compressed.glb');
    writeFileSync(path, bytes);
    return verifyFile(path);
  }
  function isRight(verified, what) {
    assert.deepEqual([...verified.findings, ...(verified.unverified ?? [])], [], what);
    assert.equal(verified.counts.wrong, 0, `${what}: wrong claims`);
    return verified.counts.microTriangles;
  }
  const bindingsOf = (document) =>
    document.getRoot().listMeshes().flatMap((mesh) => mesh.listPrimitives()).map((primitive) => primitive.getExtension(NAME)).filter((binding) => binding?.getMicromap());
  const asJson = (bytes) => JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true))));
  const binOf = (bytes) => bytes.subarray(28 + new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true));
  const baked = async (name, options = {}) => {
    const document = await io.readBinary(models[name]);
    await document.transform(omm({ vellum, ...kOptions, ...options }));
    return document;
  };

  test('omm() bakes what the baker of files bakes', async () => {
    for (const name of Object.keys(models)) {
      const document = await baked(name);
      const plain = await io.writeBinary(document);
      // Without strips, which both make lists of in their own order.
      document.disposeExtension(NAME);
      const expected = vellum.readGltf(vellum.bakeGltf(await io.writeBinary(document), kOptions).bytes);
      const found = vellum.readGltf(plain);
      assert.deepEqual(found.micromaps.map(({ data, triangles, usages }) => ({ data, triangles, usages })), expected.micromaps, name);
      assert.deepEqual(found.primitives.map(({ indices, micromap, mesh, primitive }) => ({ indices, micromap, mesh, primitive })),
        expected.primitives.map(({ indices, micromap, mesh, primitive }) => ({ indices, micromap, mesh, primitive })), name);
      assert(isRight(verify(plain), name) > 0);
    }
  });

  test('a document of another copy of gltf-transform is an error, and not a file without micromaps', async () => {
    await assert.rejects(omm({ vellum })({ ...new core.Document() }), /another copy of @gltf-transform\/core/);
  });

  test('what nothing changed is kept, and the rest of the file is what it is without micromaps', async () => {
    for (const name of Object.keys(models)) {
      const first = await io.writeBinary(await baked(name));
      const lines = [];
      const document = await ioOf({}, lines).readBinary(first);
      const second = await ioOf({}, lines).writeBinary(document);
      assert.deepEqual(micromapLines(lines), [], name);
      assert.deepEqual(vellum.readGltf(second), vellum.readGltf(first), name);
      assert.deepEqual(second, await ioOf().writeBinary(await ioOf().readBinary(second)), name);
      document.disposeExtension(NAME);
      const without = await ioOf().writeBinary(document);
      const json = asJson(second);
      const plain = asJson(without);
      assert.equal(plain.extensionsUsed?.includes(NAME) ?? false, false);
      // Micromaps are at the end of every list and of the buffer.
      for (const list of ['accessors', 'bufferViews']) json[list].length = plain[list].length;
      for (const mesh of json.meshes)
        for (const primitive of mesh.primitives) {
          delete primitive.extensions?.[NAME];
          if (primitive.extensions && Object.keys(primitive.extensions).length === 0) delete primitive.extensions;
        }
      delete json.extensions[NAME];
      if (Object.keys(json.extensions).length === 0) delete json.extensions;
      json.extensionsUsed = json.extensionsUsed.filter((used) => used !== NAME);
      if (json.extensionsUsed.length === 0) delete json.extensionsUsed;
      json.buffers[0].byteLength = plain.buffers[0].byteLength;
      assert.deepEqual(json, plain, name);
      const size = plain.buffers[0].byteLength;
      assert(Buffer.from(binOf(second)).subarray(0, size).equals(Buffer.from(binOf(without)).subarray(0, size)), name);
    }
  });

  test('changes that micromaps depend on: baked again, or dropped with a warning', async () => {
    const first = await io.writeBinary(await baked('mixture 1'));
    const changes = {
      triangles: (document) => document.getRoot().listMeshes()[0].listPrimitives()[0].getIndices().getArray().reverse(),
      coordinates: (document) => document.getRoot().listMeshes()[0].listPrimitives()[0].getAttribute('TEXCOORD_0').getArray().fill(0.25, 0, 60),
      cutoff: (document) => document.getRoot().listMaterials()[0].setAlphaCutoff(0.9),
      factor: (document) => document.getRoot().listMaterials()[1].setBaseColorFactor([1, 1, 1, 0.4]),
      wrap: (document) => document.getRoot().listMaterials()[0].getBaseColorTextureInfo().setWrapS(33071),
      'vertex alpha': (document) => document.getRoot().listMeshes()[2].listPrimitives()[0].getAttribute('COLOR_0').getArray().fill(0.5),
      image: (document) => {
        const [disc, waves] = document.getRoot().listTextures();
        disc.setImage(waves.getImage().slice());
      },
      'texture transform': (document) => document.getRoot().listMaterials()[2].getBaseColorTextureInfo().getExtension('KHR_texture_transform').setRotation(1),
      'coordinate set': (document) => document.getRoot().listMaterials().find((m) => m.getName() === 'moss').getBaseColorTextureInfo().setTexCoord(0),
    };
    for (const [what, change] of Object.entries(changes)) {
      const before = vellum.readGltf(first).primitives.length;
      const document = await io.readBinary(first);
      change(document);
      const again = await io.writeBinary(document);
      isRight(verify(again), what);
      assert.equal(vellum.readGltf(again).primitives.length, before, what);
      const lines = [];
      const dropping = ioOf({}, lines);
      const other = await dropping.readBinary(first);
      change(other);
      const dropped = await dropping.writeBinary(other);
      isRight(verify(dropped), what);
      const left = vellum.readGltf(dropped).primitives.length;
      assert(left > 0 && left < before, what);
      const warnings = micromapLines(lines);
      assert.equal(warnings.length, before - left, what);
      assert(warnings.every((line) => /^warning: .*: mesh \d+ ".*" primitive \d+ has no micromap: it changed/.test(line)), warnings[0]);
    }
    // What is not alpha-tested any more has none, silently only where it had none.
    const document = await io.readBinary(first);
    document.getRoot().listMaterials()[0].setAlphaMode('OPAQUE');
    isRight(verify(await io.writeBinary(document)), 'opaque');
  });

  // Primitives of `document`, as it is written, and what is logged about micromaps.
  async function writtenBy(dependencies, document) {
    const lines = [];
    document.setLogger(logOf(lines));
    const bytes = await ioOf(dependencies, lines).writeBinary(document);
    isRight(verify(bytes), lines.join('\n'));
    return { bytes, primitives: vellum.readGltf(bytes).primitives, lines: micromapLines(lines) };
  }
  const primitivesOf = (document) => document.getRoot().listMeshes().flatMap((mesh) => mesh.listPrimitives());
  const zerosLike = (document, accessor) =>
    document.createAccessor().setArray(new Float32Array(accessor.getArray().length)).setType(accessor.getType()).setBuffer(accessor.getBuffer());
  const morph = (document, primitive, semantic) =>
    primitive.addTarget(document.createPrimitiveTarget().setAttribute(semantic, zerosLike(document, primitive.getAttribute(semantic))));

  // What gltf-transform has no extension for.
  class AnimationPointer extends core.Extension {
    static EXTENSION_NAME = 'KHR_animation_pointer';
    extensionName = 'KHR_animation_pointer';
    read() {
      return this;
    }
    write({ jsonDoc: { json } }) {
      json.animations[0].channels[0].target = { path: 'pointer', extensions: { KHR_animation_pointer: { pointer: this.pointer } } };
      return this;
    }
  }

  test('alpha that changes has no micromap', async () => {
    const animate = (pointer) => (document) => (document.createExtension(AnimationPointer).pointer = pointer);
    const vary = (other) => (document) => {
      const variants = document.createExtension(extensions.KHRMaterialsVariants);
      const primitive = primitivesOf(document)[0];
      const material = other ? document.getRoot().listMaterials().at(-1) : primitive.getMaterial();
      const mapping = variants.createMapping().setMaterial(material).addVariant(variants.createVariant('autumn'));
      primitive.setExtension('KHR_materials_variants', variants.createMappingList().addMapping(mapping));
    };
    const colored = (document) => primitivesOf(document).find((primitive) => primitive.getAttribute('COLOR_0'));
    const moss = (document) => primitivesOf(document).find((primitive) => primitive.getMaterial().getName() === 'moss');
    // [change, how many primitives lose their micromap, why]
    const changes = [
      [(document) => morph(document, primitivesOf(document)[0], 'POSITION'), 0],
      [(document) => morph(document, primitivesOf(document)[0], 'TEXCOORD_0'), 1, /morph targets change its TEXCOORD_0/],
      [(document) => morph(document, moss(document), 'TEXCOORD_0'), 0],
      [(document) => morph(document, moss(document), 'TEXCOORD_1'), 1, /morph targets change its TEXCOORD_1/],
      [(document) => morph(document, colored(document), 'COLOR_0'), 1, /morph targets change its COLOR_0/],
      [animate('/materials/1/alphaCutoff'), 2, /alpha is animated \(KHR_animation_pointer\)/],
      [animate('/materials/1/pbrMetallicRoughness/baseColorFactor'), 2, /alpha is animated \(KHR_animation_pointer\)/],
      [animate('/materials/1/emissiveFactor'), 0],
      [animate('/nodes/1/translation'), 0],
      [vary(false), 0],
      [vary(true), 1, /its material can be changed \(KHR_materials_variants\)/],
    ];
    const first = await io.writeBinary(await baked('mixture 1'));
    for (const [change, lost, reason] of changes) {
      for (const dependencies of [{}, { vellum }]) {
        const document = await ioOf().readBinary(first);
        const before = bindingsOf(document).length;
        change(document);
        const lines = [];
        // As ioOf(), with the extension of this test.
        const its = ioOf(dependencies, lines).registerExtensions([AnimationPointer]);
        document.setLogger(logOf(lines));
        const bytes = await its.writeBinary(document);
        isRight(verify(bytes), `${change}`);
        const warnings = micromapLines(lines);
        assert.equal(vellum.readGltf(bytes).primitives.length, before - lost, `${change}`);
        assert.equal(warnings.length, lost, `${change}: ${warnings}`);
        assert(warnings.every((line) => reason.test(line)), warnings[0]);
        // omm() finds the same, as does the baker of files.
        const document2 = await io.readBinary(models['mixture 1']);
        change(document2);
        await document2.transform(omm({ vellum, ...kOptions }));
        assert.equal(bindingsOf(document2).length, before - lost, `${change}`);
        document2.disposeExtension(NAME);
        const plain = await its.writeBinary(document2);
        assert.equal(vellum.readGltf(vellum.bakeGltf(plain, kOptions).bytes).primitives.length, before - lost, `${change}`);
      }
    }
  });

  test('normalized floats are compared', async () => {
    const first = await io.writeBinary(await baked('mixture 1'));
    const normalized = async () => {
      const json = asJson(first);
      const primitive = json.meshes[0].primitives[0];
      json.accessors[primitive.attributes.TEXCOORD_0].normalized = true;
      return ioOf().readJSON({ json, resources: { '@glb.bin': binOf(first).slice() } });
    };
    const lines = [];
    const document = await normalized();
    primitivesOf(document)[0].getAttribute('TEXCOORD_0').getArray().fill(0.25, 0, 60);
    document.setLogger(logOf(lines));
    await ioOf({}, lines).writeBinary(document);
    assert(micromapLines(lines).some((line) => line.includes('it changed since it was baked')), lines.join('\n'));
  });

  test('images that an application writes to', async () => {
    const first = await io.writeBinary(await baked('mixture 1'));
    const buffers = await io.readBinary(models['mixture 1']);
    for (const texture of buffers.getRoot().listTextures()) texture.setImage(Buffer.from(texture.getImage()));
    await buffers.transform(omm({ vellum, ...kOptions }));
    // A clone has no baker.
    for (const document of [await ioOf().readBinary(first), functions.cloneDocument(await baked('mixture 1')), functions.cloneDocument(buffers)]) {
      const before = bindingsOf(document).length;
      document.getRoot().listTextures()[0].getImage().fill(0, 50);
      const { primitives, lines } = await writtenBy({}, document);
      assert(primitives.length < before);
      assert.equal(lines.length, before - primitives.length);
      assert(lines.every((line) => line.includes('it changed since it was baked')), lines[0]);
    }
    // Images that an encoder decodes.
    const [disc, waves] = await Promise.all((await io.readBinary(models['mixture 1'])).getRoot().listTextures()
      .map((texture) => sharp(texture.getImage()).webp({ lossless: true }).toBuffer()));
    const dataOf = async (document) => {
      await document.transform(omm({ vellum, encoder: sharp, ...kOptions }));
      return bindingsOf(document).map((binding) => binding.getMicromap().getData());
    };
    const withImages = async (image) => {
      const document = await io.readBinary(models['mixture 1']);
      for (const texture of document.getRoot().listTextures()) texture.setImage(image).setMimeType('image/webp');
      return document;
    };
    const image = new Uint8Array(Math.max(disc.length, waves.length));
    image.set(disc);
    const document = await withImages(image);
    const discData = await dataOf(document);
    image.fill(0).set(waves);
    const wavesData = await dataOf(document);
    assert.notDeepEqual(wavesData, discData);
    assert.deepEqual(wavesData, await dataOf(await withImages(new Uint8Array(waves))));
  });

  test('one bad primitive costs the others nothing', async () => {
    const document = await baked('mixture 1');
    const before = bindingsOf(document).length;
    const [disc] = document.getRoot().listTextures();
    for (const material of document.getRoot().listMaterials()) if (material.getAlphaMode() === 'MASK') material.setAlphaCutoff(0.45);
    disc.setImage(new Uint8Array(100));
    const bad = primitivesOf(document).filter((primitive) => primitive.getMaterial().getAlphaMode() === 'MASK' && primitive.getMaterial().getBaseColorTexture() === disc);
    const { lines, bytes } = await writtenBy({ vellum }, document).catch(async () => assert.fail('it is not written'));
    assert.equal(vellum.readGltf(bytes).primitives.length, before - bad.length);
    const warnings = lines.filter((line) => line.startsWith('warning'));
    assert.equal(warnings.length, bad.length);
    assert(bad.length > 0 && bad.length < before);
    assert(warnings.every((line) => /has no micromap: .*image/.test(line)), warnings[0]);
  });

  test('more vertices than a list of zeros may have', async () => {
    const document = await io.readBinary(models['mixture 1']);
    const [buffer] = document.getRoot().listBuffers();
    const primitive = primitivesOf(document).find((each) => each.getMaterial()?.getAlphaMode() === 'MASK' && each.getAttribute('TEXCOORD_0'));
    const count = 2 ** 22 + 1;
    for (const attribute of primitive.listAttributes()) {
      const array = new (attribute.getArray().constructor)(count * attribute.getElementSize());
      array.set(attribute.getArray());
      primitive.setAttribute(primitive.listSemantics().find((semantic) => primitive.getAttribute(semantic) === attribute),
        document.createAccessor().setBuffer(buffer).setType(attribute.getType()).setNormalized(attribute.getNormalized()).setArray(array));
    }
    await document.transform(omm({ vellum, ...kOptions }));
    assert(primitive.getExtension(NAME)?.getMicromap(), 'no micromap');
  });

  test('accessors without a buffer', async () => {
    for (const semantic of ['TEXCOORD_0', 'COLOR_0']) {
      const document = await baked('mixture 1');
      const before = bindingsOf(document).length;
      primitivesOf(document).find((primitive) => primitive.getAttribute('COLOR_0')).getAttribute(semantic).setBuffer(null);
      const lines = [];
      document.setLogger(logOf(lines));
      const json = asJson(await ioOf({ vellum }, lines).writeBinary(document));
      assert.equal(json.meshes.flatMap((mesh) => mesh.primitives).filter((primitive) => primitive.extensions?.[NAME]).length, before - 1);
      assert(micromapLines(lines).every((line) => /no micromap: one of its accessors has no buffer/.test(line)) && micromapLines(lines).length === 1, lines.join('\n'));
    }
  });

  test('a budget is for all of the file, also when a part is baked again', async () => {
    const sizeOf = (bytes) => vellum.readGltf(bytes).micromaps.reduce((sum, { data, triangles }) => sum + data.length + triangles.length, 0);
    const all = sizeOf(await io.writeBinary(await baked('mixture 1', { level: -1, maxLevel: 5 })));
    for (const share of [0.5, 0.25]) {
      const budget = Math.floor(all * share);
      const document = await baked('mixture 1', { level: -1, maxLevel: 5, budget });
      const first = sizeOf(await io.writeBinary(document));
      assert(first <= budget && first > budget / 2, `${first} of ${budget}`);
      document.getRoot().listMaterials().find((material) => material.getName() === 'fern').setAlphaCutoff(0.4);
      document.getRoot().listMaterials().find((material) => material.getName() === 'grass').setAlphaCutoff(0.4);
      const { bytes, lines } = await writtenBy({ vellum }, document);
      assert(lines.some((line) => line.includes('baked again')), lines.join('\n'));
      assert(sizeOf(bytes) <= budget, `${sizeOf(bytes)} of ${budget}`);
    }
  });

  test('sparse accessors', async () => {
    const document = await baked('mixture 1');
    const before = bindingsOf(document).length;
    for (const primitive of primitivesOf(document)) primitive.getAttribute('TEXCOORD_0').setSparse(true);
    const first = await io.writeBinary(document);
    assert(asJson(first).accessors.some((accessor) => accessor.sparse));
    const { primitives, lines } = await writtenBy({}, await ioOf().readBinary(first));
    assert.equal(primitives.length, before);
    assert.deepEqual(lines, []);
    // Of the extension: zeros, and zeros of which some are replaced.
    const json = asJson(first);
    const bin = binOf(first);
    const accessor = json.accessors[json.meshes[0].primitives[0].extensions[NAME].micromapIndices];
    delete accessor.bufferView;
    const read = async (resources = { '@glb.bin': bin.slice() }) => {
      const lines2 = [];
      const found = await ioOf({}, lines2).readJSON({ json: structuredClone(json), resources });
      return { indices: primitivesOf(found)[0].getExtension(NAME)?.getIndices(), lines: lines2 };
    };
    const expected = new Int32Array(accessor.count);
    assert.deepEqual(await read(), { indices: expected, lines: [] });
    const longer = new Uint8Array(bin.length + 8);
    longer.set(bin);
    longer.set([1, 0, 3, 0, 254, 255], bin.length); // elements 1 and 3 are -2 and -1
    json.buffers[0].byteLength = longer.length;
    const view = (byteOffset, byteLength) => json.bufferViews.push({ buffer: 0, byteOffset: bin.length + byteOffset, byteLength }) - 1;
    accessor.componentType = 5121;
    accessor.sparse = { count: 2, indices: { bufferView: view(0, 4), componentType: 5123 }, values: { bufferView: view(4, 2) } };
    expected[1] = -2;
    expected[3] = -1;
    assert.deepEqual(await read({ '@glb.bin': longer }), { indices: expected, lines: [] });
    accessor.sparse.count = 3;
    const { indices, lines: found } = await read({ '@glb.bin': longer });
    assert.equal(indices, undefined);
    assert(/outside of its buffer view/.test(found), found);
  });

  test('new primitives without a baker', async () => {
    const document = await ioOf().readBinary(await io.writeBinary(await baked('mixture 1')));
    const [mesh] = document.getRoot().listMeshes();
    mesh.addPrimitive(mesh.listPrimitives()[0].clone().setExtension(NAME, null));
    const { lines } = await writtenBy({}, document);
    assert.equal(lines.length, 1);
    assert(/no micromap: it is new, and the dependency "vellum"/.test(lines[0]), lines[0]);
  });

  test('many micromaps with the same buffer views', async () => {
    const first = await io.writeBinary(await baked('mixture 1'));
    const json = asJson(first);
    const { micromaps } = json.extensions[NAME];
    json.extensions[NAME].micromaps = Array.from({ length: 1000 }, () => micromaps[0]);
    const document = await ioOf().readJSON({ json, resources: { '@glb.bin': binOf(first).slice() } });
    const read = document.getRoot().listExtensionsUsed().find(({ extensionName }) => extensionName === NAME).listProperties()
      .filter((property) => property instanceof OpacityMicromap);
    assert.equal(read.length, 1000);
    for (const array of ['getData', 'getTriangles']) assert.equal(new Set(read.map((micromap) => micromap[array]().buffer)).size, 1);
  });

  test('strips that are not baked stay strips', async () => {
    const { Mode } = core.Primitive;
    for (const [options, mode] of [[{}, Mode.TRIANGLE_STRIP], [{ blend: true }, Mode.TRIANGLES], [{ blendCutoff: 0.5 }, Mode.TRIANGLES]]) {
      const document = await io.readBinary(models['mixture 1']);
      const window = primitivesOf(document).find((primitive) => primitive.getMaterial().getName() === 'glass').setMode(Mode.TRIANGLE_STRIP);
      await document.transform(omm({ vellum, ...options }));
      assert.equal(window.getMode(), mode, JSON.stringify(options));
    }
  });

  test('a module that could not be loaded is loaded later', async () => {
    const from = join(installed, 'node_modules/vellum-omm');
    const copy = join(installed, 'vellum-test-copy');
    rmSync(copy, { recursive: true, force: true });
    mkdirSync(copy);
    for (const name of ['index.js', 'gltf-transform.js', 'package.json']) copyFileSync(join(from, name), join(copy, name));
    const { omm: other } = await import(pathToFileURL(join(copy, 'gltf-transform.js')));
    const document = await ioOf().readBinary(models['mixture 1']);
    await assert.rejects(document.transform(other(kOptions)), /vellum\.wasm/);
    copyFileSync(join(from, 'vellum.wasm'), join(copy, 'vellum.wasm'));
    await document.transform(other(kOptions));
    assert(bindingsOf(document).length > 0);
    rmSync(copy, { recursive: true });
  });

  test('a module whose memory has run out is not used again', async () => {
    const from = join(installed, 'node_modules/vellum-omm');
    const copy = join(installed, 'vellum-test-small');
    rmSync(copy, { recursive: true, force: true });
    mkdirSync(copy);
    for (const name of ['index.js', 'gltf-transform.js', 'package.json']) copyFileSync(join(from, name), join(copy, name));
    const wasm = readFileSync(join(from, 'vellum.wasm'));
    writeFileSync(join(copy, 'vellum.wasm'), limited(wasm, 260));
    const { omm: other } = await import(pathToFileURL(join(copy, 'gltf-transform.js')));
    const document = await ioOf().readBinary(models['mixture 1']);
    await assert.rejects(document.transform(other({ level: 10 })), { code: 'VELLUM_ERROR_OUT_OF_MEMORY' });
    writeFileSync(join(copy, 'vellum.wasm'), wasm);
    await document.transform(other({ level: 8 }));
    assert(bindingsOf(document).length > 0);
    rmSync(copy, { recursive: true });
  });

  test('primitives that were left out stay out', async () => {
    const document = await baked('mixture 2', { excludedMaterials: ['fern'] });
    const count = bindingsOf(document).length;
    for (let i = 0; i < 2; ++i) {
      const bytes = await io.writeBinary(await io.readBinary(await io.writeBinary(document)));
      assert.equal(vellum.readGltf(bytes).primitives.length, count);
      assert(!vellum.readGltf(bytes).primitives.some(({ name }) => name.includes('plant again')));
    }
  });

  test('blended alpha, levels and states are those of the first bake', async () => {
    for (const options of [{ blend: true }, { blendCutoff: 0.4 }, { format: api.MicromapFormat.TWO_STATE }, { level: 2 }]) {
      const first = await io.writeBinary(await baked('mixture 3', { blend: options.blendCutoff !== undefined, ...options }));
      const document = await io.readBinary(first);
      for (const mesh of document.getRoot().listMeshes())
        for (const primitive of mesh.listPrimitives()) primitive.getAttribute('TEXCOORD_0').getArray().forEach((v, i, array) => (array[i] = v + 0.125));
      const again = await io.writeBinary(document);
      const [before, after] = [first, again].map((bytes) => vellum.readGltf(bytes));
      assert.equal(after.primitives.length, before.primitives.length, JSON.stringify(options));
      assert.equal(asJson(again).extensions[NAME].extras?.blendCutoff, options.blendCutoff);
      const usages = after.micromaps.flatMap((micromap) => micromap.usages);
      assert(usages.every(({ format, subdivisionLevel }) => format === (options.format ?? 2) && subdivisionLevel <= (options.level ?? 3)));
      if (options.format === undefined) isRight(verify(again), JSON.stringify(options));
    }
  });

  test('copies, merges and disposal', async () => {
    const document = await baked('mixture 1');
    const count = bindingsOf(document).length;
    const lines = [];
    const plain = ioOf({}, lines);
    const written = await plain.writeBinary(document);
    assert.deepEqual(await plain.writeBinary(functions.cloneDocument(document)), written);
    const twice = functions.cloneDocument(document);
    functions.mergeDocuments(twice, functions.cloneDocument(document));
    await twice.transform(functions.unpartition());
    const merged = vellum.readGltf(await plain.writeBinary(twice));
    assert.equal(merged.primitives.length, 2 * count);
    // Equal micromaps are written once.
    assert.equal(merged.micromaps.length, vellum.readGltf(written).micromaps.length);
    assert.deepEqual(micromapLines(lines), []);
    document.getRoot().listMeshes()[0].dispose();
    await document.transform(functions.prune());
    assert(vellum.readGltf(await plain.writeBinary(document)).primitives.length < count);
    bindingsOf(document)[0].dispose();
    for (const property of document.getRoot().listExtensionsUsed().find((e) => e.extensionName === NAME).listProperties())
      assert(property instanceof OpacityMicromap || property instanceof PrimitiveMicromap);
    document.disposeExtension(NAME);
    assert.equal(bindingsOf(document).length, 0);
    const none = await plain.writeBinary(document);
    assert.equal(asJson(none).extensionsUsed?.includes(NAME) ?? false, false);
    assert.equal(asJson(none).extensions?.[NAME], undefined);
    // Files of several buffers, and of none inside.
    const parts = await baked('mixture 1');
    await parts.transform(functions.partition());
    const { json, resources } = await plain.writeJSON(parts);
    const back = await plain.readJSON({ json, resources });
    assert.equal(bindingsOf(back).length, count);
  });

  test('the wrong order of transforms is right, too', async () => {
    const document = await baked('mixture 2');
    await document.transform(functions.weld(), functions.reorder({ encoder: MeshoptEncoder }), functions.quantize({ quantizeTexcoord: 8 }), functions.draco());
    const bytes = await io.writeBinary(document);
    isRight(verifyCompressed(bytes), 'draco');
    // The document is as it was, not as it was written.
    assert.deepEqual(bindingsOf(document)[0].getIndices(), bindingsOf(await baked('mixture 2'))[0].getIndices());
    const missing = [];
    const copy = functions.cloneDocument(document);
    const blind = new core.NodeIO().registerExtensions([...extensions.ALL_EXTENSIONS, EXTMeshOpacityMicromap]).setLogger(logOf(missing))
      .registerDependencies({ 'draco3d.encoder': compressors['draco3d.encoder'], vellum });
    copy.setLogger(logOf(missing));
    await blind.writeBinary(copy);
    assert(micromapLines(missing).some((line) => line.includes('the dependency "draco3d.decoder"')));
  });

  test('wrong options, and what cannot be baked', async () => {
    const document = await io.readBinary(models['mixture 1']);
    for (const [options, message] of [[{ maxLevel: 13 }, /maxLevel is 13/], [{ levle: 1 }, /no member "levle"/], [{ files: {} }, /no member "files"/]])
      await assert.rejects(document.transform(omm({ vellum, ...options })), (error) => error instanceof api.VellumError && message.test(error.message));
    // Also where there is nothing to bake.
    await assert.rejects(new core.Document().transform(omm({ vellum, levle: 1 })), /no member "levle"/);
    const seen = [];
    await document.transform(omm({ vellum, onProgress: (done, total) => seen.push(done / total) }));
    assert.equal(seen.at(-1), 1);
    await assert.rejects(document.transform(omm({ vellum, cancelled: () => true })), /cancel/);
    const broken = await io.readBinary(models['mixture 1']);
    broken.getRoot().listTextures()[0].setImage(new Uint8Array(100));
    await assert.rejects(broken.transform(omm({ vellum })), api.VellumError);
    // At the end of a pipeline a damaged image costs its micromaps, not the file.
    const lines = [];
    const document2 = await ioOf({ vellum }, lines).readBinary(await io.writeBinary(await baked('mixture 1')));
    document2.getRoot().listTextures()[0].setImage(new Uint8Array(100));
    await ioOf({ vellum }, lines).writeBinary(document2);
    assert(micromapLines(lines).some((line) => /has no micromap: .*image/.test(line)), micromapLines(lines)[0]);
    // Nothing to bake is no error.
    const empty = new core.Document();
    empty.createScene();
    await empty.transform(omm({ vellum }));
    assert.equal(asJson(await io.writeBinary(empty)).extensionsUsed, undefined);
  });

  test('WebP images are baked by way of sharp', async () => {
    const webp = async (name) => {
      const document = await io.readBinary(models[name]);
      await document.transform(functions.textureCompress({ encoder: sharp, targetFormat: 'webp', lossless: name !== 'tree' }));
      return document;
    };
    for (const name of ['mixture 1', 'tree']) {
      const lines = [];
      const without = await webp(name);
      without.setLogger(logOf(lines));
      await without.transform(omm({ vellum }));
      assert(micromapLines(lines).length > 0, name);
      assert.equal(bindingsOf(without).length, 0);
      const document = await webp(name);
      await document.transform(omm({ vellum, encoder: sharp, maxLevel: 4 }), functions.draco());
      const bytes = await io.writeBinary(document);
      assert(isRight(verifyCompressed(bytes), name) > 0);
    }
  });

  test('damaged extensions cost their micromaps, with a warning, and nothing else', async () => {
    const first = await io.writeBinary(await baked('mixture 1', { level: 2 }));
    const parsed = () => {
      const json = asJson(first);
      return { json, resources: { '@glb.bin': binOf(first).slice() } };
    };
    const micromaps = (json) => json.extensions[NAME].micromaps;
    const bindings = (json) => json.meshes.flatMap((mesh) => mesh.primitives).map((primitive) => primitive.extensions?.[NAME]).filter(Boolean);
    const indicesOf = (json) => json.accessors[bindings(json)[0].micromapIndices];
    const huge = [-1, 1.5, 1e9, 2 ** 32, 2 ** 53, null, 'x', {}, [], true];
    const damages = [
      ...huge.map((value) => (json) => (micromaps(json)[0].data = value)),
      ...huge.map((value) => (json) => (micromaps(json)[0].triangles = value)),
      ...huge.map((value) => (json) => (bindings(json)[0].micromap = value)),
      ...huge.map((value) => (json) => (bindings(json)[0].micromapIndices = value)),
      ...huge.slice(0, -1).map((value) => (json) => (bindings(json)[0].micromapBaseTriangle = value ?? 'x')),
      ...huge.map((value) => (json) => (json.bufferViews[micromaps(json)[0].data].byteOffset = value ?? 'x')),
      ...huge.map((value) => (json) => (json.bufferViews[micromaps(json)[0].data].byteLength = value)),
      ...huge.map((value) => (json) => (json.bufferViews[micromaps(json)[0].data].buffer = value)),
      ...huge.map((value) => (json) => (json.bufferViews[micromaps(json)[0].triangles].byteStride = value ?? 'x')),
      ...huge.map((value) => (json) => (indicesOf(json).bufferView = value)),
      ...huge.map((value) => (json) => (indicesOf(json).byteOffset = value ?? 'x')),
      ...huge.map((value) => (json) => (indicesOf(json).componentType = value)),
      (json) => (indicesOf(json).componentType = 5120),
      (json) => (indicesOf(json).normalized = true),
      ...huge.map((value) => (json) => (indicesOf(json).count = value)),
      ...huge.map((value) => (json) => (indicesOf(json).type = value)),
      ...huge.map((value) => (json) => (indicesOf(json).sparse = value ?? 'x')),
      ...['count', 'indices', 'values'].flatMap((member) => huge.map((value) => (json) => {
        const part = { bufferView: micromaps(json)[0].triangles, componentType: 5121 };
        indicesOf(json).sparse = { count: 1, indices: part, values: part, [member]: value };
      })),
      ...huge.map((value) => (json) => {
        delete indicesOf(json).bufferView;
        indicesOf(json).count = value;
      }),
      ...huge.map((value) => (json) => (micromaps(json)[0] = value)),
      ...huge.map((value) => (json) => (json.extensions[NAME].micromaps = value)),
      ...huge.map((value) => (json) => (json.extensions[NAME] = value)),
      ...huge.map((value) => (json) => (json.meshes[0].primitives[0].extensions[NAME] = value)),
      (json) => delete json.extensions,
      (json) => {
        delete bindings(json)[0].micromapIndices;
        json.accessors[json.meshes[0].primitives[0].indices].count = 3e9;
      },
      (json) => delete micromaps(json)[0].data,
      (json) => delete micromaps(json)[0].triangles,
      (json) => delete bindings(json)[0].micromap,
      (json) => (bindings(json)[0].micromapBaseTriangle = 2 ** 31),
    ];
    let silent = 0;
    for (const [number, damage] of damages.entries()) {
      const lines = [];
      const { json, resources } = parsed();
      damage(json);
      const text = `damage ${number}: ${damage}`;
      const plain = ioOf({}, lines);
      const document = await plain.readJSON({ json, resources }).catch((error) => assert.fail(`${text}: ${error.stack}`));
      if (micromapLines(lines).length === 0) ++silent;
      isRight(verify(await plain.writeBinary(document)), text);
      const copy = parsed();
      damage(copy.json);
      const again = await ioOf({ vellum }).writeBinary(await ioOf({ vellum }).readJSON(copy));
      isRight(verify(again), text);
    }
    // sparse: true and the like are no sparse accessor; some values are valid.
    assert(silent <= 12, `${silent} damages without a warning`);
  });

  test('damaged bytes: an error, or a file without wrong claims', async () => {
    const first = await io.writeBinary(await baked('mixture 2', { level: 2 }));
    const json = asJson(first);
    const begin = 28 + new DataView(first.buffer).getUint32(12, true);
    const places = json.extensions[NAME].micromaps.map(({ triangles }) => json.bufferViews[triangles]);
    let random = 7;
    const next = (below) => (random = (random * 48271) % 2147483647) % below;
    for (let i = 0; i < 150; ++i) {
      const damaged = first.slice();
      if (i % 2) {
        const { byteOffset, byteLength } = places[next(places.length)];
        damaged[begin + byteOffset + next(byteLength)] = next(256);
      } else {
        const from = new TextDecoder('latin1').decode(damaged.subarray(0, begin)).indexOf(NAME, next(begin - 2000));
        damaged[from + next(300)] = 48 + next(10);
      }
      let document;
      try {
        document = await ioOf().readBinary(damaged);
      } catch (error) {
        assert(!error.stack.includes('vellum-omm'), error.stack);
        continue;
      }
      const written = await ioOf({ vellum }).writeBinary(document);
      assert.deepEqual(vellum.inspectGltf(written).findings, [], String(i));
    }
  });

  const commands = {
    copy: ['copy'], dedup: ['dedup'], prune: ['prune'], center: ['center'], instance: ['instance', { min: 2 }], flatten: ['flatten'],
    join: ['join'], partition: ['partition'], draco: ['draco'], 'draco, sequential': ['draco', { method: 'sequential' }],
    meshopt: ['meshopt', { level: 'medium' }], 'meshopt, high': ['meshopt', { level: 'high' }],
    quantize: ['quantize'], dequantize: ['dequantize'], weld: ['weld'], unweld: ['unweld'],
    tangents: ['tangents'], reorder: ['reorder'], simplify: ['simplify', { ratio: 0.5, error: 0.1 }],
    unwrap: ['unwrap', { overwrite: true }], metalrough: ['metalrough'], palette: ['palette', { min: 1 }], unlit: ['unlit'],
    resample: ['resample'], sequence: ['sequence', { pattern: 'frame_*' }], sparse: ['sparse'],
    resize: ['resize', { width: 32, height: 32 }], png: ['png'], webp: ['webp'], avif: ['avif'],
    optimize: ['optimize'], 'optimize, draco': ['optimize', { compress: 'draco' }],
    'optimize, quantize': ['optimize', { compress: 'quantize' }],
  };

  test('every command of the command line, on every model, plain and from Draco: no wrong claim', async (t) => {
    let states = 0;
    let files = 0;
    for (const [number, name] of Object.keys(models).entries()) {
      const source = join(work, `source-${number}.glb`);
      writeFileSync(source, models[name]);
      const inputs = { plain: join(work, `plain-${number}.glb`), draco: join(work, `draco-${number}.glb`) };
      await run('omm', source, inputs.plain, kOptions);
      await run('draco', inputs.plain, inputs.draco);
      for (const [kind, input] of Object.entries(inputs)) {
        const tested = verifyFile(input).primitives.length;
        assert(tested > 0, `${name}, ${kind}`);
        for (const [what, [first, options]] of Object.entries(commands)) {
          const output = join(work, first === 'partition' ? 'output.gltf' : 'output.glb');
          await run(first, input, output, options);
          const verified = verifyFile(output);
          const label = `${what}, ${name}, ${kind}`;
          const right = isRight(verified, label);
          assert(right > 0, `${label}: no micromap is left`);
          states += right;
          ++files;
        }
      }
    }
    t.diagnostic(`${files} files, ${states} micro-triangles`);
  });

  test('merging files by the command line', async () => {
    const inputs = [0, 1].map((i) => join(work, `merge-${i}.glb`));
    for (const [i, path] of inputs.entries()) {
      writeFileSync(path, models[`mixture ${i + 1}`]);
      await run('omm', path, path, { level: 3, blend: true });
    }
    const output = join(work, 'merged.glb');
    start('merge', ...inputs, output, '--config', config);
    const sum = inputs.map((path) => verifyFile(path).primitives.length).reduce((a, b) => a + b);
    assert.equal(verifyFile(output).primitives.length, sum);
    const report = vellum.inspectGltf(new Uint8Array(readFileSync(output)));
    assert.deepEqual(report.findings, []);
    assert(report.micromaps.every(({ usages }) => usages.every(({ subdivisionLevel }) => subdivisionLevel === 3)));
  });

  test('the examples of docs/gltf-transform.md', async () => {
    const page = readFileSync(join(root, 'docs/gltf-transform.md'), 'utf8');
    const examples = [...page.matchAll(/```js\n([\s\S]*?)```/g)].map((match) => match[1]);
    assert(examples.length >= 3);
    writeFileSync(join(work, 'tree.glb'), models.tree);
    for (const [number, example] of examples.entries()) {
      const path = join(installed, `vellum-test-example-${number}.mjs`);
      writeFileSync(path, example);
      execFileSync(process.execPath, [path], { cwd: work, stdio: 'pipe' });
      if (example.includes('.config.mjs')) writeFileSync(join(installed, 'gltf-transform.config.mjs'), example);
    }
    assert(isRight(verifyFile(join(work, 'tree.omm.glb')), 'example') > 0);
    const lines = page.match(/^npx gltf-transform .*$/gm);
    assert(lines.length >= 2);
    for (const line of lines) {
      const words = line.replace('gltf-transform.config.mjs', join(installed, 'gltf-transform.config.mjs')).split(' ').slice(2);
      start(...words);
      assert(isRight(verifyFile(join(work, words[2])), line) > 0);
    }
  });

  test('the types', { skip: !existsSync(join(installed, 'node_modules/typescript')) && 'typescript is not installed' }, () => {
    const compiler = join(installed, 'node_modules/typescript/bin/tsc');
    for (const [name, lib, types] of [['types.mts', 'es2022,dom', 'node'], ['types_alone.mts', 'es2022', '']]) {
      const path = join(installed, `vellum-test-${name}`);
      writeFileSync(path, readFileSync(join(here, '../cases', name)));
      const { status, stdout } = spawnSync(process.execPath, [compiler, '--noEmit', '--strict', '--target', 'es2022', '--module', 'nodenext',
        '--lib', lib, '--types', types, path], { encoding: 'utf8', cwd: installed });
      assert.equal(status, 0, stdout);
    }
  });

  test('Vite builds the package and its worker', { skip: !existsSync(join(installed, 'node_modules/vite')) && 'vite is not installed' }, () => {
    const app = join(installed, 'vellum-test-app');
    mkdirSync(app, { recursive: true });
    writeFileSync(join(app, 'index.html'), '<script type="module" src="/main.js"></script>');
    writeFileSync(join(app, 'main.js'), `
      import { load } from 'vellum-omm';
      import { VellumWorker } from 'vellum-omm/worker';
      console.log(await load(), new VellumWorker());`);
    execFileSync(process.execPath, [join(installed, 'node_modules/vite/bin/vite.js'), 'build', '--emptyOutDir'], { cwd: app, stdio: 'pipe' });
    const made = readdirSync(join(app, 'dist/assets')).sort();
    assert.deepEqual(made.map((name) => name.replace(/-[\w-]{8}\./, '.')).sort(), ['index.js', 'serve.js', 'vellum.wasm']);
    const wasm = readFileSync(join(app, 'dist/assets', made.find((name) => name.endsWith('.wasm'))));
    assert(wasm.equals(readFileSync(join(installed, 'node_modules/vellum-omm/vellum.wasm'))));
  });
}
