#pragma once
// Asio is compiled into the library, so every file that includes ISE's headers must see the same Asio with the same
// definitions: its types differ with them, and a program that mixes two crashes. Each file refers to a symbol that is
// named after what it was compiled with; the library defines the one of its own.
#include <asio/detail/config.hpp>
#include <asio/version.hpp>

#define ISE_ASIO_JOIN_(a, b) a##b
#define ISE_ASIO_JOIN(a, b) ISE_ASIO_JOIN_(a, b)

#if defined(ASIO_SEPARATE_COMPILATION)
    #define ISE_ASIO_SEPARATE _separate
#else
    #define ISE_ASIO_SEPARATE _without_ASIO_SEPARATE_COMPILATION
#endif
#if defined(ASIO_NO_DEPRECATED)
    #define ISE_ASIO_DEPRECATED
#else
    #define ISE_ASIO_DEPRECATED _without_ASIO_NO_DEPRECATED
#endif
#if defined(_WIN32) || defined(ASIO_HAS_STD_ALIGNED_ALLOC)
    #define ISE_ASIO_ALIGNED
#else
    #define ISE_ASIO_ALIGNED _without_ASIO_HAS_STD_ALIGNED_ALLOC
#endif

/// What the linker names where a program was compiled with other definitions of Asio than ISE: docs/embedding.md.
#define ISE_ASIO_CONFIGURATION                                                                                     \
    ISE_ASIO_JOIN(                                                                                                 \
        ISE_ASIO_JOIN(ISE_ASIO_JOIN(ISE_ASIO_JOIN(compile_with_the_definitions_of_ise_target_asio_, ASIO_VERSION), \
                                    ISE_ASIO_SEPARATE),                                                            \
                      ISE_ASIO_DEPRECATED),                                                                        \
        ISE_ASIO_ALIGNED)

namespace ise::detail {

extern const char ISE_ASIO_CONFIGURATION;
// Named by the configuration too: files that differ must not share one of these.
[[gnu::used]] inline const char* const ISE_ASIO_JOIN(please_, ISE_ASIO_CONFIGURATION) = &ISE_ASIO_CONFIGURATION;

} // namespace ise::detail
