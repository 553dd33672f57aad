// SPDX-License-Identifier: Apache-2.0
/* Prints the opacity micromaps of a glTF file, in C99. With two files, the first is baked into the second before.
 *
 *     cmake -S . -B build -DCMAKE_PREFIX_PATH=<prefix> && cmake --build build
 *     cc micromaps.c -o micromaps $(pkg-config --cflags --libs vellum-gltf)
 *
 *     micromaps tree.omm.glb
 *     micromaps tree.glb tree.omm.glb
 */
#include <stdio.h>
#include <stdlib.h>

#include <vellum/gltf.h>

static void onMessage(void *userData, VellumResult result, const char *message)
{
    (void)userData;
    fprintf(stderr, "%s: %s\n", vellumResultName(result), message);
}

static void onNote(void *userData, const char *place, const char *note)
{
    (void)userData;
    fprintf(stderr, "%s: %s\n", place, note);
}

static VellumResult bakeFile(const char *input, const char *output)
{
    VellumBakeOptions options;
    vellumInitBakeOptions(&options, sizeof options);
    options.message = onMessage;
    VellumGltfBakeOptions more;
    vellumInitGltfBakeOptions(&more, sizeof more);
    more.skipped = onNote;
    return vellumBakeGltf(input, output, &options, &more, NULL);
}

static void printUsages(const VellumMicromapUsage *usages, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        printf("%s%lu of level %lu, %s-state", i == 0 ? "" : ", ", (unsigned long)usages[i].count,
               (unsigned long)usages[i].subdivisionLevel,
               usages[i].format == VELLUM_MICROMAP_FORMAT_2_STATE ? "2" : "4");
    printf("\n");
}

static void printFile(const VellumGltf *file)
{
    VellumGltfInfo info = {.structSize = sizeof info};
    vellumGetGltfInfo(file, &info);
    printf("%zu micromaps%s%s\n", info.micromapCount, *info.extension != '\0' ? " by " : "", info.extension);
    for (size_t i = 0; i < info.micromapCount; ++i) {
        VellumGltfMicromapInfo micromap = {.structSize = sizeof micromap};
        vellumGetGltfMicromapInfo(file, i, &micromap);
        printf("micromap %zu: %zu bytes of data for %zu triangles: ", i, micromap.dataSize, micromap.triangleCount);
        printUsages(micromap.usages, micromap.usageCount);
    }
    for (size_t i = 0; i < info.primitiveCount; ++i) {
        VellumGltfPrimitiveInfo primitive = {.structSize = sizeof primitive};
        vellumGetGltfPrimitiveInfo(file, i, &primitive);
        size_t special = 0;
        for (size_t t = 0; t < primitive.indexCount; ++t)
            special += primitive.indices[t] < 0;
        printf("%s: micromap %zu, %zu triangles, %zu of them with a special index", primitive.name, primitive.micromap,
               primitive.indexCount, special);
        printf("%s", primitive.usageCount != 0 ? "; " : "");
        printUsages(primitive.usages, primitive.usageCount);
    }
}

int main(int argc, char **argv)
{
    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: micromaps FILE | micromaps INPUT OUTPUT\n");
        return EXIT_FAILURE;
    }
    if (argc == 3 && bakeFile(argv[1], argv[2]) != VELLUM_SUCCESS)
        return EXIT_FAILURE;
    VellumGltf *file;
    if (vellumReadGltf(argv[argc - 1], onMessage, NULL, &file) != VELLUM_SUCCESS)
        return EXIT_FAILURE;
    printFile(file);
    vellumDestroyGltf(file);
    return EXIT_SUCCESS;
}
