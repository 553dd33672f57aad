// The application's pNext chains are const. To take a structure out of one, or change it, the layer copies the chain up
// to that structure; what comes after stays the application's own.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// First structure of the given type in a chain, or null.
const VkBaseInStructure *findInChain(const void *chain, VkStructureType type);

template <typename T>
const T *findInChain(const void *chain, VkStructureType type)
{
    return reinterpret_cast<const T *>(findInChain(chain, type));
}

// A chain whose first structures may be copies.
class Chain
{
public:
    explicit Chain(const void *chain) : head_(chain) {}

    [[nodiscard]] const void *head() const { return head_; }
    // Takes every structure of this type out. A structure that lies behind one of unknown size cannot be taken out: it
    // stays, and a driver that does not know it must ignore it (Vulkan, "Valid Usage for Structure Pointer Chains").
    void remove(VkStructureType type);
    // A copy, within the chain, of the first structure of this type, to be changed; null where there is none to be had.
    template <typename T>
    T *edit(VkStructureType type)
    {
        return reinterpret_cast<T *>(makeOwn(type));
    }
    // Puts `structure` (kept by the caller, its pNext overwritten) at the head.
    void prepend(VkBaseInStructure *structure);

private:
    struct alignas(std::max_align_t) Storage {
        std::byte bytes[sizeof(std::max_align_t)];
    };
    VkBaseInStructure *makeOwn(VkStructureType type);
    VkBaseInStructure *ownUpTo(const VkBaseInStructure *last);

    const void *head_;
    std::vector<std::unique_ptr<Storage[]>> copies_;
    std::vector<const VkBaseInStructure *> owned_;
};

// Unlinks one structure from a chain that the driver writes to, for as long as this object lives. Such chains are not
// const, and the application sees its own chain again.
class Unlinked
{
public:
    Unlinked(void *chain, VkStructureType type); // of a null chain: nothing
    ~Unlinked();
    Unlinked(const Unlinked &) = delete;
    Unlinked &operator=(const Unlinked &) = delete;
    template <typename T>
    [[nodiscard]] T *get() const
    {
        return reinterpret_cast<T *>(structure_);
    }

private:
    VkBaseOutStructure *previous_ = nullptr;
    VkBaseOutStructure *structure_ = nullptr;
};

} // namespace vellum::layer
