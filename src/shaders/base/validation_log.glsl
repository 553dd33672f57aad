// SPDX-License-Identifier: Apache-2.0
// The log of wrong input that only the device sees, which the host reads (layer/command_buffer/gpu_validation_log.h). Needs
// records.h, memory.glsl and push.log.

// Appends an entry; entries that do not fit are only counted.
void reportFinding(uint what, uvec2 object, uint triangle, uint value0, uint value1)
{
    if ((push.log.x | push.log.y) == 0u)
        return;
    Words log = Words(push.log);
    const uint n = atomicAdd(log.w[kLogCount], 1u);
    if (n >= kLogCapacity)
        return;
    const uint at = kLogHeaderWords + n * kLogEntryWords;
    log.w[at + 1u] = triangle;
    log.w[at + 2u] = value0;
    log.w[at + 3u] = value1;
    log.w[at + 4u] = object.x;
    log.w[at + 5u] = object.y;
    memoryBarrierBuffer();
    atomicExchange(log.w[at], what); // last, since it makes the entry valid
}
