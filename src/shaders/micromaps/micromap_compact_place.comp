// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Compaction of a micromap: counts the data units before each triangle, in its block; then, by one workgroup, those before each
// block, and so the size, which is written where a query wants it. A micromap that would not become smaller is left as it is.
const uint kThreads = 128u; // the least maxComputeWorkGroupInvocations
layout(local_size_x = kThreads) in;

#include "micromap_compact.glsl"
#include "base/structure_descriptor.glsl"

shared uint sums[kThreads];

void count(uint triangles)
{
    Words blockSums = Words(sumsAddress());
    for (uint b = globalInvocation(); b < blocksOf(triangles); b += push.invocations) {
        uint sum = 0u;
        for (uint t = b * kPlaceBlock; t < min((b + 1u) * kPlaceBlock, triangles); ++t) {
            Words words = wordsOf(triangles, t);
            words.w[0] = sum;
            if (words.w[2] == t)
                sum += dataOf(triangles, recordOf(t)).units;
        }
        blockSums.w[b] = sum; // at most kPlaceBlock * 2^18
    }
}

bool less(uvec2 a, uvec2 b)
{
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

// Returns whether the compacted micromap can be written to the target.
bool fits(uvec2 bytes)
{
    Words source = Words(push.source);
    const uvec2 from = micromapBytes(source.w[kMicromapHeaderTriangles], source.w[kMicromapHeaderUnits]);
    const bool tooSmall = less(push.targetBytes, bytes);
    // The header of a target that is too small is written, and must not be part of the source.
    const uvec2 written = tooSmall ? push.targetBytes : bytes;
    if (less(addressMinus(push.target, push.source), from) || less(addressMinus(push.source, push.target), written)) {
        gpuError(push.root, kGpuErrorMicromapOverlap);
        return false;
    }
    if (tooSmall) {
        gpuError(push.root, kGpuErrorMicromapTooSmall);
        Words(push.target).w[kMicromapHeaderMagic] = 0u;
    }
    return !tooSmall;
}

void writeHeader(uint triangles, uint units)
{
    Words from = Words(push.source);
    Words to = Words(push.target);
    for (uint i = 0u; i < kMicromapHeaderWords; ++i)
        to.w[i] = from.w[i];
    to.w[kMicromapHeaderUnits] = units;
    to.w[kMicromapHeaderCompacted] = 1u;
    if ((triangles & 1u) != 0u)
        storePair(addressPlus(push.target, kMicromapHeaderWords * 4u), triangles, uvec2(0u));
}

// With all units known.
void finish(uint triangles, uint units)
{
    const uvec2 bytes = micromapBytes(triangles, units);
    if ((push.value.x | push.value.y) != 0u) {
        const uvec2 value = push.mark != 0u ? marked(bytes) : bytes;
        Words(push.value).w[0] = value.x;
        Words(push.value).w[1] = value.y;
        return;
    }
    const bool writes = fits(bytes);
    Words(push.scratch).w[kCompactionOutcome] = writes ? kCompactionWrites : kCompactionFails;
    Words(push.scratch).w[kCompactionParts] = 0u;
    if (writes)
        writeHeader(triangles, units);
}

void main()
{
    const uint triangles = compactedTriangles();
    if (push.pass == kCompactCount) {
        count(triangles);
        return;
    }
    const uint me = gl_LocalInvocationIndex;
    const uint blocks = blocksOf(triangles);
    const uint run = (blocks + kThreads - 1u) / kThreads;
    const uint first = min(me * run, blocks);
    const uint last = min(first + run, blocks);
    const uint most = triangles == 0u ? 0u : Words(push.source).w[kMicromapHeaderUnits];
    const uint limit = most + 1u; // sums saturate there
    Words blockSums = Words(sumsAddress());
    uint sum = 0u;
    for (uint b = first; b < last; ++b)
        sum = min(sum + blockSums.w[b], limit);
    sums[me] = sum;
    barrier();
    // Not by steps with barriers between: a CPU driver takes four times as long to compile this with barriers in a loop.
    sum = 0u;
    for (uint i = 0u; i < me; ++i)
        sum += min(sums[i], limit - sum);
    for (uint b = first; b < last; ++b) {
        const uint own = blockSums.w[b];
        blockSums.w[b] = sum;
        sum = min(sum + own, limit);
    }
    if (me == kThreads - 1u && triangles != 0u && sum <= most)
        finish(triangles, sum);
}
