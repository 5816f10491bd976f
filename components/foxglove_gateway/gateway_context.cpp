#include <components/foxglove_gateway/gateway_context.hpp>

#include <fmt/format.h>

namespace ise::foxglove {

void gateway_context::note(const std::string& what) {
    if (auto left_out = quiet_.admit(self.now())) self.log().warning(what, {{"left_out", std::to_string(*left_out)}});
}

std::uint32_t gateway_context::number_of(const std::string& what) {
    if (numbers_.size() > 4 * max_channels) numbers_.clear(); // the count goes on
    auto& made = numbers_[what];
    if (made == 0) made = fresh_number();
    return made;
}

std::string identity_of(const schema_info& of) {
    return fmt::format("{}\n{}\n{}\n{}", of.encoding, of.name, of.schema_encoding, of.schema);
}

} // namespace ise::foxglove
