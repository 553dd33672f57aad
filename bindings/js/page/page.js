// SPDX-License-Identifier: Apache-2.0
// The page: a file, the settings that a sweep compares, the bake, and the page of `vellum inspect` for the result. This code runs
// in the worker as well, where index.js and worker.js are all that counts.

const kModels = ['.glb', '.gltf'];
const kNamed = ['.bin', '.png', '.jpg', '.jpeg', '.webp', '.avif', '.ktx2', '.dds'];
const kMostBytes = 2 ** 31 - 1; // of all files together
const suffixOf = (path) => /\.[^./]*$/.exec(path)?.[0].toLowerCase() ?? '';

// All files in what was dropped, with their paths. Chromium gives a page that is a local file no files by the older interface of
// entries, and other browsers have no handles.
async function filesOfHandle(handle, path = handle.name) {
  if (handle.kind === 'file') return [{ path, file: await handle.getFile() }];
  const found = [];
  for await (const child of handle.values()) found.push(...(await filesOfHandle(child, `${path}/${child.name}`)));
  return found;
}

async function filesOfEntry(entry) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    return [{ path: entry.fullPath.replace(/^\//, ''), file }];
  }
  const reader = entry.createReader();
  const found = [];
  while (true) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return found; // it returns a hundred at a time
    for (const each of some) found.push(...(await filesOfEntry(each)));
  }
}

function filesOfItem(item) {
  return item.getAsFileSystemHandle ? item.getAsFileSystemHandle().then((handle) => filesOfHandle(handle)) : filesOfEntry(item.webkitGetAsEntry());
}

function startPage() {
  const at = (id) => document.getElementById(id);
  const textOf = (id) => at(id).textContent;
  let worker;
  let running; // the AbortController of what runs
  let model; // { name, bytes, files }
  let sweep;
  const urls = {}; // of blobs, by the element that has it

  // --- what is shown ---

  function say(text) {
    at('status').textContent = text;
  }

  function complain(text, ...more) {
    at('messages').replaceChildren(...(text ? [element('p', { class: 'note' }, text, ...more)] : []));
  }

  function setUrl(id, attribute, blob) {
    if (urls[id]) URL.revokeObjectURL(urls[id]);
    urls[id] = URL.createObjectURL(blob);
    at(id).setAttribute(attribute, urls[id]);
  }

  function hide(...ids) {
    for (const id of ids) at(id).hidden = true;
  }

  // Runs what takes long; the buttons that would start something else wait for it. Returns whether it succeeded.
  async function run(doing, work) {
    running?.abort();
    const own = (running = new AbortController());
    const { signal } = own;
    const onProgress = (done, total) => {
      at('progress').value = total ? done / total : 1;
    };
    at('doing').textContent = doing;
    at('progress').removeAttribute('value');
    at('work').hidden = false;
    at('bake').disabled = true;
    complain();
    say(doing);
    try {
      await work({ signal, onProgress });
      return own === running;
    } catch (error) {
      if (own !== running) return false; // something else began
      if (signal.aborted) say('Cancelled.');
      else complain(messageOf(error));
      return false;
    } finally {
      if (own === running) {
        running = undefined;
        at('work').hidden = true;
        at('bake').disabled = false;
      }
    }
  }

  function messageOf(error) {
    if (error.code === 'VELLUM_ERROR_OUT_OF_MEMORY' || /allocation failed|out of memory/i.test(error.message)) return `${model?.name ?? 'The file'} needs more memory than a page can have (4 GiB): use the command, vellum bake.`;
    if (error.code === 'VELLUM_ERROR_FILE' && /no such file$/.test(error.message))
      return `${error.message}. Drop the .gltf together with the files that it names, or their folder.`;
    return error.message;
  }

  // --- files ---

  async function take(files) {
    const models = files.filter(({ path }) => kModels.includes(suffixOf(path)));
    if (files.length === 0) return;
    if (models.length === 1) return open(models[0], files);
    running?.abort();
    hide('settings', 'result');
    if (models.length === 0) return complain(`${files.length === 1 ? `${files[0].path} is no glTF file` : 'None of these files is a glTF file'}: its name would end with .glb or .gltf.`);
    const choices = models.slice(0, 100).map((each) => {
      const button = element('button', { type: 'button' }, each.path);
      button.addEventListener('click', () => open(each, files));
      return button;
    });
    complain('Which of these files?', element('span', { class: 'buttons' }, ...choices));
  }

  async function open(chosen, files) {
    const folder = chosen.path.slice(0, chosen.path.lastIndexOf('/') + 1);
    const beside = files.filter(({ path }) => path.startsWith(folder) && kNamed.includes(suffixOf(path)));
    worker.terminate(); // with its memory
    hide('settings', 'result');
    model = sweep = undefined;
    const read = await run(`Reading ${chosen.path}`, async ({ signal }) => {
      const total = [chosen, ...beside].reduce((sum, { file }) => sum + file.size, 0);
      if (total > kMostBytes) throw new Error(`${chosen.path} has ${size(total)}, and this page takes 2 GiB: use the command, vellum bake.`);
      const bytesOf = async ({ path, file }) => {
        try {
          return new Uint8Array(await file.arrayBuffer());
        } catch (error) {
          throw new Error(`${path} cannot be read: ${error.message}`);
        }
      };
      const contents = {};
      for (const each of beside) contents[each.path.slice(folder.length)] = await bytesOf(each);
      const bytes = await bytesOf(chosen);
      signal.throwIfAborted();
      model = { name: chosen.path.slice(folder.length), bytes, files: contents };
    });
    if (read) await compare();
  }

  // --- settings ---

  // Of the sweep and of the bakes with its rows.
  const options = () => ({ maxLevel: Number(at('max-level').value), blend: at('blend').checked });
  const files = () => ({ name: model.name, files: model.files });
  const chosenRow = () => sweep.rows[Number(document.querySelector('#sweep :checked').value)];

  async function compare() {
    hide('result');
    const given = options();
    const compared = await run(`Comparing settings for ${model.name}`, async (callbacks) => {
      sweep = { ...(await worker.sweepGltf(model.bytes, { ...files(), ...given, ...callbacks })), given };
    });
    if (!compared) {
      if (sweep && !running) [at('max-level').value, at('blend').checked] = [sweep.given.maxLevel, sweep.given.blend]; // what is shown
      return;
    }
    showParts();
    at('sweep').replaceChildren();
    const any = sweep.rows.length > 0;
    for (const id of ['sweep', 'bake', 'command', 'recommended']) at(id).hidden = !any;
    at('sweep').parentElement.hidden = !any;
    at('settings').hidden = false;
    at('existing').hidden = !sweep.hadMicromaps;
    if (any) showRows();
    say(any ? `Settings compared. ${textOf('recommended')}` : textOf('baked'));
  }

  function showParts() {
    at('settings-title').textContent = model.name;
    const triangles = sweep.primitives.reduce((sum, { triangles }) => sum + triangles, 0);
    const parts = [size(model.bytes.length), `${plural(sweep.primitives.length, 'primitive')} with ${plural(triangles, 'triangle')} would get micromaps`];
    if (sweep.rows.length === 0) parts[1] = sweep.skipped.length ? 'no primitive can get a micromap' : 'nothing to bake: no material is alpha-tested (alphaMode MASK)';
    if (sweep.skipped.length) parts.push(`${count(sweep.skipped.length)} would not`);
    if (sweep.withoutMicromap > 1e-9) parts.push(`${percent(sweep.withoutMicromap)} of the alpha-tested surface stays without`);
    at('baked').textContent = `${parts.join(' · ')}.`;
    const list = at('parts').querySelector('ul');
    at('parts').hidden = sweep.primitives.length + sweep.skipped.length === 0;
    at('parts').open = sweep.skipped.length > 0;
    at('parts').querySelector('summary').textContent = sweep.skipped.length ? 'Primitives, and why some are not baked' : 'Primitives';
    const most = 200;
    const lines = [
      ...sweep.skipped.map(({ name, material, reason }) => `${name}${material ? ` (${material})` : ''}: not baked, ${reason}`),
      ...sweep.primitives.map(({ name, material, triangles }) => `${name}${material ? ` (${material})` : ''}: ${plural(triangles, 'triangle')}`),
    ];
    list.replaceChildren(...lines.slice(0, most).map((line) => element('li', {}, line)));
    if (lines.length > most) list.append(element('li', {}, `and ${count(lines.length - most)} more`));
  }

  function nameOf({ level, budget }) {
    if (budget !== null) return `At most ${budget < 2 ** 20 ? `${budget / 2 ** 10} KiB` : `${budget / 2 ** 20} MiB`}`;
    return level === null ? 'Automatic levels' : `Level ${level}`;
  }

  function showRows() {
    const { rows, recommendation } = sweep;
    const chosen = recommendation?.row ?? rows.findIndex(({ tooLarge }) => !tooLarge);
    at('sweep').append(element('thead', {}, row(head('Setting'), head('Bytes', true), head('Known', true), head(''), head('Approximate', true), head('Levels', true))));
    const kinds = [
      ['Levels', ({ states, budget }) => states === 4 && budget === null],
      ['Levels, 2 states', ({ states }) => states === 2],
      ['A limit for the bytes', ({ budget }) => budget !== null],
    ];
    for (const [title, isOf] of kinds) {
      const body = element('tbody', {}, row(element('th', { scope: 'rowgroup', colspan: 6 }, title)));
      rows.forEach((each, number) => {
        if (!isOf(each)) return;
        const input = element('input', { type: 'radio', name: 'setting', value: number, ...(number === chosen && { checked: '' }), ...(each.tooLarge && { disabled: '' }) });
        const name = element('span', {}, nameOf(each));
        if (each.states === 2) name.append(element('span', { class: 'hidden' }, ', 2 states'));
        if (number === recommendation?.row) name.append(' ', element('span', { class: 'mark' }, 'recommended'));
        const bar = [each.proven, each.known - each.proven].map((share) => {
          const made = element('i');
          made.style.width = `${100 * share}%`;
          return made;
        });
        const levels = Object.keys(each.levels);
        const made = row(
          cell(element('label', {}, input, name)), cell(each.tooLarge ? 'too large' : count(each.bytes), true), cell(percent(each.known), true),
          element('td', { class: 'bar-cell' }, element('div', { class: 'bar', 'aria-hidden': 'true' }, ...bar)),
          cell(each.states === 2 ? percent(each.known - each.proven) : '–', true),
          cell(levels.length > 1 ? `${levels[0]}–${levels.at(-1)}` : (levels[0] ?? '–'), true));
        made.addEventListener('click', () => !input.disabled && !input.checked && input.click());
        body.append(made);
      });
      if (body.rows.length > 1) at('sweep').append(body);
    }
    at('recommended').textContent = recommendation ? `Recommended: ${nameOf(rows[recommendation.row])}, ${recommendation.reason}.` : 'No setting is recommended: none knows anything of the surface.';
    showCommand();
  }

  function showCommand() {
    const { maxLevel, blend } = sweep.given;
    const name = /^[\w./-]+$/.test(model.name) ? model.name : `'${model.name.replaceAll("'", "'\\''")}'`;
    at('command').textContent = `vellum bake ${name} ${chosenRow().options}${maxLevel === 8 ? '' : ` --max-level ${maxLevel}`}${blend ? ' --blend' : ''}`;
  }

  // --- the result ---

  async function bake() {
    hide('result');
    const chosen = chosenRow();
    const name = model.name.replace(/\.[^.]*$/, (suffix) => `.omm${suffix}`);
    const done = await run(`Baking ${model.name}`, async (callbacks) => {
      const { bytes, report } = await worker.bakeGltf(model.bytes, { ...files(), ...sweep.given, ...chosen.bakeOptions, ...callbacks });
      at('made').textContent = `${plural(report.primitiveCount, 'primitive')} of ${model.name} got micromaps of ${count(report.micromapSize)} bytes, ` +
        `which know ${percent(chosen.known)} of the alpha-tested surface. The file has ${size(report.outputSize)}, and had ${size(report.inputSize)}.` +
        (suffixOf(name) === '.gltf' && Object.keys(model.files).length ? ' Put it beside the files that it names.' : '');
      const type = suffixOf(name) === '.gltf' ? 'model/gltf+json' : 'model/gltf-binary';
      setUrl('download', 'href', new Blob([bytes], { type }));
      at('download').download = name;
      at('download').textContent = `Download ${name}`;
      at('download').hidden = false;
      await inspect(bytes, name, callbacks);
    });
    if (done) say(`Baked. ${textOf('made')}`);
  }

  async function existing() {
    hide('result', 'download');
    await run(`Reading the micromaps of ${model.name}`, async (callbacks) => {
      at('made').textContent = `The micromaps that ${model.name} has.`;
      await inspect(model.bytes, model.name, callbacks);
    });
  }

  async function inspect(bytes, name, { signal }) {
    at('doing').textContent = `Drawing ${name}`;
    hide('inspect', 'save');
    at('result').hidden = false; // what was baked can be downloaded, whatever becomes of the picture
    at('result-title').focus();
    const html = new Blob([await worker.inspectPage(bytes, { name, files: model.files, signal })], { type: 'text/html' });
    setUrl('save', 'href', html);
    at('save').download = `${name.replace(/\.[^.]*$/, '')}.html`;
    at('inspect').hidden = at('save').hidden = false;
    setUrl('inspect', 'src', html);
  }

  // --- events ---

  function listen() {
    const on = (id, event, act) => at(id).addEventListener(event, act);
    for (const id of ['files', 'folder'])
      on(id, 'change', ({ target }) => {
        take([...target.files].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
        target.value = ''; // the same file may be chosen again
      });
    on('cancel', 'click', () => running?.abort());
    on('bake', 'click', bake);
    on('existing', 'click', existing);
    on('sweep', 'change', showCommand);
    for (const id of ['max-level', 'blend']) on(id, 'change', compare);
    const over = (is) => at('drop').classList.toggle('over', is);
    document.addEventListener('dragover', (event) => {
      event.preventDefault();
      over(true);
    });
    document.addEventListener('dragleave', (event) => event.relatedTarget === null && over(false));
    document.addEventListener('drop', async (event) => {
      event.preventDefault();
      over(false);
      const dropped = [...event.dataTransfer.items].filter(({ kind }) => kind === 'file').map(filesOfItem);
      try {
        take((await Promise.all(dropped)).flat());
      } catch (error) {
        complain(`What was dropped cannot be read: ${error.message}`);
      }
    });
    addEventListener('message', ({ source, data }) => {
      if (source === at('inspect').contentWindow && Number.isFinite(data?.height)) at('inspect').style.height = `${data.height}px`;
    });
  }

  async function start() {
    for (let level = 1; level <= 12; ++level) at('max-level').append(element('option', level === 8 ? { selected: '' } : {}, `${level}`));
    const module = await WebAssembly.compile(Uint8Array.from(atob(textOf('module')), (c) => c.charCodeAt(0)));
    const code = URL.createObjectURL(new Blob([textOf('code')], { type: 'text/javascript' }));
    worker = new VellumWorker(module, { make: ({ name }) => new Worker(code, { name }) });
    listen();
    document.documentElement.dataset.ready = 'true';
  }

  start().catch((error) => complain(`This browser cannot run the page: ${error.message}`));
}

if (typeof document !== 'undefined') startPage();
