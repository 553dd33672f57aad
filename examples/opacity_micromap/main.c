/* A triangle with an opacity micromap, made with VK_KHR_opacity_micromap and seen by ray queries: the example at the
   end of the extension's proposal as a complete program. It prints what each ray met, and returns 0 if that is right.

   It uses the Vulkan API only. Where the driver lacks the extension, the layer VK_LAYER_VELLUM_opacity_micromap brings
   it, if the loader finds that (VK_LAYER_PATH, or installed). */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <vulkan/vulkan.h>

#include "vellum/vulkan_opacity_micromap.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define LAYER "VK_LAYER_VELLUM_opacity_micromap"

/* What rays.comp writes. */
enum { NOTHING, HIT, CONFIRMED, REJECTED };
static const char kCharacters[] = " #o.";

/* Sizes of the picture at which no ray goes through an edge of a micro-triangle. */
enum { WIDTH = 50, HEIGHT = 24 };

static const char *const kExtensions[] = {
    VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME,
    VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, /* VK_KHR_opacity_micromap depends on it */
    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, /* VK_KHR_acceleration_structure depends on it */
    VK_KHR_RAY_QUERY_EXTENSION_NAME,
};

static void check(VkResult result, const char *what)
{
    if (result == VK_SUCCESS)
        return;
    fprintf(stderr, "%s: VkResult %d\n", what, (int)result);
    exit(1);
}

static VkInstance instance;
static VkPhysicalDevice gpu;
static VkDevice device;
static VkQueue queue;
static uint32_t queueFamily;
static VkCommandPool commandPool;
static VkDeviceSize alignment; /* enough for whatever is put into a buffer */

/* The loader exports no commands of extensions. */
static PFN_vkGetAccelerationStructureBuildSizesKHR getBuildSizes;
static PFN_vkCreateAccelerationStructure2KHR createAccelerationStructure2;
static PFN_vkDestroyAccelerationStructureKHR destroyAccelerationStructure;
static PFN_vkCmdBuildAccelerationStructuresKHR cmdBuildAccelerationStructures;
static PFN_vkGetAccelerationStructureDeviceAddressKHR getAccelerationStructureDeviceAddress;

/* ---- Instance and device ------------------------------------------------------------------------------------------
 */

static int layerIsThere(void)
{
    VkLayerProperties layers[256];
    uint32_t count = COUNT(layers);
    vkEnumerateInstanceLayerProperties(&count, layers);
    for (uint32_t i = 0; i < count; ++i)
        if (strcmp(layers[i].layerName, LAYER) == 0)
            return 1;
    return 0;
}

static void createInstance(void)
{
    const char *layer = LAYER;
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                     .pApplicationName = "opacity_micromap",
                                     .apiVersion = VK_API_VERSION_1_3};
    VkInstanceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                 .pApplicationInfo = &application,
                                 .enabledLayerCount = layerIsThere() ? 1 : 0,
                                 .ppEnabledLayerNames = &layer};
    check(vkCreateInstance(&info, NULL, &instance), "vkCreateInstance");
}

static int hasExtensions(VkPhysicalDevice candidate)
{
    uint32_t count = 0;
    vkEnumerateDeviceExtensionProperties(candidate, NULL, &count, NULL);
    VkExtensionProperties *list = calloc(count + 1, sizeof(*list));
    if (list == NULL)
        exit(1);
    vkEnumerateDeviceExtensionProperties(candidate, NULL, &count, list);
    size_t found = 0;
    for (size_t wanted = 0; wanted < COUNT(kExtensions); ++wanted)
        for (uint32_t i = 0; i < count; ++i)
            if (strcmp(list[i].extensionName, kExtensions[wanted]) == 0) {
                ++found;
                break;
            }
    free(list);
    return found == COUNT(kExtensions);
}

static void choosePhysicalDevice(void)
{
    VkPhysicalDevice all[16];
    uint32_t count = COUNT(all);
    if (vkEnumeratePhysicalDevices(instance, &count, all) < 0)
        count = 0;
    for (uint32_t i = 0; i < count && gpu == VK_NULL_HANDLE; ++i)
        if (hasExtensions(all[i]))
            gpu = all[i];
    if (gpu == VK_NULL_HANDLE) {
        fprintf(stderr, "no Vulkan device has VK_KHR_opacity_micromap and ray queries%s\n",
                layerIsThere() ? "" : ", and the layer " LAYER " is not found");
        exit(1);
    }
    VkPhysicalDeviceAccelerationStructurePropertiesKHR limits = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
    VkPhysicalDeviceProperties2 properties = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                              .pNext = &limits};
    vkGetPhysicalDeviceProperties2(gpu, &properties);
    printf("device: %s\n", properties.properties.deviceName);
    /* Structures lie at multiples of 256, micromap data at multiples of 128. */
    alignment = limits.minAccelerationStructureScratchOffsetAlignment > 256
                    ? limits.minAccelerationStructureScratchOffsetAlignment
                    : 256;
}

static void createDevice(void)
{
    VkQueueFamilyProperties families[16];
    uint32_t count = COUNT(families);
    vkGetPhysicalDeviceQueueFamilyProperties(gpu, &count, families);
    while (queueFamily + 1 < count && (families[queueFamily].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0)
        ++queueFamily;

    VkPhysicalDeviceOpacityMicromapFeaturesKHR micromaps = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR, .micromap = VK_TRUE};
    VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR addressCommands = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR,
        .pNext = &micromaps,
        .deviceAddressCommands = VK_TRUE};
    VkPhysicalDeviceRayQueryFeaturesKHR rayQueries = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR,
                                                      .pNext = &addressCommands,
                                                      .rayQuery = VK_TRUE};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
        .pNext = &rayQueries,
        .accelerationStructure = VK_TRUE};
    VkPhysicalDeviceVulkan12Features vulkan12 = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                                 .pNext = &structures,
                                                 .bufferDeviceAddress = VK_TRUE};
    float priority = 1;
    VkDeviceQueueCreateInfo queueInfo = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                         .queueFamilyIndex = queueFamily,
                                         .queueCount = 1,
                                         .pQueuePriorities = &priority};
    VkDeviceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                               .pNext = &vulkan12,
                               .queueCreateInfoCount = 1,
                               .pQueueCreateInfos = &queueInfo,
                               .enabledExtensionCount = COUNT(kExtensions),
                               .ppEnabledExtensionNames = kExtensions};
    check(vkCreateDevice(gpu, &info, NULL, &device), "vkCreateDevice");
    vkGetDeviceQueue(device, queueFamily, 0, &queue);
    VkCommandPoolCreateInfo pool = {.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                    .queueFamilyIndex = queueFamily};
    check(vkCreateCommandPool(device, &pool, NULL, &commandPool), "vkCreateCommandPool");

#define LOAD(type, name) (type) vkGetDeviceProcAddr(device, #name)
    getBuildSizes = LOAD(PFN_vkGetAccelerationStructureBuildSizesKHR, vkGetAccelerationStructureBuildSizesKHR);
    createAccelerationStructure2 = LOAD(PFN_vkCreateAccelerationStructure2KHR, vkCreateAccelerationStructure2KHR);
    destroyAccelerationStructure = LOAD(PFN_vkDestroyAccelerationStructureKHR, vkDestroyAccelerationStructureKHR);
    cmdBuildAccelerationStructures = LOAD(PFN_vkCmdBuildAccelerationStructuresKHR, vkCmdBuildAccelerationStructuresKHR);
    getAccelerationStructureDeviceAddress =
        LOAD(PFN_vkGetAccelerationStructureDeviceAddressKHR, vkGetAccelerationStructureDeviceAddressKHR);
#undef LOAD
}

/* ---- Memory and commands ------------------------------------------------------------------------------------------
 */

typedef struct Buffer {
    VkBuffer buffer;
    VkDeviceMemory memory;
    VkDeviceAddress address; /* a multiple of `alignment` */
    void *mapped;            /* what lies at `address`, where the host sees it */
} Buffer;

static Buffer createBuffer(VkDeviceSize size, VkBufferUsageFlags usage, VkMemoryPropertyFlags properties)
{
    Buffer result = {0};
    VkBufferCreateInfo info = {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                               .size = size + alignment,
                               .usage = usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT};
    check(vkCreateBuffer(device, &info, NULL, &result.buffer), "vkCreateBuffer");
    VkMemoryRequirements needed;
    vkGetBufferMemoryRequirements(device, result.buffer, &needed);
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(gpu, &memory);
    uint32_t type = 0;
    while (type + 1 < memory.memoryTypeCount && ((needed.memoryTypeBits & 1u << type) == 0 ||
                                                 (memory.memoryTypes[type].propertyFlags & properties) != properties))
        ++type;
    VkMemoryAllocateFlagsInfo flags = {.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
                                       .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT};
    VkMemoryAllocateInfo allocate = {.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                                     .pNext = &flags,
                                     .allocationSize = needed.size,
                                     .memoryTypeIndex = type};
    check(vkAllocateMemory(device, &allocate, NULL, &result.memory), "vkAllocateMemory");
    check(vkBindBufferMemory(device, result.buffer, result.memory, 0), "vkBindBufferMemory");

    VkBufferDeviceAddressInfo address = {.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO,
                                         .buffer = result.buffer};
    VkDeviceAddress begin = vkGetBufferDeviceAddress(device, &address);
    result.address = (begin + alignment - 1) / alignment * alignment;
    if ((properties & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0) {
        check(vkMapMemory(device, result.memory, 0, VK_WHOLE_SIZE, 0, &result.mapped), "vkMapMemory");
        result.mapped = (char *)result.mapped + (result.address - begin);
    }
    return result;
}

static Buffer createDeviceBuffer(VkDeviceSize size, VkBufferUsageFlags usage)
{
    return createBuffer(size, usage, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
}

static Buffer createHostBuffer(VkDeviceSize size, VkBufferUsageFlags usage)
{
    return createBuffer(size, usage, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
}

/* What a build reads. Micromaps have no usage flag of their own for it, as they have with VK_EXT_opacity_micromap. */
static Buffer createInput(const void *data, size_t size)
{
    Buffer result = createHostBuffer(size, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    memcpy(result.mapped, data, size);
    return result;
}

static void destroyBuffer(Buffer buffer)
{
    vkDestroyBuffer(device, buffer.buffer, NULL);
    vkFreeMemory(device, buffer.memory, NULL);
}

static VkCommandBuffer beginCommands(void)
{
    VkCommandBufferAllocateInfo info = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                        .commandPool = commandPool,
                                        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                        .commandBufferCount = 1};
    VkCommandBuffer commands;
    check(vkAllocateCommandBuffers(device, &info, &commands), "vkAllocateCommandBuffers");
    VkCommandBufferBeginInfo begin = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                      .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
    check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    return commands;
}

static void finishCommands(VkCommandBuffer commands)
{
    check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
    VkSubmitInfo submit = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &commands};
    check(vkQueueSubmit(queue, 1, &submit, VK_NULL_HANDLE), "vkQueueSubmit");
    check(vkQueueWaitIdle(queue), "vkQueueWaitIdle");
    vkFreeCommandBuffers(device, commandPool, 1, &commands);
}

/* ---- Acceleration structures --------------------------------------------------------------------------------------
 */

typedef struct Structure {
    VkAccelerationStructureKHR handle;
    VkDeviceAddress address;
    Buffer storage;
} Structure;

/* The steps are the same for micromaps, bottom levels and top levels: sizes, memory, object, build. */
static Structure buildStructure(VkAccelerationStructureTypeKHR type, const VkAccelerationStructureGeometryKHR *geometry,
                                uint32_t primitives)
{
    const int isMicromap = type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    VkAccelerationStructureBuildGeometryInfoKHR build = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = type,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = 1,
        .pGeometries = geometry};

    /* How large a micromap is follows from its usage counts, so nothing else is told. */
    VkAccelerationStructureBuildSizesInfoKHR sizes = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    getBuildSizes(device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, isMicromap ? NULL : &primitives,
                  &sizes);

    /* vkCreateAccelerationStructure2KHR takes an address where vkCreateAccelerationStructureKHR takes a buffer. For
       micromaps it is the only one; other structures can be made with either. */
    Structure result = {0};
    result.storage =
        createDeviceBuffer(sizes.accelerationStructureSize, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    VkAccelerationStructureCreateInfo2KHR create = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR,
        .addressRange = {result.storage.address, sizes.accelerationStructureSize},
        .type = type};
    check(createAccelerationStructure2(device, &create, NULL, &result.handle), "vkCreateAccelerationStructure2KHR");

    Buffer scratch = createDeviceBuffer(sizes.buildScratchSize, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    build.dstAccelerationStructure = result.handle;
    build.scratchData.deviceAddress = scratch.address;
    VkAccelerationStructureBuildRangeInfoKHR range = {.primitiveCount = isMicromap ? 0 : primitives};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    VkCommandBuffer commands = beginCommands();
    cmdBuildAccelerationStructures(commands, 1, &build, &ranges);
    /* The structures that refer to this one, and the rays, come later. Micromaps need no stage and access of their own,
       as they do with VK_EXT_opacity_micromap. */
    VkMemoryBarrier barrier = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                               .srcAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                               .dstAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                         VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR | VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                         0, 1, &barrier, 0, NULL, 0, NULL);
    finishCommands(commands);
    destroyBuffer(scratch);

    VkAccelerationStructureDeviceAddressInfoKHR address = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = result.handle};
    if (!isMicromap)
        result.address = getAccelerationStructureDeviceAddress(device, &address);
    return result;
}

static void destroyStructure(Structure structure)
{
    destroyAccelerationStructure(device, structure.handle, NULL);
    destroyBuffer(structure.storage);
}

/* One micromap triangle of subdivision level 1, so four micro-triangles: 0 at vertex 0 of the triangle, 1 in the
   middle, 2 at vertex 1, 3 at vertex 2. Two bits tell the state of each, from the least significant bit on:

     0  transparent: rays go through
     1  opaque: rays end here
     2  unknown: the shader is asked (transparent where states are forced to two)
     3  unknown: the shader is asked (opaque where states are forced to two)

   Here each micro-triangle has the state of its own number. */
static const uint8_t kMicromapData[] = {0 << 0 | 1 << 2 | 2 << 4 | 3 << 6};
static const VkMicromapTriangleKHR kMicromapTriangle = {
    .dataOffset = 0, .subdivisionLevel = 1, .format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR};

static Structure buildMicromap(void)
{
    Buffer data = createInput(kMicromapData, sizeof(kMicromapData));
    Buffer triangles = createInput(&kMicromapTriangle, sizeof(kMicromapTriangle));
    /* How many micromap triangles there are of each format and level. */
    VkMicromapUsageKHR usage = {.count = 1, .subdivisionLevel = 1, .format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR};
    VkAccelerationStructureGeometryMicromapDataKHR micromapData = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR,
        .usageCountsCount = 1,
        .pUsageCounts = &usage,
        .data = data.address,
        .triangleArray = triangles.address,
        .triangleArrayStride = sizeof(VkMicromapTriangleKHR)};
    VkAccelerationStructureGeometryKHR geometry = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                   .pNext = &micromapData,
                                                   .geometryType = VK_GEOMETRY_TYPE_MICROMAP_KHR};
    Structure result = buildStructure(VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR, &geometry, 0);
    destroyBuffer(triangles);
    destroyBuffer(data);
    return result;
}

/* The micromap must live as long as the bottom level: nothing is copied from it. */
static Structure buildBottomLevel(VkAccelerationStructureKHR micromap)
{
    static const float vertices[3][3] = {{0, 0, 0}, {1, 0, 0}, {0.5f, 1, 0}};
    /* For each triangle of the geometry, which micromap triangle is its own; or a special index, which gives all of the
       triangle one state. */
    static const int32_t micromapIndices[] = {0};
    Buffer positions = createInput(vertices, sizeof(vertices));
    Buffer indices = createInput(micromapIndices, sizeof(micromapIndices));

    VkAccelerationStructureTrianglesOpacityMicromapKHR opacity = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR,
        .indexType = VK_INDEX_TYPE_UINT32,
        .indexBuffer = indices.address,
        .indexStride = sizeof(int32_t),
        .baseTriangle = 0,
        .micromap = micromap};
    VkAccelerationStructureGeometryKHR geometry = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                   .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR};
    geometry.geometry.triangles = (VkAccelerationStructureGeometryTrianglesDataKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
        .pNext = &opacity, /* with the triangles, not with the geometry */
        .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
        .vertexData.deviceAddress = positions.address,
        .vertexStride = sizeof(vertices[0]),
        .maxVertex = 2,
        .indexType = VK_INDEX_TYPE_NONE_KHR};
    Structure result = buildStructure(VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, &geometry, 1);
    destroyBuffer(indices);
    destroyBuffer(positions);
    return result;
}

static Structure buildTopLevel(VkDeviceAddress bottomLevel)
{
    VkAccelerationStructureInstanceKHR triangle = {.transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
                                                   .mask = 0xff,
                                                   .accelerationStructureReference = bottomLevel};
    Buffer instances = createInput(&triangle, sizeof(triangle));
    VkAccelerationStructureGeometryKHR geometry = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                   .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR};
    geometry.geometry.instances = (VkAccelerationStructureGeometryInstancesDataKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
        .data.deviceAddress = instances.address};
    Structure result = buildStructure(VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, &geometry, 1);
    destroyBuffer(instances);
    return result;
}

/* ---- Rays ---------------------------------------------------------------------------------------------------------
 */

/* rays.comp, whose module declares the execution mode OpacityMicromapIdKHR: without it (and without
   VK_EXT_opacity_micromap) ray queries do not see micromaps. See CMakeLists.txt. */
static VkShaderModule loadShader(void)
{
    static uint32_t words[16384];
    FILE *file = fopen(RAYS_SPV, "rb");
    const size_t count = file == NULL ? 0 : fread(words, sizeof(words[0]), COUNT(words), file);
    if (file == NULL || count == 0 || count == COUNT(words)) {
        fprintf(stderr, "%s cannot be read\n", RAYS_SPV);
        exit(1);
    }
    fclose(file);
    VkShaderModuleCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, .codeSize = count * sizeof(words[0]), .pCode = words};
    VkShaderModule module;
    check(vkCreateShaderModule(device, &info, NULL, &module), "vkCreateShaderModule");
    return module;
}

typedef struct Push {
    VkDeviceAddress scene;
    VkDeviceAddress picture;
} Push;

static void trace(Push push)
{
    VkPushConstantRange range = {.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT, .size = sizeof(Push)};
    VkPipelineLayoutCreateInfo layoutInfo = {.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                             .pushConstantRangeCount = 1,
                                             .pPushConstantRanges = &range};
    VkPipelineLayout layout;
    check(vkCreatePipelineLayout(device, &layoutInfo, NULL, &layout), "vkCreatePipelineLayout");
    VkShaderModule shader = loadShader();
    VkComputePipelineCreateInfo info = {.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
                                        .stage = {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                  .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                  .module = shader,
                                                  .pName = "main"},
                                        .layout = layout};
    VkPipeline pipeline;
    check(vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, NULL, &pipeline), "vkCreateComputePipelines");

    VkCommandBuffer commands = beginCommands();
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
    vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(push), &push);
    vkCmdDispatch(commands, WIDTH, HEIGHT, 1);
    VkMemoryBarrier barrier = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
                               .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT,
                               .dstAccessMask = VK_ACCESS_HOST_READ_BIT};
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0,
                         NULL, 0, NULL);
    finishCommands(commands);
    vkDestroyPipeline(device, pipeline, NULL);
    vkDestroyShaderModule(device, shader, NULL);
    vkDestroyPipelineLayout(device, layout, NULL);
}

/* ---- The picture --------------------------------------------------------------------------------------------------
 */

/* What a ray must have met, by the triangle's and the micromap's definition. */
static uint32_t expected(uint32_t column, uint32_t row)
{
    const double x = ((double)column + 0.5) / WIDTH;
    const double y = ((double)(HEIGHT - row) - 0.5) / HEIGHT;
    const double v = y; /* weights of the vertices 1 and 2 */
    const double u = x - 0.5 * y;
    if (u < 0 || u + v > 1)
        return NOTHING;
    const int microTriangle = u > 0.5 ? 2 : v > 0.5 ? 3 : u + v < 0.5 ? 0 : 1;
    const int state = kMicromapData[0] >> 2 * microTriangle & 3;
    if (state == 0)
        return NOTHING;
    if (state == 1)
        return HIT;
    const double stripes = 6 * v;
    return stripes - (int)stripes < 0.5 ? CONFIRMED : REJECTED;
}

static unsigned printPicture(const uint32_t *seen)
{
    unsigned wrong = 0;
    for (uint32_t row = 0; row < HEIGHT; ++row) {
        for (uint32_t column = 0; column < WIDTH; ++column) {
            const uint32_t value = seen[row * WIDTH + column];
            wrong += value != expected(column, row);
            putchar(value <= REJECTED ? kCharacters[value] : '?');
        }
        putchar('\n');
    }
    printf(
        "#: opaque, the shader was not asked   o .: unknown, the shader confirmed or rejected   blank: nothing met\n");
    return wrong;
}

int main(void)
{
    createInstance();
    choosePhysicalDevice();
    createDevice();

    Structure micromap = buildMicromap();
    Structure bottom = buildBottomLevel(micromap.handle);
    Structure top = buildTopLevel(bottom.address);
    Buffer picture = createHostBuffer(WIDTH * HEIGHT * sizeof(uint32_t), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    trace((Push){top.address, picture.address});
    const unsigned wrong = printPicture(picture.mapped);
    if (wrong != 0)
        printf("%u of %d rays met something else than they should have\n", wrong, WIDTH * HEIGHT);

    destroyBuffer(picture);
    destroyStructure(top);
    destroyStructure(bottom);
    destroyStructure(micromap);
    vkDestroyCommandPool(device, commandPool, NULL);
    vkDestroyDevice(device, NULL);
    vkDestroyInstance(instance, NULL);
    return wrong == 0 ? 0 : 1;
}
