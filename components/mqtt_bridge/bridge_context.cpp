#include <components/mqtt_bridge/bridge_context.hpp>

#include <fmt/format.h>

namespace ise::mqtt {

void bridge_context::note(const std::string& what) {
    if (auto left_out = quiet_.admit(self.now())) self.log().warning(what, {{"left_out", std::to_string(*left_out)}});
}

std::string bridge_context::topic_below(std::string_view rest) const {
    return fmt::format("{}/{}", options.prefix, rest);
}

} // namespace ise::mqtt
