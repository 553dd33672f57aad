// SPDX-License-Identifier: Apache-2.0
// The page: a file, the settings that a sweep compares, the bake, and the page of `vellum inspect` for the result. This code also
// runs in the worker, which uses index.js, serve.js and Vellum.inspectPage().

const kModels = ['.glb', '.gltf'];
const kMostBytes = 2 ** 31 - 1; // of all files together
const suffixOf = (path) => /\.[^./]*$/.exec(path)?.[0].toLowerCase() ?? '';

// An error whose message is for the user.
class PageError extends Error {}

// --- the page of `vellum inspect`, which only this page's module makes ---

Vellum.prototype.inspectPage = function (bytes, options = {}) {
  return this._gltf(bytes, options, [], (call, file) => call.run(() => call.module.inspectPage(...file))[1][0]);
};

class PageWorker extends VellumWorker {
  inspectPage(bytes, options) {
    return this._post('inspectPage', [bytes], options);
  }
}

// --- files that are dropped ---

// All files in what was dropped, with their paths. Chromium gives a page that is a local file no files by the older interface of
// entries, and other browsers have no handles. Both interfaces may return null.
async function filesOfHandle(handle, signal, path = handle?.name) {
  signal.throwIfAborted();
  if (!handle) return [];
  if (handle.kind === 'file') return [{ path, file: await handle.getFile() }];
  const found = [];
  for await (const child of handle.values()) found.push(...(await filesOfHandle(child, signal, `${path}/${child.name}`)));
  return found;
}

async function filesOfEntry(entry, signal) {
  signal.throwIfAborted();
  if (!entry) return [];
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    return [{ path: entry.fullPath.replace(/^\//, ''), file }];
  }
  const reader = entry.createReader();
  const found = [];
  while (true) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return found; // it returns a hundred at a time
    for (const each of some) found.push(...(await filesOfEntry(each, signal)));
  }
}

// Asks for the item at once: it is valid only during its event.
function filesOfItem(item, signal) {
  if (!item.getAsFileSystemHandle) return filesOfEntry(item.webkitGetAsEntry(), signal);
  return item.getAsFileSystemHandle().then((handle) => filesOfHandle(handle, signal));
}

// --- files that a model names ---

// Percent signs that begin no escape stay.
function pathOfUri(uri) {
  return uri.replace(/(%[0-9a-f]{2})+/gi, (escapes) => {
    try {
      return decodeURIComponent(escapes);
    } catch {
      return escapes; // not UTF-8
    }
  });
}

const normalized = (path) => path.split('/').filter((part) => part !== '' && part !== '.').join('/');

// The paths of the buffers and images, relative to the model. A model that is damaged names none: the module says what is wrong.
function namedFiles(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const isBinary = bytes.length >= 20 && view.getUint32(0, true) === 0x46546c67; // "glTF"
  let json;
  try {
    json = JSON.parse(new TextDecoder().decode(isBinary ? bytes.subarray(20, 20 + view.getUint32(12, true)) : bytes));
  } catch {
    return [];
  }
  const uris = [json?.buffers, json?.images].flatMap((list) => (Array.isArray(list) ? list.map((each) => each?.uri) : []));
  return [...new Set(uris.filter((uri) => typeof uri === 'string' && !/^[^/]*:/.test(uri)).map(pathOfUri))];
}

function startPage() {
  const at = (id) => document.getElementById(id);
  const textOf = (id) => at(id).textContent;
  let worker;
  let running; // the AbortController of what runs
  let model; // { name, bytes, files }
  let sweep;
  const urls = {}; // of blobs, by the element that has it
  const kStarts = ['bake', 'existing']; // the buttons

  // --- what is shown ---

  function say(text) {
    at('status').textContent = text;
  }

  function showMessage(text, ...more) {
    at('messages').replaceChildren(...(text ? [element('p', { class: 'note' }, text, ...more)] : []));
  }

  function setUrl(id, attribute, blob) {
    if (urls[id]) URL.revokeObjectURL(urls[id]);
    urls[id] = URL.createObjectURL(blob);
    at(id).setAttribute(attribute, urls[id]);
  }

  // Frees the result.
  function dropUrls() {
    for (const [id, attribute] of [['download', 'href'], ['save', 'href'], ['inspect', 'src']]) {
      if (urls[id]) URL.revokeObjectURL(urls[id]);
      delete urls[id];
      at(id).removeAttribute(attribute);
    }
  }

  function hide(...ids) {
    for (const id of ids) at(id).hidden = true;
  }

  // Runs what takes long, instead of what runs; the buttons that would start something else wait for it. Returns { done: true },
  // or { error }, which is shown, or {} where something else began in the meantime.
  async function run(doing, work) {
    running?.abort();
    const own = (running = new AbortController());
    const { signal } = own;
    const focused = document.activeElement;
    const onProgress = (done, total) => {
      at('progress').value = total ? done / total : 1;
    };
    at('doing').textContent = doing;
    at('progress').removeAttribute('value');
    at('work').hidden = false;
    for (const id of kStarts) at(id).disabled = true;
    showMessage();
    say(doing);
    try {
      await work({ signal, onProgress });
      signal.throwIfAborted();
      return own === running ? { done: true } : {};
    } catch (error) {
      if (own !== running) return {};
      say('');
      showMessage(signal.aborted ? 'Cancelled.' : messageOf(error));
      return { error };
    } finally {
      if (own === running) {
        running = undefined;
        for (const id of kStarts) at(id).disabled = false;
        const { activeElement } = document;
        const lost = activeElement === at('cancel') || (activeElement === document.body && focused !== document.body);
        at('work').hidden = true;
        if (lost) focusOneOf(focused, at('bake'), at('files'));
      }
    }
  }

  function focusOneOf(...candidates) {
    candidates.find((each) => each !== document.body && each.checkVisibility())?.focus({ preventScroll: true });
  }

  function isOutOfMemory({ code, message }) {
    return code === 'VELLUM_ERROR_OUT_OF_MEMORY' || /allocation failed|out of memory|not enough memory/i.test(message);
  }

  function messageOf(error) {
    const name = model?.name ?? 'The file';
    if (error instanceof PageError) return error.message;
    if (isOutOfMemory(error)) return `${name} needs more memory than a page can have (4 GiB): use the command, vellum bake.`;
    if (!(error instanceof VellumError)) return `${name}: this page failed (${error.message || error}).`;
    if (error.code === 'VELLUM_ERROR_FILE' && /no such file$/.test(error.message))
      return `${error.message}. Drop the .gltf together with the files that it names, or their folder.`;
    return error.message;
  }

  // --- files ---

  async function takeItems(items) {
    if (items.length === 0) return take([]);
    let files;
    const { done } = await run('Reading the folder', async ({ signal }) => {
      try {
        files = (await Promise.all(items.map((item) => filesOfItem(item, signal)))).flat();
      } catch (error) {
        throw new PageError(`What was dropped cannot be read: ${error.message}`);
      }
    });
    if (done) await take(files);
  }

  async function take(files) {
    if (files.length === 0) return showMessage('No file was found. Choose or drop a .glb or .gltf file.');
    const models = files.filter(({ path }) => kModels.includes(suffixOf(path)));
    if (models.length === 1) return open(models[0], files);
    running?.abort();
    hide('settings', 'result');
    if (models.length === 0) {
      const what = files.length === 1 ? `${files[0].path} is not a glTF file` : 'None of these files is a glTF file';
      return showMessage(`${what}; expected .glb or .gltf.`);
    }
    const choices = models.slice(0, 100).map((each) => {
      const button = element('button', { type: 'button' }, each.path);
      button.addEventListener('click', () => open(each, files));
      return button;
    });
    showMessage('Which of these files?', element('span', { class: 'buttons' }, ...choices));
  }

  async function open(chosen, files) {
    worker.terminate(); // with its memory
    hide('settings', 'result');
    dropUrls();
    model = sweep = undefined;
    const { done } = await run(`Reading ${chosen.path}`, async ({ signal }) => {
      let total = 0;
      const bytesOf = async ({ path, file }) => {
        signal.throwIfAborted();
        total += file.size;
        if (total > kMostBytes) throw new PageError(`${chosen.path} needs more than 2 GiB of files: use the command, vellum bake.`);
        try {
          return new Uint8Array(await file.arrayBuffer());
        } catch (error) {
          throw new PageError(`${path} cannot be read: ${error.message}`);
        }
      };
      const folder = chosen.path.slice(0, chosen.path.lastIndexOf('/') + 1);
      const byPath = new Map(files.map((each) => [normalized(each.path), each]));
      const bytes = await bytesOf(chosen);
      const contents = [];
      for (const path of namedFiles(bytes)) {
        const found = byPath.get(normalized(folder + path));
        if (found) contents.push([path, await bytesOf(found)]);
      }
      model = { name: chosen.path.slice(folder.length), bytes, files: Object.fromEntries(contents) };
    });
    if (done) await compare();
  }

  // --- settings ---

  // Of the sweep and of the bakes with its rows.
  const options = () => ({ maxLevel: Number(at('max-level').value), blend: at('blend').checked });
  const files = () => ({ name: model.name, files: model.files });
  const chosenRow = () => sweep.rows[Number(document.querySelector('#sweep :checked').value)];

  async function compare() {
    hide('result');
    const given = options();
    const { done, error } = await run(`Comparing settings for ${model.name}`, async (callbacks) => {
      sweep = { ...(await worker.sweepGltf(model.bytes, { ...files(), ...given, ...callbacks })), given };
    });
    if (error && sweep) [at('max-level').value, at('blend').checked] = [sweep.given.maxLevel, sweep.given.blend]; // what is shown
    // Another level may succeed, unless it is the file that is wrong.
    if (error && !sweep && error.code !== 'VELLUM_ERROR_FILE') showOptions();
    if (!done) return;
    showParts();
    const any = sweep.rows.length > 0;
    showRowsIf(any);
    at('existing').hidden = !sweep.hadMicromaps;
    if (any) showRows();
    say(any ? `Settings compared. ${textOf('recommended')}` : textOf('baked'));
  }

  // The options of a comparison, without a comparison.
  function showOptions() {
    at('settings-title').textContent = model.name;
    at('baked').textContent = '';
    hide('parts', 'existing');
    showRowsIf(false);
  }

  function showRowsIf(any) {
    at('sweep').replaceChildren();
    for (const id of ['sweep', 'bake', 'command', 'recommended', 'known']) at(id).hidden = !any;
    at('sweep').parentElement.hidden = !any;
    at('settings').hidden = false;
  }

  function showParts() {
    at('settings-title').textContent = model.name;
    const triangles = sweep.primitives.reduce((sum, { triangles }) => sum + triangles, 0);
    const primitives = plural(sweep.primitives.length, 'primitive');
    const parts = [size(model.bytes.length), `${primitives} with ${plural(triangles, 'triangle')} would get micromaps`];
    if (sweep.rows.length === 0) {
      const nothing = 'nothing to bake: no material is alpha-tested (alphaMode MASK)';
      parts[1] = sweep.skipped.length ? 'no primitive can get a micromap' : nothing;
    }
    if (sweep.skipped.length) parts.push(`${count(sweep.skipped.length)} would not`);
    if (sweep.withoutMicromap > 1e-9) parts.push(`${percent(sweep.withoutMicromap)} of the alpha-tested surface stays without`);
    at('baked').textContent = `${parts.join(' · ')}.`;
    const list = at('parts').querySelector('ul');
    at('parts').hidden = sweep.primitives.length + sweep.skipped.length === 0;
    at('parts').open = sweep.skipped.length > 0;
    const summary = sweep.skipped.length ? 'Primitives, and why some are not baked' : 'Primitives';
    at('parts').querySelector('summary').textContent = summary;
    const most = 200;
    const titleOf = ({ name, material }) => `${name}${material ? ` (${material})` : ''}`;
    const lines = [
      ...sweep.skipped.map((each) => `${titleOf(each)}: not baked, ${each.reason}`),
      ...sweep.primitives.map((each) => `${titleOf(each)}: ${plural(each.triangles, 'triangle')}`),
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
    const numbers = ['Approximate', 'Levels'].map((text) => head(text, true));
    const heads = [head('Setting'), head('Bytes', true), head('Known', true), head(''), ...numbers];
    at('sweep').append(element('thead', {}, row(...heads)));
    const kinds = [
      ['Levels', ({ states, budget }) => states === 4 && budget === null],
      ['Levels, 2 states', ({ states }) => states === 2],
      ['A limit for the bytes', ({ budget }) => budget !== null],
    ];
    for (const [title, isOf] of kinds) {
      const body = element('tbody', {}, row(element('th', { scope: 'rowgroup', colspan: 6 }, title)));
      rows.forEach((each, number) => {
        if (!isOf(each)) return;
        const state = { ...(number === chosen && { checked: '' }), ...(each.tooLarge && { disabled: '' }) };
        const input = element('input', { type: 'radio', name: 'setting', value: number, ...state });
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
          cell(element('label', {}, input, name)),
          cell(each.tooLarge ? 'too large' : count(each.bytes), true),
          cell(percent(each.proven), true),
          element('td', { class: 'bar-cell' }, element('div', { class: 'bar', 'aria-hidden': 'true' }, ...bar)),
          cell(each.states === 2 ? percent(each.known - each.proven) : '–', true),
          cell(levels.length > 1 ? `${levels[0]}–${levels.at(-1)}` : (levels[0] ?? '–'), true));
        made.addEventListener('click', () => !input.disabled && !input.checked && input.click());
        body.append(made);
      });
      if (body.rows.length > 1) at('sweep').append(body);
    }
    at('recommended').textContent = recommendation
      ? `Recommended: ${nameOf(rows[recommendation.row])}, ${recommendation.reason}.`
      : 'No setting is recommended: with each of them, the whole surface stays unknown.';
    showCommand();
  }

  function showCommand() {
    const { maxLevel, blend } = sweep.given;
    const path = model.name.startsWith('-') ? `./${model.name}` : model.name; // not an option
    const name = /^[\w./-]+$/.test(path) ? path : `'${path.replaceAll("'", "'\\''")}'`;
    const more = `${maxLevel === 8 ? '' : ` --max-level ${maxLevel}`}${blend ? ' --blend' : ''}`;
    at('command').textContent = `vellum bake ${name} ${chosenRow().options}${more}`;
  }

  // --- the result ---

  async function bake() {
    hide('result');
    const chosen = chosenRow();
    const name = model.name.replace(/\.[^.]*$/, (suffix) => `.omm${suffix}`);
    const { done } = await run(`Baking ${model.name}`, async (callbacks) => {
      const settings = { ...sweep.given, ...chosen.bakeOptions };
      const { bytes, report } = await worker.bakeGltf(model.bytes, { ...files(), ...settings, ...callbacks });
      at('made').textContent =
        `${plural(report.primitiveCount, 'primitive')} of ${model.name} got micromaps of ${count(report.micromapSize)} bytes, ` +
        `which know ${percent(chosen.proven)} of the alpha-tested surface` +
        (chosen.states === 2 ? `, and approximate ${percent(chosen.known - chosen.proven)}. ` : '. ') +
        `The file has ${size(report.outputSize)}, and had ${size(report.inputSize)}.` +
        (suffixOf(name) === '.gltf' && Object.keys(model.files).length ? ' Put it beside the files that it names.' : '');
      const type = suffixOf(name) === '.gltf' ? 'model/gltf+json' : 'model/gltf-binary';
      setUrl('download', 'href', new Blob([bytes], { type }));
      at('download').download = name;
      at('download').textContent = `Download ${name}`;
      at('download').hidden = false;
      await inspect(bytes, name, callbacks, 'The bake is done and can be downloaded; its picture');
    });
    if (done) say(`Baked. ${textOf('made')}`);
  }

  async function existing() {
    hide('result', 'download');
    await run(`Reading the micromaps of ${model.name}`, async (callbacks) => {
      at('made').textContent = `The micromaps that ${model.name} has.`;
      await inspect(model.bytes, model.name, callbacks, `The picture of ${model.name}`);
    });
  }

  // `picture` begins the message for a picture that is too large.
  async function inspect(bytes, name, { signal }, picture) {
    at('doing').textContent = `Drawing ${name}`;
    hide('inspect', 'save');
    at('result').hidden = false; // what was baked can be downloaded, whatever becomes of the picture
    at('result').scrollIntoView();
    at('result-title').focus();
    const page = await worker.inspectPage(bytes, { name, files: model.files, signal }).catch((error) => {
      if (!isOutOfMemory(error)) throw error;
      throw new PageError(`${picture} needs more memory than a page can have (4 GiB): use the command, vellum inspect.`);
    });
    const html = new Blob([page], { type: 'text/html' });
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
    document.addEventListener('drop', (event) => {
      event.preventDefault();
      over(false);
      takeItems([...event.dataTransfer.items].filter(({ kind }) => kind === 'file'));
    });
    addEventListener('message', ({ source, data }) => {
      const { contentWindow, style } = at('inspect');
      if (source === contentWindow && Number.isFinite(data?.height)) style.height = `${data.height}px`;
    });
  }

  async function start() {
    for (let level = 1; level <= 12; ++level)
      at('max-level').append(element('option', level === 8 ? { selected: '' } : {}, `${level}`));
    const module = await WebAssembly.compile(Uint8Array.from(atob(textOf('module')), (c) => c.charCodeAt(0)));
    const code = URL.createObjectURL(new Blob([textOf('code')], { type: 'text/javascript' }));
    worker = new PageWorker(module, { make: ({ name }) => new Worker(code, { name }) });
    listen();
    document.documentElement.dataset.ready = 'true';
  }

  start().catch((error) => showMessage(`This browser cannot run the page: ${error.message}`));
}

if (typeof document !== 'undefined') startPage();
