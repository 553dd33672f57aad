// SPDX-License-Identifier: Apache-2.0
import assert from 'node:assert/strict';

// The module with another limit for its memory, in pages of 64 KiB.
export function limited(wasm, pages) {
  const bytes = new Uint8Array(wasm);
  const numberAt = (at) => {
    let [value, shift, byte] = [0, 0];
    do {
      byte = bytes[at++];
      value += (byte & 127) << shift;
      shift += 7;
    } while (byte > 127);
    return [value, at];
  };
  for (let at = 8; at < bytes.length; ) {
    const id = bytes[at];
    const [size, begin] = numberAt(at + 1);
    if (id === 5) {
      // One memory, with limits: flags, the first number of pages, the last, which has 3 bytes.
      const [, last] = numberAt(begin + 2);
      assert.deepEqual([...bytes.subarray(begin, begin + 2), ...numberAt(last)], [1, 1, 65536, last + 3]);
      bytes.set([(pages & 127) | 128, ((pages >> 7) & 127) | 128, pages >> 14], last);
    }
    at = begin + size;
  }
  return bytes;
}
