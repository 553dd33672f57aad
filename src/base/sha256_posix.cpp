// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.h"

#include <openssl/evp.h>
#include <stdexcept>

namespace vellum
{
namespace
{

void check(int succeeded)
{
    if (succeeded != 1)
        throw std::runtime_error("OpenSSL cannot compute SHA-256");
}

EVP_MD_CTX *contextOf(void *state)
{
    return static_cast<EVP_MD_CTX *>(state);
}

} // namespace

Sha256::Sha256() : state_(EVP_MD_CTX_new())
{
    if (EVP_DigestInit_ex(contextOf(state_), EVP_sha256(), nullptr) != 1) {
        EVP_MD_CTX_free(contextOf(state_));
        check(0);
    }
}

Sha256::~Sha256()
{
    EVP_MD_CTX_free(contextOf(state_));
}

void Sha256::add(std::span<const uint8_t> bytes)
{
    check(EVP_DigestUpdate(contextOf(state_), bytes.data(), bytes.size()));
}

Digest Sha256::finish()
{
    Digest digest;
    check(EVP_DigestFinal_ex(contextOf(state_), digest.data(), nullptr));
    return digest;
}

} // namespace vellum
