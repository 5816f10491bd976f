#pragma once
#include <ise/core/result.hpp>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace ise::access {

/// A pattern of paths, services and identities: `*` is any text without a `/`, `**` any text, `{a,b}` one of several.
class pattern {
public:
    static constexpr std::size_t max_bytes = 512;
    static constexpr std::size_t max_alternatives = 64; ///< that braces unfold to

    /// errc::invalid_argument: empty, too long, braces that do not match or unfold to too many.
    static result<pattern> parse(std::string_view text);

    bool matches(std::string_view text) const noexcept;
    /// Whether it names something itself, without a wildcard.
    bool plain() const noexcept { return plain_; }
    const std::string& text() const noexcept { return text_; }
    /// What it unfolds to; each matches or does not.
    const std::vector<std::string>& alternatives() const noexcept { return alternatives_; }

private:
    std::string text_;
    std::vector<std::string> alternatives_;
    struct fixed { // what every text that an alternative matches begins and ends with
        std::size_t first = 0, last = 0;
        bool whole = false;
    };
    std::vector<fixed> fixed_; // of each alternative
    bool plain_ = false;
};

} // namespace ise::access
