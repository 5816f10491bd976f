#pragma once
#include <components/seal/sealed_frame.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// The files of the radio's keys. Pure.
namespace atirma::seal {

/// What a key file holds.
struct radio_keys {
    radio_key now;
    std::optional<radio_key> next; ///< to which the boat is to change
    ise::bytes recovery;           ///< the change to `next`, sealed by the recovery key; empty: `now` seals it
};

/// Reads a key file: `boat NAME`, `epoch N`, `key HEX`, and while the key is changed `next-epoch N`, `next HEX` and
/// perhaps `recovery HEX`; a line each, `#` begins a comment. `origin` is named in errors. Errors: malformed.
ise::result<radio_keys> parse_keys(std::string_view text, std::string_view origin);
/// The text of a key file.
std::string format_keys(const radio_keys& keys);
inline std::string format_key(const radio_key& key) { return format_keys({key, std::nullopt, {}}); }

/// The content of a recovery key file.
struct recovery_key {
    radio_key key;
    std::uint64_t generation = 0; ///< of the last change that it sealed
};
/// The file of a recovery key: `boat NAME`, `recovery-key HEX`, and `generation N` once it was used. Errors: malformed.
ise::result<recovery_key> parse_recovery_key(std::string_view text, std::string_view origin);
std::string format_recovery_key(const recovery_key& of);

} // namespace atirma::seal
