#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

struct ssl_ctx_st; // of OpenSSL

namespace ise {

/// A secret that all nodes of a system know. It seals their sessions over tcp and local (FORMAT.md, section 17); over
/// other transports both sides prove that they know it (section 5).
class shared_key {
public:
    using digest = std::array<std::uint8_t, 32>;
    static constexpr std::size_t min_bytes = 32; ///< what can be guessed offline is no key
    static constexpr std::size_t max_bytes = 1024;

    /// The content of a file that only its owner reads, without the blanks and line ends around it: 32 to 1,024 bytes
    /// (`openssl rand -hex 32`). Errors: errc::unauthorized (too many may read it), errc::io_failed,
    /// errc::invalid_argument. `legacy`: it seals nothing, and is proved over every transport, as before 0.1.
    static result<std::shared_ptr<const shared_key>> load(environment& env, const std::string& file,
                                                          bool legacy = false);
    /// The same of a text; `from` says in errors where it came from.
    static result<std::shared_ptr<const shared_key>> make(std::string_view text, std::string_view from,
                                                          bool legacy = false);
    ~shared_key();
    shared_key(const shared_key&) = delete;
    shared_key& operator=(const shared_key&) = delete;

    /// Whether sessions over tcp and local are sealed with it.
    bool seals() const noexcept { return sealing_ != nullptr; }
    /// What sealed sessions are made with. Lifetime: whoever uses it holds the key.
    const std::shared_ptr<ssl_ctx_st>& sealing() const noexcept { return sealing_; }

    /// HMAC-SHA-256 of the label, a zero byte and the transcript.
    digest prove(std::string_view label, bytes_view transcript) const;
    /// Compares in a time that depends on nothing but the lengths.
    static bool equal(std::span<const std::uint8_t> wanted, std::span<const std::uint8_t> given) noexcept;

private:
    explicit shared_key(std::string_view secret) : secret_(secret) {}

    std::string secret_;
    digest sealing_secret_{};
    std::shared_ptr<ssl_ctx_st> sealing_;
};

} // namespace ise
