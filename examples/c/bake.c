// SPDX-License-Identifier: Apache-2.0
/* Bakes the opacity micromap of a leaf on two triangles and prints what came out, in C99.
 *
 *     cmake -S . -B build -DCMAKE_PREFIX_PATH=<prefix> && cmake --build build
 *     cc bake.c -o bake $(pkg-config --cflags --libs vellum)
 */
#include <stdio.h>
#include <stdlib.h>

#include <vellum/vellum.h>

enum { SIZE = 64 };

/* An ellipse with a soft border, in the alpha of RGBA. */
static void paintLeaf(unsigned char *rgba)
{
    for (int y = 0; y < SIZE; ++y)
        for (int x = 0; x < SIZE; ++x) {
            const double dx = (x + 0.5) / SIZE * 2 - 1;
            const double dy = ((y + 0.5) / SIZE * 2 - 1) / 0.6;
            const double inside = 0.5 + (0.8 - (dx * dx + dy * dy)) * 8;
            unsigned char *texel = rgba + 4 * (y * SIZE + x);
            texel[0] = 40, texel[1] = 120, texel[2] = 30;
            texel[3] = (unsigned char)(inside < 0 ? 0 : inside > 1 ? 255 : inside * 255);
        }
}

static void onMessage(void *userData, VellumResult result, const char *message)
{
    (void)userData;
    fprintf(stderr, "%s: %s\n", vellumResultName(result), message);
}

int main(void)
{
    static unsigned char rgba[SIZE * SIZE * 4];
    paintLeaf(rgba);

    VellumTexture texture;
    vellumInitTexture(&texture, sizeof texture);
    texture.texels = rgba;
    texture.texelsSize = sizeof rgba;
    texture.width = SIZE;
    texture.height = SIZE;
    texture.offset = 3;
    texture.pixelStride = 4;
    texture.addressModeU = VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE;
    texture.addressModeV = VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE;

    const float uvs[] = {0, 0, 1, 0, 0, 1, 1, 1};
    const uint16_t indices[] = {0, 1, 2, 3, 2, 1};
    VellumBakeInput card;
    vellumInitBakeInput(&card, sizeof card);
    card.textures = &texture;
    card.textureCount = 1;
    card.uvs = uvs;
    card.uvsSize = sizeof uvs;
    card.indexType = VELLUM_INDEX_TYPE_UINT16;
    card.indices = indices;
    card.indicesSize = sizeof indices;
    card.triangleCount = 2;

    VellumBakeOptions options;
    vellumInitBakeOptions(&options, sizeof options);
    options.level = 5;
    options.message = onMessage;

    VellumMicromap *micromap;
    if (vellumBake(&card, 1, &options, &micromap) != VELLUM_SUCCESS)
        return EXIT_FAILURE;
    VellumMicromapInfo info = {.structSize = sizeof info};
    if (vellumGetMicromapInfo(micromap, &info) != VELLUM_SUCCESS)
        return EXIT_FAILURE;
    printf("%zu bytes of data for %zu of %zu triangles\n", info.dataSize, info.triangleCount, info.indexCount);
    printf("micro-triangles: %llu transparent, %llu opaque, %llu unknown\n", (unsigned long long)info.stateCounts[0],
           (unsigned long long)info.stateCounts[1], (unsigned long long)(info.stateCounts[2] + info.stateCounts[3]));

    /* The first triangle: v goes down, u to the right. */
    for (int row = 0; row < 16; ++row) {
        for (int column = 0; column < 2 * (16 - row); ++column) {
            uint32_t state = 0;
            vellumGetState(micromap, 0, ((float)column + 0.5f) / 32, ((float)row + 0.5f) / 16, &state);
            putchar(" #.o"[state]);
        }
        putchar('\n');
    }
    vellumDestroyMicromap(micromap);
    return EXIT_SUCCESS;
}
