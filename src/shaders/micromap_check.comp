#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build: can the data be used as it lies, because each triangle's begins at a data unit and ends within as much as
// there is room for? And have the large ones no more parts than there is room for on the list? They have, where triangles
// that share data are more than the usage counts say.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint i = globalInvocation();
    const uint run = kCheckedPerInvocation;
    uint last = 0u;
    bool elsewhere = false;
    uint total = 0u;
    uint parts = 0u;
    bool wrong = false;
    for (uint t = i * run; t < min((i + 1u) * run, push.triangleCount); ++t) {
        const Source s = readSource(t);
        const uint units = unitsOf(s);
        total += units;
        wrong = wrong || s.problem != 0u;
        if (units == 0u)
            continue;
        parts += units > kPartUnits ? (units + kPartUnits - 1u) / kPartUnits : 0u;
        const uint end = (s.dataOffset >> 4u) + units;
        elsewhere = elsewhere || (s.dataOffset & 15u) != 0u || end > push.capacityUnits;
        last = max(last, end);
    }
    countForLog(total, wrong);
    // Nothing wraps before some invocation sees the limit passed; micromap_scan.comp clears the number again.
    if (parts > 0u && (push.flags & kPreferFastBuild) == 0u)
        elsewhere = elsewhere || parts > push.partCapacity ||
                    atomicAdd(Words(push.scratch).w[kScratchPartCount], parts) > push.partCapacity - parts;
    if (elsewhere)
        Words(push.scratch).w[kScratchElsewhere] = 1u;
    if (last > 0u)
        atomicMax(Words(push.scratch).w[kScratchLastUnit], last);
}
