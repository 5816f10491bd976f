#pragma once
#include <components/seal/sealed_frame.hpp>

/// How the boat is told of its next key. Pure.
namespace atirma::seal {

inline constexpr std::size_t rekey_size = 1 + key_size;

/// The content of a packet of `rekey_type`: epoch and key.
ise::bytes rekey_content(const radio_key& next);
/// `like`: of the same boat and link. Errors: malformed.
ise::result<radio_key> parse_rekey(ise::bytes_view content, const radio_key& like);

/// The recovery key opens nothing but this: a packet that makes the boat change to `next`. `generation` rises with
/// each; the boat takes none twice.
ise::bytes seal_recovery(const radio_key& recovery, std::uint64_t generation, const radio_key& next);
struct recovered_key {
    radio_key next;
    std::uint64_t generation = 0;
};
/// Errors: malformed, refused.
ise::result<recovered_key> open_recovery(const radio_key& recovery, ise::bytes_view raw);

} // namespace atirma::seal
