#include <ise/instantiation/saved_state.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_bytes = std::size_t{16} << 20;

} // namespace

saved_state load_state(machine& host, const std::string& file, std::string& problem) {
    auto text = host.read_file(file, max_bytes);
    if (!text) {
        if (text.error().code() != errc::no_such_name) problem = text.error().message();
        return {};
    }
    try {
        return from_json<saved_state>(*text);
    } catch (const error& unfit) {
        // It is written whole or not at all: this one is somebody else's work, and may be needed.
        auto aside = file + ".unreadable";
        [[maybe_unused]] auto kept = host.replace_file(aside, *text);
        problem = fmt::format("{} is not a state of an instantiation server and was copied to {}: {}", file, aside,
                              unfit.what());
        return {};
    }
}

result<void> save_state(machine& host, const std::string& file, const saved_state& state) {
    return host.replace_reserved(file, to_json(state, json_style::pretty) + "\n");
}

} // namespace ise::instantiation
