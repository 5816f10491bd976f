#include <components/boat/hex_digit.hpp>
#include <components/seal/key_file.hpp>
#include <components/seal/rekey.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <span>

namespace atirma::seal {
namespace {

constexpr std::size_t max_boat = 64, recovery_size = 2 + counter_size + rekey_size + tag_size;

bool from_hex(std::string_view text, std::span<std::byte> into) {
    if (text.size() != 2 * into.size()) return false;
    for (std::size_t i = 0; i < into.size(); ++i) {
        int high = hex_digit(text[2 * i]), low = hex_digit(text[2 * i + 1]);
        if (high < 0 || low < 0) return false;
        into[i] = static_cast<std::byte>(high * 16 + low);
    }
    return true;
}

std::string hex(ise::bytes_view from) {
    std::string text;
    for (auto one : from) text += fmt::format("{:02x}", std::to_integer<unsigned>(one));
    return text;
}

template <class Number>
bool read_number(std::string_view text, Number& into, Number most) {
    auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), into);
    return failed == std::errc() && end == text.data() + text.size() && into <= most;
}
bool read_epoch(std::string_view text, std::uint8_t& into) { return read_number(text, into, max_epoch); }

using lines = std::map<std::string_view, std::string_view>;

// Names and values of the lines. Errors never have a value: it may be a key.
ise::result<lines> lines_of(std::string_view text, std::string_view origin, std::span<const std::string_view> known) {
    lines made;
    while (!text.empty()) {
        auto line = text.substr(0, text.find('\n'));
        text.remove_prefix(std::min(text.size(), line.size() + 1));
        if (line.ends_with('\r')) line.remove_suffix(1);
        if (line.empty() || line.starts_with('#')) continue;
        auto space = line.find(' ');
        auto name = line.substr(0, space);
        if (space == line.npos || std::ranges::count(known, name) == 0)
            return ise::failure(
                ise::errc::malformed,
                fmt::format("{} is not a radio key: a line does not begin with {}", origin, fmt::join(known, ", ")));
        if (!made.emplace(name, line.substr(space + 1)).second)
            return ise::failure(ise::errc::malformed,
                                fmt::format("{} is not a radio key: '{}' is there twice", origin, name));
    }
    return made;
}

} // namespace

ise::result<radio_keys> parse_keys(std::string_view text, std::string_view origin) {
    static constexpr std::string_view known[] = {"boat", "epoch", "key", "next-epoch", "next", "recovery"};
    auto read = lines_of(text, origin, known);
    if (!read) return read.error();
    auto bad = [&](std::string_view why) {
        return ise::failure(ise::errc::malformed, fmt::format("{} is not a radio key: {}", origin, why));
    };
    auto& all = *read;
    if (!all.contains("boat") || !all.contains("epoch") || !all.contains("key"))
        return bad("it needs the lines 'boat NAME', 'epoch N' and 'key HEX'");
    radio_keys made;
    made.now.boat = all["boat"];
    if (made.now.boat.empty() || made.now.boat.size() > max_boat) return bad("the boat's name has 1 to 64 bytes");
    if (!read_epoch(all["epoch"], made.now.epoch)) return bad("the epoch is 0 to 63");
    if (!from_hex(all["key"], made.now.secret)) return bad("the key has 64 hexadecimal digits");
    if (all.contains("next") != all.contains("next-epoch")) return bad("'next-epoch N' and 'next HEX' stand together");
    if (all.contains("next")) {
        made.next = made.now;
        if (!read_epoch(all["next-epoch"], made.next->epoch)) return bad("the next epoch is 0 to 63");
        if (!from_hex(all["next"], made.next->secret)) return bad("the next key has 64 hexadecimal digits");
        if (made.next->epoch == made.now.epoch) return bad("the next key has another epoch");
    }
    if (all.contains("recovery")) {
        if (!made.next) return bad("'recovery HEX' stands with a next key only");
        made.recovery.resize(recovery_size);
        if (!from_hex(all["recovery"], made.recovery)) return bad("a change by the recovery key has 96 digits");
    }
    return made;
}

std::string format_keys(const radio_keys& keys) {
    auto text = fmt::format("boat {}\nepoch {}\nkey {}\n", keys.now.boat, keys.now.epoch, hex(keys.now.secret));
    if (keys.next) text += fmt::format("next-epoch {}\nnext {}\n", keys.next->epoch, hex(keys.next->secret));
    if (!keys.recovery.empty()) text += fmt::format("recovery {}\n", hex(keys.recovery));
    return text;
}

ise::result<recovery_key> parse_recovery_key(std::string_view text, std::string_view origin) {
    static constexpr std::string_view known[] = {"boat", "recovery-key", "generation"};
    auto read = lines_of(text, origin, known);
    if (!read) return read.error();
    recovery_key made;
    auto& key = made.key;
    key.boat = (*read)["boat"];
    if (key.boat.empty() || key.boat.size() > max_boat || !from_hex((*read)["recovery-key"], key.secret))
        return ise::failure(ise::errc::malformed,
                            fmt::format("{} is not a recovery key: it needs the lines 'boat NAME' and 'recovery-key "
                                        "HEX' with 64 digits",
                                        origin));
    if (read->contains("generation") && !read_number((*read)["generation"], made.generation, max_counter))
        return ise::failure(ise::errc::malformed,
                            fmt::format("{} is not a recovery key: the generation is 0 to {}", origin, max_counter));
    return made;
}

std::string format_recovery_key(const recovery_key& of) {
    auto text = fmt::format("boat {}\nrecovery-key {}\n", of.key.boat, hex(of.key.secret));
    if (of.generation != 0) text += fmt::format("generation {}\n", of.generation);
    return text;
}

} // namespace atirma::seal
