#include <ise/instantiation/saved_state.hpp>

#include <ise/packet/json.hpp>

#include <fmt/format.h>

namespace ise::instantiation {

saved_state load_state(machine& host, const std::string& file, std::string& problem) {
    auto text = host.read_file(file, max_state_bytes);
    if (!text && text.error().code() == errc::no_such_name) return {};
    if (!text && text.error().code() != errc::too_large) throw error(text.error());
    try {
        return from_json<saved_state>(text.value());
    } catch (const error& unfit) {
        // It is written whole or not at all: this one is somebody else's work, and may be needed.
        auto aside = file + ".unreadable";
        auto moved = host.rename(file, aside);
        problem = fmt::format("{} cannot be used as the state of an instantiation server and {}: {}", file,
                              moved ? "was moved to " + aside : "is going to be replaced", unfit.what());
        return {};
    }
}

result<std::string> text_of(const saved_state& state, std::size_t max_bytes) {
    std::string text;
    try {
        text = to_json(schema_of<saved_state>(), encode(state), json_style::pretty, max_bytes) + "\n";
    } catch (const error& why) {
        return failure(why.code(), why.what());
    }
    if (text.size() <= max_bytes) return text;
    return failure(errc::too_large, fmt::format("the state has more than {} bytes", max_bytes));
}

result<void> save_state(machine& host, const std::string& file, const saved_state& state) {
    auto text = text_of(state, max_state_bytes);
    if (!text) return text.error();
    return host.replace_reserved(file, *text);
}

} // namespace ise::instantiation
