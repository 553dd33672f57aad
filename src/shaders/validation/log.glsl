// SPDX-License-Identifier: Apache-2.0
// The log of findings (core/findings.h), which the host reads (layer/validation/gpu/gpu_log.h). Needs findings.h, memory.glsl and
// push.finding.

// Appends an entry; entries that do not fit are only counted.
void reportFinding(uint what, uint triangle, uint value0, uint value1)
{
    CoherentWords log = CoherentWords(push.finding.log);
    const uint n = atomicAdd(log.w[kLogCount], 1u);
    if (n >= kLogCapacity)
        return;
    const uint at = kLogHeaderWords + n * kLogEntryWords;
    log.w[at + 1u] = push.finding.site;
    log.w[at + 2u] = push.finding.geometry;
    log.w[at + 3u] = triangle;
    log.w[at + 4u] = value0;
    log.w[at + 5u] = value1;
    log.w[at + 6u] = push.finding.object.x;
    log.w[at + 7u] = push.finding.object.y;
    memoryBarrierBuffer();
    atomicExchange(log.w[at], what | push.finding.bits); // last, since it makes the entry valid
}
