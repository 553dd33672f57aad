// SPDX-License-Identifier: Apache-2.0
// The texels of the image, as the alpha test sees them.
#extension GL_EXT_samplerless_texture_functions : require

layout(set = 0, binding = 0) uniform texture2D image;

const uint kMagnitude = 0x7fffffffu;
const uint kInfinity = 0x7f800000u;

// Constants of the alpha test. Loaded once: invocations that load from memory wait for each other.
uint alphaFlags;
float alphaBorder;
float alphaOpaqueFrom;
float alphaTransparentBelow;
float alphaCutoff;

void loadAlpha()
{
    alphaFlags = SCRATCH(kBakeFlags);
    alphaBorder = scratchFloat(kBakeBorder);
    alphaOpaqueFrom = scratchFloat(kBakeOpaqueFrom);
    alphaTransparentBelow = scratchFloat(kBakeTransparentBelow);
    alphaCutoff = scratchFloat(kBakeCutoff);
}

// A texel at a position that wrapTexel() gave. Where it may be used for a claim, it is compared by its bits: nothing
// that a device may do to denormal numbers plays a part.
float texelAt(int x, int y, int mip)
{
    float alpha = alphaBorder;
    if (x >= 0 && y >= 0)
        alpha = texelFetch(image, ivec2(x, y), mip)[(alphaFlags >> kBakeComponentShift) & 3u];
    const uint bits = floatBitsToUint(alpha);
    return uintBitsToFloat((alphaFlags & kBakeNegate) != 0u ? bits ^ ~kMagnitude : bits);
}

bool isFinite(float value)
{
    return (floatBitsToUint(value) & kMagnitude) < kInfinity;
}

// A number that is as large as another one if and only if the floats are. Not for NaN.
int orderOf(float value)
{
    const uint bits = floatBitsToUint(value);
    return bits > kMagnitude ? -int(bits & kMagnitude) : int(bits);
}
